"""Linear shape functions on the unit simplex, shared by the triangle and the tetrahedron."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray


def simplex_nodes(dim: int) -> FloatArray:
    """Return the corners of the unit simplex, the origin first.

    Parameters
    ----------
    dim : int

    Returns
    -------
    (dim + 1, dim) float64
    """
    return np.vstack([np.zeros((1, dim)), np.eye(dim)])


def N(xi: FloatArray) -> FloatArray:
    """Return the barycentric coordinates.

    Parameters
    ----------
    xi : (q, dim) float64

    Returns
    -------
    (q, dim + 1) float64
    """
    return np.hstack([1.0 - xi.sum(axis=1, keepdims=True), xi])


def dN(xi: FloatArray) -> FloatArray:
    """Return the constant derivatives of the barycentric coordinates.

    Parameters
    ----------
    xi : (q, dim) float64

    Returns
    -------
    (q, dim + 1, dim) float64
    """
    q, dim = xi.shape
    return np.tile(np.vstack([-np.ones((1, dim)), np.eye(dim)]), (q, 1, 1))
