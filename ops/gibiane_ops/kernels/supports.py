"""Where the values of elements stand (nodes, centre, integration points), and how to move them."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.errors import BadValue

SUPPORTS = ("NOEUD", "GRAVITE", "RIGIDITE", "MASSE", "STRESSES")


def support_points(shape: Shape, support: str) -> FloatArray:
    """Give the reference coordinates of the points of a support.

    Parameters
    ----------
    shape : Shape
    support : {'NOEUD', 'GRAVITE', 'RIGIDITE', 'MASSE', 'STRESSES'}
        Nodes, centre, points of the stiffness rule, of the mass rule, of the stresses (those of the stiffness).

    Returns
    -------
    (q, dim) float64

    Raises
    ------
    BadValue
        Unknown support.
    """
    match support:
        case "NOEUD":
            return shape.ref_nodes
        case "GRAVITE":
            return np.asarray(shape.ref_nodes[: shape.n_corners].mean(axis=0, keepdims=True), np.float64)
        case "RIGIDITE" | "STRESSES":
            return shape.gauss[0]
        case "MASSE":
            return shape.mass_gauss[0]
        case _:
            raise BadValue("support", support, f"one of {' '.join(SUPPORTS)}")


def moved(shape: Shape, values: FloatArray, source: str, target: str) -> FloatArray:
    """Bring values of elements from one support to another.

    Parameters
    ----------
    shape : Shape
    values : (m, q, c) float64
        At the points of `source`; one value per element (q = 1) goes anywhere as it is.
    source, target : str
        See `support_points`.

    Returns
    -------
    (m, p, c) float64

    Notes
    -----
    The interpolation of the shape nearest to the values (least squares; of least norm when there are fewer points
    than nodes) is evaluated at the target points.
    """
    there = support_points(shape, target)
    if values.shape[1] == 1:
        return np.repeat(values, len(there), axis=1)
    here = support_points(shape, source)
    if here.shape == there.shape and np.array_equal(here, there):
        return values
    return np.asarray(np.matmul(shape.N(there) @ np.linalg.pinv(shape.N(here)), values), np.float64)


def integrals(
    shape: Shape, X: FloatArray, values: FloatArray, support: str, *, axisymmetric: bool = False
) -> FloatArray:
    """Integrate values over each element.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, space_dim) float64, length
    values : (m, q, c) float64
        At the points of `support`.
    support : str
        See `support_points`.
    axisymmetric : bool
        Whether to integrate over the bodies of revolution of which the elements are the sections.

    Returns
    -------
    (m, c) float64

    Notes
    -----
    With the rule of the points where the values stand; nodal values are interpolated to the points of the mass rule.
    """
    at_points = support in ("RIGIDITE", "STRESSES") and values.shape[1] == len(shape.gauss[1])
    rule = shape.gauss if at_points else shape.mass_gauss
    if not at_points:
        values = moved(shape, values, support, "MASSE")
    weight = geometry.measure_densities(shape, X, rule[0]) * rule[1]
    if axisymmetric:
        weight = weight * geometry.circumferences(shape, X, rule[0])
    return np.asarray((weight[..., None] * values).sum(axis=1), np.float64)
