"""Nodes inside a patch bounded by four lines, by transfinite interpolation."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray


def _lengths(line: FloatArray) -> FloatArray:
    """Return the curvilinear abscissas of a polyline, from 0 to 1."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    total = steps.sum()
    if not total > 0:
        return np.linspace(0.0, 1.0, len(line))
    return np.asarray(np.concatenate([[0.0], np.cumsum(steps)]) / total, np.float64)


def patch(bottom: FloatArray, right: FloatArray, top: FloatArray, left: FloatArray) -> FloatArray:
    """Place the nodes of a grid between four lines.

    Parameters
    ----------
    bottom, top : (nu + 1, dim) float64, length
        From left to right.
    left, right : (nv + 1, dim) float64, length
        From bottom to top. The four corners agree.

    Returns
    -------
    (nv + 1, nu + 1, dim) float64, length
        The borders are the given lines.

    Notes
    -----
    Coons's bilinearly blended patch. Each node takes for parameters (u, v) the crossing of the straight lines that
    join equal ranks on opposite sides of the unit square, ranks being placed there by curvilinear abscissa: lines
    of unequal spacing keep their spacing inside.

    Source
    ------
    Coons, Surfaces for computer-aided design of space forms, 1967.
    """
    u0, u1 = _lengths(bottom)[None, :], _lengths(top)[None, :]
    v0, v1 = _lengths(left)[:, None], _lengths(right)[:, None]
    du, dv = u1 - u0, v1 - v0
    # u = u0 + v du and v = v0 + u dv, solved together; |du|, |dv| < 1 keep the determinant positive.
    u = (u0 + v0 * du) / (1.0 - du * dv)
    v = (v0 + u0 * dv) / (1.0 - du * dv)
    u, v = u[..., None], v[..., None]
    ruled = (1 - v) * bottom[None] + v * top[None] + (1 - u) * left[:, None] + u * right[:, None]
    corners = (1 - u) * (1 - v) * bottom[0] + u * (1 - v) * bottom[-1] + (1 - u) * v * top[0] + u * v * top[-1]
    grid: FloatArray = ruled - corners
    grid[0], grid[-1], grid[:, 0], grid[:, -1] = bottom, top, left, right
    return grid
