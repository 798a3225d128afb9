"""Mapping from reference shapes to cells: jacobians, gradients, measures, normals, and the checks on them.

Cells come as the coordinates of their nodes, ``X : (n_cells, n_nodes, space_dim)``, so that no function needs a mesh.
"""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.errors import BadValue, InvertedElement

# A jacobian below this share of the product of its column lengths is a flat cell seen through round-off.
FLAT = 1e-12
PIECE = 1024
"""Cells worked on at a time, where their arrays would otherwise leave the cache."""


def jacobians(shape: Shape, X: FloatArray, xi: FloatArray) -> FloatArray:
    """Compute the derivatives of the coordinates by the reference coordinates.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, space_dim) float64, length
    xi : (q, dim) float64
        Reference points.

    Returns
    -------
    (m, q, space_dim, dim) float64
        ``J[e, q, i, j] = d x_i / d xi_j``.
    """
    m, n, space_dim = X.shape
    dN = shape.dN(xi)
    # A batch of small products: one tall product would wake BLAS threads, which cost far more than they bring here.
    flat: FloatArray = np.matmul(X.transpose(0, 2, 1), dN.transpose(1, 0, 2).reshape(n, -1))
    return flat.reshape(m, space_dim, len(xi), shape.dim).transpose(0, 2, 1, 3)


def _determinants(J: FloatArray) -> FloatArray:
    """Return the signed determinants of 1x1, 2x2 or 3x3 matrices held in the last two axes."""
    dim = J.shape[-1]
    if dim == 1:
        return J[..., 0, 0]
    if dim == 2:
        return np.asarray(J[..., 0, 0] * J[..., 1, 1] - J[..., 0, 1] * J[..., 1, 0], np.float64)
    return np.asarray(
        J[..., 0, 0] * (J[..., 1, 1] * J[..., 2, 2] - J[..., 1, 2] * J[..., 2, 1])
        - J[..., 0, 1] * (J[..., 1, 0] * J[..., 2, 2] - J[..., 1, 2] * J[..., 2, 0])
        + J[..., 0, 2] * (J[..., 1, 0] * J[..., 2, 1] - J[..., 1, 1] * J[..., 2, 0]),
        np.float64,
    )


def _inverses(J: FloatArray, det: FloatArray) -> FloatArray:
    """Return the inverses by cofactors; `numpy.linalg.inv` is several times slower on millions of 3x3 matrices."""
    dim = J.shape[-1]
    inverse = np.empty_like(J)
    if dim == 1:
        inverse[...] = 1.0
    elif dim == 2:
        inverse[..., 0, 0], inverse[..., 1, 1] = J[..., 1, 1], J[..., 0, 0]
        inverse[..., 0, 1], inverse[..., 1, 0] = -J[..., 0, 1], -J[..., 1, 0]
    else:
        for i in range(3):
            for j in range(3):
                a, b, c, d = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
                inverse[..., j, i] = J[..., a, c] * J[..., b, d] - J[..., a, d] * J[..., b, c]
    inverse /= det[..., None, None]
    return inverse


def measure_densities(shape: Shape, X: FloatArray, xi: FloatArray) -> FloatArray:
    """Compute the ratio of measures, cell to reference, at reference points.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, space_dim) float64, length
    xi : (q, dim) float64

    Returns
    -------
    (m, q) float64
        ``det J``, signed, when the shape fills the space; ``sqrt(det J^T J)`` for lines and surfaces in a larger
        space; 1 for a point.
    """
    J = jacobians(shape, X, xi)
    if shape.dim == 0:
        return np.ones(J.shape[:2])
    if shape.dim == X.shape[2]:
        return _determinants(J)
    gram = np.matmul(J.swapaxes(-1, -2), J)
    return np.asarray(np.sqrt(np.maximum(_determinants(gram), 0.0)), np.float64)


