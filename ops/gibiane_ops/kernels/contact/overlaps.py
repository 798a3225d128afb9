"""Common parts of two surfaces: integrals of the functions of one, and of products with those of the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.clip import clip, fan
from gibiane_ops.kernels.contact.pairs import FACING
from gibiane_ops.kernels.contact.search import candidates, reach, spheres
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.quadrature import line, square, triangle
from gibiane_ops.kernels.topology import Block

CHUNK = 500
"""Pairs of facets treated together: some 100 000 points."""

STRAIGHT = 1e-9
"""How far, over its size, the middle of a straight side may lie from that of its ends."""

# Corners of the flat pieces that stand for a curved facet.
PIECES = {
    "SEG3": [[0, 2], [2, 1]],
    "TRI6": [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
    "QUA8": [[0, 4, 7], [1, 5, 4], [2, 6, 5], [3, 7, 6], [4, 5, 6], [4, 6, 7]],
}


@dataclass(frozen=True, eq=False)
class Overlaps:
    """Integrals over the parts that facets of one block share with those of the other surface; one row per part.

    Attributes
    ----------
    slave : (k,) int64
        Facet of the slave block.
    block, master : (k,) int64
        Block of the other surface, and facet in it.
    area : (k, n) float64, area
        ``int N``.
    mass : (k, n, n) float64, area
        ``int N N^T``.
    coupling : (k, n, m) float64, area
        ``int N N2^T``, the columns after ``width[block]`` are 0.
    gap : (k, n) float64, area x length
        ``int N gap``, the gap along the normal of the slave facet.
    lowest : (k,) float64, length
        Smallest gap.
    normal : (k, d) float64
        Unit normal of the master facet.
    width : list of int
        Nodes of a facet of each master block.
    """

    slave: IntArray
    block: IntArray
    master: IntArray
    area: FloatArray
    mass: FloatArray
    coupling: FloatArray
    gap: FloatArray
    lowest: FloatArray
    normal: FloatArray
    width: list[int]


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Flat pieces of the facets of a block: facet, corners (k, c, d), reference coordinates of these (k, c, dim).

    `affine`: the piece is a segment, a triangle or a parallelogram.
    """

    facet: IntArray
    corners: FloatArray
    ref: FloatArray
    affine: NDArray[np.bool_]


def overlaps(
    points: FloatArray, name: str, cells: IntArray, master: Sequence[Block], axisymmetric: bool = False
) -> Overlaps:
    """Integrate over the common parts of the facets of one block and of another surface.

    Parameters
    ----------
    points : (n_points, d) float64, length
    name : str
        Shape of the slave facets.
    cells : (m, n_nodes) int64
    master : sequence of (shape name, (m, n_nodes) int64)
    axisymmetric : bool
        Integrals go once round the axis.

    Returns
    -------
    Overlaps

    Notes
    -----
    Each pair of facets is projected on the plane of the slave piece along its normal, the polygons are clipped and cut
    into triangles, and points are mapped back. Curved quadratic facets are cut into flat pieces; facets with straight
    sides are kept whole. Where both are affine the rules are exact.

    Source
    ------
    M. A. Puso, T. A. Laursen, CMAME 193, 2004.
    """
    of = shape(name)
    own = _pieces(of, points[cells])
    own_spheres = spheres(own.corners.reshape(-1, points.shape[1]), [_as_block(own)])
    far = reach(points[cells].reshape(-1, points.shape[1]))
    width = [shape(other).n_nodes for other, _ in master]
    found: list[list[FloatArray | IntArray]] = []
    for number, (other, facing) in enumerate(master):
        theirs = _pieces(shape(other), points[facing])
        their_spheres = spheres(theirs.corners.reshape(-1, points.shape[1]), [_as_block(theirs)])
        s, m = candidates(own_spheres.centre, own_spheres.radius, their_spheres, far)
        face = np.einsum("ki,ki->k", own_spheres.normal[s], their_spheres.normal[m]) < FACING
        s, m = s[face], m[face]
        affine = own.affine[s] & theirs.affine[m]
        for exact in (True, False):
            group = np.flatnonzero(affine == exact)
            for start in range(0, len(group), CHUNK):
                part = group[start : start + CHUNK]
                plane = _plane(own_spheres.centre[s[part]], own_spheres.normal[s[part]], own.corners[s[part]])
                sides = (of, points[cells], own, s[part]), (shape(other), points[facing], theirs, m[part])
                each = _integrals(*sides, plane, max(width), _order(of, shape(other), exact), axisymmetric)
                if each is not None:
                    found.append([np.full(len(each[0]), number), *each[:-1], their_spheres.normal[m[part]][each[-1]]])
    n, d = of.n_nodes, points.shape[1]
    empty: list[FloatArray | IntArray] = [
        *(np.zeros(0, np.int64) for _ in range(3)), np.zeros((0, n)), np.zeros((0, n, n)),
        np.zeros((0, n, max(width))), np.zeros((0, n)), np.zeros(0), np.zeros((0, d)),
    ]  # fmt: skip
    block, slave, other_facet, area, mass, coupling, gap, lowest, normal = (
        np.concatenate(column) for column in zip(empty, *found, strict=True)
    )
    return Overlaps(slave, block, other_facet, area, mass, coupling, gap, lowest, normal, width)


