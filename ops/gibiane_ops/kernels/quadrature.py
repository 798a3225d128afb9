"""Quadrature rules on the reference shapes, each with the total degree that it integrates exactly and its source."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray


class Rule(NamedTuple):
    """Points and weights of a quadrature rule.

    Attributes
    ----------
    points : (q, dim) float64
        Reference coordinates.
    weights : (q,) float64
        Their sum is the measure of the reference shape.
    degree : int
        Every polynomial of this total degree is integrated exactly.
    source : str
        Where the rule comes from.
    """

    points: FloatArray
    weights: FloatArray
    degree: int
    source: str


def point() -> Rule:
    """Return the value at the only point of a shape of dimension 0.

    Returns
    -------
    Rule
        One point without coordinates, weight 1; exact for everything.
    """
    return Rule(np.zeros((1, 0)), np.ones(1), 99, "trivial")


@cache
def line(n: int) -> Rule:
    """Return the Gauss-Legendre rule on [-1, 1].

    Parameters
    ----------
    n : int
        Number of points; the degree is 2n - 1.

    Returns
    -------
    Rule
    """
    x, w = np.polynomial.legendre.leggauss(n)
    return Rule(x[:, None], w, 2 * n - 1, "Gauss-Legendre")


@cache
def square(n: int) -> Rule:
    """Return the product Gauss-Legendre rule on [-1, 1]^2.

    Parameters
    ----------
    n : int
        Points per axis; exact to degree 2n - 1 in each variable.

    Returns
    -------
    Rule
    """
    x, w = np.polynomial.legendre.leggauss(n)
    eta, xi = np.meshgrid(x, x, indexing="ij")
    return Rule(np.stack([xi.ravel(), eta.ravel()], 1), np.outer(w, w).ravel(), 2 * n - 1, "product Gauss-Legendre")


@cache
def cube(n: int) -> Rule:
    """Return the product Gauss-Legendre rule on [-1, 1]^3.

    Parameters
    ----------
    n : int
        Points per axis; exact to degree 2n - 1 in each variable.

    Returns
    -------
    Rule
    """
    x, w = np.polynomial.legendre.leggauss(n)
    zeta, eta, xi = np.meshgrid(x, x, x, indexing="ij")
    weights = np.einsum("i,j,k->ijk", w, w, w).ravel()
    points = np.stack([xi.ravel(), eta.ravel(), zeta.ravel()], 1)
    return Rule(points, weights, 2 * n - 1, "product Gauss-Legendre")


@cache
def triangle(degree: int) -> Rule:
    """Return a symmetric rule on the triangle (0, 0) (1, 0) (0, 1).

    Parameters
    ----------
    degree : int
        1 (one point), 2 (three points) or 4 (six points).

    Returns
    -------
    Rule

    Raises
    ------
    KeyError
        For another degree: the table holds those that the elements use.
    """
    if degree == 4:
        groups = [(0.445948490915965, 0.223381589678011 / 2), (0.091576213509771, 0.109951743655322 / 2)]
        points = [p for a, _ in groups for p in _orbit(a)]
        return Rule(np.array(points), np.repeat([w for _, w in groups], 3), 4, "Dunavant 1985, 6 points")
    a, source = {1: (1 / 3, "centroid"), 2: (1 / 6, "Strang-Fix 1973, 3 interior points")}[degree]
    points = _orbit(a)[: 1 if degree == 1 else 3]
    return Rule(np.array(points), np.full(len(points), 0.5 / len(points)), degree, source)


def _orbit(a: float) -> list[list[float]]:
    """Return the three points of barycentric coordinates (a, a, 1 - 2a), in the order of the nearest corner."""
    return [[a, a], [1 - 2 * a, a], [a, 1 - 2 * a]]


@cache
def tetrahedron(degree: int) -> Rule:
    """Return a symmetric rule on the tetrahedron (0,0,0) (1,0,0) (0,1,0) (0,0,1).

    Parameters
    ----------
    degree : int
        1 (one point), 2 (four points) or 5 (fourteen points).

    Returns
    -------
    Rule

    Raises
    ------
    KeyError
        For another degree: the table holds those that the elements use.
    """
    if degree == 5:
        return _tetrahedron_14()
    inner = (5 - np.sqrt(5)) / 20
    a, source = {1: (0.25, "centroid"), 2: (float(inner), "Hammer-Stroud 1956, 4 points")}[degree]
    if degree == 1:
        return Rule(np.full((1, 3), a), np.full(1, 1 / 6), 1, source)
    points = np.full((4, 3), a)
    points[[1, 2, 3], [0, 1, 2]] = 1 - 3 * a
    return Rule(points, np.full(4, 1 / 24), 2, source)


def _tetrahedron_14() -> Rule:
    """Return the rule of 14 points, two orbits near the corners and faces and one near the edges."""
    points, weights = [], []
    for a, w in ((0.31088591926330060980, 0.018781320953002641800), (0.092735250310891226402, 0.012248840519393658257)):
        orbit = np.full((4, 3), a)
        orbit[[1, 2, 3], [0, 1, 2]] = 1 - 3 * a
        points.append(orbit)
        weights += [w] * 4
    a, w = 0.045503704125649649492, 0.0070910034628469110730
    pairs = np.array([(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)])
    bary = np.full((6, 4), a)
    bary[np.arange(6)[:, None], pairs] = 0.5 - a
    points.append(bary[:, 1:])
    return Rule(np.vstack(points), np.array(weights + [w] * 6), 5, "Walkington 2000, 14 points")


@cache
def prism(degree: int, n: int) -> Rule:
    """Return the product of a triangle rule and a Gauss-Legendre rule over the height [-1, 1].

    Parameters
    ----------
    degree : int
        Degree of the triangle rule.
    n : int
        Points over the height.

    Returns
    -------
    Rule
    """
    flat, tall = triangle(degree), line(n)
    points = np.hstack([np.tile(flat.points, (n, 1)), np.repeat(tall.points, len(flat.points), 0)])
    weights = np.outer(tall.weights, flat.weights).ravel()
    return Rule(points, weights, min(degree, 2 * n - 1), "product of triangle and Gauss-Legendre")


@cache
def pyramid(n: int = 2) -> Rule:
    """Return the conical product rule of n^3 points on the pyramid of base [-1, 1]^2 and apex (0, 0, 1).

    Parameters
    ----------
    n : int
        Points per axis.

    Returns
    -------
    Rule
        Of degree 2n - 1.

    Notes
    -----
    With x = (1 - z) a, y = (1 - z) b the volume element is (1 - z)^2 da db dz: Gauss-Legendre in a and b,
    Gauss-Jacobi in z. The rational functions of the pyramids are polynomials of a, b and z.

    Source
    ------
    Stroud 1971, conical product rules.
    """
    heights, layer = _towards_apex(n, 2)
    base = square(n)
    points = np.vstack([np.c_[base.points * (1 - z), np.full(n * n, z)] for z in heights])
    return Rule(points, np.outer(layer, base.weights).ravel(), 2 * n - 1, "Stroud 1971, conical product")


@cache
def pyramid_5() -> Rule:
    """Return the rule of 5 points on the pyramid of base [-1, 1]^2 and apex (0, 0, 1), of degree 2.

    Returns
    -------
    Rule

    Notes
    -----
    Four points at height ``z1`` under the apex edges and one on the axis at ``z2``, of equal weights. The integrals of
    z and z^2 (means 1/4 and 1/10) give ``4 z1 + z2 = 5/4`` and ``4 z1^2 + z2^2 = 1/2``, that of x^2 their place 1/2.
    """
    low = (10 - np.sqrt(15)) / 40
    points = np.vstack(
        [np.c_[0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), np.full(4, low)], [0, 0, 1.25 - 4 * low]]
    )
    return Rule(points, np.full(5, 4 / 15), 2, "moments up to degree 2")


@cache
def simplex(dim: int, n: int) -> Rule:
    """Return the conical product rule of n^dim points on the reference triangle or tetrahedron.

    Parameters
    ----------
    dim : {2, 3}
    n : int
        Points per axis.

    Returns
    -------
    Rule
        Of degree 2n - 1; all points inside, all weights positive.

    Source
    ------
    Stroud 1971, conical product rules.
    """
    x, w = np.polynomial.legendre.leggauss(n)
    points, weights = (1 + x)[:, None] / 2, w / 2
    for k in range(1, dim):
        heights, layer = _towards_apex(n, k)
        points = np.vstack([np.c_[points * (1 - z), np.full(len(points), z)] for z in heights])
        weights = np.outer(layer, weights).ravel()
    return Rule(points, weights, 2 * n - 1, "Stroud 1971, conical product")


def _towards_apex(n: int, a: int) -> tuple[FloatArray, FloatArray]:
    """Return points and weights on [0, 1] for the weight (1 - z)^a (Golub-Welsch, Jacobi polynomials P^(a, 0))."""
    k = np.arange(n, dtype=np.float64)
    diagonal = -(a**2) / ((2 * k + a) * (2 * k + a + 2))
    k = k[1:]
    beside = np.sqrt(4 * k * (k + a) * k * (k + a) / ((2 * k + a) ** 2 * (2 * k + a + 1) * (2 * k + a - 1)))
    x, vectors = np.linalg.eigh(np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1))
    return (1 + x) / 2, vectors[0] ** 2 / (a + 1)
