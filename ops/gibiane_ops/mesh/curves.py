"""Curved lines beside arcs of circle: CER3 through three points, PARA, CUBP and CUBT, COURBE."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import FLOTTANT, MAILLAGE, POINT
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.mesh import arcs, curves
from gibiane_ops.mesh.building import dimension, explained, nodes_of, places_along
from gibiane_ops.mesh.paths import COUNT, DFIN, DINI, ENDS, End, end_sizes, first_node, last_node, line_along
from gibiane_ops.values.maillage import Maillage, Point

Path = Callable[[FloatArray], FloatArray]
_COMMON = " N, densities and lines in place of end points as in DROIT."
CER3 = operator(
    "CER3",
    topic="mesh",
    summary="arc of a circle through three points",
    notice="`L = CER3 N P1 P2 P3`: from P1 to P3 through P2, as CERC 'PASS'." + _COMMON,
    example="OPTI DIME 2 ELEM SEG2 ; L = CER3 8 (1. 0.) (0. 1.) (-1. 0.) ; MESS (NBEL L) ;",
    see=["CERCLE", "PARABOLE"],
)


@CER3.form(
    COUNT,
    Arg("a", ENDS, "first point"),
    Arg("c", POINT, "point of the arc"),
    Arg("b", ENDS, "last point", optional=True),
    DINI,
    DFIN,
    gives=[MAILLAGE],
)
def _cer3(
    ctx: Context, n: int | None, a: End, c: Point, b: End | None, dini: float | None, dfin: float | None
) -> Maillage:
    def arc(start: FloatArray, end: FloatArray) -> tuple[Path, float]:
        found = arcs.through(start, c.coords, end)
        if found is None:
            hint = "DROIT makes a straight line"
            ctx.fail(21, "the three points are on one line: no circle passes through them", hint=hint)
        return found, found.length

    return _drawn(ctx, a, b, (n, dini, dfin), arc)


def _drawn(
    ctx: Context,
    a: End,
    b: End | None,
    spacing: tuple[int | None, float | None, float | None],
    curve: Callable[[FloatArray, FloatArray], tuple[Path, float]],
) -> Maillage:
    """Mesh a curve given by its ends: its path and length. Without the second end the line a is closed on its start."""
    dimension(ctx)
    if b is None and isinstance(a, Point):
        ctx.fail(37, "no POINT for its other end", at="a", label="one end only")
    start, end = last_node(ctx, a, "a"), first_node(ctx, a if b is None else b, "b")
    x = nodes_of(ctx).coords
    n, dini, dfin = spacing
    sizes = end_sizes(ctx, start, end, dini, dfin)
    path, length = curve(x[start], x[end])
    return line_along(ctx, a, b, start, end, path, places_along(ctx, length, *sizes, n), sizes)


PARA = operator(
    "PARABOLE",
    topic="mesh",
    summary="arc of a parabola",
    notice="`L = PARA N P1 P3 P2`: from P1 to P2, its tangents at the ends meet at P3; elements of equal length."
    + _COMMON,
    example="OPTI DIME 2 ELEM SEG2 ; L = PARA 8 (0. 0.) (1. 1.) (2. 0.) ; MESS (NBEL L) ;",
    see=["CUBT", "CERCLE"],
)


@PARA.form(
    COUNT,
    Arg("a", ENDS, "first point"),
    Arg("tip", POINT, "where the tangents meet"),
    Arg("b", ENDS, "last point", optional=True),
    DINI,
    DFIN,
    gives=[MAILLAGE],
)
def _parabole(
    ctx: Context, n: int | None, a: End, tip: Point, b: End | None, dini: float | None, dfin: float | None
) -> Maillage:
    def parabola(start: FloatArray, end: FloatArray) -> tuple[Path, float]:
        with explained(ctx, "tip"):
            found = curves.parabola(start, tip.coords, end)
        return found.by_length, found.length

    return _drawn(ctx, a, b, (n, dini, dfin), parabola)


CUBP = operator(
    "CUBP",
    topic="mesh",
    summary="cubic through four points",
    notice="`L = CUBP N P1 P2 P3 P4 ('UNIF')`: from P1 to P4. The places of the nodes follow the parameter, which goes "
    "as the chords between the four points; with 'UNIF' they follow the length. N and densities as in DROIT.",
    example="OPTI DIME 2 ELEM SEG2 ; L = CUBP 6 (0. 0.) (1. 1.) (2. 1.) (3. 0.) 'UNIF' ; MESS (NBEL L) ;",
    see=["CUBT", "COURBE"],
)


@CUBP.form(
    COUNT,
    *(Arg(name, POINT, "point of the curve") for name in ("p1", "p2", "p3", "p4")),
    Key("UNIF", "places by length"),
    DINI,
    DFIN,
    gives=[MAILLAGE],
)
def _cubp(
    ctx: Context,
    n: int | None,
    p1: Point,
    p2: Point,
    p3: Point,
    p4: Point,
    unif: bool,
    dini: float | None,
    dfin: float | None,
) -> Maillage:
    def cubic(start: FloatArray, end: FloatArray) -> tuple[Path, float]:
        with explained(ctx, "p2"):
            found = curves.cubic_through(np.array([start, p2.coords, p3.coords, end]))
        return found.by_length if unif else found.by_parameter, found.length

    return _drawn(ctx, p1, p4, (n, dini, dfin), cubic)


CUBT = operator(
    "CUBT",
    topic="mesh",
    summary="cubic between two points with given tangents",
    notice="`L = CUBT N P1 V1 V2 P2`: from P1 to P2, with the derivatives V1 and V2 at the ends (longer vectors keep "
    "the curve longer along them); elements of equal length. N and densities as in DROIT.",
    example="OPTI DIME 2 ELEM SEG2 ; L = CUBT 6 (0. 0.) (1. 1.) (1. -1.) (2. 0.) ; MESS (NBEL L) ;",
    see=["CUBP", "PARABOLE"],
)


@CUBT.form(
    COUNT,
    Arg("p1", POINT, "first point"),
    Arg("v1", POINT, "tangent there"),
    Arg("v2", POINT, "tangent at the last point"),
    Arg("p2", POINT, "last point"),
    DINI,
    DFIN,
    gives=[MAILLAGE],
)
def _cubt(
    ctx: Context, n: int | None, p1: Point, v1: Point, v2: Point, p2: Point, dini: float | None, dfin: float | None
) -> Maillage:
    def cubic(start: FloatArray, end: FloatArray) -> tuple[Path, float]:
        with explained(ctx, "p2"):
            found = curves.hermite(start, v1.coords, v2.coords, end)
        return found.by_length, found.length

    return _drawn(ctx, p1, p2, (n, dini, dfin), cubic)


COUR = operator(
    "COURBE",
    topic="mesh",
    summary="polynomial curve",
    notice="`L = COUR N P0 P1 P2 ... ('PARA' u1 u2) ('REGU')`: P0 + u P1 + u^2 P2 + ... for u from u1 to u2 (0 to 1). "
    "The places of the nodes follow u, with 'REGU' the length. 'PINI' and 'PFIN' give the points, or lines, that the "
    "ends are to be; they must be at those places.",
    example="OPTI DIME 2 ELEM SEG2 ; L = COUR 8 (0. 0.) (1. 0.) (0. 1.) 'REGU' ; MESS (NBEL L) ;",
    see=["CUBP", "CUBT"],
)


@COUR.form(
    COUNT,
    DINI,
    DFIN,
    Key("PINI", "first end", Arg("first", ENDS)),
    Key("PFIN", "last end", Arg("last", ENDS)),
    Arg("points", POINT, "coefficients of 1, u, u^2 ...", many=True),
    Key("PARAMETRE", "bounds of u", Arg("u1", FLOTTANT), Arg("u2", FLOTTANT)),
    Key("REGULIER", "places by length"),
    gives=[MAILLAGE],
)
def _courbe(
    ctx: Context,
    n: int | None,
    dini: float | None,
    dfin: float | None,
    pini: End | None,
    pfin: End | None,
    points: list[Point],
    parametre: Any,
    regulier: bool,
) -> Maillage:
    dimension(ctx)
    if len(points) < 2:
        ctx.fail(37, "at least two POINT are wanted: the coefficients of 1 and of u", at="points")
    u1, u2 = parametre if parametre is not None else (0.0, 1.0)
    with explained(ctx, "points"):
        curve = curves.Curve(np.array([p.coords for p in points]), u1, u2)
    where = curve.by_parameter(np.array([0.0, 1.0]))
    sizes = [float(ctx.option("DENS")) if d is None else d for d in (dini, dfin)]
    nodes = []
    for k, (end, at, find) in enumerate(((pini, "pini", last_node), (pfin, "pfin", first_node))):
        if end is None:
            nodes.append(int(nodes_of(ctx).add(where[k : k + 1], sizes[k])[0]))
            continue
        node = find(ctx, end, at)
        gap = float(np.linalg.norm(nodes_of(ctx).coords[node] - where[k]))
        if gap > 1e-5 * curve.length:
            ctx.fail(21, "this end is at {gap} from the end of the curve", at=at, gap=f"{gap:.4g}")
        nodes.append(node)
        if (dini, dfin)[k] is None:
            sizes[k] = float(nodes_of(ctx).density[node])
    path = curve.by_length if regulier else curve.by_parameter
    places = places_along(ctx, curve.length, sizes[0], sizes[1], n)
    before, after = (end if isinstance(end, Maillage) else None for end in (pini, pfin))
    start = before or Point(nodes_of(ctx), nodes[0])
    return line_along(ctx, start, after, nodes[0], nodes[1], path, places, (sizes[0], sizes[1]))