def _as_block(pieces: _Pieces) -> Block:
    k, c = pieces.corners.shape[:2]
    return {2: "SEG2", 3: "TRI3", 4: "QUA4"}[c], np.arange(k * c).reshape(k, c)


def _pieces(of: Shape, X: FloatArray) -> _Pieces:
    """Cut curved facets into flat pieces, and keep the others whole."""
    m, n = len(X), of.n_corners
    curved = False
    for a, b, *middle in of.edges:
        if middle:
            off = np.linalg.norm(X[:, middle[0]] - (X[:, a] + X[:, b]) / 2, axis=1)
            curved |= bool((off > STRAIGHT * np.linalg.norm(X[:, a] - X[:, b], axis=1)).any())
    lists = np.array(PIECES[of.name]) if curved else np.arange(n)[None]
    corners = X[:, lists].reshape(-1, lists.shape[1], X.shape[2])
    ref = np.broadcast_to(of.ref_nodes[lists], (m, *lists.shape, of.dim)).reshape(-1, lists.shape[1], of.dim)
    affine = np.ones(len(corners), dtype=bool)
    if lists.shape[1] == 4:
        skew = np.linalg.norm(corners[:, 0] - corners[:, 1] + corners[:, 2] - corners[:, 3], axis=1)
        affine = skew <= STRAIGHT * np.linalg.norm(corners[:, 2] - corners[:, 0], axis=1)
    return _Pieces(np.repeat(np.arange(m), len(lists)), corners, ref, affine)


