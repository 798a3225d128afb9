"""Regular grids: the rows and columns of a patch of quadrangles, and the inside of six such patches."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray, IntArray


def corners(cells: IntArray) -> IntArray:
    """Return the nodes that belong to one quadrangle only, in the order of the cells.

    Parameters
    ----------
    cells : (m, 4) int64

    Returns
    -------
    (k,) int64
        Four for a regular grid.
    """
    count = np.bincount(cells.ravel())
    return np.asarray(cells.ravel()[count[cells.ravel()] == 1], np.int64)


def grid(cells: IntArray, origin: int, along: int) -> IntArray | None:
    """Find the rows and columns of a patch of quadrangles.

    Parameters
    ----------
    cells : (m, 4) int64
    origin, along : int
        Two corners of the patch, ends of one of its sides.

    Returns
    -------
    (n_rows + 1, n_columns + 1) int64 or None
        The nodes, from the origin, the first row ending at `along`; None when the patch is no regular grid with
        these corners.

    Notes
    -----
    In a grid the numbers of edges from two neighbouring corners, i + j and i + n - j, give the row and the column.
    """
    from scipy.sparse.csgraph import dijkstra

    nodes, local = np.unique(cells, return_inverse=True)
    local = local.reshape(cells.shape)
    if origin not in nodes or along not in nodes:
        return None
    a, b = local.ravel(), np.roll(local, -1, axis=1).ravel()
    links = sp.csr_array((np.ones(len(a)), (a, b)), shape=(len(nodes),) * 2)
    ends = np.searchsorted(nodes, [origin, along])
    steps = dijkstra(links, directed=False, unweighted=True, indices=ends)
    if not np.isfinite(steps).all():
        return None
    first, second = steps.astype(np.int64)
    width = int(first[ends[1]])
    row, column = (first + second - width) // 2, (first - second + width) // 2
    shape = int(row.max()) + 1, width + 1
    if shape[0] * shape[1] != len(nodes) or (shape[0] - 1) * width != len(cells) or (column < 0).any():
        return None
    if column.max() > width or len(np.unique(row * shape[1] + column)) != len(nodes):
        return None
    # Every quadrangle must be a square of the grid.
    square = (np.ptp(row[local], axis=1) == 1) & (np.ptp(column[local], axis=1) == 1)
    if not square.all():
        return None
    result = np.empty(shape, np.int64)
    result[row, column] = nodes
    return result


def _along(lines: list[FloatArray]) -> FloatArray:
    """Return the mean of the curvilinear abscissas, from 0 to 1, of lines with the same number of nodes."""
    parts = []
    for line in lines:
        steps = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        parts.append(steps / steps[-1] if steps[-1] > 0 else np.linspace(0.0, 1.0, len(line)))
    return np.asarray(np.mean(parts, axis=0), np.float64)


def inside(hull: FloatArray) -> FloatArray:
    """Place the nodes inside a block whose six faces are given.

    Parameters
    ----------
    hull : (nw + 1, nv + 1, nu + 1, 3) float64, length
        The faces of the array hold the nodes of the faces of the block; the rest is not read.

    Returns
    -------
    (nw + 1, nv + 1, nu + 1, 3) float64, length
        With the inside filled.

    Notes
    -----
    Boolean sum of the interpolations between opposite faces (Gordon 1971); the parameters are mean curvilinear
    abscissas of the four edges of each direction.
    """
    u = _along([hull[k, j] for k in (0, -1) for j in (0, -1)])[None, None, :, None]
    v = _along([hull[k, :, i] for k in (0, -1) for i in (0, -1)])[None, :, None, None]
    w = _along([hull[:, j, i] for j in (0, -1) for i in (0, -1)])[:, None, None, None]

    def blend(x: FloatArray, axis: int, t: FloatArray) -> FloatArray:
        first, last = x.take([0], axis), x.take([-1], axis)
        return np.asarray((1 - t) * first + t * last, np.float64)

    along_u, along_v, along_w = blend(hull, 2, u), blend(hull, 1, v), blend(hull, 0, w)
    uv, uw, vw = blend(along_u, 1, v), blend(along_u, 0, w), blend(along_v, 0, w)
    result = along_u + along_v + along_w - uv - uw - vw + blend(uv, 0, w)
    for axis in range(3):
        for end in (0, -1):
            side = (slice(None),) * axis + (end,)
            result[side] = hull[side]
    return result
