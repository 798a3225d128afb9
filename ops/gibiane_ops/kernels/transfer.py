"""Values of one mesh brought to another: sampled at its points, or fitted element by element."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.errors import BadValue


def product_rule(shape: Shape, n: int) -> tuple[FloatArray, FloatArray]:
    """Return a rule with n points along each axis of a reference shape.

    Parameters
    ----------
    shape : Shape
        A line, surface or volume.
    n : int

    Returns
    -------
    points : (n^dim, dim) float64
    weights : (n^dim,) float64

    Notes
    -----
    Gauss-Legendre points of the cube, brought onto triangles, tetrahedra, prisms and pyramids by collapsing an edge
    or a face; the weights hold the jacobian of that map.
    """
    x, w = np.polynomial.legendre.leggauss(n)
    axes = np.meshgrid(*[x] * shape.dim, indexing="ij")
    points = np.stack([axis.ravel() for axis in axes], axis=1)
    weights = np.prod(np.meshgrid(*[w] * shape.dim, indexing="ij"), axis=0).ravel()
    unit = (points + 1) / 2
    match shape.n_corners, shape.dim:
        case (3, 2):
            points = np.stack([unit[:, 0] * (1 - unit[:, 1]), unit[:, 1]], axis=1)
            weights = weights / 4 * (1 - unit[:, 1])
        case (4, 3):
            a, b, c = unit.T
            points = np.stack([a * (1 - b) * (1 - c), b * (1 - c), c], axis=1)
            weights = weights / 8 * (1 - b) * (1 - c) ** 2
        case (6, 3):
            points = np.stack([unit[:, 0] * (1 - unit[:, 1]), unit[:, 1], points[:, 2]], axis=1)
            weights = weights / 4 * (1 - unit[:, 1])
        case (5, 3):
            shrink = 1 - unit[:, 2]
            points = np.stack([points[:, 0] * shrink, points[:, 1] * shrink, unit[:, 2]], axis=1)
            weights = weights / 2 * shrink**2
        case _:
            pass
    return points, weights


def fitted(shape: Shape, X: FloatArray, sample: Callable[[FloatArray], FloatArray], n: int = 3) -> FloatArray:
    """Fit nodal values of each element to a function, in the mean of its square over the element.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, dim) float64, length
    sample : callable
        ``sample(points (k, dim)) -> (k, c)``.
    n : int
        Integration points along each axis.

    Returns
    -------
    (m, n_nodes, c) float64

    Raises
    ------
    BadValue
        Fewer integration points than nodes.

    Notes
    -----
    Minimises the integral of ``(N^T u - f)^2`` over each element by itself: the result is discontinuous from one to
    the next, exact where f is of the degree of the element.
    """
    xi, weights = product_rule(shape, n)
    if len(weights) < shape.n_nodes:
        raise BadValue("integration points along each axis", n, f"{shape.n_nodes} points or more in an element")
    N = shape.N(xi)
    at = geometry.positions(shape, X, xi)
    values = sample(at.reshape(-1, at.shape[2])).reshape(len(X), len(weights), -1)
    weight = np.abs(geometry.measure_densities(shape, X, xi)) * weights
    mass = np.einsum("qa,mq,qb->mab", N, weight, N, optimize=True)
    load = np.einsum("qa,mq,mqc->mac", N, weight, values, optimize=True)
    return np.asarray(np.linalg.solve(mass, load), np.float64)