def _plane(centre: FloatArray, normal: FloatArray, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give the origin and the axes of the planes of pieces: (k, d), (k, d, d), the last axis being the normal."""
    along = corners[:, 1] - corners[:, 0]
    along = along - np.einsum("ki,ki->k", along, normal)[:, None] * normal
    along /= np.linalg.norm(along, axis=1)[:, None]
    if corners.shape[2] == 2:
        return centre, np.stack([along, normal], axis=1)
    return centre, np.stack([along, np.cross(normal, along), normal], axis=1)


_Side = tuple[Shape, FloatArray, _Pieces, IntArray]


def _integrals(
    slave: _Side, master: _Side, plane: tuple[FloatArray, FloatArray], width: int, n_points: int, axisymmetric: bool
) -> list[FloatArray | IntArray] | None:
    """Integrate over the common parts of pairs of pieces; ends with the places of the pairs that have one."""
    origin, axes = plane
    (one, X1, pieces1, s), (two, X2, pieces2, m) = slave, master
    flat1, flat2 = (
        np.einsum("kij,kcj->kci", axes, pieces.corners[which] - origin[:, None])[..., :-1]
        for pieces, which in ((pieces1, s), (pieces2, m))
    )
    owner, x, weight = _points_1d(flat1, flat2, n_points) if one.dim == 1 else _points_2d(flat1, flat2, n_points)
    if not len(owner):
        return None
    xi1, xi2 = (
        _reference(flat[owner], pieces.ref[which[owner]], x)
        for flat, pieces, which in ((flat1, pieces1, s), (flat2, pieces2, m))
    )
    N1, N2 = one.N(xi1), two.N(xi2)
    at1 = np.einsum("qa,qai->qi", N1, X1[pieces1.facet[s[owner]]])
    at2 = np.einsum("qa,qai->qi", N2, X2[pieces2.facet[m[owner]]])
    normal = axes[owner, -1]
    weight = weight / _slope(one, X1[pieces1.facet[s[owner]]], xi1, normal)
    if axisymmetric:
        weight = weight * 2 * np.pi * np.maximum(at1[:, 0], 0.0)
    gap = np.einsum("qi,qi->q", at2 - at1, normal)
    used = np.unique(owner)
    starts = np.searchsorted(owner, used)
    W = N1 * weight[:, None]
    coupling = np.zeros((len(used), one.n_nodes, width))
    coupling[:, :, : two.n_nodes] = np.add.reduceat(W[:, :, None] * N2[:, None, :], starts)
    return [
        pieces1.facet[s[used]], pieces2.facet[m[used]],
        np.add.reduceat(W, starts), np.add.reduceat(W[:, :, None] * N1[:, None, :], starts), coupling,
        np.add.reduceat(W * gap[:, None], starts), np.minimum.reduceat(gap, starts), used,
    ]  # fmt: skip


def _order(one: Shape, two: Shape, affine: bool) -> int:
    """Choose the points per axis: exact where both are affine, to round-off for moderately bent quadrangles."""
    if not affine:
        return 10
    return 2 if one.degree == two.degree == 1 and one.n_corners == two.n_corners and one.n_corners < 4 else 4


def _points_1d(one: FloatArray, two: FloatArray, n: int) -> tuple[IntArray, FloatArray, FloatArray]:
    """Put points on the common parts of segments: (owner, position, weight)."""
    low = np.maximum(one[..., 0].min(axis=1), two[..., 0].min(axis=1))
    high = np.minimum(one[..., 0].max(axis=1), two[..., 0].max(axis=1))
    kept = np.flatnonzero(high > low)
    t, w = line(n).points[:, 0], line(n).weights
    half = (high - low)[kept, None] / 2
    x = (high + low)[kept, None] / 2 + half * t
    return np.repeat(kept, n), x.reshape(-1, 1), (half * w).ravel()


def _points_2d(one: FloatArray, two: FloatArray, n: int) -> tuple[IntArray, FloatArray, FloatArray]:
    """Put points on the common parts of polygons: (owner, position, weight)."""
    polygon, count = clip(one, two[:, ::-1])
    owner, corners, area = fan(polygon, count)
    points, weights = _triangle(n)
    bary = np.column_stack([1 - points.sum(axis=1), points])
    x = np.einsum("qc,tci->tqi", bary, corners)
    return np.repeat(owner, len(weights)), x.reshape(-1, 2), (2 * area[:, None] * weights).ravel()


@cache
def _triangle(n: int) -> tuple[FloatArray, FloatArray]:
    """Return a rule on the triangle of degree 2 n - 2, a square with one side pulled together; 3 points for n = 2."""
    if n == 2:
        return triangle(2).points, triangle(2).weights
    u, v = (square(n).points.T + 1) / 2
    return np.column_stack([u, v * (1 - u)]), square(n).weights / 4 * (1 - u)


def _reference(corners: FloatArray, ref: FloatArray, x: FloatArray) -> FloatArray:
    """Find the reference coordinates of points in the plane: corners (q, c, dim), ref (q, c, dim), x (q, dim)."""
    c = corners.shape[1]
    if c == 2:
        along = corners[:, 1] - corners[:, 0]
        t = (x - corners[:, 0]) / along
        return np.asarray(ref[:, 0] + t * (ref[:, 1] - ref[:, 0]))
    if c == 3:
        A = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
        ratio = np.linalg.solve(A, (x - corners[:, 0])[..., None])
        R = np.stack([ref[:, 1] - ref[:, 0], ref[:, 2] - ref[:, 0]], axis=2)
        return np.asarray(ref[:, 0] + (R @ ratio)[..., 0])
    return _inside_quadrangle(corners, x)


def _inside_quadrangle(corners: FloatArray, x: FloatArray) -> FloatArray:
    """Find the reference coordinates of points in quadrangles of the plane, by Newton's method."""
    # x = c + a xi + b eta + s xi eta; written out: a batch of 2 x 2 systems costs ten times more
    signs = np.array([[1, 1, 1, 1], [-1, 1, 1, -1], [-1, -1, 1, 1], [1, -1, 1, -1]]) / 4
    c, a, b, s = np.einsum("kc,qci->kiq", signs, corners)
    y = x.T - c
    xi, eta = np.zeros(len(x)), np.zeros(len(x))
    for _ in range(20):
        J00, J01, J10, J11 = a[0] + s[0] * eta, b[0] + s[0] * xi, a[1] + s[1] * eta, b[1] + s[1] * xi
        r0 = y[0] - a[0] * xi - (b[0] + s[0] * xi) * eta
        r1 = y[1] - a[1] * xi - (b[1] + s[1] * xi) * eta
        det = J00 * J11 - J01 * J10
        one, two = (J11 * r0 - J01 * r1) / det, (J00 * r1 - J10 * r0) / det
        xi, eta = xi + one, eta + two
        if max(np.abs(one).max(initial=0.0), np.abs(two).max(initial=0.0)) < 1e-14:
            break
    return np.column_stack([xi, eta])


def _slope(of: Shape, X: FloatArray, xi: FloatArray, normal: FloatArray) -> FloatArray:
    """Give the cosine of the true normal at points with that of the plane, at least a half."""
    J = np.einsum("qaj,qai->qij", of.dN(xi), X)
    true = np.stack([J[:, 1, 0], -J[:, 0, 0]], axis=1) if X.shape[2] == 2 else np.cross(J[..., 0], J[..., 1])
    return np.asarray(np.maximum(np.einsum("qi,qi->q", true, normal) / np.linalg.norm(true, axis=1), 0.5), np.float64)
