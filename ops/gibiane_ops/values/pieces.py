"""Elements of a model cut into simplices, with their boundary: what a stress in equilibrium is built on."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gibiane.diagnostics import Text
from gibiane.registry import Context
from gibiane_ops.kernels import topology
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.admissible import plane_compliance
from gibiane_ops.kernels.estimate.cutting import CENTRES, CORNERS, MIDDLES, Cutting
from gibiane_ops.kernels.estimate.fields import Field, field_of
from gibiane_ops.kernels.estimate.macro import STATIC
from gibiane_ops.kernels.estimate.sides import Parts
from gibiane_ops.kernels.hanging import outer_boundary
from gibiane_ops.kernels.supports import moved
from gibiane_ops.kernels.topology import Facets
from gibiane_ops.values.champs import MChaml
from gibiane_ops.values.exterior import Side, nodal_normals
from gibiane_ops.values.material import elastic_law, on_zone
from gibiane_ops.values.modele import ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store

ROUND_OFF = 1e-9
SIMPLICES = ("TRI3", "TET4")


@dataclass(frozen=True, eq=False)
class Pieces:
    """The simplices that the elements of a model are, or are cut into.

    Attributes
    ----------
    zones : list of ModelZone
    nodes : (n,) int64
        Nodes of the session, sorted.
    cells : list of (m, n_nodes) int64
        Elements of each zone, nodes numbered in `nodes`.
    cutting : Cutting
        Of these elements.
    """

    zones: list[ModelZone]
    nodes: IntArray
    cells: list[IntArray]
    cutting: Cutting

    @property
    def whole(self) -> bool:
        """Whether no element was cut, and stresses are uniform."""
        return self.cutting.finest < MIDDLES and all(z.shape in SIMPLICES for z in self.zones)

    def places(self, nodes: IntArray) -> IntArray:
        """Return the points of the simplices that nodes of the session are."""
        return self.cutting.places(np.searchsorted(self.nodes, nodes))

    def facets(self, name: str, nodes: IntArray) -> tuple[IntArray, FloatArray, IntArray]:
        """Cut facets of nodes of the session, see `Cutting.facets`."""
        return self.cutting.facets(name, np.searchsorted(self.nodes, nodes))


def pieces_of(ctx: Context, zones: list[ModelZone], pairs: IntArray | None = None, finest: int | None = None) -> Pieces:
    """Cut the elements of a model into simplices; facets of `pairs` of nodes, (k, 2), are cut alike on both sides.

    Quadratic elements are cut through the middles of their edges, so that the stress on the simplices, linear in parts,
    follows theirs; quadrangles from their centres.
    """
    dim = zones[0].dim
    wrong = next((z for z in zones if z.axisymmetric or z.bars or shape(z.shape).dim != dim), None)
    if wrong is not None:
        ctx.fail(
            251,
            "an equilibrated stress is built on solids in space or in a plane, not on {shape} in mode {mode}",
            at="model",
            shape="BARR" if wrong.bars else wrong.shape,
            mode=wrong.mode,
            hint="ERREUR with 'SPR' estimates the error there, without a bound",
        )
    if finest is None:
        finest = _finest(zones)
    nodes, flat = np.unique(np.concatenate([z.cells.ravel() for z in zones]), return_inverse=True)
    cells = [
        part.reshape(z.cells.shape)
        for part, z in zip(np.split(flat, np.cumsum([z.cells.size for z in zones])[:-1]), zones, strict=True)
    ]
    lead = nodes.copy()
    if pairs is not None and len(pairs):
        known = pairs[np.isin(pairs, nodes).all(axis=1)]
        lead[np.searchsorted(nodes, known[:, 1])] = known[:, 0]
    rank = np.empty(len(nodes), np.int64)
    rank[np.lexsort((nodes, lead))] = np.arange(len(nodes))
    points = node_store(ctx).coords[nodes][:, :dim]
    blocks = [(z.shape, c) for z, c in zip(zones, cells, strict=True)]
    outer, every = outer_boundary(points, blocks), topology.boundary(blocks)
    if sum(len(f.nodes) for f in outer.values()) < sum(len(f.nodes) for f in every.values()):
        ctx.fail(
            251,
            "an equilibrated stress is not built on small elements beside a large one (hanging nodes)",
            at="model",
            hint="'RESI' takes them; TRI3 and TET4 divided in place have none",
        )
    cutting = Cutting(points, blocks, rank, finest)
    return Pieces(zones, nodes, cells, cutting)


def _stress_on(
    fields: list[Field], start: IntArray, of: Shape, cell: IntArray, local: IntArray, rows: IntArray, xi: FloatArray
) -> FloatArray:
    """Return the stress at points of some facets of elements, counted through the zones from `start` on."""
    parts = []
    for field, first, last in zip(fields, start[:-1], start[1:], strict=True):
        mine = (cell[rows] >= first) & (cell[rows] < last)
        parts.append((mine, field.stresses_on(of, cell[rows[mine]] - first, local[rows[mine]], xi[mine])))
    found = np.empty((*xi.shape[:2], len(STATIC[fields[0].of.dim])))
    for mine, values in parts:
        found[mine] = values
    return found


def _finest(zones: list[ModelZone]) -> int:
    """Choose the points of the simplices: the stress on them is linear in parts, that of quadratic elements linear.

    Measured, smooth stress: CU20 3.7, 1.21, 1.12 times the error with corners, centres, middles, each time at two to
    four times the cost; TE10 3.2 and 1.16 with corners and middles; QUA8 5.1, 1.39, 1.23; TRI6 4.1 and 1.10; QUA4 1.02
    and 1.01.
    """
    dim, quadratic = zones[0].dim, [z.shape for z in zones if shape(z.shape).degree > 1]
    if dim == 2:
        return MIDDLES if quadratic else CENTRES
    return MIDDLES if "TE10" in quadratic else CENTRES if quadratic else CORNERS


def fields_of(ctx: Context, pieces: Pieces, stress: MChaml, material: MChaml) -> list[Field]:
    """Return the stress inside the elements of each zone; nothing when it is uniform there."""
    found: list[Field] = []
    for zone in [] if pieces.whole else pieces.zones:
        of, dim = shape(zone.shape), zone.dim
        values = moved(of, on_zone(ctx, stress, zone, "sig").values, stress.support, "STRESSES")[..., STATIC[dim]]
        law = elastic_law(ctx, material, zone, "mat")
        compliance = np.broadcast_to(plane_compliance(law, dim), (len(values), *[values.shape[2]] * 2))
        found.append(field_of(of, node_store(ctx).coords[zone.cells][:, :, :dim], values, compliance))
    return found


@dataclass(frozen=True, eq=False)
class Boundary:
    """Sides of the simplices on the boundary of a model.

    Attributes
    ----------
    side : Side
        Nodes are points of the simplices.
    same : bool
        Whether their linear tractions are those given.
    bent : (k,) bool
        Those that stand for parts of curved facets.
    """

    side: Side
    same: bool
    bent: NDArray[np.bool_]


def cut_sides(ctx: Context, pieces: Pieces, sides: list[Side], fields: list[Field]) -> Boundary:
    """Cut the boundary into sides of the simplices.

    Tractions have on each side the moments of those given, which keeps their resultants: they are the same where these
    are linear. On chords of curved facets see `Parts.linear`.
    """
    start = np.cumsum([0] + [len(z.cells) for z in pieces.zones])
    dim = pieces.zones[0].dim
    name, points = "SEG2" if dim == 2 else "TRI3", node_store(ctx).coords[:, :dim]
    parts, same = [], True
    for side in sides:
        of = shape(side.facets.name)
        sides_of, at, owner = pieces.facets(of.name, side.facets.nodes)
        traction, bent = side.traction[owner], np.zeros(len(owner), bool)
        if of.name == name and pieces.cutting.finest < MIDDLES:
            # as given, to the last digit
            given = np.einsum("kan,kni->kai", of.N(at.reshape(-1, dim - 1)).reshape(*at.shape[:2], -1), traction)
        else:
            X, corners = points[side.facets.nodes[owner]], pieces.cutting.points[sides_of]
            cell, local = side.facets.cell[owner], side.facets.local[owner]
            stress = partial(_stress_on, fields, start, of, cell, local)
            parts_of = Parts(of, X, at, corners)
            bare, pressure = None, None
            if side.pressure is not None:
                normal = nodal_normals(of, points[side.facets.nodes])
                bare, pressure = (side.traction + side.pressure[..., None] * normal)[owner], side.pressure[owner]
            given, left = parts_of.linear(traction, stress, bare, pressure)
            bent[parts_of.bent()] = True
            same = same and left.max(initial=0.0) <= ROUND_OFF * float(np.abs(side.traction).max(initial=0.0))
        parts.append((sides_of, side.facets.cell[owner], given, side.free[owner], bent))
    nodes, cell, values, free, chords = (np.concatenate(each) for each in zip(*parts, strict=True))
    return Boundary(Side(Facets(name, nodes, cell, np.zeros(len(nodes), np.int64)), values, free), same, chords)


def doubts_of(ctx: Context, pieces: Pieces, same: bool, fields: list[Field]) -> list[Text]:
    """Say why the simplices are not exactly the elements and their loads; nothing when they are."""
    if any(field.rest is not None and not field.affine.all() for field in fields):
        return [Text("thermal or other strains, which no displacement of the elements has, are part of the stress")]
    points = node_store(ctx).coords[pieces.nodes][:, : pieces.zones[0].dim]
    for zone, cells in zip(pieces.zones, pieces.cells, strict=True):
        of, X = shape(zone.shape), points[cells]
        size = np.abs(X - X[:, :1]).max(axis=(1, 2))
        for a, b, *middle in of.edges:
            if middle and _off_chord(X[:, a], X[:, b], X[:, middle[0]], size):
                return [Text("sides of elements are curved: the stress in equilibrium stands on their chords")]
        for kind, corners in of.faces:
            if shape(kind).n_corners == 4 and not _plane(X[:, list(corners[:4])], size):
                return [
                    Text("faces of elements are not plane: those of the stress in equilibrium are cut into triangles")
                ]
    if not same:
        return [Text("a load varies more than linearly over the facets of the stress in equilibrium")]
    return []


def _off_chord(a: FloatArray, b: FloatArray, middle: FloatArray, size: FloatArray) -> bool:
    """Tell whether a middle node is not on the line between the ends of its edge."""
    along = b - a
    share = ((middle - a) * along).sum(axis=1) / (along**2).sum(axis=1)
    return bool((np.abs(middle - a - share[:, None] * along).max(axis=1) > ROUND_OFF * size).any())


def _plane(X: FloatArray, size: FloatArray) -> bool:
    """Tell whether four corners, (m, 4, 3), lie in a plane."""
    volume = np.abs(np.linalg.det(X[:, 1:] - X[:, :1]))
    return bool((volume <= ROUND_OFF * size**3).all())