def point_measures(
    shape: Shape, X: FloatArray, rule: tuple[FloatArray, FloatArray], *, axisymmetric: bool = False
) -> FloatArray:
    """Compute the measures that the points of a quadrature rule stand for.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, space_dim) float64, length
    rule : (q, dim) and (q,) float64
        Points and weights in the reference element.
    axisymmetric : bool
        The integral goes once round the axis.

    Returns
    -------
    (m, q) float64
        Their sum over q is the measure of the cell.
    """
    points, weights = rule
    measure = measure_densities(shape, X, points) * weights
    return measure * circumferences(shape, X, points) if axisymmetric else measure


def circumferences(shape: Shape, X: FloatArray, xi: FloatArray) -> FloatArray:
    """Compute the length of the circles that points of a meridian plane describe about the axis.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, 2) float64, length
        Radius and height.
    xi : (q, dim) float64

    Returns
    -------
    (m, q) float64, length
        ``2 pi r``: an integral over the meridian plane times this one is an integral over the body of revolution.

    Raises
    ------
    BadValue
        When a node has a negative radius.
    """
    radius = X[:, :, 0]
    if radius.size and radius.min() < -FLAT * np.abs(X).max():
        raise BadValue("radius of a node", float(radius.min()), "r >= 0 in an axisymmetric model")
    return np.asarray(2 * np.pi * (radius @ shape.N(xi).T), np.float64)


def check_cells(shape: Shape, X: FloatArray, xi: FloatArray | None = None) -> FloatArray:
    """Refuse cells that are turned inside out or flat.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, space_dim) float64, length
    xi : (q, dim) float64, optional
        Where to look; by default the points of the stiffness rule.

    Returns
    -------
    (m, q) float64
        The densities of measure, all positive.

    Raises
    ------
    InvertedElement
        With the ids, the smallest jacobian and the corners of every bad cell.
    """
    points = shape.gauss[0] if xi is None else xi
    J = jacobians(shape, X, points)
    density = measure_densities(shape, X, points)
    # Hadamard: |det J| is at most the product of the lengths of the columns.
    bound = np.sqrt((J * J).sum(axis=2)).prod(axis=2)
    bad = np.flatnonzero((density <= FLAT * bound).any(axis=1))
    if len(bad):
        raise InvertedElement(shape.name, bad.astype(np.int64), density[bad].min(axis=1), X[bad])
    return density


