"""The stress of elements at any of their points, from its values at the integration points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels import elasticity, geometry
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.quadratic import LINEAR
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import NotConverged
from gibiane_ops.kernels.estimate.macro import PAIRS, STATIC
from gibiane_ops.kernels.supports import extension, through_points

AFFINE = 1e-9
"""Largest change of the jacobian matrix of an element, over its size, for which its map counts as affine."""

INVERSIONS, INVERTED = 50, 1e-12
"""Largest number of Newton steps to a point of an element; distance left that is round-off, over its size."""

FITS = 1e-9
"""Largest strain that no displacement has, over the largest strain, that is round-off."""

RATIONAL = ("PYR5", "PY13")
"""Elements whose shape functions are not polynomials."""


@dataclass(frozen=True, eq=False)
class Field:
    """Strains and stresses of the displacement of elements, each up to its rigid motion.

    Attributes
    ----------
    of : Shape
    X, U : (m, n_nodes, d) float64, length
        Nodes, and displacements that have the strains.
    affine : (m,) bool
        Elements whose map is affine: strains are polynomials there.
    straight : (m,) bool
        Elements whose middle nodes are in the middles of their edges: their map is that of the linear shape.
    law : (m, n_s, n_s) float64, force / length^2
        Stress from strain, components of `macro.STATIC`.
    misfit : float
        Largest difference to the strains given, over the largest of them: round-off for those of a displacement.
    rest : (m, q, n_s) float64, optional
        This difference (of thermal strains), at the points of the stiffness rule; the interpolation that they determine
        in between, which holds thermal strains interpolated from the nodes of elements of affine map.
    """

    of: Shape
    X: FloatArray
    U: FloatArray
    affine: NDArray[np.bool_]
    straight: NDArray[np.bool_]
    law: FloatArray
    misfit: float
    rest: FloatArray | None = None

    def strains(self, cells: IntArray, x: FloatArray, guess: FloatArray, alike: IntArray | None = None) -> FloatArray:
        """Evaluate strains at points of elements.

        Parameters
        ----------
        cells : (k,) int64
            Elements.
        x : (k, p, d) float64, length
            Points of each; outside of the element its polynomials go on.
        guess : (k, p, d) float64
            Their reference coordinates, exact where the map is affine.
        alike : (k,) int64, optional
            The same number for those of the same reference coordinates, whose functions are evaluated once.

        Returns
        -------
        (k, p, n_s) float64
            Components of `macro.STATIC`, engineering shears.

        Raises
        ------
        NotConverged
            A point has no reference coordinates.
        """
        k, p, dim = x.shape
        xi = guess.copy()
        linear = shape(LINEAR.get(self.of.name, self.of.name))
        straight = self.straight[cells]
        for of, rows in ((linear, straight & ~self.affine[cells]), (self.of, ~straight)):
            some = np.flatnonzero(rows)
            if len(some):
                xi[some] = located(of, self.X[cells[some], : of.n_nodes], x[some], guess[some])
        number = np.arange(k)
        if alike is not None:
            number = np.where(self.affine[cells], alike, alike.max(initial=0) + 1 + number)
        _, first, same = np.unique(number, return_index=True, return_inverse=True)
        slope = self.of.dN(xi[first].reshape(-1, dim)).reshape(len(first), p, -1, dim).swapaxes(1, 2)
        slope = slope.reshape(len(first), -1, p * dim)[same]
        both = np.concatenate([self.X[cells], self.U[cells]], axis=2).swapaxes(1, 2)
        found = np.matmul(both, slope).reshape(k, 2, dim, p, dim)
        J, H = (found[:, i].swapaxes(1, 2) for i in (0, 1))
        gradient = np.matmul(H, np.linalg.inv(J))
        pairs = PAIRS[dim]
        strain = np.stack([gradient[..., i, j] + (gradient[..., j, i] if i != j else 0.0) for i, j in pairs], axis=-1)
        if self.rest is None:
            return strain
        there = xi[first].reshape(-1, dim)
        carried = through_points(self.of, there) if self.of.degree > 1 else extension(self.of, self.of.gauss[0], there)
        return np.asarray(strain + np.matmul(carried.reshape(len(first), p, -1)[same], self.rest[cells]), np.float64)

    def stresses_on(self, of: Shape, cells: IntArray, local: IntArray, xi: FloatArray) -> FloatArray:
        """Evaluate stresses at points of facets.

        Parameters
        ----------
        of : Shape
            Of the facets.
        cells, local : (k,) int64
            Element of each facet, and which of its facets it is.
        xi : (k, p, dim - 1) float64
            Points in reference coordinates of the facets.

        Returns
        -------
        (k, p, n_s) float64
        """
        N = of.N(xi.reshape(-1, of.dim)).reshape(*xi.shape[:2], -1)
        nodes = np.array([self.of.faces[i][1] for i in local])
        x = np.matmul(N, self.X[cells[:, None], nodes])
        strain = self.strains(cells, x, np.matmul(N, self.of.ref_nodes[nodes]))
        return np.asarray(np.matmul(strain, self.law[cells]), np.float64)


def located(of: Shape, X: FloatArray, x: FloatArray, guess: FloatArray) -> FloatArray:
    """Find the reference coordinates of points of elements or facets by Newton's method.

    Parameters
    ----------
    of : Shape
    X : (k, n_nodes, d) float64, length
    x : (k, p, d) float64, length
        Points of each; those of a facet on it.
    guess : (k, p, dim) float64

    Returns
    -------
    (k, p, dim) float64

    Raises
    ------
    NotConverged
        A point has no reference coordinates.
    """
    k, p, dim = x.shape
    X, xi = np.repeat(X, p, axis=0), guess.reshape(k * p, of.dim).copy()
    x = x.reshape(k * p, dim)
    size = np.abs(X - X[:, :1]).max(axis=(1, 2), initial=0.0)
    history: list[float] = []
    rows = np.arange(len(x))
    for _ in range(INVERSIONS):
        left = x[rows] - np.einsum("kn,kni->ki", of.N(xi[rows]), X[rows])
        far = np.abs(left).max(axis=1) > INVERTED * size[rows]
        history.append(float((np.abs(left).max(axis=1) / size[rows]).max(initial=0.0)))
        rows, left = rows[far], left[far]
        if not len(rows):
            return xi.reshape(k, p, of.dim)
        J = np.einsum("kni,knj->kij", X[rows], of.dN(xi[rows]))
        Jt = J.swapaxes(1, 2)
        xi[rows] += np.linalg.solve(np.matmul(Jt, J), np.matmul(Jt, left[..., None]))[..., 0]
    raise NotConverged(history, xi)


def field_of(of: Shape, X: FloatArray, stress: FloatArray, compliance: FloatArray) -> Field:
    """Find displacements of elements that have given stresses.

    Parameters
    ----------
    of : Shape
        In a plane or in space.
    X : (m, n_nodes, d) float64, length
    stress : (m, q, n_s) float64, force / length^2
        At the points of the stiffness rule, components of `macro.STATIC`.
    compliance : (m, n_s, n_s) float64, length^2 / force

    Returns
    -------
    Field

    Notes
    -----
    Least squares over the points; the points of a stiffness rule leave no displacement without strain but the rigid
    motions, which are set to zero. So finite-element strains come back exactly, wherever they are not interpolated
    exactly from these points: in distorted elements they are rational functions.

    Cost
    ----
    One symmetric system of all the displacements of each element.
    """
    points, (m, n, dim) = of.gauss[0], X.shape
    strain = np.matmul(stress, compliance)
    J = geometry.jacobians(of, X, points)
    affine = np.abs(J - J[:, :1]).max(axis=(1, 2, 3)) <= AFFINE * np.abs(J).max(axis=(1, 2, 3))
    if of.name in RATIONAL:
        affine[:] = False
    straight = np.ones(m, bool)
    for a, b, *middle in of.edges:
        if middle:
            off = np.abs(X[:, middle[0]] - (X[:, a] + X[:, b]) / 2).max(axis=1)
            straight &= off <= AFFINE * np.abs(X[:, a] - X[:, b]).max(axis=1)
    U, rest, largest = np.empty(X.shape), np.empty(strain.shape), float(np.abs(strain).max(initial=0.0))
    turns = [(i, j) for i in range(dim) for j in range(i)]
    for start in range(0, m, elasticity.CHUNK):
        some = slice(start, start + elasticity.CHUNK)
        B = elasticity.strain_operator(of, X[some], points)[:, :, list(STATIC[dim])]
        B = B.reshape(len(B), -1, n * dim)
        arm = X[some] - X[some].mean(axis=1, keepdims=True)
        scale = np.abs(arm).max(axis=(1, 2))
        rigid = np.zeros((len(B), dim + len(turns), n, dim))
        rigid[:, range(dim), :, range(dim)] = 1.0
        for row, (i, j) in enumerate(turns, dim):
            rigid[:, row, :, i], rigid[:, row, :, j] = -arm[..., j] / scale[:, None], arm[..., i] / scale[:, None]
        rigid = rigid.reshape(len(B), -1, n * dim) / scale[:, None, None]
        A = np.matmul(B.swapaxes(1, 2), B) + np.matmul(rigid.swapaxes(1, 2), rigid)
        given = strain[some].reshape(len(B), -1, 1)
        u = np.linalg.solve(A, np.matmul(B.swapaxes(1, 2), given))
        # one more step, in strains that are left: the normal equations lose half of the digits
        u = u + np.linalg.solve(A, np.matmul(B.swapaxes(1, 2), given - np.matmul(B, u)))
        rest[some] = (given - np.matmul(B, u)).reshape(rest[some].shape)
        U[some] = u[..., 0].reshape(-1, n, dim)
    misfit = float(np.abs(rest).max(initial=0.0)) / largest if largest else 0.0
    law = np.asarray(np.linalg.inv(compliance), np.float64)
    return Field(of, X, U, affine, straight, law, misfit, rest if misfit > FITS else None)
