"""Grids of quadrangles: their rows and columns, and the layers that join two of different numbers of these."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import BadValue, MeshingFailed


def grid_of(cells: IntArray, corner: int) -> IntArray:
    """Order the nodes of a grid of quadrangles by rows and columns.

    Parameters
    ----------
    cells : (m n, 4) int64
        Quadrangles that turn alike.
    corner : int
        Node of one quadrangle only.

    Returns
    -------
    (m + 1, n + 1) int64
        Nodes, the corner first; rows follow the way in which its quadrangle turns.

    Raises
    ------
    MeshingFailed
        When the node is no corner, or the quadrangles do not make a grid.
    """
    at, local = np.nonzero(cells == corner)
    if len(at) != 1:
        raise MeshingFailed("the point is no corner of the surface")
    cell_of: dict[tuple[int, int], int] = {}
    for number, cell in enumerate(cells.tolist()):
        for k in range(4):
            cell_of[cell[k], cell[(k + 1) % 4]] = number
    rows: list[list[int]] = []
    seen = 0
    left = int(corner), int(cells[at[0], (local[0] + 3) % 4])
    while True:
        below, above = [left[0]], [left[1]]
        edge = left
        while (edge[1], edge[0]) in cell_of:
            number = cell_of.pop((edge[1], edge[0]))
            turned = cells[number].tolist()
            k = turned.index(edge[0])
            edge = (turned[(k + 1) % 4], turned[(k + 2) % 4])
            below.append(edge[0])
            above.append(edge[1])
            seen += 1
        if len(below) == 1 or (rows and below != rows[-1]):
            raise MeshingFailed("the quadrangles do not make a grid")
        rows = rows or [below]
        rows.append(above)
        if (above[0], above[1]) not in cell_of:
            break
        turned = cells[cell_of[above[0], above[1]]].tolist()
        left = above[0], turned[turned.index(above[0]) - 1]
    even = all(len(row) == len(rows[0]) for row in rows)
    if seen != len(cells) or not even or len(np.unique(rows)) != len(rows) * len(rows[0]):
        raise MeshingFailed("the quadrangles do not make a grid")
    return np.array(rows, np.int64)


def interpolated(points: FloatArray, s: FloatArray, t: FloatArray) -> FloatArray:
    """Interpolate between the nodes of a grid.

    Parameters
    ----------
    points : (m + 1, n + 1, 3) float64, length
    s, t : (k,) float64
        Places along the columns and along the rows, from 0 to 1.

    Returns
    -------
    (k, 3) float64, length
    """
    m, n = points.shape[0] - 1, points.shape[1] - 1
    i = np.clip((t * m + 1e-12).astype(np.int64), 0, m - 1)
    j = np.clip((s * n + 1e-12).astype(np.int64), 0, n - 1)
    a, b = (t * m - i)[:, None], (s * n - j)[:, None]
    low = (1 - b) * points[i, j] + b * points[i, j + 1]
    high = (1 - b) * points[i + 1, j] + b * points[i + 1, j + 1]
    return np.asarray((1 - a) * low + a * high, np.float64)


def transition(n: int, m: int) -> tuple[FloatArray, IntArray]:
    """Fill a square with quadrangles, one side of it cut into n and the opposite one into m; the other two whole.

    Parameters
    ----------
    n, m : int
        Of even sum.

    Returns
    -------
    points : (k, 2) float64
        The n + 1 of the first side (y = 0), the m + 1 of the second (y = 1), then those inside.
    cells : (q, 4) int64
        Of positive area.

    Raises
    ------
    BadValue
        When the sum is odd.

    Notes
    -----
    Each edge of the side with fewer faces an odd number w of the other: a quadrangle for w = 1, else (w - 1) / 2 frames
    of three quadrangles about one.
    """
    if (n + m) % 2:
        raise BadValue("sum", n + m, "even")
    few, many = min(n, m), max(n, m)
    extra = (many - few) // 2
    steps = np.diff([(2 * extra * i + few) // (2 * few) for i in range(few + 1)])
    points = [(i / few, 0.0) for i in range(few + 1)] + [(j / many, 1.0) for j in range(many + 1)]
    cells: list[list[int]] = []
    first = few + 1
    for i, depth in enumerate(steps.tolist()):
        width = 2 * depth + 1
        a, b = i, i + 1
        for r in range(depth):
            t = (r + 1) / (depth + 1)
            left = (1 - t) * i / few + t * points[first][0]
            right = (1 - t) * (i + 1) / few + t * points[first + width][0]
            share = (r + 1) / width
            points += [(left + share * (right - left), t), (right - share * (right - left), t)]
            c, d = len(points) - 2, len(points) - 1
            cells += [[a, b, d, c], [a, c, first + r + 1, first + r], [b, first + width - r, first + width - r - 1, d]]
            a, b = c, d
        cells.append([a, b, first + depth + 1, first + depth])
        first += width
    x, quadrangles = np.array(points), np.array(cells, np.int64)
    if n <= m:
        return x, quadrangles
    # Turned upside down: the side with more comes first.
    x[:, 1] = 1.0 - x[:, 1]
    order = np.r_[few + 1 : few + many + 2, : few + 1, few + many + 2 : len(x)]
    rank = np.empty(len(x), np.int64)
    rank[order] = np.arange(len(x))
    return x[order], rank[quadrangles][:, ::-1]
