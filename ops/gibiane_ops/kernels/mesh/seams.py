"""Triangles between two lines."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray


def seam(a: FloatArray, b: FloatArray) -> IntArray:
    """Join two lines by triangles, always along the shorter diagonal.

    Parameters
    ----------
    a : (m, 3) float64, length
    b : (n, 3) float64, length
        Nodes along two lines that run the same way, m + n > 2.

    Returns
    -------
    (m + n - 2, 3) int64
        Ranks in the nodes of a followed by those of b. Triangles turn as a quadrangle a0 a1 b1 b0 does.

    Notes
    -----
    At each step the next triangle takes the shorter of two diagonals; a line at its end leaves the rest to the other.

    Cost
    ----
    One step of Python per triangle.
    """
    m, n = len(a), len(b)
    i, j = 0, 0
    made = []
    while i < m - 1 or j < n - 1:
        if j == n - 1:
            forward = True
        elif i == m - 1:
            forward = False
        else:
            one, two = np.linalg.norm(a[i + 1] - b[j]), np.linalg.norm(a[i] - b[j + 1])
            # equal diagonals: the line that lags behind goes on
            forward = bool(one < two * (1 - 1e-9)) or (
                one <= two * (1 + 1e-9) and (i + 1) * (n - 1) <= (j + 1) * (m - 1)
            )
        if forward:
            made.append((i, i + 1, m + j))
            i += 1
        else:
            made.append((i, m + j + 1, m + j))
            j += 1
    return np.array(made, np.int64).reshape(-1, 3)
