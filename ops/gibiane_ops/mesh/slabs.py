"""DALLER: surface between four lines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import MAILLAGE, POINT
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.mesh import chains, project, transfinite
from gibiane_ops.mesh.building import dimension, explained, join, line_between, line_nodes, nodes_of, surface_shape
from gibiane_ops.mesh.degree import every_node, finished, linear_mesh, wants_quadratic
from gibiane_ops.mesh.patches import patch
from gibiane_ops.values.maillage import Maillage

SURFACES = ("PLAN", "QUEL", "SPHE", "CYLI", "CONI", "TORI")
DALL = operator(
    "DALLER",
    topic="mesh",
    summary="surface between four lines",
    notice="`S = DALL L1 L2 L3 L4 'PLAN'` fills the contour made of four lines that follow one another; opposite "
    "lines have the same number of elements; in a plane they may differ if the sum of the four is even. 'SPHE' C, "
    "'CYLI' P1 P2, 'CONI' S P, 'TORI' C P C2 put the nodes on a sphere, a cylinder, a cone or a torus, "
    "'QUEL' leaves them where the lines "
    "say. Elements turn as the contour does; the four lines are the recorded sides.",
    example="OPTI DIME 2 ELEM QUA4 ; P1 = 0. 0. ; P2 = 1. 0. ; P3 = 1. 1. ; P4 = 0. 1. ; "
    "S = DALL (DROIT 3 P1 P2) (DROIT 2 P2 P3) (DROIT 3 P3 P4) (DROIT 2 P4 P1) 'PLAN' ; MESS (NBEL S) ;",
    see=["REGLER", "SURFACE", "COTE"],
)


@DALL.form(
    Arg("l1", MAILLAGE, "first side"),
    Arg("l2", MAILLAGE, "second side"),
    Arg("l3", MAILLAGE, "third side"),
    Arg("l4", MAILLAGE, "fourth side"),
    Key(SURFACES, "surface that holds the nodes", Arg("points", POINT, many=True, optional=True), name="on"),
    gives=[MAILLAGE],
)
def _daller(ctx: Context, l1: Maillage, l2: Maillage, l3: Maillage, l4: Maillage, on: Any) -> Maillage:
    dimension(ctx)
    store = nodes_of(ctx)
    quadratic = wants_quadratic(ctx, l1, l2, l3, l4)
    l1, l2, l3, l4 = (linear_mesh(ctx, line) for line in (l1, l2, l3, l4))
    lines = [line_nodes(ctx, line, name) for line, name in ((l1, "l1"), (l2, "l2"), (l3, "l3"), (l4, "l4"))]
    bottom, right, top, left = _contour(ctx, lines)
    if len(bottom) != len(top) or len(right) != len(left):
        return finished(ctx, _transition(ctx, [bottom, right, top, left], on), quadratic)
    density = store.density
    sizes = float(density[bottom].mean()), float(density[top].mean())
    if quadratic:
        bottom, right, top, left = (every_node(ctx, side) for side in (bottom, right, top, left))
    top, left = top[::-1], left[::-1]
    x = store.coords
    grid = transfinite.patch(x[bottom], x[right], x[top], x[left])
    if on is not None and on[0] not in ("PLAN", "QUEL"):
        grid[1:-1, 1:-1] = _put_on(ctx, on[0], [p.coords for p in on[1]], grid[1:-1, 1:-1], x[bottom[0]])
    ids = np.full(grid.shape[:2], -1, np.int64)
    ids[0], ids[-1], ids[:, 0], ids[:, -1] = bottom, top, left, right
    return finished(ctx, patch(ctx, grid, ids, sizes, np.linspace(0.0, 1.0, len(left)), quadratic), quadratic)


def _transition(ctx: Context, sides: list[IntArray], on: Any) -> Maillage:
    """Fill a plane contour whose opposite sides have different numbers of elements."""
    from gibiane_ops.mesh.filling import fill_contour

    counts = [len(side) - 1 for side in sides]
    if sum(counts) % 2 and surface_shape(ctx) == "QUA4":
        ctx.fail(
            33,
            "the sides have {counts} elements: opposite ones differ, and their sum is odd",
            counts=" ".join(map(str, counts)),
            hint="give opposite sides as many elements, or change one side by one",
        )
    if on is not None and on[0] not in ("PLAN", "QUEL"):
        ctx.fail(
            33,
            "the sides have {counts} elements: opposite ones must have as many on a curved surface",
            counts=" ".join(map(str, counts)),
        )
    segments = np.concatenate([chains.segments_of(side) for side in sides])
    surface = fill_contour(ctx, segments, None, surface_shape(ctx) == "QUA4", "l1")
    lines = {str(number): line_between(ctx, side) for number, side in enumerate(sides, 1)}
    return join([surface], lines)


def _contour(ctx: Context, lines: Sequence[IntArray]) -> list[IntArray]:
    """Turn the sides so that each begins where the one before it ends."""
    found = list(lines)
    if found[0][-1] not in (found[1][0], found[1][-1]):
        found[0] = found[0][::-1]
    for i in range(1, 4):
        if found[i][0] != found[i - 1][-1]:
            found[i] = found[i][::-1]
        if found[i][0] != found[i - 1][-1]:
            ctx.fail(
                28,
                "the sides do not follow one another: side {number} does not begin where side {before} ends",
                at=f"l{i + 1}",
                number=i + 1,
                before=i,
                label="not joined to the side before it",
                hint="they must share their end points: the same POINT, or ELIM for points at one place",
            )
    if found[3][-1] != found[0][0]:
        ctx.fail(
            28,
            "the contour is not closed: side 4 does not end where side 1 begins",
            at="l4",
            hint="they must share their end points: the same POINT, or ELIM for points at one place",
        )
    return found


POINTS_WANTED = {"SPHE": 1, "CYLI": 2, "CONI": 2, "TORI": 3}


def _put_on(ctx: Context, kind: str, points: list[FloatArray], grid: FloatArray, corner: FloatArray) -> FloatArray:
    if len(points) != POINTS_WANTED[kind]:
        ctx.fail(37, "'{kind}' wants {count} POINT", at="on", kind=kind, count=POINTS_WANTED[kind])
    flat = grid.reshape(-1, 3)
    with explained(ctx, "on"):
        put: dict[str, Callable[..., FloatArray]] = {
            "SPHE": project.to_sphere,
            "CYLI": project.to_cylinder,
            "CONI": project.to_cone,
            "TORI": project.to_torus,
        }
        return put[kind](flat, *points, corner).reshape(grid.shape)
