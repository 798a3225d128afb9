"""SURFACE: the inside of closed lines, in a plane or on a sphere, a cylinder, a cone or a torus."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import FLOTTANT, MAILLAGE, POINT
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.mesh import charts
from gibiane_ops.mesh.building import dimension, explained, new_mesh, nodes_of, surface_shape
from gibiane_ops.mesh.degree import finished, wants_quadratic
from gibiane_ops.mesh.filling import SIZE, added, contour_of, fill_contour, numbered
from gibiane_ops.mesh.wanted import Size, sizes_at
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.middles import middles_of

SURF = operator(
    "SURFACE",
    topic="mesh",
    summary="mesh of the inside of a closed line",
    notice="`S = SURF L 'PLAN'` fills plane closed lines, the largest outside and the others as holes, with "
    "triangles or quadrangles (OPTI ELEM). 'SPHE' C, 'CYLI' P1 P2, 'CONI' S P (apex, point of the axis), 'TORI' C P C2 "
    "(centre, point of the axis, centre of a small circle) fill lines on a sphere, a cylinder, a cone or a torus; two "
    "lines that go round the axis bound the part between them. The segments of the lines are kept as they are; inside, "
    "the elements follow their lengths, or the CHPOINT or FLOTTANT given before the word. Elements turn as the outer "
    "line does. A FLOTTANT after 'PLAN' (tolerance of flatness) is accepted. `S = SURF 'POLYNOME' N1 N2 P1 P2 ... "
    "('PARAMETRE' U1 U2 V1 V2) ('REGULIER')`: the surface sum P U**i V**j, the N1 points of V**0 first, then those of "
    "V**1 ... for U and V from 0 to 1 or between the bounds; the density says how many elements; their nodes are "
    "equally spaced in U and V, or with 'REGULIER' along the four sides.",
    example="OPTI DIME 2 ELEM TRI3 ; C = CERC 24 'ROTA' 360. (1. 0.) (0. 0.) 'ELIM' ; "
    "S = SURF C 'PLAN' ; MESS ((MESU S) > 3.) ;",
    see=["DALLER", "MAILLER", "CONTOUR"],
)
WANTED = {"PLAN": 0, "SPHE": 1, "CYLI": 2, "CONI": 2, "TORI": 3}


@SURF.form(
    Arg("g", MAILLAGE, "closed lines"),
    SIZE,
    Key(
        tuple(WANTED),
        "surface that holds the nodes",
        Arg("points", POINT, many=True, optional=True),
        Arg("flat", FLOTTANT, "accepted", optional=True),
        name="on",
    ),
    gives=[MAILLAGE],
)
def _surface(ctx: Context, g: Maillage, size: Size, on: Any) -> Maillage:
    segments = contour_of(ctx, g, "g")
    quadrangles, quadratic = surface_shape(ctx) == "QUA4", wants_quadratic(ctx, g)
    kind, points = ("PLAN", []) if on is None else (on[0], on[1])
    if len(points) != WANTED[kind]:
        ctx.fail(37, "'{kind}' wants {count} POINT", at="on", kind=kind, count=WANTED[kind])
    if kind == "PLAN":
        return finished(ctx, fill_contour(ctx, segments, size, quadrangles, "g"), quadratic)
    if dimension(ctx) != 3:
        ctx.fail(34, "curved surfaces exist in three dimensions only", at="on", hint="OPTI DIME 3 ELEM TRI3 ;")
    chart, filled = _on_chart(ctx, segments, size, quadrangles, kind, points)
    if quadratic:
        _bend(ctx, filled, chart)
    return finished(ctx, filled, quadratic)


def _on_chart(
    ctx: Context, segments: IntArray, size: Size, quadrangles: bool, kind: str, given: list[Point]
) -> tuple[charts.Chart, Maillage]:
    """Mesh the inside of closed lines in the plane of a map that keeps angles, and bring it onto the surface."""
    from gibiane_ops.kernels.remesh import contours_of, mesh_surface

    nodes, (local,) = numbered(ctx, [segments])
    x = nodes_of(ctx).coords[nodes]
    sizes = sizes_at(ctx, size, nodes)
    places = [p.coords for p in given]
    make = {"SPHE": charts.Sphere, "CYLI": charts.Cylinder, "CONI": charts.Cone, "TORI": charts.Torus}[kind]
    with explained(ctx, "g", failed=28):
        chart = make(*places, x)
        loops = contours_of(local)
        plane = np.zeros((len(x), 2))
        for loop, flat in zip(loops, chart.flat([x[loop] for loop in loops]), strict=True):
            plane[loop] = flat
        wanted = _spacing(x, local) if sizes is None else sizes
        filled = mesh_surface(plane, local, wanted, quadrangles=quadrangles, scale=chart.scale)
    new = chart.space(filled.points[len(nodes) :])
    ids = added(ctx, nodes, np.vstack([x, new]))
    parts = [("QUA4" if quadrangles else "TRI3", ids[filled.cells]), ("TRI3", ids[filled.rest])]
    return chart, new_mesh(ctx, parts)


def _spacing(x: FloatArray, segments: IntArray) -> FloatArray:
    """Return the mean length of the segments at each node, (k,), length."""
    length = np.linalg.norm(x[segments[:, 1]] - x[segments[:, 0]], axis=1)
    total = np.bincount(segments.ravel(), np.repeat(length, 2), minlength=len(x))
    return np.asarray(total / np.bincount(segments.ravel(), minlength=len(x)), np.float64)


def _bend(ctx: Context, surface: Maillage, chart: charts.Chart) -> None:
    """Give the edges that have none mid-nodes on the surface."""
    from gibiane_ops.kernels import topology

    middles, x = middles_of(ctx), nodes_of(ctx).coords
    ends = topology.edges(surface.kernel_blocks)
    ends = ends[~middles.known(ends)]
    middles.add(ends, chart.nearest(x[ends].mean(axis=1)))
