"""What the operators that draw lines share: their ends, their densities, and the line along a path."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context
from gibiane.values import ENTIER, FLOTTANT, MAILLAGE, POINT
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.mesh import chains
from gibiane_ops.mesh.building import join, line_between, line_nodes, nodes_of
from gibiane_ops.mesh.degree import finished, linear_mesh, wants_quadratic
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.middles import middles_of

COUNT = Arg("n", ENTIER, "number of elements", optional=True)
DINI = Key("DINI", "density at the first end", Arg("d", FLOTTANT))
DFIN = Key("DFIN", "density at the other end", Arg("d", FLOTTANT))
ENDS = (POINT, MAILLAGE)
End = Point | Maillage


def first_node(ctx: Context, end: End, at: str) -> int:
    """Return the node of a point, or the first one of a line."""
    return end.node if isinstance(end, Point) else int(line_nodes(ctx, end, at)[0])


def last_node(ctx: Context, end: End, at: str) -> int:
    """Return the node of a point, or the last one of a line."""
    return end.node if isinstance(end, Point) else int(line_nodes(ctx, end, at)[-1])


def end_sizes(ctx: Context, start: int, end: int, dini: float | None, dfin: float | None) -> tuple[float, float]:
    """Return the sizes wanted at two nodes: given, or their densities."""
    density = nodes_of(ctx).density
    return (float(density[start]) if dini is None else dini), (float(density[end]) if dfin is None else dfin)


def line_along(
    ctx: Context,
    a: End,
    b: End | None,
    start: int,
    end: int,
    path: Callable[[FloatArray], FloatArray],
    places: FloatArray,
    sizes: tuple[float, float],
) -> Maillage:
    """Join two nodes along a path, (k,) from 0 to 1 to (k, 3); lines given for ends are put before and after."""
    given = [each for each in (a, b) if isinstance(each, Maillage)]
    quadratic = wants_quadratic(ctx, *given)
    inner = places[1:-1]
    density = sizes[0] + inner * (sizes[1] - sizes[0])
    ids = nodes_of(ctx).add(path(inner), density) if len(inner) else np.zeros(0, np.int64)
    nodes = np.concatenate([[start], ids, [end]])
    if quadratic:
        middles_of(ctx).add(chains.segments_of(nodes), path((places[1:] + places[:-1]) / 2))
    parts = [linear_mesh(ctx, a)] if isinstance(a, Maillage) else []
    parts.append(line_between(ctx, nodes))
    if isinstance(b, Maillage):
        parts.append(linear_mesh(ctx, b))
    return finished(ctx, join(parts), quadratic)
