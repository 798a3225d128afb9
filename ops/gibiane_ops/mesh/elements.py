"""Elements of meshes: ELEM in all its forms, INCLUS, DIFF and INTE."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, Refused, operator
from gibiane.values import ENTIER, FLOTTANT, LISTENTI, MAILLAGE, POINT
from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.mesh import chains, locate, unions
from gibiane_ops.mesh.building import DIMENSION, dimension, join, line_between, line_nodes, line_segments, nodes_of
from gibiane_ops.mesh.degree import finished, is_quadratic, linear_mesh
from gibiane_ops.mesh.merging import as_mesh
from gibiane_ops.options import ELEMENTS
from gibiane_ops.values.listes import ListEnti, ListMots
from gibiane_ops.values.maillage import COLOURS, Block, Maillage, Point

ELEM = operator(
    "ELEM",
    topic="mesh",
    summary="choose elements of a mesh",
    notice="`G ELEM TYPE (N|LENTI)`: the elements of a type, element N of it, or those of a list of numbers; "
    "`G ELEM COLOUR`: those of a colour (type and colour may be combined); `G ELEM N`: element N. "
    "`G ELEM 'CONT' P`: the element that contains a point ('TOUS': all that do). `G ELEM 'APPU' ('STRI'|"
    "'LARG') G2`: those with all their nodes in G2 (the default) or at least one. `L ELEM 'COMP' P1 P2`: "
    "the part of a line from P1 to P2; where lines branch, the way of fewest segments. "
    "`G ELEM 'TYPE'` and `G ELEM 'COUL'`: the LISTMOTS of the types and "
    "colours. An empty choice is an error unless 'NOVE' is given.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 3 (0. 0.) (1. 0.)) TRAN 2 (0. 1.) ; "
    "G = S ELEM 'APPU' 'LARG' (COTE 1 S) ; MESS (NBEL G) ;",
    see=["POINT", "INCLUS", "NBEL"],
)

MESH = Arg("g", MAILLAGE, "mesh")
NOVE = Key("NOVERIF", "an empty result is allowed")


def choose(mesh: Maillage, rows: Sequence[Any]) -> Maillage:
    """Keep some rows of each block (indices or masks)."""
    return Maillage(
        mesh.store, [Block(b.shape, b.cells[r], b.colours[r]) for b, r in zip(mesh.blocks, rows, strict=True)]
    )


def not_empty(ctx: Context, chosen: Maillage, allowed: bool, at: str = "g", word: str = "NOVE") -> Maillage:
    """Refuse an empty choice unless it is allowed, by the keyword `word`."""
    if chosen.n_cells == 0 and not allowed:
        ctx.fail(26, "no element of the mesh is like that", at=at, word=word, hint="'{word}' accepts an empty result")
    return chosen


@ELEM.form(
    MESH,
    Key("APPUYE", "with nodes in a second mesh", required=True),
    Key(("STRICTEMENT", "LARGEMENT"), "all nodes, or at least one", name="how"),
    Arg("support", (MAILLAGE, POINT), "second mesh, or point"),
    NOVE,
    gives=[MAILLAGE],
)
def _resting(
    ctx: Context, g: Maillage, appuye: bool, how: str | None, support: Maillage | Point, noverif: bool
) -> Maillage:
    on = np.zeros(nodes_of(ctx).count, bool)
    on[as_mesh(support).nodes] = True
    rows = [on[b.cells].any(axis=1) if how == "LARGEMENT" else on[b.cells].all(axis=1) for b in g.blocks]
    return not_empty(ctx, choose(g, rows), noverif)


@ELEM.form(
    MESH,
    Key("CONTENANT", "that contains a point", Arg("p", POINT), required=True),
    Key("TOUS", "all elements that do"),
    NOVE,
    gives=[MAILLAGE],
)
def _containing(ctx: Context, g: Maillage, contenant: Point, tous: bool, noverif: bool) -> Maillage:
    dim = int(ctx.option("DIME"))
    store = nodes_of(ctx)
    rows: list[IntArray] = []
    found = False
    for block in g.blocks:
        inside = locate.containing(block.shape, store.coords[block.cells][:, :, :dim], contenant.coords[:dim])
        if not tous:
            inside = inside[:0] if found else inside[:1]
        found = found or len(inside) > 0
        rows.append(inside)
    return not_empty(ctx, choose(g, rows), noverif, "contenant")


@ELEM.form(MESH, Key("COMPRIS", "part of a line", Arg("a", POINT), Arg("b", POINT), required=True), gives=[MAILLAGE])
def _between(ctx: Context, g: Maillage, compris: tuple[Point, Point]) -> Maillage:
    quadratic, g = is_quadratic(g), linear_mesh(ctx, g)
    segments = line_segments(ctx, g, "g")
    if chains.branches(segments):
        way = chains.path(segments, compris[0].node, compris[1].node)
        if len(way) < 2:
            ctx.fail(21, "no way along these segments joins the two points", at="compris")
        return finished(ctx, line_between(ctx, way), quadratic)
    nodes = line_nodes(ctx, g, "g")
    closed = len(nodes) > 2 and nodes[0] == nodes[-1]
    places = []
    for point in compris:
        at = np.flatnonzero(nodes == point.node)
        if len(at) == 0:
            ctx.fail(
                18,
                "this point is not on the line",
                at="compris",
                hint="L POIN 'PROC' P gives the node of the line nearest to P",
            )
        places.append(int(at[0]))
    first, last = places
    if closed:
        ring = nodes[:-1]
        count = (last - first) % len(ring) or len(ring)
        return finished(ctx, line_between(ctx, ring[(first + np.arange(count + 1)) % len(ring)]), quadratic)
    if first == last:
        ctx.fail(21, "the two points are one: nothing is between them", at="compris")
    part = nodes[first : last + 1] if first < last else nodes[last : first + 1][::-1]
    return finished(ctx, line_between(ctx, part), quadratic)


@ELEM.stream(
    Key(("TYPE", "COUL"), "types or colours, as a LISTMOTS; 'COUL' N the elements of a colour"),
    Key(ELEMENTS, "elements of this type", name="type"),
    Key(COLOURS, "elements of this colour", name="colour"),
    syntax="g:MAILLAGE (TYPE) (COLOUR) (n:ENTIER|LISTENTI)",
    gives=["MAILLAGE|LISTMOTS"],
)
def _elem(ctx: Context, q: Operands) -> Any:
    saved = q.values.copy(), q.nodes.copy()
    g = q.read(MAILLAGE)
    types: list[str] = []
    colours: list[str] = []
    while (word := q.read_keyword(["TYPE", "COUL", *ELEMENTS, *COLOURS])) is not None:
        if word in ("TYPE", "COUL"):
            mesh = g if g is not None else q.need(MAILLAGE)
            return _names(ctx, mesh, word, q.read(ENTIER) if word == "COUL" else None)
        (types if word in ELEMENTS else colours).append(word)
    if g is None:
        g = q.read(MAILLAGE)
    number = q.read((ENTIER, LISTENTI)) if g is not None else None
    if g is None or (number is None and not types and not colours):
        q.values[:], q.nodes[:] = saved
        if g is None:
            return Refused
        colours = [COLOURS[i] for i in np.unique(np.concatenate([b.colours for b in g.blocks]))] if g.blocks else []
        raise q.unknown_keyword(["APPUYE", "CONTENANT", "COMPRIS", "TYPE", "COUL", *g.shapes, *colours[:6]])
    chosen = g
    if types:
        chosen = Maillage(g.store, [b for b in g.blocks if b.shape in types])
    if colours:
        wanted = [COLOURS.index(name) for name in colours]
        chosen = choose(chosen, [np.isin(b.colours, wanted) for b in chosen.blocks])
    if number is not None:
        chosen = _numbered(ctx, chosen, number)
    return not_empty(ctx, chosen, False)


def _names(ctx: Context, g: Maillage, word: str, number: int | None) -> ListMots | Maillage:
    if word == "TYPE":
        return ListMots(g.shapes)
    if number is not None:
        return not_empty(ctx, choose(g, [b.colours == number - 1 for b in g.blocks]), False)
    used = dict.fromkeys(int(c) for b in g.blocks for c in np.unique(b.colours))
    return ListMots([COLOURS[c] for c in used])


def _numbered(ctx: Context, g: Maillage, number: int | ListEnti) -> Maillage:
    wanted = np.asarray(number.values if isinstance(number, ListEnti) else [number], np.int64)
    block = g.single()
    if block is None:
        ctx.fail(
            25,
            "element {number} of which type? this mesh holds {shapes}",
            number=int(wanted[0]) if len(wanted) else 0,
            shapes=" ".join(g.shapes) or "no element",
            hint="name the type: G ELEM QUA4 3",
        )
    bad = wanted[(wanted < 1) | (wanted > len(block.cells))]
    if len(bad):
        ctx.fail(
            36,
            "there is no element {number}: the mesh has {count} {shapes}",
            number=int(bad[0]),
            count=len(block.cells),
            shapes=block.shape,
        )
    return choose(g, [wanted - 1])


INCL = operator(
    "INCLUS",
    topic="mesh",
    summary="elements of a mesh that are inside another",
    notice="`G = INCL G1 G2`: the elements of G1 all of whose nodes are inside a plane contour (closed lines, or a "
    "surface), its border included ('LARG', the default) or not ('STRI'). `INCL G1 G2 'VOLU'`: inside the "
    "volumes of G2, all nodes ('STRI', the default) or at least one ('LARG'); a FLOTTANT, by default 0.01, "
    "catches nodes a little outside, or leaves out those near the faces if negative, by parts of an element. "
    "'BARY': the centre of the element is inside. An empty result is an error unless 'NOID' is given.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 4 (0. 0.) (4. 0.)) TRAN 4 (0. 4.) ; "
    "C = CERC 12 'ROTA' 360. (3.5 2.) (2. 2.) 'ELIM' ; MESS (NBEL (INCL S C 'BARY')) ;",
    see=["ELEM"],
)
HOW = Key(("STRICTEMENT", "LARGEMENT", "BARYCENTRE"), "what must be inside", name="how")
NOID = Key("NOID", "an empty result is allowed")


@INCL.form(
    Arg("g1", MAILLAGE, "mesh"),
    Arg("g2", MAILLAGE, "volumes"),
    Key("VOLU", "inside volumes", required=True),
    HOW,
    NOID,
    Arg("tolerance", FLOTTANT, "by parts of an element", optional=True),
    gives=[MAILLAGE],
)
def _in_volumes(
    ctx: Context, g1: Maillage, g2: Maillage, volu: bool, how: str | None, noid: bool, tolerance: float | None
) -> Maillage:
    x = nodes_of(ctx).coords
    solids = [b for b in g2.kernel_blocks if DIMENSION[b[0]] == 3]
    if not solids:
        ctx.fail(
            16, "volumes are wanted, this mesh holds {shapes}", at="g2", shapes=" ".join(g2.shapes) or "no element"
        )
    margin = 0.01 if tolerance is None else tolerance
    if how == "BARYCENTRE":
        centres = [locate.in_mesh(x[b.cells].mean(axis=1), x, solids, margin) for b in g1.blocks]
        return not_empty(ctx, choose(g1, centres), noid, "g1", "NOID")
    flag = np.zeros(len(x), bool)
    flag[g1.nodes] = locate.in_mesh(x[g1.nodes], x, solids, margin)
    rows = [flag[b.cells].any(axis=1) if how == "LARGEMENT" else flag[b.cells].all(axis=1) for b in g1.blocks]
    return not_empty(ctx, choose(g1, rows), noid, "g1", "NOID")


@INCL.form(Arg("g1", MAILLAGE, "mesh"), Arg("g2", MAILLAGE, "closed lines, or surface"), HOW, NOID, gives=[MAILLAGE])
def _in_contour(ctx: Context, g1: Maillage, g2: Maillage, how: str | None, noid: bool) -> Maillage:
    x = nodes_of(ctx).coords
    lines = _contour_of(g2)
    if len(lines) == 0:
        ctx.fail(
            16,
            "closed lines or a surface are wanted, this mesh holds {shapes}",
            at="g2",
            shapes=" ".join(g2.shapes) or "no element",
            hint="'VOLU' chooses the inside of volumes",
        )
    if (np.bincount(lines.ravel()) % 2).any():
        ctx.fail(28, "the contour is not closed", at="g2", label="some of its ends are free")
    plane = x[np.unique(lines)] - x[lines[0, 0]]
    axes = np.eye(3)[:2] if dimension(ctx) == 2 else np.linalg.svd(plane, full_matrices=False)[2][:2]
    flat = (x - x[lines[0, 0]]) @ axes.T
    if how == "BARYCENTRE":
        rows = [
            np.logical_or(*locate.in_contours(flat[b.cells].mean(axis=1), flat[lines[:, 0]], flat[lines[:, 1]]))
            for b in g1.blocks
        ]
        return not_empty(ctx, choose(g1, rows), noid, "g1", "NOID")
    nodes = g1.nodes
    inside, on = locate.in_contours(flat[nodes], flat[lines[:, 0]], flat[lines[:, 1]])
    flag = np.zeros(len(x), bool)
    flag[nodes] = inside & ~on if how == "STRICTEMENT" else inside | on
    return not_empty(ctx, choose(g1, [flag[b.cells].all(axis=1) for b in g1.blocks]), noid, "g1", "NOID")


def _contour_of(g: Maillage) -> IntArray:
    """Return the segments of closed lines or around surfaces; those of second degree count as two each."""
    blocks = [b for b in g.kernel_blocks if DIMENSION[b[0]] == 2]
    found = [f.nodes for f in topology.boundary(blocks).values()] if blocks else [c for _, c in g.kernel_blocks]
    lines = [cells[:, [0, 2, 2, 1]].reshape(-1, 2) for cells in found if cells.shape[1] == 3]
    return np.concatenate([np.zeros((0, 2), np.int64), *lines, *(cells for cells in found if cells.shape[1] == 2)])


DIFF = operator(
    "DIFFERENCE",
    topic="mesh",
    summary="elements of one mesh or the other, not of both",
    notice="Elements count as the same when they have the same nodes, in any order.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 3 (0. 0.) (1. 0.)) TRAN 2 (0. 1.) ; "
    "R = DIFF (CONT S) (COTE 1 S) ; MESS (NBEL R) ;",
    see=["INTERSECTION", "ET"],
)
INTE = operator(
    "INTERSECTION",
    topic="mesh",
    summary="elements that two meshes have in common",
    notice="Elements count as the same when they have the same nodes, in any order. The result may be empty.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 3 (0. 0.) (1. 0.)) TRAN 2 (0. 1.) ; "
    "R = INTE (CONT S) (COTE 1 S) ; MESS (NBEL R) ;",
    see=["DIFFERENCE", "ET"],
)
TWO = (Arg("a", MAILLAGE, "mesh"), Arg("b", MAILLAGE, "mesh"))


def _known(a: Maillage, b: Maillage) -> list[Any]:
    return [unions.is_in(block.cells, b.cells(block.shape)) for block in a.blocks]


@DIFF.form(*TWO, gives=[MAILLAGE])
def _diff(ctx: Context, a: Maillage, b: Maillage) -> Maillage:
    return join([choose(a, [~k for k in _known(a, b)]), choose(b, [~k for k in _known(b, a)])])


@INTE.form(*TWO, gives=[MAILLAGE])
def _inte(ctx: Context, a: Maillage, b: Maillage) -> Maillage:
    return choose(a, _known(a, b))
