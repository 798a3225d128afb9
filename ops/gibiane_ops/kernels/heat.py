"""Steady heat: conduction in solids, exchange and flux through facets, sources."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gibiane_ops.kernels import geometry, integrals
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.shape import Shape


def element_conduction(
    shape: Shape, X: FloatArray, conductivity: ArrayLike, *, axisymmetric: bool = False
) -> FloatArray:
    """Compute the conduction matrices of cells.

    Parameters
    ----------
    shape : Shape
        A shape that fills the space.
    X : (m, n_nodes, dim) float64, length
    conductivity : scalar or (m,) float64
        Heat per time, length and degree.
    axisymmetric : bool
        Heat goes once round the axis.

    Returns
    -------
    (m, n_nodes, n_nodes) float64, symmetric
        ``int k grad N_a . grad N_b``.

    Raises
    ------
    InvertedElement
        When a jacobian is not positive at an integration point.
    """
    points, weights = shape.gauss
    geometry.check_cells(shape, X, points)
    gradient, det = geometry.gradients(shape, X, points)
    factor = det * weights * np.asarray(conductivity, np.float64)[..., None]
    if axisymmetric:
        factor = factor * geometry.circumferences(shape, X, points)
    m, q, n, d = gradient.shape
    flat = (gradient * np.sqrt(factor)[..., None, None]).transpose(0, 2, 1, 3).reshape(m, n, q * d)
    return np.asarray(np.matmul(flat, flat.transpose(0, 2, 1)), np.float64)


def scalar_load(shape: Shape, X: FloatArray, density: FloatArray, *, axisymmetric: bool = False) -> FloatArray:
    """Compute the nodal heat of a source or flux given at nodes.

    Parameters
    ----------
    shape : Shape
        Cells or facets.
    X : (m, n_nodes, space_dim) float64, length
    density : (m, n_nodes) float64
        Heat per time and measure, interpolated by the shape functions.
    axisymmetric : bool

    Returns
    -------
    (m, n_nodes) float64
        ``int N_a density``.
    """
    mass = integrals.element_mass(shape, X, axisymmetric=axisymmetric)
    return np.asarray(np.matmul(mass, density[..., None])[..., 0], np.float64)
