"""Points of meshes: POIN, NBEL, NBNO, COUL."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, FLOTTANT, LISTMOTS, LISTREEL, MAILLAGE, MOT, POINT
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.mesh import distances
from gibiane_ops.mesh.building import DIMENSION, dimension, explained, new_mesh, nodes_of, tolerance_of
from gibiane_ops.values.listes import ListEnti, ListMots, ListReel
from gibiane_ops.values.maillage import COLOURS, Block, Maillage, Point, cells_in_turn

POIN = operator(
    "POINT",
    topic="mesh",
    summary="make a point, or choose points of a mesh",
    notice="`P = POIN x y z` makes a point, `POIN LX LY LZ` a mesh of points; 'DENS' gives their density. "
    "`G POIN N` is node N of a mesh of points or of a line, `G POIN i j` node i of element j, 'INIT' and "
    "'FINA' the ends of a line, 'PROC' P the node nearest to P: these are POINT. 'DROI' P1 P2, 'PLAN' P1 "
    "P2 P3, 'CYLI' A1 A2 P, 'CONE' S A P, 'SPHE' C P and 'TORE' C A C2 P give the mesh of the nodes on "
    "a line, a plane, a cylinder, a cone, a sphere or a torus, up to a distance that may follow (by "
    "default a tenth of the current density); 'JONC' those where more than two elements meet.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 3 (0. 0.) (1. 0.)) TRAN 2 (0. 1.) ; "
    "B = S POIN 'DROI' (0. 0.) (1. 0.) 1.E-6 ; MESS (NBNO B) ;",
    see=["ELEM", "COORDONNEE"],
)

MESH = Arg("g", MAILLAGE, "mesh")
TOLERANCE = Arg("tolerance", FLOTTANT, "distance", optional=True)


def _points(*names: str) -> list[Arg]:
    return [Arg(name, POINT) for name in names]


def _not_empty(ctx: Context, g: Maillage) -> None:
    if g.n_cells == 0:
        ctx.fail(18, "there is no point to choose: the mesh is empty", at="g")


@POIN.form(MESH, Key("PROC", "nearest node", Arg("p", POINT), required=True), gives=[POINT])
def _near(ctx: Context, g: Maillage, proc: Point) -> Point:
    _not_empty(ctx, g)
    store, nodes = nodes_of(ctx), g.nodes
    return Point(store, int(nodes[distances.nearest(store.coords[nodes], proc.coords)]))


@POIN.form(MESH, Key(("INITIAL", "FINAL"), "first or last point", name="which", required=True), gives=[POINT])
def _end(ctx: Context, g: Maillage, which: str) -> Point:
    _not_empty(ctx, g)
    block = g.single()
    if block is None or DIMENSION[block.shape] > 1:
        ctx.fail(
            16, "a line or a mesh of points is wanted, this mesh holds {shapes}", at="g", shapes=" ".join(g.shapes)
        )
    return Point(g.store, block.cells[0, 0] if which == "INITIAL" else block.cells[-1, min(DIMENSION[block.shape], 1)])


@POIN.form(MESH, Key("JONC", "where more than two elements meet", required=True), gives=[MAILLAGE])
def _junctions(ctx: Context, g: Maillage, jonc: bool) -> Maillage:
    cells = [b.cells.ravel() for b in g.blocks]
    count = np.bincount(np.concatenate(cells)) if cells else np.zeros(0, np.int64)
    return new_mesh(ctx, [("POI1", np.flatnonzero(count > 2).reshape(-1, 1).astype(np.int64))])


ON: dict[str, tuple[str, list[Arg], Callable[..., FloatArray]]] = {
    "DROIT": ("nodes on a line", _points("a", "b"), distances.to_line),
    "PLAN": ("nodes in a plane", _points("a", "b", "c"), distances.to_plane),
    "CYLI": ("nodes on a cylinder", _points("a", "b", "p"), distances.to_cylinder),
    "CONE": ("nodes on a cone", _points("s", "a", "p"), distances.to_cone),
    "SPHE": ("nodes on a sphere", _points("c", "p"), distances.to_sphere),
    "TORE": ("nodes on a torus", _points("c", "a", "c2", "p"), distances.to_torus),
}


def _selection(word: str, doc: str, points: list[Arg], distance: Callable[..., FloatArray]) -> None:
    @POIN.form(MESH, Key(word, doc, *points, TOLERANCE, name="given", required=True), gives=[MAILLAGE])
    def _on(ctx: Context, g: Maillage, given: tuple[Any, ...]) -> Maillage:
        nodes = g.nodes
        *at, tolerance = given
        with explained(ctx, "given"):
            found = distance(nodes_of(ctx).coords[nodes], *(p.coords for p in at))
        kept = nodes[found <= tolerance_of(ctx, tolerance, nodes)]
        if len(kept) == 0:
            ctx.warn(18, "no node is there: the mesh of points is empty", at="given")
        return Maillage.of_nodes(nodes_of(ctx), kept)


for _word, (_doc, _args, _distance) in ON.items():
    _selection(_word, _doc, _args, _distance)


@POIN.form(MESH, Arg("i", ENTIER, "number"), Arg("j", ENTIER, "number of the element", optional=True), gives=[POINT])
def _number(ctx: Context, g: Maillage, i: int, j: int | None) -> Point:
    block = g.single()
    if block is None:
        ctx.fail(
            25,
            "a mesh of one element type is wanted, this one holds {shapes}",
            at="g",
            shapes=" ".join(g.shapes) or "no element",
            hint="CHAN POI1 G is the mesh of its points",
        )
    if j is not None:
        column, row = i, j
    elif block.shape == "POI1":
        column, row = 1, i
    elif DIMENSION[block.shape] == 1:
        # Along a line of second degree corners and mid-nodes come in turn.
        step = block.cells.shape[1] - 1
        row = min(max(i - 1, 0) // step + 1, len(block.cells))
        column = i - (row - 1) * step
    else:
        ctx.fail(
            16,
            "node {number} of what? this mesh holds {shapes}",
            at="g",
            number=i,
            shapes=block.shape,
            hint="CHAN POI1 G is the mesh of its points; POIN i j is node i of element j",
        )
    if not (1 <= row <= len(block.cells) and 1 <= column <= block.cells.shape[1]):
        ctx.fail(
            18,
            "there is no such point: the mesh has {count} {shapes}",
            at="i",
            count=len(block.cells),
            shapes=block.shape,
        )
    return Point(g.store, cells_in_turn(block.shape, block.cells)[row - 1, column - 1])


@POIN.form(
    Arg("x", LISTREEL, "first coordinates"),
    Arg("y", LISTREEL, "second coordinates", optional=True),
    Arg("z", LISTREEL, "third coordinates", optional=True),
    Key("DENS", "their density", Arg("d", (FLOTTANT, LISTREEL))),
    gives=[MAILLAGE],
)
def _make_many(ctx: Context, x: ListReel, y: ListReel | None, z: ListReel | None, dens: Any) -> Maillage:
    lists = [each.values for each in (x, y, z) if each is not None]
    _check_count(ctx, len(lists))
    density = ctx.option("DENS") if dens is None else dens.values if isinstance(dens, ListReel) else dens
    lengths = {len(each) for each in lists} | ({len(dens)} if isinstance(dens, ListReel) else set())
    if len(lengths) > 1:
        ctx.fail(217, "the lists have different lengths: {lengths}", lengths=" ".join(map(str, sorted(lengths))))
    store = nodes_of(ctx)
    return Maillage.of_nodes(store, store.add(np.column_stack(lists), density))


def _check_count(ctx: Context, given: int) -> None:
    dim = dimension(ctx)
    if given != dim:
        ctx.fail(37, "{dim} coordinates are wanted, {given} are given", dim=dim, given=given)


@POIN.form(
    Arg("x", FLOTTANT, "first coordinate"),
    Arg("y", FLOTTANT, "second coordinate", optional=True),
    Arg("z", FLOTTANT, "third coordinate", optional=True),
    Key("DENS", "its density", Arg("d", FLOTTANT)),
    gives=[POINT],
    last=True,
)
def _make(ctx: Context, x: float, y: float | None, z: float | None, dens: float | None) -> Point:
    values = [each for each in (x, y, z) if each is not None]
    _check_count(ctx, len(values))
    store = nodes_of(ctx)
    return Point(store, int(store.add([values], ctx.option("DENS") if dens is None else dens)[0]))


NOEU = operator(
    "NOEUD",
    topic="mesh",
    summary="point of a given number",
    notice="`P = NOEU N`: numbers are those that LIST shows; they change when nodes are merged.",
    example="OPTI DIME 2 ; P = 3. 4. ; MESS (COOR 2 (NOEU 1)) ;",
    see=["POINT"],
)


@NOEU.form(Arg("n", ENTIER, "number"), gives=[POINT])
def _noeud(ctx: Context, n: int) -> Point:
    store = nodes_of(ctx)
    if not 1 <= n <= store.count:
        ctx.fail(18, "there is no node {number}: the last is {count}", at="n", number=n, count=store.count)
    return Point(store, n - 1)


NBEL = operator(
    "NBEL",
    topic="mesh",
    summary="number of elements of a mesh",
    notice="An ENTIER; with a LISTMOTS of types, a LISTENTI of the numbers of elements of each.",
    example="OPTI DIME 2 ; MESS (NBEL (DROIT 10 (0. 0.) (1. 0.))) ;",
    see=["NBNO"],
)
NBNO = operator(
    "NBNO",
    topic="mesh",
    summary="number of distinct nodes of a mesh",
    notice="An ENTIER.",
    example="OPTI DIME 2 ; MESS (NBNO (DROIT 10 (0. 0.) (1. 0.))) ;",
    see=["NBEL"],
)


@NBEL.form(MESH, Arg("types", LISTMOTS, "types of elements", optional=True), gives=["ENTIER|LISTENTI"])
def _nbel(ctx: Context, g: Maillage, types: ListMots | None) -> int | ListEnti:
    if types is not None:
        return ListEnti([len(g.cells(name)) for name in types.words])
    return g.n_cells


@NBNO.form(MESH, gives=[ENTIER])
def _nbno(ctx: Context, g: Maillage) -> int:
    return len(g.nodes)


COUL = operator(
    "COULEUR",
    topic="mesh",
    summary="the same mesh in a colour",
    notice="A word (" + " ".join(COLOURS) + ") or its number from 1; without either, the colour of OPTI COUL.",
    example="OPTI DIME 2 ELEM SEG2 ; L = (DROIT 2 (0. 0.) (1. 0.)) COUL ROUG ; LIST L ;",
    see=["ELEM"],
)


@COUL.form(
    MESH,
    Arg("number", ENTIER, "number of a colour", optional=True),
    Arg("word", MOT, "name of a colour", optional=True),
    gives=[MAILLAGE],
)
def _coul(ctx: Context, g: Maillage, number: int | None, word: str | None) -> Maillage:
    if word is not None:
        name = word[:4]
        if name not in COLOURS:
            ctx.fail(
                1055,
                "there is no colour '{word}'",
                at="word",
                word=word,
                known=" ".join(COLOURS),
                hint="known colours: {known}",
            )
        index = COLOURS.index(name)
    elif number is not None:
        if number > len(COLOURS):
            ctx.fail(1055, "there is no colour {number}: 1 to {count}", at="number", number=number, count=len(COLOURS))
        index = max(number - 1, 0)
    else:
        index = COLOURS.index(ctx.session.options.get("COUL") or "DEFA")
    blocks = [Block(b.shape, b.cells, np.full(len(b.cells), index, np.int64)) for b in g.blocks]
    return Maillage(g.store, blocks, g.sides)
