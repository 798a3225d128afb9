"""Where the values of elements stand (nodes, centre, integration points), and how to move them."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.quadratic import LINEAR
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import SHAPES
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
    See `extension`.
    """
    there = support_points(shape, target)
    if values.shape[1] == 1:
        return np.repeat(values, len(there), axis=1)
    here = support_points(shape, source)
    if here.shape == there.shape and np.array_equal(here, there):
        return values
    return np.asarray(np.matmul(extension(shape, here, there), values), np.float64)


def extension(shape: Shape, here: FloatArray, there: FloatArray) -> FloatArray:
    """Give the matrix that takes values at some points of a cell to other points.

    Parameters
    ----------
    shape : Shape
    here : (q, dim) float64
        Reference points of the known values.
    there : (p, dim) float64

    Returns
    -------
    (p, q) float64

    Notes
    -----
    The field is the one nearest to the values (least squares) in the richest space that they determine: the
    interpolation of the shape; for PR15 the linear functions of the triangle times parabolas over the height; the
    interpolation of the linear shape; a constant. So the three points of TRI6 and the four of TE10, fewer than their
    nodes, give a linear field.
    """
    spaces = [shape.N]
    if shape.degree > 1:
        spaces += [_swept] if shape.name == "PR15" else []
        spaces += [SHAPES[LINEAR[shape.name]].N]
    for space in spaces:
        at_points = space(here)
        if np.linalg.matrix_rank(at_points) == at_points.shape[1]:
            return np.asarray(space(there) @ np.linalg.pinv(at_points), np.float64)
    return np.full((len(there), len(here)), 1.0 / len(here))


def through_points(shape: Shape, there: FloatArray) -> FloatArray:
    """Give the matrix that takes values at the stiffness points to other points without changing any of them.

    Parameters
    ----------
    shape : Shape
        Of second degree.
    there : (p, dim) float64

    Returns
    -------
    (p, q) float64

    Notes
    -----
    The points of QUA8 and CU20 are a grid: parabolas in each direction pass through their values. So do they in the
    coordinates ``x / (1 - z), y / (1 - z), z`` of PY13, and along the height of PR15. On cells with straight edges
    these spaces hold every quadratic field, however distorted the cells are. TRI6 and TE10: the linear field.
    """
    spaces = {"QUA8": _grid, "CU20": _grid, "PY13": _conical, "PR15": _swept}
    space = spaces[shape.name] if shape.name in spaces else SHAPES[LINEAR[shape.name]].N
    return np.asarray(space(there) @ np.linalg.inv(space(shape.gauss[0])), np.float64)


def _grid(xi: FloatArray) -> FloatArray:
    """Return the products of the powers 0, 1, 2 of each coordinate, (q, 3^dim)."""
    products = np.ones((len(xi), 1))
    for x in xi.T:
        products = (products[:, :, None] * np.vander(x, 3)[:, None, :]).reshape(len(xi), -1)
    return products


def _conical(xi: FloatArray) -> FloatArray:
    """Return the functions of `_grid` on a pyramid seen as a cone over its base; defined below the apex."""
    return _grid(np.hstack([xi[:, :2] / (1.0 - xi[:, 2:]), xi[:, 2:]]))


def _swept(xi: FloatArray) -> FloatArray:
    """Return the linear functions of the triangle times the powers 0, 1, 2 of the height, (q, 9)."""
    flat = np.hstack([np.ones((len(xi), 1)), xi[:, :2]])
    return np.asarray((flat[:, :, None] * np.vander(xi[:, 2], 3)[:, None, :]).reshape(len(xi), -1), np.float64)


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
    weight = geometry.point_measures(shape, X, rule, axisymmetric=axisymmetric)
    return np.asarray((weight[..., None] * values).sum(axis=1), np.float64)
