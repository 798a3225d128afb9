"""REMAILLER: a new mesh of the same domain, of other sizes, with its groups."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, MAILLAGE, TABLE, Table, type_of
from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.errors import MeshingFailed
from gibiane_ops.kernels.mesh import unions
from gibiane_ops.mesh.building import dimension, explained, new_mesh, nodes_of
from gibiane_ops.mesh.degree import finished, is_quadratic, linear_mesh
from gibiane_ops.mesh.filling import fill_contour, fill_envelope, sizes_at
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.maillage import Maillage, Point

SIMPLEX = {1: "POI1", 2: "SEG2", 3: "TRI3", 4: "TET4"}

REMA = operator(
    "REMAILLER",
    topic="mesh",
    summary="new mesh of the same domain with other sizes",
    notice="`M2 = REMAILLER M1 size` meshes the domain of M1 (TET4 in space, TRI3 in the plane) again; size is a "
    "FLOTTANT or a CHPOINT on M1, of component SCAL (edge length) or G (its square inverse). Corners, "
    "plane faces and straight edges are kept exactly, curved faces follow the old facets. "
    "`M2 T2 = REMAILLER M1 size 'GROU' T1`: the MAILLAGE in the table T1 (parts of M1, of its boundary, of "
    "edges, points) are found again on M2 under the same indices. Index PAIRES of T1, a table of tables "
    "(1: face of the second body, 2: face of the first), names contact faces that are meshed once and "
    "duplicated, so that their nodes still pair. With 'SOUC' a failure is a warning and M1 is returned. "
    "`M2 = REMAILLER M1 BORD size` keeps the whole boundary BORD (ENVE M1, CONT M1) as it is, node for node. Meshes "
    "of second degree get mid-nodes again; on the boundary they are those of new straight edges, unless it is kept.",
    example="OPTI DIME 2 ELEM TRI3 ; C = CERC 16 'ROTA' 360. (1. 0.) (0. 0.) 'ELIM' ; S = SURF C 'PLAN' ; "
    "S2 = REMAILLER S 0.1 ; MESS ((NBEL S2) > (NBEL S)) ;",
    see=["MAILLER", "TAILLE"],
)

SIZE = Arg("size", (FLOTTANT, CHPOINT), "edge length, or field of sizes")
SOUC = Key("SOUCI", "a failure is a warning")


class Groups:
    """The groups of a table as kernels take them: names and elements by ranks of nodes.

    A contact face that is not one of the groups is added under a name of its own.
    """

    def __init__(self, ctx: Context, table: Table, nodes: IntArray) -> None:
        self.ctx = ctx
        self.nodes = nodes
        self.keys: dict[str, Any] = {}
        self.cells: dict[str, IntArray] = {}
        self.points: set[str] = set()
        self.quadratic: set[str] = set()
        self.pairs: list[tuple[str, str]] = []
        self.pair_keys: list[Any] = []
        values: dict[int, str] = {}
        for index, value in table.entries.values():
            if index in ("PAIRES", "SOUSTYPE"):
                continue
            name = f"{len(self.keys)}"
            self._add(name, index, value)
            values[id(value)] = name
        if table.has("PAIRES"):
            self._read_pairs(table.get("PAIRES"), values)

    def _add(self, name: str, index: Any, value: Any) -> None:
        if isinstance(value, Point):
            self.points.add(name)
            cells = np.array([[value.node]])
        elif isinstance(value, Maillage):
            if is_quadratic(value):
                self.quadratic.add(name)
            block = linear_mesh(self.ctx, value).single()
            if block is None or block.shape not in SIMPLEX.values():
                self.ctx.fail(
                    16,
                    "the group {index} holds {shapes}: one of POI1, SEG2, TRI3, TET4 is wanted",
                    at="grou",
                    index=index,
                    shapes=" ".join(value.shapes) or "no element",
                )
            cells = block.cells
        else:
            self.ctx.fail(
                39, "the group {index} is a {type}, not a MAILLAGE", at="grou", index=index, type=type_of(value)
            )
        place = np.searchsorted(self.nodes, cells)
        place[place == len(self.nodes)] = 0
        if (self.nodes[place] != cells).any():
            self.ctx.fail(
                21,
                "the group {index} is not a part of the mesh: {count} of its nodes are elsewhere",
                at="grou",
                index=index,
                count=len(np.setdiff1d(cells, self.nodes)),
                hint="a group made of other nodes at the same places is another mesh: ELIM makes them one",
            )
        self.keys[name] = index
        self.cells[name] = place

    def _read_pairs(self, pairs: Any, values: dict[int, str]) -> None:
        if not isinstance(pairs, Table):
            self.ctx.fail(37, "PAIRES is a {type}: a TABLE of TABLE is wanted", at="grou", type=type_of(pairs))
        for index, pair in pairs.entries.values():
            names = []
            for side in (1, 2):
                face = pair.get(side) if isinstance(pair, Table) and pair.has(side) else None
                if not isinstance(face, Maillage):
                    self.ctx.fail(
                        37, "the pair {index} has no MAILLAGE at index {side}", at="grou", index=index, side=side
                    )
                if id(face) not in values:
                    name = values[id(face)] = f"pair {index} {side}"
                    self._add(name, name, face)
                names.append(values[id(face)])
            self.pairs.append((names[0], names[1]))
            self.pair_keys.append(index)

    def renewed(self, groups: dict[str, IntArray], ids: IntArray) -> Table:
        """Return the table of the same groups on the new nodes."""
        table = Table()
        made: dict[str, Maillage] = {}
        for name, cells in groups.items():
            group = new_mesh(self.ctx, [(SIMPLEX[cells.shape[1]], ids[cells])])
            made[name] = finished(self.ctx, group, name in self.quadratic)
        for name, index in self.keys.items():
            if name.startswith("pair"):
                continue
            group = made[name]
            table.set(index, Point(group.store, int(group.nodes[0])) if name in self.points else group)
        if self.pairs:
            pairs = Table()
            for index, (first, second) in zip(self.pair_keys, self.pairs, strict=True):
                pair = Table()
                pair.set(1, made[first])
                pair.set(2, made[second])
                pairs.set(index, pair)
            table.set("PAIRES", pairs)
        return table


def _remesh(
    ctx: Context, g: Maillage, size: float | ChPoint, grou: Table | None, souci: bool
) -> tuple[Maillage, Table]:
    from gibiane_ops.kernels.remesh import remesh

    dim = dimension(ctx)
    wanted = {2: "TRI3", 3: "TET4"}.get(dim)
    quadratic, old = is_quadratic(g), g
    g = linear_mesh(ctx, g)
    block = g.single()
    if block is None or block.shape != wanted:
        ctx.fail(
            16,
            "a mesh of {wanted} is wanted, this one holds {shapes}",
            at="g",
            wanted=wanted,
            shapes=" ".join(g.shapes) or "no element",
            hint="CHAN {wanted} cuts other elements",
        )
    store = nodes_of(ctx)
    nodes = g.nodes
    sizes = sizes_at(ctx, size, nodes)
    groups = Groups(ctx, grou if grou is not None else Table(), nodes)
    with explained(ctx, "g"):
        try:
            result = remesh(
                store.coords[nodes][:, :dim],
                np.searchsorted(nodes, block.cells),
                np.asarray(sizes, np.float64),
                groups=groups.cells,
                pairs=groups.pairs,
            )
        except MeshingFailed as failure:
            if not souci:
                raise
            ctx.warn(27, "no new mesh could be made, the old one is kept: {reason}", at="g", reason=failure.reason)
            return old, grou if grou is not None else Table()
    from scipy.spatial import cKDTree

    _, near = cKDTree(store.coords[nodes][:, :dim]).query(result.points)
    ids = store.add(result.points, store.density[nodes][near])
    mesh = finished(ctx, new_mesh(ctx, [(wanted, ids[result.cells])]), quadratic)
    return mesh, groups.renewed(result.groups, ids)


@REMA.form(
    Arg("g", MAILLAGE, "mesh"),
    SIZE,
    Key("GROUPES", "table of groups", Arg("t", TABLE), required=True, name="grou"),
    SOUC,
    gives=[MAILLAGE, TABLE],
)
def _with_groups(ctx: Context, g: Maillage, size: float | ChPoint, grou: Table, souci: bool) -> tuple[Maillage, Table]:
    return _remesh(ctx, g, size, grou, souci)


@REMA.form(Arg("g", MAILLAGE, "mesh"), Arg("bord", MAILLAGE, "its boundary, to be kept"), SIZE, gives=[MAILLAGE])
def _kept_boundary(ctx: Context, g: Maillage, bord: Maillage, size: float | ChPoint) -> Maillage:
    dim = dimension(ctx)
    fill = {2: ("TRI3", "SEG2"), 3: ("TET4", "TRI3")}
    corners, kept = linear_mesh(ctx, g), linear_mesh(ctx, bord)
    if dim not in fill or corners.shapes != [fill[dim][0]]:
        ctx.fail(
            16,
            "a mesh of {wanted} is wanted, this one holds {shapes}",
            at="g",
            wanted=fill.get(dim, ("TRI3",))[0],
            shapes=" ".join(g.shapes) or "no element",
            hint="CHAN {wanted} cuts other elements",
        )
    facets = topology.boundary(corners.kernel_blocks)[fill[dim][1]].nodes
    given = kept.cells(fill[dim][1])
    if len(given) != len(facets) or not unions.is_in(facets, given).all():
        ctx.fail(
            251,
            "a part of the boundary cannot be kept alone: {given} of its {total} facets are given",
            at="bord",
            given=int(unions.is_in(facets, given).sum()) if len(given) else 0,
            total=len(facets),
            hint="ENVE (in the plane CONT) gives the whole boundary",
        )
    mesh = fill_envelope(ctx, facets, size, "g") if dim == 3 else fill_contour(ctx, facets, size, False, "g")
    return finished(ctx, mesh, is_quadratic(g))


@REMA.form(Arg("g", MAILLAGE, "mesh"), SIZE, SOUC, gives=[MAILLAGE])
def _plain(ctx: Context, g: Maillage, size: float | ChPoint, souci: bool) -> Maillage:
    return _remesh(ctx, g, size, None, souci)[0]
