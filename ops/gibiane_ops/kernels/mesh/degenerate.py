"""Elements that have lost a corner, and the lower elements that they are."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import IntArray


def split_off_triangles(cells: IntArray) -> tuple[IntArray, IntArray]:
    """Separate quadrangles from those that have one corner twice in a row.

    Parameters
    ----------
    cells : (m, 4) int64

    Returns
    -------
    quadrangles : (k, 4) int64
    triangles : (m - k, 3) int64
        In the order of `cells`, turning as they did.
    """
    same = cells == np.roll(cells, -1, axis=1)
    rows = np.flatnonzero(same.any(axis=1))
    if len(rows) == 0:
        return cells, np.zeros((0, 3), np.int64)
    drop = same[rows].argmax(axis=1)
    local = (drop[:, None] + np.array([1, 2, 3])) % 4
    return np.delete(cells, rows, axis=0), np.take_along_axis(cells[rows], local, axis=1)
