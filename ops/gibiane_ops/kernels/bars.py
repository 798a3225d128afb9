"""Bars: lines that resist stretching only, straight or curved, in the plane or in space."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.shape import Shape


def stretch_operator(shape: Shape, X: FloatArray, xi: FloatArray) -> FloatArray:
    """Build B, which gives the axial strain from the nodal displacements.

    Parameters
    ----------
    shape : Shape
        A line, SEG2 or SEG3.
    X : (m, n_nodes, space_dim) float64, length
    xi : (q, 1) float64

    Returns
    -------
    (m, q, n_nodes * space_dim) float64, 1 / length
        ``dN_a/ds t``, t the unit tangent.
    """
    J = geometry.jacobians(shape, X, xi)[..., 0]
    slope = shape.dN(xi)[..., 0]
    B = slope[None, :, :, None] * (J / (J * J).sum(axis=2, keepdims=True))[:, :, None, :]
    return np.asarray(B.reshape(len(X), len(xi), -1), np.float64)


def _weights(shape: Shape, X: FloatArray) -> FloatArray:
    """Return the lengths that the integration points stand for, (m, q), refusing bars without length."""
    return geometry.check_cells(shape, X) * shape.gauss[1]


def bar_stiffness(shape: Shape, X: FloatArray, D: FloatArray) -> FloatArray:
    """Compute the stiffness matrices of bars.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, space_dim) float64, length
    D : (1, 1) or (m, 1, 1) float64, force
        Young's modulus times section.

    Returns
    -------
    (m, n_nodes * space_dim, n_nodes * space_dim) float64, symmetric

    Raises
    ------
    InvertedElement
        When a bar has no length.
    """
    weights = _weights(shape, X)
    B = stretch_operator(shape, X, shape.gauss[0])
    K = np.matmul(B.transpose(0, 2, 1), B * weights[..., None]) * D
    return np.asarray((K + K.transpose(0, 2, 1)) / 2, np.float64)


def bar_strains(shape: Shape, X: FloatArray, U: FloatArray, xi: FloatArray, *, quadratic: bool = False) -> FloatArray:
    """Compute the axial strains of a displacement field.

    Parameters
    ----------
    shape : Shape
    X, U : (m, n_nodes, space_dim) float64, length
    xi : (q, 1) float64
    quadratic : bool
        Green and Lagrange's strain, ``t . du/ds + |du/ds|^2 / 2``.

    Returns
    -------
    (m, q, 1) float64
    """
    strain = np.asarray(np.matmul(stretch_operator(shape, X, xi), U.reshape(len(U), -1, 1)), np.float64)
    if quadratic:
        J, moved = geometry.jacobians(shape, X, xi)[..., 0], geometry.jacobians(shape, U, xi)[..., 0]
        strain += 0.5 * ((moved**2).sum(axis=2) / (J**2).sum(axis=2))[..., None]
    return strain


def bar_forces(shape: Shape, X: FloatArray, tension: FloatArray) -> FloatArray:
    """Compute the nodal forces that balance axial forces given at the integration points.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, space_dim) float64, length
    tension : (m, q, 1) float64, force
        At the points of ``shape.gauss``.

    Returns
    -------
    (m, n_nodes, space_dim) float64, force
    """
    B = stretch_operator(shape, X, shape.gauss[0])
    forces = np.matmul(B.transpose(0, 2, 1), tension * _weights(shape, X)[..., None])
    return np.asarray(forces.reshape(X.shape), np.float64)
