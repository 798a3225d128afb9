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


def metric_quality(X: FloatArray, M: FloatArray) -> FloatArray:
    """Compute how close simplices are to equilateral ones of unit edges, lengths being measured by a metric.

    Parameters
    ----------
    X : (m, 3 or 4, dim) float64, length
        Corners of triangles or tetrahedra.
    M : (m, dim, dim) float64, 1/length^2
        Positive definite; an edge e has the length ``sqrt(e . M e)``.

    Returns
    -------
    (m,) float64
        From 0 (flat) to 1: the mean ratio in the metric times ``(s (2 - s))^3``, where s is the root of the mean
        square of the edges, or its inverse, whichever is below 1.

    Raises
    ------
    numpy.linalg.LinAlgError
        When a metric is not positive definite.

    Source
    ------
    K. Lipnikov and Y. Vassilevski, On control of adaptation in parallel mesh generation, 2004 (the factor of size).
    """
    Y = X @ np.linalg.cholesky(M)
    length = np.sqrt((_edges(Y) ** 2).mean(axis=1))
    inverse = np.divide(1.0, length, out=np.zeros(len(X)), where=length > 0)
    s = np.minimum(length, inverse)
    return np.asarray(mean_ratio(Y) * (s * (2.0 - s)) ** 3, np.float64)


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


# Corners whose three (two) edges leave it in order, and the shape that counts as perfect: unit square and cube, prism
# of equilateral bases and unit height, pyramid of eight unit edges (its apex, where four edges meet, is left out).
CORNERS: dict[str, tuple[tuple[int, ...], ...]] = {
    "QUA4": ((0, 1, 3), (1, 2, 0), (2, 3, 1), (3, 0, 2)),
    "CUB8": ((0, 1, 3, 4), (1, 2, 0, 5), (2, 3, 1, 6), (3, 0, 2, 7),
             (4, 7, 5, 0), (5, 4, 6, 1), (6, 5, 7, 2), (7, 6, 4, 3)),
    "PRI6": ((0, 1, 2, 3), (1, 2, 0, 4), (2, 0, 1, 5), (3, 5, 4, 0), (4, 3, 5, 1), (5, 4, 3, 2)),
    "PYR5": ((0, 1, 3, 4), (1, 2, 0, 4), (2, 3, 1, 4), (3, 0, 2, 4)),
}  # fmt: skip
_SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
_TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, np.sqrt(3) / 2, 0]])
_UP = np.array([0.0, 0.0, 1.0])
PERFECT: dict[str, FloatArray] = {
    "QUA4": _SQUARE[:, :2],
    "CUB8": np.concatenate([_SQUARE, _SQUARE + _UP]),
    "PRI6": np.concatenate([_TRIANGLE, _TRIANGLE + _UP]),
    "PYR5": np.concatenate([_SQUARE, [[0.5, 0.5, np.sqrt(0.5)]]]),
}


def corner_ratio(name: str, X: FloatArray) -> FloatArray:
    """Compute the smallest mean ratio of the corners of quadrangles, cubes, prisms or pyramids.

    Parameters
    ----------
    name : str
        QUA4, CUB8, PRI6 or PYR5.
    X : (m, n_nodes, dim) float64, length

    Returns
    -------
    (m,) float64
        From 0 (a corner is flat or turned inside out) to 1 (the perfect shape of `PERFECT`, of any size): at each
        corner ``d det(T)^(2/d) / |T|^2``, where T maps the edges of the perfect corner onto those of the element.
        Quadrangles in space have no sense of turning: their corners count as positive unless the element is folded.

    Source
    ------
    P. M. Knupp, Algebraic mesh quality metrics for unstructured initial meshes, 2003.
    """
    worst = np.full(len(X), np.inf)
    ideal = PERFECT[name]
    d = ideal.shape[1]
    normal = np.cross(X[:, 2] - X[:, 0], X[:, 3] - X[:, 1]) if d == 2 and X.shape[2] == 3 else None
    for corner in CORNERS[name]:
        edges = (X[:, corner[1:]] - X[:, corner[:1]]).swapaxes(1, 2)
        T = edges @ np.linalg.inv((ideal[list(corner[1:])] - ideal[corner[0]]).T)
        if d == T.shape[1]:
            det = np.linalg.det(T)
        else:
            across = np.cross(T[:, :, 0], T[:, :, 1])
            side = np.sign((across * normal).sum(axis=1)) if normal is not None else 1.0
            det = np.linalg.norm(across, axis=1) * side
        size = (T * T).sum(axis=(1, 2))
        ratio = np.divide(d * np.maximum(det, 0.0) ** (2 / d), size, out=np.zeros(len(X)), where=size > 0)
        worst = np.minimum(worst, ratio)
    return np.asarray(worst, np.float64)


def flatness(X: FloatArray) -> FloatArray:
    """Compute how flat quadrangles are: 100 in a plane, 0 when folded back on themselves.

    Parameters
    ----------
    X : (m, 4, 3) float64, length

    Returns
    -------
    (m,) float64
        ``100 (1 - angle / pi)``, the angle between the normals at two opposite corners.
    """
    one = np.cross(X[:, 1] - X[:, 0], X[:, 3] - X[:, 0])
    two = np.cross(X[:, 3] - X[:, 2], X[:, 1] - X[:, 2])
    sizes = np.linalg.norm(one, axis=1) * np.linalg.norm(two, axis=1)
    cosine = np.divide((one * two).sum(axis=1), sizes, out=np.ones(len(X)), where=sizes > 0)
    return np.asarray(100 * (1 - np.arccos(np.clip(cosine, -1, 1)) / np.pi), np.float64)
