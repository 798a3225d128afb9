"""What the shapes of second degree share: mid-nodes on the edges of the linear shape, and their interpolations."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements import simplex
from gibiane_ops.kernels.elements.shape import Basis, Face, Shape

# Name of the shape of second degree that has the corners of a linear one.
QUADRATIC = {
    "SEG2": "SEG3",
    "TRI3": "TRI6",
    "QUA4": "QUA8",
    "TET4": "TE10",
    "PYR5": "PY13",
    "PRI6": "PR15",
    "CUB8": "CU20",
}
LINEAR = {quadratic: linear for linear, quadratic in QUADRATIC.items()}


def ref_nodes(linear: Shape) -> FloatArray:
    """Return the corners of a linear shape, then the middles of its edges in their order.

    Parameters
    ----------
    linear : Shape

    Returns
    -------
    (n_corners + n_edges, dim) float64
    """
    corners = linear.ref_nodes
    return np.vstack([corners, [corners[list(edge)].mean(axis=0) for edge in linear.edges]])


def edges(linear: Shape) -> tuple[tuple[int, ...], ...]:
    """Return the edges of a linear shape with their middle node last.

    Parameters
    ----------
    linear : Shape

    Returns
    -------
    tuple of (int, int, int)
    """
    return tuple((a, b, linear.n_corners + i) for i, (a, b) in enumerate(linear.edges))


def faces(linear: Shape) -> tuple[Face, ...]:
    """Return the facets of a linear shape with the mid-nodes of their edges.

    Parameters
    ----------
    linear : Shape

    Returns
    -------
    tuple of (str, tuple of int)
        Corners, then the mid-nodes along the sides from the first corner on.
    """
    if linear.dim == 1:
        return linear.faces
    middle = {frozenset((a, b)): m for a, b, m in edges(linear)}
    result = []
    for name, corners in linear.faces:
        around = corners if linear.dim == 3 else corners[:1]
        sides = [middle[frozenset((a, b))] for a, b in zip(around, (*corners[1:], corners[0]), strict=False)]
        result.append((QUADRATIC[name], (*corners, *sides)))
    return tuple(result)


def simplex_basis(linear: Shape) -> tuple[Basis, Basis]:
    """Build the complete polynomials of second degree on a triangle or tetrahedron.

    Parameters
    ----------
    linear : Shape
        TRI3 or TET4.

    Returns
    -------
    N, dN : callable
        See `Shape`.

    Notes
    -----
    ``N_a = l_a (2 l_a - 1)`` at corners and ``4 l_a l_b`` between them, l the barycentric coordinates.
    """
    first, second = (np.array([edge[i] for edge in linear.edges]) for i in (0, 1))

    def N(xi: FloatArray) -> FloatArray:
        bary = simplex.N(xi)
        return np.hstack([bary * (2 * bary - 1), 4 * bary[:, first] * bary[:, second]])

    def dN(xi: FloatArray) -> FloatArray:
        bary, slope = simplex.N(xi)[:, :, None], simplex.dN(xi)
        middle = 4 * (bary[:, first] * slope[:, second] + bary[:, second] * slope[:, first])
        return np.concatenate([(4 * bary - 1) * slope, middle], axis=1)

    return N, dN


def serendipity_basis(linear: Shape) -> tuple[Basis, Basis]:
    """Build the serendipity functions of second degree on [-1, 1]^dim.

    Parameters
    ----------
    linear : Shape
        SEG2, QUA4 or CUB8.

    Returns
    -------
    N, dN : callable
        See `Shape`.

    Notes
    -----
    With s the reference coordinates of the node: ``prod_i (1 + s_i x_i) / 2 (sum_i s_i x_i - dim + 1)`` at corners,
    ``(1 - x_j^2) prod_{i != j} (1 + s_i x_i) / 2`` on the edges along axis j.

    Source
    ------
    Zienkiewicz, Taylor, Zhu 2005, chapter 4.
    """
    nodes, dim = ref_nodes(linear), linear.dim
    on_edge = nodes == 0.0
    corner = ~on_edge.any(axis=1)

    def factors(xi: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the factor of each node and axis, and its derivative by that axis, (q, n, dim)."""
        x = xi[:, None, :]
        value = np.where(on_edge, 1 - x * x, 0.5 * (1 + nodes * x))
        slope = np.where(on_edge, -2 * x, np.broadcast_to(0.5 * nodes, value.shape))
        return value, slope

    def lowering(xi: FloatArray) -> FloatArray:
        """Return the factor of corners that vanishes at the mid-nodes, 1 for the mid-nodes, (q, n)."""
        return np.where(corner, xi @ nodes.T - (dim - 1), 1.0)

    def N(xi: FloatArray) -> FloatArray:
        return np.asarray(factors(xi)[0].prod(axis=2) * lowering(xi), np.float64)

    def dN(xi: FloatArray) -> FloatArray:
        value, slope = factors(xi)
        product, lower = value.prod(axis=2), lowering(xi)
        gradient = np.empty_like(value)
        for i in range(dim):
            others = [j for j in range(dim) if j != i]
            along = slope[:, :, i] * value[:, :, others].prod(axis=2)
            gradient[:, :, i] = along * lower + np.where(corner, product * nodes[:, i], 0.0)
        return gradient

    return N, dN
