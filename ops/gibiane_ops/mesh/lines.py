"""Lines: straight segments, arcs of circle, polylines; their reversal, and the lines that bound surfaces."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, FLOTTANT, LISTREEL, MAILLAGE, POINT
from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.mesh import arcs, chains, edges, transforms
from gibiane_ops.mesh.building import (
    DIMENSION,
    axis_end,
    dimension,
    explained,
    join,
    line_between,
    new_mesh,
    nodes_of,
    places_along,
    reference,
    reversed_mesh,
)
from gibiane_ops.mesh.degree import is_quadratic, linear_mesh, quadratic_mesh
from gibiane_ops.mesh.elements import choose
from gibiane_ops.mesh.paths import COUNT, DFIN, DINI, ENDS, End, end_sizes, first_node, last_node, line_along
from gibiane_ops.values.listes import ListReel
from gibiane_ops.values.maillage import Maillage, Point

DROI = operator(
    "DROIT",
    topic="mesh",
    summary="straight line between two points",
    notice="`L = DROIT N P1 P2` makes N equal segments. Without N, the densities of the two points (or 'DINI' "
    "and 'DFIN') give the number and the sizes; with N negative, |N| segments of sizes that follow the "
    "densities. A line in place of P1 is prolonged from its last point; without P2 it is closed on its "
    "first point. With OPTI ELEM of second degree lines are SEG3, their mid-nodes on the line or arc. D is another "
    "name of this operator.",
    example="OPTI DIME 2 ELEM QUA4 ; L = DROIT 10 (0. 0.) (1. 0.) ; MESS (NBEL L) ;",
    see=["CERCLE", "DALLER", "DENSITE"],
)


@DROI.form(
    COUNT,
    Arg("a", ENDS, "first point, or line to prolong"),
    Arg("b", ENDS, "last point", optional=True),
    DINI,
    DFIN,
    gives=[MAILLAGE],
)
def _droit(ctx: Context, n: int | None, a: End, b: End | None, dini: float | None, dfin: float | None) -> Maillage:
    dimension(ctx)
    start = last_node(ctx, a, "a")
    if b is None and isinstance(a, Point):
        ctx.fail(
            37,
            "no POINT for its other end",
            at="a",
            label="one end only",
            hint="in space a point needs three numbers, in parentheses: (0. 0. 1.)",
        )
    end = first_node(ctx, a if b is None else b, "b")
    store = nodes_of(ctx)
    x0, x1 = store.coords[start], store.coords[end]
    d0, d1 = end_sizes(ctx, start, end, dini, dfin)
    places = places_along(ctx, float(np.linalg.norm(x1 - x0)), d0, d1, n)
    return line_along(ctx, a, b, start, end, lambda t: x0 + t[:, None] * (x1 - x0), places, (d0, d1))


CERC = operator(
    "CERCLE",
    topic="mesh",
    summary="arc of a circle",
    notice="`L = CERC N P1 C P2`: the shorter arc from P1 to P2 about the centre C (never half a circle). "
    "`CERC N 'PASS' P1 P2 P3`: through three points. `CERC N 'ROTA' angle P1 C (A)`: the path of P1 turned "
    "by an angle in degrees about C, or about the axis C-A in space; 'ELIM' closes a full turn. N, "
    "densities and lines in place of end points as in DROIT. C is another name of this operator.",
    example="OPTI DIME 2 ELEM SEG2 ; L = CERC 8 (1. 0.) (0. 0.) (0. 1.) ; MESS (NBEL L) ;",
    see=["DROIT"],
)


@CERC.form(
    COUNT,
    Key("ROTA", "turn the first point", Arg("angle", FLOTTANT, "degrees"), required=True),
    Arg("a", ENDS, "first point"),
    Arg("c", POINT, "centre"),
    Arg("e", POINT, "second point of the axis", optional=True),
    Key("ELIM", "close the circle"),
    DINI,
    DFIN,
    gives=[MAILLAGE],
)
def _cercle_rota(
    ctx: Context,
    n: int | None,
    rota: float,
    a: End,
    c: Point,
    e: Point | None,
    elim: bool,
    dini: float | None,
    dfin: float | None,
) -> Maillage:
    dimension(ctx)
    if elim and abs(rota) != 360.0:
        ctx.fail(21, "'ELIM' closes a full turn only, not {angle} degrees", angle=rota)
    store = nodes_of(ctx)
    start = last_node(ctx, a, "a")
    d0, d1 = end_sizes(ctx, start, start, dini, dfin)
    first, centre = store.coords[start], c.coords
    axis = axis_end(ctx, c, e)
    with explained(ctx, "c"):
        radius = arcs.distance_to_axis(first[None], centre, axis)[0]
        places = places_along(ctx, abs(np.radians(rota)) * float(radius), d0, d1, n)

    def path(t: FloatArray) -> FloatArray:
        turned = [transforms.rotation(rota * float(s), centre, axis)(first[None]) for s in t]
        return np.concatenate(turned) if turned else np.zeros((0, 3))

    end = start if elim else int(store.add(path(places[-1:]), d1)[0])
    return line_along(ctx, a, None, start, end, path, places, (d0, d1))


@CERC.form(
    COUNT,
    Key("PASS", "the second point is on the arc", name="through"),
    Key("CENTR", "it is the centre"),
    Arg("a", ENDS, "first point"),
    Arg("c", POINT, "centre, or point of the arc"),
    Arg("b", ENDS, "last point", optional=True),
    DINI,
    DFIN,
    gives=[MAILLAGE],
)
def _cercle(
    ctx: Context,
    n: int | None,
    through: bool,
    centr: bool,
    a: End,
    c: Point,
    b: End | None,
    dini: float | None,
    dfin: float | None,
) -> Maillage:
    dimension(ctx)
    start, end = last_node(ctx, a, "a"), first_node(ctx, a if b is None else b, "b")
    store = nodes_of(ctx)
    x0, x1 = store.coords[start], store.coords[end]
    d0, d1 = end_sizes(ctx, start, end, dini, dfin)
    if start == end:
        ctx.fail(21, "its two ends are one point", hint="CERC 'ROTA' 360. P1 C 'ELIM' makes a full circle")
    arc = _through(ctx, x0, c.coords, x1) if through else _about(ctx, x0, c.coords, x1)
    return line_along(ctx, a, b, start, end, arc, places_along(ctx, arc.length, d0, d1, n), (d0, d1))


def _through(ctx: Context, x0: FloatArray, middle: FloatArray, x1: FloatArray) -> arcs.Arc:
    arc = arcs.through(x0, middle, x1)
    if arc is None:
        ctx.fail(
            21, "the three points are on one line: no circle passes through them", hint="DROIT makes a straight line"
        )
    return arc


def _about(ctx: Context, x0: FloatArray, centre: FloatArray, x1: FloatArray) -> arcs.Arc:
    r0, r1 = float(np.linalg.norm(x0 - centre)), float(np.linalg.norm(x1 - centre))
    if abs(r0 - r1) > 1e-3 * max(r0, r1) or r0 == 0:
        ctx.fail(
            21,
            "the two ends are not at the same distance from the centre: {r0} and {r1}",
            r0=f"{r0:.6g}",
            r1=f"{r1:.6g}",
            hint="the operands are first point, centre, last point",
        )
    arc = arcs.about(x0, centre, x1)
    if arc is None:
        ctx.fail(
            30,
            "the two ends are opposite: half a circle can be drawn on either side",
            hint="make it of two arcs, or by CERC 'ROTA' 180.",
        )
    return arc


QUEL = operator(
    "QUELCONQUE",
    topic="mesh",
    summary="line through given points",
    notice="`L = QUEL 'SEG2' P1 P2 P3 ...` joins points; a mesh of points (POI1) stands for its points in order. "
    "`QUEL 'SEG2' LX LY (LZ)` joins new points whose coordinates are lists. 'SEG3' takes corners and mid-nodes in "
    "turn, an odd number of points.",
    example="OPTI DIME 2 ; L = QUEL 'SEG2' (0. 0.) (1. 0.) (1. 1.) ; MESS (NBEL L) ;",
    see=["DROIT", "MANUEL"],
)


@QUEL.form(
    Key(("SEG2", "SEG3"), "type of elements", name="kind", required=True),
    Arg("x", LISTREEL, "abscissas"),
    Arg("y", LISTREEL, "ordinates", optional=True),
    Arg("z", LISTREEL, "third coordinates", optional=True),
    gives=[MAILLAGE],
)
def _quel_lists(ctx: Context, kind: str, x: ListReel, y: ListReel | None, z: ListReel | None) -> Maillage:
    lists = [each.values for each in (x, y, z) if each is not None]
    dim = dimension(ctx)
    if len(lists) != dim:
        ctx.fail(37, "{dim} LISTREEL are wanted, one per coordinate; {given} are given", dim=dim, given=len(lists))
    if len({len(each) for each in lists}) > 1:
        ctx.fail(217, "the lists have different lengths: {lengths}", lengths=" ".join(str(len(each)) for each in lists))
    return _polyline(ctx, kind, nodes_of(ctx).add(np.column_stack(lists), ctx.option("DENS")))


@QUEL.form(
    Key(("SEG2", "SEG3"), "type of elements", name="kind", required=True),
    Arg("points", ENDS, "points, or meshes of points", many=True),
    gives=[MAILLAGE],
)
def _quel(ctx: Context, kind: str, points: list[End]) -> Maillage:
    nodes = [np.array([p.node]) if isinstance(p, Point) else p.nodes_in_order() for p in points]
    return _polyline(ctx, kind, np.concatenate(nodes))


def _polyline(ctx: Context, kind: str, nodes: IntArray) -> Maillage:
    if len(nodes) < 2:
        ctx.fail(37, "at least two points are wanted for a line")
    if kind == "SEG3" and len(nodes) % 2 == 0:
        ctx.fail(
            36, "{count} points do not make whole SEG3: corners and mid-nodes in turn are wanted", count=len(nodes)
        )
    if (nodes[1:] == nodes[:-1]).any():
        ctx.fail(75, "a point follows itself: a segment would have the same node twice")
    if kind == "SEG3":
        return new_mesh(ctx, [("SEG3", np.stack([nodes[:-1:2], nodes[2::2], nodes[1::2]], axis=1))])
    return line_between(ctx, nodes)


INVE = operator(
    "INVERSE",
    topic="mesh",
    summary="the same mesh turned over",
    notice="Every element turns the other way round; a line is also read from its other end. Normals change "
    "side, and a volume gets negative jacobians (ORIE repairs them).",
    example="OPTI DIME 2 ; L = INVE (DROIT 4 (0. 0.) (1. 0.)) ; X Y = COOR (L POIN 'INIT') ; MESS X ;",
    see=["ORIENTER"],
)


@INVE.form(Arg("g", MAILLAGE, "mesh"), gives=[MAILLAGE])
def _inverse(ctx: Context, g: Maillage) -> Maillage:
    return reversed_mesh(g)


CONT = operator(
    "CONTOUR",
    topic="mesh",
    summary="boundary line of a surface",
    notice="The edges that belong to one element only ('EXTE', the default), to three or more ('INTE'), or to "
    "any number but two ('TOUT'), oriented as the elements turn and in the order of a walk along "
    "them. An empty contour is an error unless 'NOID' is given.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 3 (0. 0.) (1. 0.)) TRAN 2 (0. 1.) ; MESS (NBEL (CONT S)) ;",
    see=["COTE", "ENVELOPPE"],
)


@CONT.form(
    Arg("g", MAILLAGE, "surface"),
    Key(("EXTE", "INTE", "TOUT"), "which edges", name="which"),
    Key("NOID", "an empty result is allowed"),
    gives=[MAILLAGE],
)
def _contour(ctx: Context, g: Maillage, which: str | None, noid: bool) -> Maillage:
    if is_quadratic(g):
        line = _contour(ctx, linear_mesh(ctx, g), which, noid)
        bent = [_has_middle(g, block.cells) for block in line.blocks]
        straight = [~rows for rows in bent]
        # the sides of linear elements stay linear
        parts = [quadratic_mesh(ctx, choose(line, bent)), choose(line, straight)]
        return join([part for part in parts if part.n_cells] or [line])
    surface = [b for b in g.kernel_blocks if DIMENSION[b[0]] == 2]
    found = edges.contour(surface, which or "EXTE")
    if len(found) == 0:
        if noid:
            return new_mesh(ctx, [])
        ctx.fail(
            26,
            "this mesh has no contour: it holds {shapes}",
            at="g",
            shapes=" ".join(g.shapes) or "no element",
            hint="a closed surface has none, and ENVE gives the boundary of a volume; 'NOID' accepts an empty result",
        )
    return new_mesh(ctx, [("SEG2", found[chains.walk(found)])])


def _has_middle(g: Maillage, ends: IntArray) -> NDArray[np.bool_]:
    """Tell which edges, (k, 2), are those of elements of second degree."""
    known = topology.middles([b for b in g.kernel_blocks if DIMENSION[b[0]] == 2])[:, :2]
    group, _ = topology.group_by_nodes(np.vstack([ends, known]))
    return np.isin(group[: len(ends)], group[len(ends) :])


COTE = operator(
    "COTE",
    topic="mesh",
    summary="sides of a surface",
    notice="`L = COTE I S`: side 1 is the line that a surface was made from, 2 the right one, 3 the final one, 4 "
    "the left one, each directed along the contour. Without I, all of them: `L1 L2 L3 L4 = COTE S`. "
    "DALLER, TRAN, ROTA and REGLER record the sides.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 3 (0. 0.) (1. 0.)) TRAN 2 (0. 1.) ; MESS (NBEL (COTE 2 S)) ;",
    see=["CONTOUR", "FACE"],
)


@COTE.form(Arg("g", MAILLAGE, "surface"), Arg("i", ENTIER, "which side", optional=True), gives=["MAILLAGE..."])
def _cote(ctx: Context, g: Maillage, i: int | None) -> Any:
    return reference(ctx, g, i, "side")
