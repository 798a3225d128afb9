"""Where a nodal field takes a value: points on segments, lines on triangles, surfaces in tetrahedra."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray

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
