"""Integrals of shape functions over cells and facets, in batches: loads and masses.

Of axisymmetric cells they go once round the axis, with the factor 2 pi r.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.shape import Shape


def pressure_load(face_shape: Shape, X: FloatArray, p: ArrayLike, *, axisymmetric: bool = False) -> FloatArray:
    """Compute the consistent nodal forces of a pressure.

    Parameters
    ----------
    face_shape : Shape
        A facet: ``dim == space_dim - 1``, nodes turning so that the normal leaves the solid.
    X : (m, n_nodes, space_dim) float64, length
    p : scalar, (m,) or (m, n_nodes) float64, force / length^2
        Positive when it pushes on the solid; one value per facet, or nodal values that are interpolated.
    axisymmetric : bool

    Returns
    -------
    (m, n_nodes, space_dim) float64, force
        ``F_a = - int N_a p n dS``.
    """
    points, weights = face_shape.mass_gauss
    N = face_shape.N(points)
    value = np.asarray(p, np.float64)
    forces = np.empty(X.shape)
    for start in range(0, len(X), 16 * geometry.PIECE):
        part = slice(start, start + 16 * geometry.PIECE)
        at_points = value if value.ndim == 0 else value[part] if value.ndim == 1 else (value[part] @ N.T).T
        if axisymmetric:
            at_points = at_points * geometry.circumferences(face_shape, X[part], points).T
        flux = geometry.normal_densities(face_shape, X[part], points).T * (-weights[:, None] * at_points)
        forces[part] = np.matmul(N.T, flux).T
    return forces


def distributed_load(shape: Shape, X: FloatArray, density: ArrayLike, *, axisymmetric: bool = False) -> FloatArray:
    """Compute the consistent nodal forces of a force per unit of length, area or volume.

    Parameters
    ----------
    shape : Shape
        Any shape: a line, a facet, or the solid itself for a body force.
    X : (m, n_nodes, space_dim) float64, length
    density : (d,), (m, d) or (m, n_nodes, d) float64
        Uniform, per cell, or nodal values that are interpolated.
    axisymmetric : bool

    Returns
    -------
    (m, n_nodes, d) float64, force
        ``F_a = int N_a t``.
    """
    points = shape.mass_gauss[0]
    N = shape.N(points)
    value = np.asarray(density, np.float64)
    at_points = np.matmul(N, value) if value.ndim == 3 else np.atleast_2d(value)[:, None, :]
    factor = geometry.point_measures(shape, X, shape.mass_gauss, axisymmetric=axisymmetric)
    return np.asarray(np.matmul(N.T, at_points * factor[..., None]), np.float64)


def element_mass(shape: Shape, X: FloatArray, density: ArrayLike = 1.0, *, axisymmetric: bool = False) -> FloatArray:
    """Compute the consistent mass matrices of one scalar component.

    Parameters
    ----------
    shape : Shape
        Any shape.
    X : (m, n_nodes, space_dim) float64, length
    density : scalar or (m,) float64
    axisymmetric : bool

    Returns
    -------
    (m, n_nodes, n_nodes) float64, symmetric
        ``M_ab = int density N_a N_b``; every displacement component has the same.
    """
    N = shape.N(shape.mass_gauss[0])
    factor = (
        geometry.point_measures(shape, X, shape.mass_gauss, axisymmetric=axisymmetric)
        * np.asarray(density, np.float64)[..., None]
    )
    products = (N[:, :, None] * N[:, None, :]).reshape(len(N), -1)
    return (factor @ products).reshape(len(X), shape.n_nodes, shape.n_nodes)


def lumped_mass(shape: Shape, X: FloatArray, density: ArrayLike = 1.0, *, axisymmetric: bool = False) -> FloatArray:
    """Compute diagonal mass matrices of one scalar component.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, space_dim) float64, length
    density : scalar or (m,) float64
    axisymmetric : bool

    Returns
    -------
    (m, n_nodes) float64, positive
        Their sum is the mass of the cell.

    Notes
    -----
    Sums of the rows of the consistent matrix for linear shapes. In those of second degree such sums are zero or
    negative at corners: there the diagonal of the consistent matrix is scaled to the mass of the cell.

    Source
    ------
    Hinton, Rock, Zienkiewicz 1976.
    """
    M = element_mass(shape, X, density, axisymmetric=axisymmetric)
    if shape.degree < 2:
        return np.asarray(M.sum(axis=2), np.float64)
    diagonal = np.diagonal(M, axis1=1, axis2=2)
    total: FloatArray = diagonal * (M.sum(axis=(1, 2)) / diagonal.sum(axis=1))[:, None]
    return total


def face_mass(face_shape: Shape, X: FloatArray) -> FloatArray:
    """Compute the mass matrices of facets, which relate nodal forces F and densities R by ``M R = F``.

    Parameters
    ----------
    face_shape : Shape
    X : (m, n_nodes, space_dim) float64, length

    Returns
    -------
    (m, n_nodes, n_nodes) float64, symmetric
        Area / 36 [4 2 1 2; ...] for a parallelogram, area / 12 (1 + delta_ab) for a triangle.

    Raises
    ------
    InvertedElement
        When a facet has no area.
    """
    geometry.check_cells(face_shape, X, face_shape.mass_gauss[0])
    return element_mass(face_shape, X)
