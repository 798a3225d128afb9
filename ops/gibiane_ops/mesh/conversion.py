"""The same mesh with other elements: CHANGER, ORIENTER, REGENERER, and ARETE."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import FLOTTANT, LISTENTI, MAILLAGE, POINT
from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.mesh import chains, degenerate, edges, orientation, simplices
from gibiane_ops.mesh.building import (
    DIMENSION,
    SECOND_DEGREE,
    SURFACES,
    VOLUMES,
    dimension,
    explained,
    join,
    new_mesh,
    nodes_of,
)
from gibiane_ops.mesh.degree import LINEAR, bend_diagonals, is_quadratic, linear_mesh, quadratic_mesh
from gibiane_ops.values.listes import ListEnti
from gibiane_ops.values.maillage import Block, Maillage, Point, cells_from_turn

CHAN = operator(
    "CHANGER",
    topic="mesh",
    summary="the same mesh, or field, in another form",
    notice="`G2 = CHAN TYPE G` gives a mesh on the same nodes made of elements of a type: POI1 (its points, each "
    "once), SEG2 or LIGNE (its edges), SURFACE (its facets), TRI3 (quadrangles cut in two), PRI6 (cubes cut "
    "in two), TET4 (volumes cut in tetrahedra), or the same elements. Without TYPE, that of OPTI ELEM. "
    "'QUADRATIQUE' gives the elements mid-nodes (a type such as CU20 or TE10 cuts them first), one per edge "
    "for all the meshes that share its ends; 'LINEAIRE' drops them. "
    "Cuts start from the corner of smallest number, so that neighbours fit, and so do a volume and its "
    "surface changed apart. Recorded sides and faces follow. `CHAN TYPE G LENTI` makes elements of a mesh "
    "of points: the list numbers its points, as many as an element has, element by element.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 3 (0. 0.) (1. 0.)) TRAN 2 (0. 1.) ; "
    "T = CHAN TRI3 S ; MESS (NBEL T) ' ' (NBEL (CHAN POI1 S)) ;",
    see=["ORIENTER", "REGENERER"],
)

# The pieces of the elements of a shape: their shape, their nodes, the row of the element that each is from.
Pieces = tuple[str, IntArray, IntArray]
Cutter = Callable[[str, IntArray], Pieces | None]


def _same(name: str, cells: IntArray) -> Pieces:
    return name, cells, np.arange(len(cells))


def _triangles(name: str, cells: IntArray) -> Pieces | None:
    if name == "QUA4":
        return "TRI3", simplices.triangles_of_quadrangles(cells), np.repeat(np.arange(len(cells)), 2)
    return _same(name, cells) if name == "TRI3" else None


def _tetrahedra(name: str, cells: IntArray) -> Pieces | None:
    if name not in VOLUMES:
        return _triangles(name, cells)
    pieces, owner = simplices.tetrahedra(name, cells)
    return "TET4", pieces, owner


def _prisms(name: str, cells: IntArray) -> Pieces | None:
    if name == "CUB8":
        halves = cells[:, [0, 1, 2, 4, 5, 6, 0, 2, 3, 4, 6, 7]].reshape(-1, 6)
        return "PRI6", halves, np.repeat(np.arange(len(cells)), 2)
    return _same(name, cells) if name in ("PRI6", *SURFACES) else None


def _keep(kept: str) -> Cutter:
    return lambda name, cells: _same(name, cells) if name == kept else None


CUTTERS: dict[str, Cutter] = {
    "TRI3": _triangles,
    "TET4": _tetrahedra,
    "PRI6": _prisms,
    "QUA4": _keep("QUA4"),
    "CUB8": _keep("CUB8"),
    "PYR5": _keep("PYR5"),
}
KINDS = (
    "POI1",
    "SEG2",
    "LIGNE",
    "SURFACE",
    "LINEAIRE",
    "QUADRATIQUE",
    *CUTTERS,
    *SECOND_DEGREE,
)


@CHAN.form(
    Key(KINDS, "type of the elements", name="kind"),
    Arg("g", MAILLAGE, "mesh of points"),
    Arg("numbers", LISTENTI, "their numbers, element by element"),
    gives=[MAILLAGE],
)
def _connect(ctx: Context, kind: str | None, g: Maillage, numbers: ListEnti) -> Maillage:
    name = _target(ctx, kind)
    if g.shapes != ["POI1"]:
        ctx.fail(
            16,
            "a mesh of points is wanted with a list of numbers, this one holds {shapes}",
            at="g",
            shapes=" ".join(g.shapes) or "no element",
        )
    if name not in DIMENSION:
        ctx.fail(16, "'{kind}' is no type of element", at="kind", kind=name)
    points, size = g.cells("POI1")[:, 0], shape(name).n_nodes
    wanted = numbers.values
    if len(wanted) % size:
        ctx.fail(
            36,
            "{count} numbers do not make whole {kind} elements of {size} points",
            at="numbers",
            count=len(wanted),
            kind=name,
            size=size,
        )
    if len(wanted) and not (wanted.min() >= 1 and wanted.max() <= len(points)):
        ctx.fail(36, "the mesh has points 1 to {count} only", at="numbers", count=len(points))
    return new_mesh(ctx, [(name, cells_from_turn(name, points[wanted - 1].reshape(-1, size)))])


@CHAN.form(Key(KINDS, "type of the elements", name="kind"), Arg("g", MAILLAGE, "mesh"), gives=[MAILLAGE])
def _changer(ctx: Context, kind: str | None, g: Maillage) -> Maillage:
    target = _target(ctx, kind)
    if target == "QUADRATIQUE":
        return quadratic_mesh(ctx, g)
    if target == "LINEAIRE":
        return linear_mesh(ctx, g)
    if target == "POI1":
        return Maillage.of_nodes(g.store, g.nodes_in_order())
    if target in LINEAR or (is_quadratic(g) and target in ("LIGNE", "SURFACE")):
        corners = linear_mesh(ctx, g)
        if is_quadratic(g):
            _bend(ctx, corners, target)
        return quadratic_mesh(ctx, _changer(ctx, LINEAR.get(target, target), corners))
    if is_quadratic(g):
        g = linear_mesh(ctx, g)
    if target in ("SEG2", "LIGNE"):
        return _edges(ctx, g)
    if target == "SURFACE":
        return _facets(ctx, g)
    return _cut(ctx, g, target, CUTTERS[target])


def _bend(ctx: Context, g: Maillage, target: str) -> None:
    """Let the cuts of curved faces follow their curve."""
    if target in ("TRI6", "TE10"):
        faces = topology.faces_of([b for b in g.kernel_blocks if b[0] in VOLUMES]).get("QUA4")
        inner = np.zeros((0, 4), np.int64) if faces is None else faces.nodes[topology.group_by_nodes(faces.nodes)[1]]
        quadrangles = np.concatenate([g.cells("QUA4").reshape(-1, 4), inner])
        bend_diagonals(ctx, quadrangles, simplices.triangles_of_quadrangles(quadrangles))
    elif target == "PR15":
        cubes = g.cells("CUB8").reshape(-1, 8)
        ends = np.concatenate([cubes[:, :4], cubes[:, 4:]])
        bend_diagonals(ctx, ends, ends[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))


def _target(ctx: Context, kind: str | None) -> str:
    target = kind or ctx.option("ELEM")
    if target is None:
        ctx.fail(16, "to which type of elements?", hint="CHAN TRI3 G, or set OPTI ELEM")
    return str(target)


def _edges(ctx: Context, g: Maillage) -> Maillage:
    if all(name == "SEG2" for name in g.shapes):
        return g
    return new_mesh(ctx, [("SEG2", topology.edges(g.kernel_blocks))])


def _facets(ctx: Context, g: Maillage) -> Maillage:
    parts = []
    for name, facets in topology.faces_of([b for b in g.kernel_blocks if b[0] in VOLUMES]).items():
        _, first = topology.group_by_nodes(facets.nodes)
        parts.append((name, facets.nodes[first]))
    surfaces = Maillage(g.store, [b for b in g.blocks if b.shape in SURFACES])
    if not parts:
        return surfaces
    return join([surfaces, new_mesh(ctx, parts)])


def _cut(ctx: Context, g: Maillage, target: str, cutter: Cutter) -> Maillage:
    found = []
    for block in g.blocks:
        cut = cutter(block.shape, block.cells)
        if cut is None:
            ctx.fail(
                995, "{old} elements cannot become {new}", at="g", old=block.shape, new=target, label="holds {old}"
            )
        found.append(_pieces(g, block, cut))
    sides = {name: _cut_side(side, cutter) for name, side in g.sides.items()}
    return join(found, sides) if found else g


def _cut_side(side: Maillage, cutter: Cutter) -> Maillage:
    """Cut a recorded face as the volume is cut; lines stay."""
    return join([_pieces(side, b, cutter(b.shape, b.cells) or _same(b.shape, b.cells)) for b in side.blocks])


def _pieces(mesh: Maillage, block: Block, cut: Pieces) -> Maillage:
    name, cells, owner = cut
    return Maillage(mesh.store, [Block(name, cells, block.colours[owner])])


ORIE = operator(
    "ORIENTER",
    topic="mesh",
    summary="the same mesh with all its elements turned the right way",
    notice="`ORIE G`: volumes in space and surfaces in the plane get a positive measure. `ORIE G ('DIRE') V`: "
    "surfaces in space get normals on the side of the vector V; `ORIE G 'POINT' P`: normals towards P.",
    example="OPTI DIME 2 ELEM QUA4 ; S = INVE ((DROIT 3 (0. 0.) (1. 0.)) TRAN 2 (0. 1.)) ; MESS (MESU (ORIE S)) ;",
    see=["INVERSE", "CHANGER"],
)


def _turned(mesh: Maillage, wrong: dict[str, Any]) -> Maillage:
    """Turn over the elements of given rows."""
    blocks = []
    for block in mesh.blocks:
        rows = wrong.get(block.shape)
        if rows is None or not len(rows):
            blocks.append(block)
            continue
        cells = block.cells.copy()
        cells[rows] = orientation.reversed_cells(block.shape, cells[rows])
        blocks.append(Block(block.shape, cells, block.colours))
    return Maillage(mesh.store, blocks, mesh.sides)


def _against(ctx: Context, g: Maillage, direction: Callable[[Any], Any]) -> Maillage:
    """Turn over the facets whose normal is against the direction wanted at their centre."""
    if dimension(ctx) != 3:
        ctx.fail(34, "normals of surfaces exist in space only; in the plane, ORIE G alone")
    x = nodes_of(ctx).coords
    wrong = {}
    for block in g.blocks:
        if DIMENSION[block.shape] == 2:
            with explained(ctx, "g"):
                normals = geometry.facet_normals(shape(block.shape), x[block.cells])
            side = (normals * direction(geometry.centroids(shape(block.shape), x[block.cells]))).sum(axis=1)
            wrong[block.shape] = np.flatnonzero(side < 0)
    return _turned(g, wrong)


@ORIE.form(
    Arg("g", MAILLAGE, "surface"),
    Key("POINT", "normals towards a point", Arg("p", POINT), required=True),
    gives=[MAILLAGE],
)
def _orient_to(ctx: Context, g: Maillage, point: Point) -> Maillage:
    return _against(ctx, g, lambda centres: point.coords - centres)


@ORIE.form(
    Arg("g", MAILLAGE, "surface"),
    Key("DIRECTION", "normals along a vector"),
    Arg("v", POINT, "vector"),
    gives=[MAILLAGE],
)
def _orient_along(ctx: Context, g: Maillage, direction: bool, v: Point) -> Maillage:
    return _against(ctx, g, lambda centres: v.coords)


@ORIE.form(Arg("g", MAILLAGE, "mesh"), gives=[MAILLAGE])
def _orient(ctx: Context, g: Maillage) -> Maillage:
    dim = dimension(ctx)
    x = nodes_of(ctx).coords[:, :dim]
    return _turned(
        g, {b.shape: orientation.negative(b.shape, x[b.cells]) for b in g.blocks if DIMENSION[b.shape] == dim}
    )


REGE = operator(
    "REGENERER",
    topic="mesh",
    summary="elements that have lost corners become lower elements",
    notice="After ELIM, elements may have a node twice: QUA4 become TRI3, CUB8 PRI6, PYR5 or TET4, PRI6 PYR5 or "
    "TET4, TRI3 SEG2, SEG2 POI1. A volume that collapses in another way is an error. 'VERI' is accepted: "
    "the result never has a node twice.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 2 (0. 0.) (1. 0.)) ROTA 2 90. (0. 0.) ; ELIM S 1.E-6 ; "
    "S = REGE S ; LIST (S ELEM 'TYPE') ;",
    see=["ELIMINATION", "CHANGER"],
)


@REGE.form(Arg("g", MAILLAGE, "mesh"), Key("VERI", "accepted"), gives=[MAILLAGE])
def _rege(ctx: Context, g: Maillage, veri: bool) -> Maillage:
    if is_quadratic(g):
        return quadratic_mesh(ctx, _rege(ctx, linear_mesh(ctx, g), veri))
    found = []
    for block in g.blocks:
        by_shape, hopeless = degenerate.lowered(block.shape, block.cells)
        if len(hopeless):
            ctx.fail(
                303,
                "{count} {shape} element(s) have collapsed into no lower element: number {number}",
                at="g",
                count=len(hopeless),
                shape=block.shape,
                number=int(hopeless[0]) + 1,
                hint="was the distance given to ELIM larger than the elements?",
            )
        lower = [Block(name, cells, block.colours[rows]) for name, (cells, rows) in by_shape.items()]
        found.append(Maillage(g.store, lower))
    sides = {name: _rege(ctx, side, veri) for name, side in g.sides.items()}
    return join(found, sides) if found else g


ARET = operator(
    "ARETE",
    topic="mesh",
    summary="sharp edges of a volume or of a surface",
    notice="`L = ARET V (angle)`: the edges where two facets of the boundary make more than an angle, 20 degrees "
    "by default; of a surface, its boundary and branchings too.",
    example="OPTI DIME 3 ELEM CUB8 ; S = (DROIT 2 (0. 0. 0.) (1. 0. 0.)) TRAN 2 (0. 1. 0.) ; "
    "V = S VOLU 3 'TRAN' (0. 0. 1.) ; MESS (NBEL (ARET V)) ;",
    see=["CONTOUR", "ENVELOPPE"],
)


@ARET.form(Arg("g", MAILLAGE, "volume or surface"), Arg("angle", FLOTTANT, "degrees", optional=True), gives=[MAILLAGE])
def _arete(ctx: Context, g: Maillage, angle: float | None) -> Maillage:
    if is_quadratic(g):
        return quadratic_mesh(ctx, _arete(ctx, linear_mesh(ctx, g), angle))
    blocks = g.kernel_blocks
    solids = [b for b in blocks if b[0] in VOLUMES]
    skin = [(name, f.nodes) for name, f in topology.boundary(solids).items()]
    skin += [b for b in blocks if b[0] in SURFACES]
    if not skin:
        ctx.fail(16, "a volume or a surface is wanted, this mesh holds {shapes}", at="g", shapes=" ".join(g.shapes))
    with explained(ctx, "g"):
        found = edges.sharp(nodes_of(ctx).coords, skin, 20.0 if angle is None else angle)
    return new_mesh(ctx, [("SEG2", found[chains.walk(found)])])
