"""Smallest length of each cell, the one that limits a time step."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.shape import Shape


def smallest_lengths(shape: Shape, X: FloatArray) -> FloatArray:
    """Find the shortest way through each cell.

    Parameters
    ----------
    shape : Shape
        ``dim`` 2 or 3, equal to the dimension of space.
    X : (m, n_nodes, dim) float64, length

    Returns
    -------
    (m,) float64, length
        Least distance between two corners, or from a corner to the plane of a facet that does not touch it.

    Notes
    -----
    The plane of a facet passes through the centre of its corners; its normal is that of its diagonals.
    """
    lengths = [np.linalg.norm(X[:, i] - X[:, j], axis=1) for i, j in combinations(range(shape.n_corners), 2)]
    for _, local in shape.faces:
        corners = [k for k in local if k < shape.n_corners]
        facet = X[:, corners]
        if shape.dim == 2:
            along = facet[:, 1] - facet[:, 0]
            normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
        else:
            normal = np.cross(facet[:, 2] - facet[:, 0], facet[:, -1] - facet[:, 1])
        normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        centre = facet.mean(axis=1)
        others = [k for k in range(shape.n_corners) if k not in corners]
        lengths += [np.abs(((X[:, k] - centre) * normal).sum(axis=1)) for k in others]
    return np.asarray(np.min(lengths, axis=0), np.float64)