def gradients(shape: Shape, X: FloatArray, xi: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute the derivatives of the shape functions by the coordinates.

    Parameters
    ----------
    shape : Shape
        A shape that fills the space: ``dim == space_dim``.
    X : (m, n_nodes, dim) float64, length
    xi : (q, dim) float64

    Returns
    -------
    gradient : (m, q, n_nodes, dim) float64, 1 / length
        ``gradient[e, q, a, j] = d N_a / d x_j``.
    det : (m, q) float64
        Jacobian determinants. They are not checked here, see `check_cells`.
    """
    J = jacobians(shape, X, xi)
    det = _determinants(J)
    return np.matmul(shape.dN(xi), _inverses(J, det)), det


def vector_gradients(
    shape: Shape, X: FloatArray, U: FloatArray, xi: FloatArray, *, checked: bool = False
) -> FloatArray:
    """Compute the derivatives of a vector by the coordinates.

    Parameters
    ----------
    shape : Shape
        A shape that fills the space: ``dim == space_dim``.
    X : (m, n_nodes, dim) float64, length
    U : (m, n_nodes, d) float64
        Nodal values.
    xi : (q, dim) float64
    checked : bool
        Refuse cells whose jacobian is not positive there.

    Returns
    -------
    (m, q, d, dim) float64
        ``d u_i / d x_j``. Each component lies contiguous in memory, which is what sums of components want.
    """
    J, G = (_by_component(jacobians(shape, values, xi)) for values in (X, U))
    det = _determinants(J)
    if checked and not (det > 0).all():
        check_cells(shape, X, xi)
    inverse = _inverses(J, det)
    found = np.empty((G.shape[2], J.shape[2], *J.shape[:2])).transpose(2, 3, 0, 1)
    for i in range(found.shape[2]):
        for j in range(found.shape[3]):
            found[..., i, j] = G[..., i, 0] * inverse[..., 0, j]
            for k in range(1, shape.dim):
                found[..., i, j] += G[..., i, k] * inverse[..., k, j]
    return found


def _by_component(tensors: FloatArray) -> FloatArray:
    """Return the same array, (..., i, j), with each component contiguous in memory."""
    return np.ascontiguousarray(tensors.transpose(2, 3, 0, 1)).transpose(2, 3, 0, 1)


def measures(shape: Shape, X: FloatArray) -> FloatArray:
    """Compute lengths, areas or volumes.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, space_dim) float64, length

    Returns
    -------
    (m,) float64
        Signed when the shape fills the space: a negative volume tells an inverted cell.
    """
    points, weights = shape.mass_gauss
    return np.asarray(measure_densities(shape, X, points) @ weights, np.float64)


def positions(shape: Shape, X: FloatArray, xi: FloatArray) -> FloatArray:
    """Map reference points to space.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, space_dim) float64, length
    xi : (q, dim) float64

    Returns
    -------
    (m, q, space_dim) float64, length
    """
    return np.asarray(np.matmul(shape.N(xi), X), np.float64)


def centroids(shape: Shape, X: FloatArray) -> FloatArray:
    """Average the corners of each cell.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, space_dim) float64, length

    Returns
    -------
    (m, space_dim) float64, length
    """
    return np.asarray(X[:, : shape.n_corners].mean(axis=1), np.float64)


def normal_densities(shape: Shape, X: FloatArray, xi: FloatArray) -> FloatArray:
    """Compute the normals of facets, scaled by the density of area.

    Parameters
    ----------
    shape : Shape
        A facet: ``dim == space_dim - 1``.
    X : (m, n_nodes, space_dim) float64, length
    xi : (q, dim) float64

    Returns
    -------
    (m, q, space_dim) float64
        ``n dS = normal_density * (weights of the reference rule)``; outward when the nodes turn counterclockwise
        seen from outside (3D), or when the solid lies on the left of the segment (2D).
    """
    if X.shape[2] == 2:
        J = jacobians(shape, X, xi)
        return np.stack([J[..., 1, 0], -J[..., 0, 0]], axis=-1)
    # Component by component over many facets, which vectorises; `numpy.cross` on small vectors takes several times as
    # long. In pieces that stay in the cache, whose products are too small to wake BLAS threads.
    m, n, _ = X.shape
    q = len(xi)
    dN = shape.dN(xi).transpose(2, 0, 1).reshape(-1, n)
    normal = np.empty((3, q, m))
    for start in range(0, m, PIECE):
        stop = min(start + PIECE, m)
        tangents = np.matmul(dN, np.ascontiguousarray(X[start:stop].transpose(2, 1, 0)))
        u, v = tangents[:, :q], tangents[:, q:]
        for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
            part = normal[i, :, start:stop]
            np.multiply(u[j], v[k], out=part)
            part -= u[k] * v[j]
    return normal.transpose(2, 1, 0)


def facet_normals(shape: Shape, X: FloatArray) -> FloatArray:
    """Compute the unit normal of each facet at its centre.

    Parameters
    ----------
    shape : Shape
        A facet: ``dim == space_dim - 1``.
    X : (m, n_nodes, space_dim) float64, length

    Returns
    -------
    (m, space_dim) float64
        Same side as `normal_densities`.

    Raises
    ------
    InvertedElement
        When a facet has no area.
    """
    centre = shape.ref_nodes[: shape.n_corners].mean(axis=0, keepdims=True)
    check_cells(shape, X, centre)
    normal = normal_densities(shape, X, centre)[:, 0]
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True), np.float64)


def vector_area(polygon: FloatArray) -> FloatArray:
    """Compute the vector area of a closed polygon.

    Parameters
    ----------
    polygon : (k, 3) float64, length
        Its corners in order; it need not be plane.

    Returns
    -------
    (3,) float64, length^2
        Along the normal about which the corners turn.
    """
    centred = polygon - polygon.mean(axis=0)
    return np.asarray(np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0) / 2, np.float64)
