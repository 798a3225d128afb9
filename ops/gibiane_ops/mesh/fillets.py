"""CONGE: round the corner between two straight lines."""

from __future__ import annotations

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, FLOTTANT, MAILLAGE
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.mesh import arcs
from gibiane_ops.mesh.building import dimension, line_between, line_nodes, nodes_of, places_along
from gibiane_ops.mesh.degree import finished, linear_mesh, wants_quadratic
from gibiane_ops.mesh.paths import line_along
from gibiane_ops.values.maillage import Maillage, Point

CONG = operator(
    "CONGE",
    topic="mesh",
    summary="round the corner between two lines",
    notice="`G1 G3 G2 = L1 CONG (N) r L2`: the first straight line ends where the second begins; G3 is the arc of "
    "radius r that touches both, in N elements (or as the densities say), G1 and G2 what is left of the lines.",
    example="OPTI DIME 2 ELEM SEG2 ; P = 2. 0. ; "
    "G1 G3 G2 = (DROIT 4 (0. 0.) P) CONG 5 0.5 (DROIT 4 P (2. 2.)) ; "
    "MESS ((MESU G3) > 0.78) ' ' (MESU G1) ;",
    see=["CERCLE", "DROIT"],
)
# What is left of a segment that the arc shortens to less than this part joins its neighbour.
SHORT = 0.3


@CONG.form(
    Arg("l1", MAILLAGE, "first line"),
    Arg("n", ENTIER, "elements of the arc", optional=True),
    Arg("r", FLOTTANT, "radius"),
    Arg("l2", MAILLAGE, "second line"),
    Key("DOUBLE", "between lines that do not meet"),
    gives=["MAILLAGE", "MAILLAGE", "MAILLAGE"],
)
def _conge(
    ctx: Context, l1: Maillage, n: int | None, r: float, l2: Maillage, double: bool
) -> tuple[Maillage, Maillage, Maillage]:
    dimension(ctx)
    if double:
        ctx.fail(251, "CONG 'DOUBLE' is not available", at="double", hint="two arcs of CERC make it")
    if not r > 0:
        ctx.fail(41, "a radius is a length: {value} cannot be one", at="r", value=r)
    quadratic = wants_quadratic(ctx, l1, l2)
    first = line_nodes(ctx, linear_mesh(ctx, l1), "l1")
    second = line_nodes(ctx, linear_mesh(ctx, l2), "l2")
    store = nodes_of(ctx)
    if first[-1] != second[0]:
        ctx.fail(
            21,
            "the second line does not begin where the first one ends",
            at="l2",
            hint="they must share that point: the same POINT, or ELIM; INVE turns a line over",
        )
    corner = store.coords[first[-1]].copy()
    u, v = (_direction(ctx, nodes, at) for nodes, at in ((first[::-1], "l1"), (second, "l2")))
    cosine = float(np.clip(u @ v, -1, 1))
    half = np.arccos(cosine) / 2
    if min(half, np.pi / 2 - half) < 1e-6:
        ctx.fail(21, "the two lines are on one line: there is no corner to round", at="l2")
    cut = r / np.tan(half)
    starts = []
    for nodes, way, at in ((first[::-1], u, "l1"), (second, v, "l2")):
        length = float(np.linalg.norm(store.coords[nodes[-1]] - corner))
        if not cut < length * (1 + 1e-9):
            ctx.fail(
                21,
                "the radius is too large: the arc would touch the line at {cut} from the corner, it is {length} long",
                at=at,
                cut=f"{cut:.6g}",
                length=f"{length:.6g}",
            )
        starts.append(_shortened(ctx, nodes, corner + cut * way, cut))
    a, b = int(starts[0][0]), int(starts[1][0])
    bisector = (u + v) / np.linalg.norm(u + v)
    arc = arcs.about(store.coords[a], corner + bisector * (r / np.sin(half)), store.coords[b])
    assert arc is not None  # less than half a turn, because the corner is not flat
    sizes = float(store.density[a]), float(store.density[b])
    points = Point(store, a), Point(store, b)
    round_ = line_along(ctx, *points, a, b, arc, places_along(ctx, arc.length, *sizes, n), sizes)
    kept = [line_between(ctx, nodes) for nodes in (starts[0][::-1], starts[1])]
    return finished(ctx, kept[0], quadratic), round_, finished(ctx, kept[1], quadratic)


def _direction(ctx: Context, nodes: IntArray, at: str) -> FloatArray:
    """Return the unit vector along a straight line from its first node."""
    x = nodes_of(ctx).coords[nodes] - nodes_of(ctx).coords[nodes[0]]
    length = np.linalg.norm(x[-1])
    if length == 0 or np.linalg.norm(np.cross(x, x[-1] / length), axis=1).max() > 1e-6 * length:
        ctx.fail(21, "this line is not straight", at=at, hint="CONG rounds the corner between straight lines")
    return np.asarray(x[-1] / length, np.float64)


def _shortened(ctx: Context, nodes: IntArray, place: FloatArray, cut: float) -> IntArray:
    """Return the nodes of a line that now begins at a place, a distance away from its first node."""
    store = nodes_of(ctx)
    away = np.linalg.norm(store.coords[nodes] - store.coords[nodes[0]], axis=1)
    step = np.diff(away).mean()
    kept = nodes[away > cut + SHORT * step]
    if not len(kept) or (kept[-1] != nodes[-1]):
        kept = nodes[-1:]
    if away[-1] - cut < 1e-9 * away[-1]:
        return nodes[-1:]
    near = np.flatnonzero(np.abs(away - cut) < 1e-9 * away[-1])
    start = nodes[near[0]] if len(near) else store.add(place[None], float(store.density[nodes[0]]))[0]
    return np.concatenate([[start], kept])
