"""Surfaces swept from lines or spanned between them: TRAN, ROTA, REGLER, GENE."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, FLOTTANT, MAILLAGE, POINT
from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.mesh import arcs, chains, sweep, transforms
from gibiane_ops.mesh.building import (
    DIMENSION,
    axis_end,
    dimension,
    explained,
    join,
    line_between,
    line_nodes,
    line_segments,
    new_mesh,
    nodes_of,
    places_along,
    reversed_mesh,
)
from gibiane_ops.mesh.degree import every_node, finished, linear_mesh, wants_quadratic
from gibiane_ops.mesh.patches import elements, halved, patch
from gibiane_ops.mesh.sweeping import Base, add_layers, base_of
from gibiane_ops.values.maillage import Maillage, Point

COUNT = Arg("n", ENTIER, "number of layers", optional=True)
DINI = Key("DINI", "size of the first layer", Arg("d", FLOTTANT))
DFIN = Key("DFIN", "size of the last layer", Arg("d", FLOTTANT))
LINE = Arg("line", MAILLAGE, "line, or surface to prolong from its side 3")


def _start(ctx: Context, mesh: Maillage, at: str = "line", side: str = "3") -> tuple[Maillage, Maillage | None]:
    """Return the line to sweep, and the surface that it prolongs if one was given."""
    if not any(DIMENSION[name] == 2 for name in mesh.shapes):
        line_segments(ctx, mesh, at)
        return mesh, None
    if side not in mesh.sides:
        ctx.fail(
            24,
            "this surface has no recorded side {number}",
            at=at,
            number=side,
            hint="give the line itself: CONT and ELEM 'COMP' extract it",
        )
    edge = mesh.sides[side]
    return (reversed_mesh(edge) if side == "3" else edge), mesh


def _end_sizes(
    ctx: Context, nodes: IntArray, dini: float | None, dfin: float | None, far: float | None = None
) -> tuple[float, float]:
    """Return the sizes of the first and the last layer: given, or the densities at both ends of the sweep."""
    near = float(nodes_of(ctx).density[nodes].mean())
    return (near if dini is None else dini), ((near if far is None else far) if dfin is None else dfin)


def _sweep(ctx: Context, base: Base, layers: IntArray, extended: Maillage | None) -> Maillage:
    """Make the surface between the images of a line, its sides recorded; put a surface that it prolongs before it."""
    line = base.mesh
    segments = line.blocks[0].cells
    _, cells = sweep.sweep_cells("SEG2", np.searchsorted(base.corners, segments), layers)
    blocks = elements(ctx, cells, base.quadratic)
    walked = segments if chains.is_chain(segments) else segments[chains.walk(segments)]
    if not chains.is_chain(walked):
        return finished(ctx, new_mesh(ctx, blocks), base.quadratic)
    grid = layers[:, np.searchsorted(base.corners, chains.chain_nodes(walked))]
    sides = {
        "1": line,
        "2": line_between(ctx, grid[:, -1]),
        "3": line_between(ctx, grid[-1, ::-1]),
        "4": line_between(ctx, grid[::-1, 0]),
    }
    parts = [new_mesh(ctx, blocks, sides)]
    if extended is not None:
        parts.insert(0, linear_mesh(ctx, extended))
    return finished(ctx, _assembled(parts), base.quadratic)


def _assembled(parts: Sequence[Maillage]) -> Maillage:
    """Put surfaces that prolong one another together, with the sides of the whole."""
    if len(parts) == 1:
        return parts[0]
    return join(
        parts,
        {
            "1": parts[0].sides["1"],
            "2": join([part.sides["2"] for part in parts]),
            "3": parts[-1].sides["3"],
            "4": join([part.sides["4"] for part in reversed(parts)]),
        },
    )


TRAN = operator(
    "TRANSLATION",
    topic="mesh",
    summary="surface swept by a line that is translated",
    notice="`S = L TRAN N V` sweeps a line along the vector V in N layers; without N, or with N negative, the "
    "densities of the line (or 'DINI' and 'DFIN') give the layers, as in DROIT. The elements have the "
    "type of OPTI ELEM (QUA4 or TRI3; QUA8 or TRI6 with mid-nodes on the curves swept, also when the "
    "line has them). Sides 1 to 4 are recorded: see COTE. A surface in place of the "
    "line is prolonged from its side 3.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 3 (0. 0.) (1. 0.)) TRAN 2 (0. 1.) ; MESS (NBEL S) ;",
    see=["ROTA", "REGLER", "DALLER", "COTE"],
)


@TRAN.form(LINE, COUNT, DINI, DFIN, Arg("v", POINT, "vector"), gives=[MAILLAGE])
def _translation(
    ctx: Context, line: Maillage, n: int | None, dini: float | None, dfin: float | None, v: Point
) -> Maillage:
    dimension(ctx)
    start, extended = _start(ctx, line)
    base, vector = base_of(ctx, start), v.coords
    sizes = _end_sizes(ctx, base.corners, dini, dfin, float(v.store.density[v.node]) or None)
    places = places_along(ctx, float(np.linalg.norm(vector)), *sizes, n)
    x = base.places
    return _sweep(ctx, base, add_layers(ctx, base, lambda t: x + t * vector, places, sizes), extended)


ROTA = operator(
    "ROTATION",
    topic="mesh",
    summary="surface swept by a line that turns",
    notice="`S = L ROTA N angle P1 (P2)` turns a line by an angle in degrees about P1 (in the plane) or the axis "
    "P1-P2. Layers, elements and sides as in TRAN; the length that counts is that of the mean path. "
    "Nodes on the axis are repeated: ELIM then REGE clean the result.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 3 (1. 0.) (2. 0.)) ROTA 4 90. (0. 0.) ; MESS (NBEL S) ;",
    see=["TRANSLATION", "TOUR", "ELIMINATION", "REGENERER"],
)


@ROTA.form(
    LINE,
    COUNT,
    Arg("angle", FLOTTANT, "degrees"),
    DINI,
    DFIN,
    Arg("a", POINT, "centre"),
    Arg("b", POINT, "second point of the axis", optional=True),
    gives=[MAILLAGE],
)
def _rotation(
    ctx: Context,
    line: Maillage,
    n: int | None,
    angle: float,
    dini: float | None,
    dfin: float | None,
    a: Point,
    b: Point | None,
) -> Maillage:
    dimension(ctx)
    start, extended = _start(ctx, line)
    base, axis = base_of(ctx, start), axis_end(ctx, a, b)
    x = base.places
    sizes = _end_sizes(ctx, base.corners, dini, dfin)
    with explained(ctx, "a"):
        radius = float(arcs.distance_to_axis(x[: len(base.corners)], a.coords, axis).mean())
        places = places_along(ctx, abs(float(np.radians(angle))) * radius, *sizes, n)
        layers = add_layers(ctx, base, lambda t: transforms.rotation(angle * t, a.coords, axis)(x), places, sizes)
    return _sweep(ctx, base, layers, extended)


REGL = operator(
    "REGLER",
    topic="mesh",
    summary="ruled surface between two lines",
    notice="`S = L1 REGL N L2` joins two lines of the same number of elements, read in the same direction, by "
    "N layers on straight lines; N and densities as in TRAN. Sides 1 to 4 are recorded. A surface in "
    "place of L1 is prolonged from its side 3, one in place of L2 from its side 1.",
    example="OPTI DIME 2 ELEM QUA4 ; L1 = DROIT 3 (0. 0.) (1. 0.) ; L2 = DROIT 3 (0. 1.) (2. 2.) ; "
    "S = L1 REGL 2 L2 ; MESS (NBEL S) ;",
    see=["TRANSLATION", "DALLER"],
)


@REGL.form(LINE, COUNT, DINI, DFIN, Arg("last", MAILLAGE, "second line"), gives=[MAILLAGE])
def _regler(
    ctx: Context, line: Maillage, n: int | None, dini: float | None, dfin: float | None, last: Maillage
) -> Maillage:
    dimension(ctx)
    store = nodes_of(ctx)
    first, before = _start(ctx, line)
    second, after = _start(ctx, last, "last", "1")
    quadratic = wants_quadratic(ctx, first, second)
    first, second = linear_mesh(ctx, first), linear_mesh(ctx, second)
    a, b = line_nodes(ctx, first, "line"), line_nodes(ctx, second, "last")
    if len(a) != len(b):
        ctx.fail(
            33,
            "the two lines have {first} and {second} elements: as many are wanted",
            at="last",
            first=len(a) - 1,
            second=len(b) - 1,
            label="{second} elements",
        )
    gap = np.linalg.norm(store.coords[b] - store.coords[a], axis=1)
    sizes = _end_sizes(ctx, a, dini, dfin, float(store.density[b].mean()))
    places = places_along(ctx, float(gap.mean()), *sizes, n)
    if quadratic:
        a, b, places = every_node(ctx, a), every_node(ctx, b), halved(places)
    grid = sweep.ruled_layers(store.coords[a], store.coords[b], places)
    fixed = np.concatenate([a[None], np.full((len(places) - 2, len(a)), -1, np.int64), b[None]])
    if a[0] == a[-1] and b[0] == b[-1]:
        fixed[1:-1, -1] = -2
    fixed[:, a == b] = a[a == b]
    surface = patch(ctx, grid, fixed, sizes, places, quadratic)
    neighbours = [None if part is None else linear_mesh(ctx, part) for part in (before, after)]
    parts = [part for part in (neighbours[0], surface, neighbours[1]) if part is not None]
    return finished(ctx, _assembled(parts), quadratic)


GENE = operator(
    "GENERATRICE",
    topic="mesh",
    summary="surface swept by a line that moves along another",
    notice="`S = L1 GENE L2`: L1 is carried along L2 without turning, one layer per element of L2. Sides and elements "
    "as in TRAN; a surface in place of L1 is prolonged from its side 3.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 3 (0. 0.) (1. 0.)) GENE (CERC 4 (0. 0.) (1. 0.) (1. 1.)) ; "
    "MESS (NBEL S) ;",
    see=["TRANSLATION", "VOLUME"],
)


@GENE.form(LINE, Arg("along", MAILLAGE, "line to follow"), gives=[MAILLAGE])
def _generatrice(ctx: Context, line: Maillage, along: Maillage) -> Maillage:
    dimension(ctx)
    store = nodes_of(ctx)
    start, extended = _start(ctx, line)
    base = base_of(ctx, start)
    way = line_nodes(ctx, linear_mesh(ctx, along), "along")
    density = float(store.density[way].mean())
    rank = np.arange(len(way), dtype=np.float64)
    # Corners of the line are at whole ranks, its mid-nodes (those of a curve, if it has them) at halves.
    steps = every_node(ctx, way) if base.quadratic else np.repeat(way, 2)[:-1]
    x, path = base.places, store.coords[steps] - store.coords[way[0]]
    layers = add_layers(ctx, base, lambda t: x + path[round(2 * t)], rank, (density, density))
    return _sweep(ctx, base, layers, extended)
