"""Surfaces swept from lines or spanned between them: TRAN, ROTA, REGLER, DALLER."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, FLOTTANT, MAILLAGE, POINT
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.mesh import arcs, chains, degenerate, project, sweep, transfinite, transforms
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
    surface_shape,
)
from gibiane_ops.mesh.degree import bend_diagonals, every_node, finished, linear_mesh, wants_quadratic
from gibiane_ops.mesh.sweeping import Base, add_layers, base_of
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.middles import middles_of

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


def elements(ctx: Context, cells: IntArray, quadratic: bool) -> list[tuple[str, IntArray]]:
    """Turn quadrangles into elements of the type of OPTI ELEM; those with a corner twice become triangles."""
    quadrangles, triangles = degenerate.split_off_triangles(cells)
    if surface_shape(ctx) == "TRI3":
        cut = sweep.split_quadrangles(nodes_of(ctx).coords, quadrangles)
        if quadratic:
            bend_diagonals(ctx, quadrangles, cut)
        return [("TRI3", np.concatenate([cut, triangles]))]
    return [("QUA4", quadrangles), ("TRI3", triangles)]


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
        a, b, places = every_node(ctx, a), every_node(ctx, b), _halved(places)
    grid = sweep.ruled_layers(store.coords[a], store.coords[b], places)
    fixed = np.concatenate([a[None], np.full((len(places) - 2, len(a)), -1, np.int64), b[None]])
    if a[0] == a[-1] and b[0] == b[-1]:
        fixed[1:-1, -1] = -2
    fixed[:, a == b] = a[a == b]
    surface = _patch(ctx, grid, fixed, sizes, places, quadratic)
    neighbours = [None if part is None else linear_mesh(ctx, part) for part in (before, after)]
    parts = [part for part in (neighbours[0], surface, neighbours[1]) if part is not None]
    return finished(ctx, _assembled(parts), quadratic)


def _halved(places: FloatArray) -> FloatArray:
    """Put the middles between places, (m + 1,) to (2 m + 1,)."""
    result = np.empty(2 * len(places) - 1)
    result[::2], result[1::2] = places, (places[1:] + places[:-1]) / 2
    return result


def _patch(
    ctx: Context, grid: FloatArray, ids: IntArray, sizes: tuple[float, float], places: FloatArray, quadratic: bool
) -> Maillage:
    """Make a surface of first degree of a grid: nodes of id -1 are added, -2 is the first of the row.

    In second degree every other row and column holds mid-nodes.
    """
    new = ids == -1
    if quadratic:
        new[1::2, 1::2] = False
    density = np.broadcast_to((sizes[0] + places * (sizes[1] - sizes[0]))[:, None], ids.shape)
    ids[new] = nodes_of(ctx).add(grid[new], density[new])
    seam = ids[:, -1] == -2
    ids[seam, -1] = ids[seam, 0]
    corners = ids
    if quadratic:
        corners = ids[::2, ::2]
        for first, middle, last in (
            (ids[::2, :-1:2], ids[::2, 1::2], ids[::2, 2::2]),
            (ids[:-1:2, ::2], ids[1::2, ::2], ids[2::2, ::2]),
        ):
            middles_of(ctx).record(np.stack([first.ravel(), last.ravel()], axis=1), middle.ravel())
    sides = {
        "1": line_between(ctx, corners[0]),
        "2": line_between(ctx, corners[:, -1]),
        "3": line_between(ctx, corners[-1][::-1]),
        "4": line_between(ctx, corners[::-1, 0]),
    }
    return new_mesh(ctx, elements(ctx, _grid_cells(corners), quadratic), sides)


def _grid_cells(ids: IntArray) -> IntArray:
    return np.stack([ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]], axis=2).reshape(-1, 4)


SURFACES = ("PLAN", "QUEL", "SPHE", "CYLI", "CONI", "TORI")
DALL = operator(
    "DALLER",
    topic="mesh",
    summary="surface between four lines",
    notice="`S = DALL L1 L2 L3 L4 'PLAN'` fills the contour made of four lines that follow one another; opposite "
    "lines have the same number of elements; in a plane they may differ if the sum of the four is even. 'SPHE' C, "
    "'CYLI' P1 P2, 'CONI' S P put the nodes on a sphere, a cylinder or a cone, 'QUEL' leaves them where the lines "
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
    return finished(ctx, _patch(ctx, grid, ids, sizes, np.linspace(0.0, 1.0, len(left)), quadratic), quadratic)


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


POINTS_WANTED = {"SPHE": 1, "CYLI": 2, "CONI": 2}


def _put_on(ctx: Context, kind: str, points: list[FloatArray], grid: FloatArray, corner: FloatArray) -> FloatArray:
    if kind not in POINTS_WANTED:
        ctx.fail(251, "DALL on a torus is not available")
    if len(points) != POINTS_WANTED[kind]:
        ctx.fail(37, "'{kind}' wants {count} POINT", at="on", kind=kind, count=POINTS_WANTED[kind])
    flat = grid.reshape(-1, 3)
    with explained(ctx, "on"):
        put: dict[str, Callable[..., FloatArray]] = {
            "SPHE": project.to_sphere,
            "CYLI": project.to_cylinder,
            "CONI": project.to_cone,
        }
        return put[kind](flat, *points, corner).reshape(grid.shape)
