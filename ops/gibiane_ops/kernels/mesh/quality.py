"""How close triangles and tetrahedra are to equilateral ones."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray


def _edges(X: FloatArray) -> FloatArray:
    """Return the lengths of the edges, (m, 3) or (m, 6)."""
    i, j = np.triu_indices(X.shape[1], 1)
    return np.asarray(np.linalg.norm(X[:, i] - X[:, j], axis=2), np.float64)


def _measure(X: FloatArray) -> FloatArray:
    """Return areas or volumes, positive."""
    sides = X[:, 1:] - X[:, :1]
    gram = np.matmul(sides, sides.swapaxes(1, 2))
    return np.asarray(np.sqrt(np.maximum(np.linalg.det(gram), 0.0)) / (2.0 if X.shape[1] == 3 else 6.0), np.float64)


def mean_ratio(X: FloatArray) -> FloatArray:
    """Compute the ratio of the measure to that of the equilateral element of the same mean square edge.

    Parameters
    ----------
    X : (m, 3 or 4, dim) float64, length
        Corners of triangles or tetrahedra.

    Returns
    -------
    (m,) float64
        From 0 (flat) to 1 (equilateral): ``4 sqrt(3) A / sum l^2`` or ``12 (3 V)^(2/3) / sum l^2``.

    Source
    ------
    Liu and Joe, Relationship between tetrahedron shape measures, 1994.
    """
    square = (_edges(X) ** 2).sum(axis=1)
    measure = _measure(X)
    top = 4 * np.sqrt(3) * measure if X.shape[1] == 3 else 12 * (3 * measure) ** (2 / 3)
    return np.asarray(np.divide(top, square, out=np.zeros(len(X)), where=square > 0), np.float64)


def aspect(X: FloatArray) -> FloatArray:
    """Compute the longest edge over the smallest height, 1 for an equilateral element, infinite for a flat one.

    Parameters
    ----------
    X : (m, 3 or 4, dim) float64, length

    Returns
    -------
    (m,) float64
    """
    longest = _edges(X).max(axis=1)
    measure = _measure(X)
    if X.shape[1] == 3:
        factor, base, size = np.sqrt(3) / 2, longest, 2 * measure
    else:
        faces = np.stack([_measure(np.delete(X, i, axis=1)) for i in range(4)])
        factor, base, size = np.sqrt(2 / 3), faces.max(axis=0), 3 * measure
    return np.asarray(factor * np.divide(longest * base, size, out=np.full(len(X), np.inf), where=size > 0), np.float64)


def skewness(X: FloatArray) -> FloatArray:
    """Compute the share of the measure that lacks to the equilateral element of the same circumscribed sphere.

    Parameters
    ----------
    X : (m, 3 or 4, dim) float64, length

    Returns
    -------
    (m,) float64
        From 0 (equilateral) to 1 (flat).
    """
    sides = X[:, 1:] - X[:, :1]
    gram = np.matmul(sides, sides.swapaxes(1, 2))
    flat = _measure(X) <= 1e-14 * _edges(X).max(axis=1) ** (X.shape[1] - 1)
    gram[flat] = np.eye(X.shape[1] - 1)
    # The centre is a combination of the sides whose scalar product with each side is half its square.
    half = np.diagonal(gram, axis1=1, axis2=2) / 2
    weights = np.linalg.solve(gram, half[..., None])[..., 0]
    radius = np.sqrt((weights * half).sum(axis=1))
    best = 3 * np.sqrt(3) / 4 * radius**2 if X.shape[1] == 3 else 8 * np.sqrt(3) / 27 * radius**3
    return np.asarray(np.where(flat, 1.0, 1.0 - _measure(X) / best), np.float64)
