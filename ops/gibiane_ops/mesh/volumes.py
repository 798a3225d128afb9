"""Volumes swept from surfaces or filling envelopes, and the surfaces that bound them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, ENTIER, FLOTTANT, LISTREEL, MAILLAGE, POINT
from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.mesh import arcs, orientation, sweep, transforms
from gibiane_ops.mesh.building import (
    DIMENSION,
    axis_end,
    dimension,
    explained,
    join,
    line_nodes,
    new_mesh,
    nodes_of,
    places_along,
    reference,
    reversed_mesh,
)
from gibiane_ops.mesh.degree import every_node, finished, is_quadratic, linear_mesh
from gibiane_ops.mesh.facing import between_grids
from gibiane_ops.mesh.sweeping import Base, add_layers, base_of
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.listes import ListReel
from gibiane_ops.values.maillage import Block, Maillage, Point
from gibiane_ops.values.middles import middles_of

BoolArray = NDArray[np.bool_]

VOLU = operator(
    "VOLUME",
    topic="mesh",
    summary="volume swept by a surface, or inside an envelope",
    notice="`V = S VOLU N 'TRAN' VEC` sweeps a surface along a vector in N layers, `S VOLU N 'ROTA' angle P1 P2` "
    "turns it about an axis (degrees), `S VOLU N 'GENE' L` moves it along a line, and `S1 VOLU N S2` "
    "joins two surfaces that are meshed alike. Quadrangles give CUB8, triangles PRI6; with mid-nodes, "
    "or OPTI ELEM of second degree, CU20 and PR15. Without N or "
    "with N negative, densities (or 'DINI' and 'DFIN') give the layers, as in DROIT; 'PROG' with a "
    "LISTREEL gives their places. Faces 1 (start), 2 (end) and 3 (around) are recorded: see FACE. A "
    "volume in place of S is prolonged from its face 2. `V = S1 VOLU S2 P1 P2 N` joins two grids of QUA4 that may "
    "differ in numbers of rows and columns, if the sum of both numbers is even: P1 is a corner of S1, P2 the corner of "
    "S2 that faces it; N layers (1) of the same thickness, of which the first takes the change of columns and the last "
    "that of rows (a single layer is halved when both change). `V = S VOLU e V` puts one layer of elements around "
    "a surface, of thickness e (or a CHPOINT), half on each side along its normals; V tells the outside. "
    "`V = ENV VOLU` alone fills a closed envelope of triangles with tetrahedra.",
    example="OPTI DIME 3 ELEM CUB8 ; S = (DROIT 2 (0. 0. 0.) (1. 0. 0.)) TRAN 2 (0. 1. 0.) ; "
    "V = S VOLU 3 'TRAN' (0. 0. 1.) ; MESS (NBEL V) ;",
    see=["FACE", "ENVELOPPE", "TRANSLATION", "MAILLER"],
)

BASE = Arg("s", MAILLAGE, "surface, or volume to prolong from its face 2")
COUNT = Arg("n", ENTIER, "number of layers", optional=True)
DINI = Key("DINI", "size of the first layer", Arg("d", FLOTTANT))
DFIN = Key("DFIN", "size of the last layer", Arg("d", FLOTTANT))
PROG = Key("PROG", "places of the layers", Arg("places", LISTREEL))


def _base(ctx: Context, mesh: Maillage, at: str, face: str) -> tuple[Maillage, Maillage | None]:
    """Return the surface to sweep, and the volume that it prolongs if one was given."""
    if dimension(ctx) != 3:
        ctx.fail(34, "volumes exist in three dimensions only", hint="OPTI DIME 3 ELEM CUB8 ;")
    if mesh.shapes and all(DIMENSION[name] == 2 for name in mesh.shapes):
        return mesh, None
    if not any(DIMENSION[name] == 3 for name in mesh.shapes):
        ctx.fail(
            16,
            "a surface is wanted, this mesh holds {shapes}",
            at=at,
            shapes=" ".join(mesh.shapes) or "no element",
            label="holds {shapes}",
        )
    if face not in mesh.sides:
        ctx.fail(24, "this volume has no recorded face {number} to prolong", at=at, number=face)
    return mesh.sides[face], mesh


def _places(
    ctx: Context, length: float, sizes: tuple[float, float], n: int | None, prog: ListReel | None
) -> FloatArray:
    if prog is None:
        return places_along(ctx, length, *sizes, n)
    values = prog.values
    if len(values) < 2 or values[0] == values[-1]:
        ctx.fail(26, "'PROG' wants at least two different places", at="prog")
    return np.asarray((values - values[0]) / (values[-1] - values[0]), np.float64)


def _sizes(
    ctx: Context, nodes: IntArray, dini: float | None, dfin: float | None, far: float | None = None
) -> tuple[float, float]:
    near = float(nodes_of(ctx).density[nodes].mean())
    return (near if dini is None else dini), ((near if far is None else far) if dfin is None else dfin)


def _sweep(
    ctx: Context,
    base: Base,
    place: Callable[[float], FloatArray],
    places: FloatArray,
    sizes: tuple[float, float],
    extended: Maillage | None,
    end: IntArray | None = None,
    after: Maillage | None = None,
) -> Maillage:
    """Make the volume between the images of a surface; `end` gives the corners of the last image if they exist."""
    store, surface = nodes_of(ctx), base.mesh
    ids = add_layers(ctx, base, place, places, sizes, end)
    blocks, bottom, top, against = [], [], [], []
    for block in surface.blocks:
        local = np.searchsorted(base.corners, block.cells)
        name, cells = sweep.sweep_cells(block.shape, local, ids)
        turned = geometry.measures(shape(name), store.coords[cells]) < 0
        cells[turned] = orientation.reversed_cells(name, cells[turned])
        # The base faces against the sweep where the element had to be turned over.
        first = len(block.cells)
        against.append(turned[:first])
        bottom.append((block.shape, _outward(block.shape, block.cells, ~turned[:first])))
        top.append((block.shape, _outward(block.shape, ids[-1][local], turned[-first:])))
        with explained(ctx, "s"):
            geometry.check_cells(shape(name), store.coords[cells])
        blocks.append((name, cells))
    around = _around(surface, np.concatenate(against), base.corners, ids)
    faces = {"1": new_mesh(ctx, bottom), "2": new_mesh(ctx, top), "3": new_mesh(ctx, around)}
    parts = [new_mesh(ctx, blocks, faces)]
    if extended is not None:
        parts.insert(0, linear_mesh(ctx, extended))
    if after is not None:
        parts.append(linear_mesh(ctx, after))
    return finished(ctx, _together(parts), base.quadratic)


def _outward(name: str, cells: IntArray, turn: BoolArray) -> IntArray:
    return np.where(turn[:, None], orientation.reversed_cells(name, cells), cells)


def _around(surface: Maillage, against: BoolArray, base: IntArray, ids: IntArray) -> list[tuple[str, IntArray]]:
    """Return the facets swept by the border of the base; `against` tells which of its elements face the other way."""
    border = topology.boundary(surface.kernel_blocks).get("SEG2")
    if border is None:
        return []
    # On an element that faces the sweep the border keeps it on its left, so that the swept facet looks outside.
    ends = np.where(against[border.cell][:, None], border.nodes[:, ::-1], border.nodes)
    return [sweep.sweep_cells("SEG2", np.searchsorted(base, ends), ids)]


@VOLU.form(
    BASE, COUNT, DINI, DFIN, PROG, Key("TRAN", "translate", Arg("v", POINT, "vector"), required=True), gives=[MAILLAGE]
)
def _translated(
    ctx: Context, s: Maillage, n: int | None, dini: float | None, dfin: float | None, prog: ListReel | None, tran: Point
) -> Maillage:
    surface, extended = _base(ctx, s, "s", "2")
    base, vector = base_of(ctx, surface), tran.coords
    sizes = _sizes(ctx, base.corners, dini, dfin, float(tran.store.density[tran.node]) or None)
    places = _places(ctx, float(np.linalg.norm(vector)), sizes, n, prog)
    x = base.places
    return _sweep(ctx, base, lambda t: x + t * vector, places, sizes, extended)


@VOLU.form(
    BASE,
    COUNT,
    DINI,
    DFIN,
    PROG,
    Key(
        "ROTA",
        "turn",
        Arg("angle", FLOTTANT, "degrees"),
        Arg("a", POINT, "axis"),
        Arg("b", POINT, "axis"),
        required=True,
    ),
    gives=[MAILLAGE],
)
def _rotated(
    ctx: Context,
    s: Maillage,
    n: int | None,
    dini: float | None,
    dfin: float | None,
    prog: ListReel | None,
    rota: tuple[float, Point, Point],
) -> Maillage:
    surface, extended = _base(ctx, s, "s", "2")
    angle, a, b = rota
    base, axis = base_of(ctx, surface), axis_end(ctx, a, b)
    x = base.places
    sizes = _sizes(ctx, base.corners, dini, dfin)
    radius = float(arcs.distance_to_axis(x[: len(base.corners)], a.coords, axis).mean())
    places = _places(ctx, abs(float(np.radians(angle))) * radius, sizes, n, prog)
    return _sweep(ctx, base, lambda t: transforms.rotation(angle * t, a.coords, axis)(x), places, sizes, extended)


@VOLU.form(BASE, Key("GENE", "move along a line", Arg("line", MAILLAGE), required=True), gives=[MAILLAGE])
def _generated(ctx: Context, s: Maillage, gene: Maillage) -> Maillage:
    surface, extended = _base(ctx, s, "s", "2")
    base, store = base_of(ctx, surface), nodes_of(ctx)
    line = line_nodes(ctx, linear_mesh(ctx, gene), "gene")
    rank, density = np.arange(len(line), dtype=np.float64), float(store.density[line].mean())
    # Corners of the line are at whole ranks, its mid-nodes (those of a curve, if it has them) at halves.
    steps = every_node(ctx, line) if base.quadratic else np.repeat(line, 2)[:-1]
    x, path = base.places, store.coords[steps] - store.coords[line[0]]
    return _sweep(ctx, base, lambda t: x + path[round(2 * t)], rank, (density, density), extended)


@VOLU.form(
    Arg("s", MAILLAGE, "grid of quadrangles"),
    Arg("last", MAILLAGE, "grid that faces it"),
    Arg("p1", POINT, "corner of the first"),
    Arg("p2", POINT, "corner of the second, that faces it"),
    COUNT,
    Key("DINI", "accepted", Arg("d", FLOTTANT)),
    Key("DFIN", "accepted", Arg("d", FLOTTANT)),
    gives=[MAILLAGE],
)
def _facing(
    ctx: Context,
    s: Maillage,
    last: Maillage,
    p1: Point,
    p2: Point,
    n: int | None,
    dini: float | None,
    dfin: float | None,
) -> Maillage:
    first, extended = _base(ctx, s, "s", "2")
    second, after = _base(ctx, last, "last", "1")
    made = between_grids(ctx, first, second, p1, p2, n)
    parts = [linear_mesh(ctx, part) for part in (extended, made, after) if part is not None]
    return finished(ctx, _together(parts), is_quadratic(made))


def _together(parts: list[Maillage]) -> Maillage:
    """Join volumes made one on the other, with the faces of the whole."""
    if len(parts) == 1:
        return parts[0]
    lateral = join([part.sides["3"] for part in parts if "3" in part.sides])
    return join(parts, {"1": parts[0].sides["1"], "2": parts[-1].sides["2"], "3": lateral})


@VOLU.form(
    Arg("s", MAILLAGE, "surface"),
    Arg("thickness", (FLOTTANT, CHPOINT), "thickness"),
    Arg("v", POINT, "way out"),
    gives=[MAILLAGE],
)
def _thickened(ctx: Context, s: Maillage, thickness: float | ChPoint, v: Point) -> Maillage:
    """Put a layer of elements around a surface, half the thickness on each side, along the mean normals of nodes."""
    surface, _ = _base(ctx, s, "s", "2")
    base, store = base_of(ctx, surface), nodes_of(ctx)
    if base.quadratic:
        ctx.fail(
            16, "a surface of first degree is wanted", at="s", hint="CHAN 'QUADRATIQUE' of the volume adds mid-nodes"
        )
    normals = _mean_normals(base, v.coords)
    if isinstance(thickness, ChPoint):
        name = thickness.names[0]
        missing = len(thickness.names) != 1 or len(np.setdiff1d(base.corners, thickness.parts[name][0]))
        if missing:
            ctx.fail(181, "the field of thicknesses has one component, at every node of the surface", at="thickness")
        half = thickness.at(name, base.corners) / 2
    else:
        half = np.full(len(base.corners), thickness / 2)
    if not (half > 0).all():
        ctx.fail(41, "a thickness is a length: {value} cannot be one", at="thickness", value=float(2 * half.min()))
    x = store.coords[base.corners].copy()
    bottom = store.add(x - half[:, None] * normals, store.density[base.corners])
    blocks = [Block(b.shape, bottom[np.searchsorted(base.corners, b.cells)], b.colours) for b in base.mesh.blocks]
    below = base_of(ctx, Maillage(store, blocks))
    step = 2 * half[:, None] * normals
    return _sweep(ctx, below, lambda t: below.places + t * step, np.array([0.0, 1.0]), (0.0, 0.0), None)


def _mean_normals(base: Base, outward: FloatArray) -> FloatArray:
    """Return unit normals at the nodes of a surface, means of those of its elements, on the side of a vector."""
    x = base.mesh.store.coords
    total = np.zeros((len(base.corners), 3))
    for block in base.mesh.blocks:
        corners = x[block.cells]
        n = block.cells.shape[1]
        area = sum(np.cross(corners[:, k], corners[:, (k + 1) % n]) for k in range(n))
        area = np.where((area @ outward < 0)[:, None], -area, area)
        np.add.at(total, np.searchsorted(base.corners, block.cells).ravel(), np.repeat(area, n, axis=0))
    return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True), np.float64)


@VOLU.form(
    BASE, COUNT, DINI, DFIN, PROG, Arg("last", MAILLAGE, "second surface, meshed like the first"), gives=[MAILLAGE]
)
def _ruled(
    ctx: Context,
    s: Maillage,
    n: int | None,
    dini: float | None,
    dfin: float | None,
    prog: ListReel | None,
    last: Maillage,
) -> Maillage:
    first, extended = _base(ctx, s, "s", "2")
    second, after = _base(ctx, last, "last", "1")
    base, store = base_of(ctx, first), nodes_of(ctx)
    end = _matching(ctx, base.mesh, linear_mesh(ctx, second), base.corners)
    middles = middles_of(ctx).of(end[base.ends])
    x0, x1 = base.places, store.coords[np.concatenate([end, middles])]
    sizes = _sizes(ctx, base.corners, dini, dfin, float(store.density[end].mean()))
    length = float(np.linalg.norm(x1 - x0, axis=1)[: len(end)].mean())
    places = _places(ctx, length, sizes, n, prog)
    return _sweep(ctx, base, lambda t: (1 - t) * x0 + t * x1, places, sizes, extended, end, after)


def _matching(ctx: Context, first: Maillage, second: Maillage, base: IntArray) -> IntArray:
    """Return the node of the second surface that stands at each node of the first, by the order of the elements."""
    for candidate in (second, reversed_mesh(second)):
        if [(a.shape, a.cells.shape) for a in first.blocks] != [(b.shape, b.cells.shape) for b in candidate.blocks]:
            break
        one = np.searchsorted(base, np.concatenate([b.cells.ravel() for b in first.blocks]))
        two = np.concatenate([b.cells.ravel() for b in candidate.blocks])
        end = np.empty(len(base), np.int64)
        end[one] = two
        if (end[one] == two).all() and len(np.unique(end)) == len(end):
            return end
    ctx.fail(
        35,
        "the two surfaces are not meshed alike: {first} and {second} elements",
        at="last",
        first=first.n_cells,
        second=second.n_cells,
        label="not the image of the first surface",
        hint="make the second surface from the first, with PLUS, TOUR or DEPL",
    )


FACE = operator(
    "FACE",
    topic="mesh",
    summary="faces of a swept volume",
    notice="`S = FACE I V`: face 1 is the one that the volume was swept from, 2 the opposite one, 3 the rest of "
    "the boundary. Without I, all of them: `S1 S2 S3 = FACE V`. The normals of the facets leave the "
    "volume.",
    example="OPTI DIME 3 ELEM CUB8 ; S = (DROIT 2 (0. 0. 0.) (1. 0. 0.)) TRAN 2 (0. 1. 0.) ; "
    "V = S VOLU 3 'TRAN' (0. 0. 1.) ; MESS (NBEL (FACE 3 V)) ;",
    see=["VOLUME", "ENVELOPPE", "COTE"],
)


@FACE.form(Arg("g", MAILLAGE, "volume"), Arg("i", ENTIER, "which face", optional=True), gives=["MAILLAGE..."])
def _face(ctx: Context, g: Maillage, i: int | None) -> Any:
    return reference(ctx, g, i, "face")


ENVE = operator(
    "ENVELOPPE",
    topic="mesh",
    summary="boundary surface of a volume",
    notice="The facets that belong to one element only, with normals that leave the volume, or enter it with "
    "'ORIE'. An empty envelope is an error unless 'NOID' is given.",
    example="OPTI DIME 3 ELEM CUB8 ; S = (DROIT 2 (0. 0. 0.) (1. 0. 0.)) TRAN 2 (0. 1. 0.) ; "
    "V = S VOLU 3 'TRAN' (0. 0. 1.) ; MESS (NBEL (ENVE V)) ;",
    see=["FACE", "CONTOUR"],
)


@ENVE.form(
    Arg("g", MAILLAGE, "volume"),
    Key("ORIE", "normals into the volume"),
    Key("NOID", "an empty result is allowed"),
    gives=[MAILLAGE],
)
def _enveloppe(ctx: Context, g: Maillage, orie: bool, noid: bool) -> Maillage:
    solids = [b for b in g.kernel_blocks if DIMENSION[b[0]] == 3]
    found = topology.boundary(solids) if solids else {}
    if not found and not noid:
        ctx.fail(
            26,
            "this mesh has no envelope: it holds {shapes}",
            at="g",
            shapes=" ".join(g.shapes) or "no element",
            hint="CONT gives the boundary of a surface; 'NOID' accepts an empty result",
        )
    skin = new_mesh(ctx, [(name, facets.nodes) for name, facets in found.items()])
    return reversed_mesh(skin) if orie else skin
