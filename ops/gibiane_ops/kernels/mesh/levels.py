"""Where a nodal field takes a value: points on segments, lines on triangles, surfaces in tetrahedra."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.mesh import simplices

# A cut nearer to a node than this part of the edge is that node.
AT_NODE = 1e-12
EDGES = {2: ((0, 1),), 3: ((0, 1), (1, 2), (2, 0)), 4: ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))}
# For each set of corners above (bit i for corner i), the simplices between the edges that are cut.
CUTS: dict[int, dict[int, tuple[tuple[int, ...], ...]]] = {
    2: {1: ((0,),), 2: ((0,),)},
    3: {1: ((0, 2),), 2: ((0, 1),), 4: ((1, 2),), 3: ((1, 2),), 5: ((0, 1),), 6: ((0, 2),)},
    4: {
        1: ((0, 1, 2),), 2: ((0, 3, 4),), 4: ((1, 3, 5),), 8: ((2, 4, 5),),
        14: ((0, 1, 2),), 13: ((0, 3, 4),), 11: ((1, 3, 5),), 7: ((2, 4, 5),),
        3: ((1, 2, 4), (1, 4, 3)), 12: ((1, 2, 4), (1, 4, 3)),
        5: ((0, 2, 5), (0, 5, 3)), 10: ((0, 2, 5), (0, 5, 3)),
        9: ((0, 1, 5), (0, 5, 4)), 6: ((0, 1, 5), (0, 5, 4)),
    },
}  # fmt: skip


def level(points: FloatArray, cells: IntArray, values: FloatArray, at: float) -> tuple[FloatArray, IntArray]:
    """Cut simplices where a field that is linear in each takes a value.

    Parameters
    ----------
    points : (n, 3) float64, length
    cells : (m, d + 1) int64
        Segments, triangles or tetrahedra.
    values : (n,) float64
        At the points.
    at : float

    Returns
    -------
    points : (k, 3) float64, length
        One per edge that is cut, whichever elements share it.
    cells : (p, d) int64
        Points, segments or triangles. Triangles look to the side of higher values; in the plane segments have it on
        their left.

    Notes
    -----
    A node of exactly that value counts as above; simplices that collapse there are left out.
    """
    d = cells.shape[1]
    above = values >= at
    case = (above[cells] * (1 << np.arange(d))).sum(axis=1)
    found: list[IntArray] = []
    owners: list[IntArray] = []
    ends = np.array(EDGES[d])
    for code, pieces in CUTS[d].items():
        rows = np.flatnonzero(case == code)
        for piece in pieces:
            found.append(cells[rows][:, ends[list(piece)]])
            owners.append(rows)
    pairs = np.sort(np.concatenate(found), axis=2)  # (p, d, 2)
    owner = np.concatenate(owners)
    flat = pairs.reshape(-1, 2)
    part = (at - values[flat[:, 0]]) / (values[flat[:, 1]] - values[flat[:, 0]])
    flat = np.where((part < AT_NODE)[:, None], flat[:, :1], np.where((part > 1 - AT_NODE)[:, None], flat[:, 1:], flat))
    unique, first, number = np.unique(flat, axis=0, return_index=True, return_inverse=True)
    share = np.where(unique[:, 0] == unique[:, 1], 0.0, part[first])[:, None]
    places = points[unique[:, 0]] + share * (points[unique[:, 1]] - points[unique[:, 0]])
    made = number.reshape(len(owner), d - 1)
    order = np.sort(made, axis=1)
    whole = (order[:, 1:] != order[:, :-1]).all(axis=1)
    made, owner = made[whole], owner[whole]
    made = _turned(places, made, points[cells[owner]], above[cells[owner]])
    used, number = np.unique(made, return_inverse=True)
    return places[used], number.reshape(made.shape)


def clip(points: FloatArray, cells: IntArray, values: FloatArray, at: float) -> tuple[FloatArray, IntArray]:
    """Keep the part of simplices where a field that is linear in each is at least a value.

    Parameters
    ----------
    points : (n, 3) float64, length
    cells : (m, d + 1) int64
        Points, segments, triangles or tetrahedra (of positive volume).
    values : (n,) float64
        At the points.
    at : float

    Returns
    -------
    points : (k, 3) float64, length
        New points, on the edges that are cut; point i of these has the number n + i in the cells.
    cells : (p, d + 1) int64
        Simplices that turn like those they are parts of; neighbours fit, because the cut of a quadrangle depends on
        the numbers of its corners only.
    """
    n, d = len(points), cells.shape[1]
    outside = values[cells] < at
    order = np.argsort(outside, axis=1, kind="stable")
    count = d - outside.sum(axis=1)
    # An even permutation brings the corners that are kept to the front, so that the pieces turn like the whole.
    odd = np.linalg.det(np.eye(d)[order]) < 0 if len(cells) else np.zeros(0, bool)
    swap = np.array([1, 0, *range(2, d)]), np.array([*range(d - 2), d - 1, d - 2])
    if d > 2:
        order = np.where(odd[:, None], np.where((count > 1)[:, None], order[:, swap[0]], order[:, swap[1]]), order)
    front = np.take_along_axis(cells, order, axis=1)
    ends = np.sort(front[:, np.array(EDGES[d])].reshape(-1, 2), axis=1) if d > 1 else np.zeros((0, 2), np.int64)
    ends = np.unique(ends[(values[ends] < at).sum(axis=1) == 1], axis=0)
    part = (at - values[ends[:, 0]]) / (values[ends[:, 1]] - values[ends[:, 0]])
    near = [part < AT_NODE, part > 1 - AT_NODE]
    made = ~near[0] & ~near[1]
    ids = np.select(near, [ends[:, 0], ends[:, 1]], n + np.cumsum(made) - 1)
    places = points[ends[:, 0]] + part[:, None] * (points[ends[:, 1]] - points[ends[:, 0]])
    keys = ends[:, 0] * n + ends[:, 1]

    def cut(a: IntArray, b: IntArray) -> IntArray:
        return np.asarray(ids[np.searchsorted(keys, np.minimum(a, b) * n + np.maximum(a, b))], np.int64)

    parts = [front[count == d]]
    for kept in range(1, d):
        c = front[count == kept].T
        if d == 2:
            first = outside[count == kept, 1]
            end = cut(c[0], c[1])
            parts.append(np.where(first[:, None], np.stack([c[0], end], 1), np.stack([end, c[0]], 1)))
        elif kept == 1:
            parts.append(np.stack([c[0], *(cut(c[0], other) for other in c[1:])], axis=1))
        elif d == 3:
            quadrangles = np.stack([c[0], c[1], cut(c[1], c[2]), cut(c[0], c[2])], axis=1)
            parts.append(simplices.triangles_of_quadrangles(quadrangles))
        else:
            if kept == 3:
                prism = [c[0], c[1], c[2], cut(c[0], c[3]), cut(c[1], c[3]), cut(c[2], c[3])]
            else:
                prism = [c[0], cut(c[0], c[2]), cut(c[0], c[3]), c[1], cut(c[1], c[2]), cut(c[1], c[3])]
            parts.append(simplices.tetrahedra("PRI6", np.stack(prism, axis=1))[0])
    found = np.concatenate(parts)
    ranked = np.sort(found, axis=1)
    return places[made], found[(ranked[:, 1:] != ranked[:, :-1]).all(axis=1)]


def _turned(places: FloatArray, made: IntArray, X: FloatArray, above: FloatArray) -> IntArray:
    """Turn segments and triangles so that the higher values are on their left, or in front of them."""
    d = made.shape[1]
    if d == 1 or not len(made):
        return made
    weight = above / above.sum(axis=1, keepdims=True) - (1 - above) / (1 - above).sum(axis=1, keepdims=True)
    up = (X * weight[..., None]).sum(axis=1)
    side = places[made[:, 1]] - places[made[:, 0]]
    if d == 2:
        normal = np.stack([-side[:, 1], side[:, 0], np.zeros(len(side))], axis=1)
    else:
        normal = np.cross(side, places[made[:, 2]] - places[made[:, 0]])
    against = (normal * up).sum(axis=1) < 0
    return np.asarray(np.where(against[:, None], made[:, ::-1], made), np.int64)
