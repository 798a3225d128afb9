"""Where straight lines through points meet planes, quadrics, tori and meshes: the meeting nearest to each point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.mesh.locate import STEPS, overshoot, solve_small
from gibiane_ops.kernels.mesh.transforms import direction, normal_of
from gibiane_ops.kernels.topology import Block

# Part of the size of things below which they count as zero.
FLAT = 1e-12
# Part of its size by which an element is caught from outside.
EDGE = 1e-6


def to_plane(x: FloatArray, d: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Find where lines meet the plane through three points.

    Parameters
    ----------
    x, d : (k, 3) float64, length
        A point and the direction of each line.
    a, b, c : (3,) float64, length

    Returns
    -------
    (k,) float64
        t such that ``x + t d`` is in the plane; nan where the line is parallel to it.

    Raises
    ------
    BadValue
        The three points are on one line.
    """
    n = normal_of(a, b, c)
    slope = d @ n
    flat = np.abs(slope) <= FLAT * np.linalg.norm(d, axis=1)
    return np.where(flat, np.nan, (a - x) @ n / np.where(flat, 1.0, slope))


def _to_quadric(x: FloatArray, d: FloatArray, centre: FloatArray, Q: FloatArray, level: float) -> FloatArray:
    """Find the root of smallest size of ``(x + t d - c)^T Q (x + t d - c) = level``; nan without one."""
    p = x - centre
    A, B, C = (np.einsum("ki,ij,kj->k", u, Q, v) for u, v in ((d, d), (d, p), (p, p)))
    C = C - level
    scale = np.abs(np.einsum("ki,ki->k", d, d))
    square = B * B - A * C
    square = np.where(np.abs(square) <= FLAT * (B * B + np.abs(A * C)), 0.0, square)
    # Citardauq's form gives the root of smallest size without cancellation, also when A is zero.
    below = B + np.copysign(np.sqrt(np.maximum(square, 0.0)), B)
    on = np.abs(C) <= FLAT * max(abs(level), float(np.abs(p).max(initial=0.0)) ** 2)
    none = (square < 0) | (np.abs(below) <= FLAT * scale)
    return np.where(on, 0.0, np.where(none, np.nan, -C / np.where(below == 0, 1.0, below)))


def to_sphere(x: FloatArray, d: FloatArray, centre: FloatArray, on: FloatArray) -> FloatArray:
    """Find where lines meet a sphere; arguments and result as for `to_plane`, nan where they miss it."""
    return _to_quadric(x, d, centre, np.eye(3), float((on - centre) @ (on - centre)))


def to_cylinder(x: FloatArray, d: FloatArray, a: FloatArray, b: FloatArray, on: FloatArray) -> FloatArray:
    """Find where lines meet the cylinder of axis a-b through a point; nan where they miss it."""
    u = direction(a, b)
    Q = np.eye(3) - np.outer(u, u)
    return _to_quadric(x, d, a, Q, float((on - a) @ Q @ (on - a)))


def to_cone(x: FloatArray, d: FloatArray, apex: FloatArray, b: FloatArray, on: FloatArray) -> FloatArray:
    """Find where lines meet the cone of an apex, a second point of its axis and a point of it; nan where they miss it.

    Raises
    ------
    BadValue
        The point of the cone is level with its apex.
    """
    u = direction(apex, b)
    height = float((on - apex) @ u)
    if height == 0:
        raise BadValue("height of the cone", 0.0, "a point that is not level with the apex")
    across = np.eye(3) - np.outer(u, u)
    slope = float((on - apex) @ across @ (on - apex)) / height**2
    return _to_quadric(x, d, apex, across - slope * np.outer(u, u), 0.0)


def to_torus(
    x: FloatArray, d: FloatArray, centre: FloatArray, b: FloatArray, ring: FloatArray, on: FloatArray
) -> FloatArray:
    """Find where lines meet a torus.

    Parameters
    ----------
    x, d : (k, 3) float64, length
    centre, b, ring, on : (3,) float64, length
        Centre, second point of the axis, centre of a small circle, point of the torus.

    Returns
    -------
    (k,) float64
        As `to_plane`; the real root of smallest size of the quartic, by the eigenvalues of its companion.
    """
    u = direction(centre, b)
    R2, r2 = float((ring - centre) @ (ring - centre)), float((on - ring) @ (on - ring))
    length = np.sqrt(R2)
    p, v = (x - centre) / length, d / np.linalg.norm(d, axis=1, keepdims=True)
    slope, square = (p * v).sum(axis=1), (p * p).sum(axis=1)
    along, height = v @ u, p @ u
    gamma = square + 1 - r2 / R2
    # (t^2 + 2 s t + g)^2 = 4 (t^2 (1 - a^2) + 2 t (s - a h) + |p|^2 - h^2), lengths over the radius of the ring.
    quartic = np.stack(
        [
            4 * slope,
            4 * slope**2 + 2 * gamma - 4 * (1 - along**2),
            4 * slope * gamma - 8 * (slope - along * height),
            gamma**2 - 4 * (square - height**2),
        ],
        axis=1,
    )
    companion = np.zeros((len(x), 4, 4))
    companion[:, 0] = -quartic
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    roots = np.linalg.eigvals(companion)
    size = np.where(np.abs(roots.imag) <= 1e-7 * (1 + np.abs(roots)), np.abs(roots.real), np.inf)
    best = size.argmin(axis=1)
    t = np.where(np.isfinite(size.min(axis=1, initial=np.inf)), roots.real[np.arange(len(x)), best], np.nan)
    for _ in range(3):
        value = ((((t + quartic[:, 0]) * t + quartic[:, 1]) * t) + quartic[:, 2]) * t + quartic[:, 3]
        rate = ((4 * t + 3 * quartic[:, 0]) * t + 2 * quartic[:, 1]) * t + quartic[:, 2]
        t = t - value / np.where(np.abs(rate) <= FLAT, np.inf, rate)
    return np.asarray(t * length / np.linalg.norm(d, axis=1), np.float64)


def to_mesh(x: FloatArray, d: FloatArray, coords: FloatArray, blocks: Sequence[Block]) -> FloatArray:
    """Find where lines meet the elements of a mesh.

    Parameters
    ----------
    x, d : (k, dim) float64, length
    coords : (n_points, dim) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)
        Surfaces in space, or lines in the plane.

    Returns
    -------
    (k,) float64
        The t of smallest size with ``x + t d`` on an element; nan where the line meets none.

    Cost
    ----
    The product of the numbers of lines and elements, in parts of a million, to find the elements whose sphere the
    line crosses.
    """
    size = np.linalg.norm(d, axis=1)
    d = d / size[:, None]
    best = np.full(len(x), np.nan)
    for name, cells in blocks:
        X = coords[cells]
        centre = X.mean(axis=1)
        radius = np.linalg.norm(X - centre[:, None], axis=2).max(axis=1) * (1 + EDGE)
        step = max(1, 1_000_000 // max(len(cells), 1))
        for start in range(0, len(x), step):
            rows = slice(start, start + step)
            away = centre[None] - x[rows, None]
            along = np.einsum("kmi,ki->km", away, d[rows])
            near = (away * away).sum(axis=2) - along**2 <= radius**2
            line, element = np.nonzero(near)
            _meet(name, X[element], x[rows][line], d[rows][line], line + start, best)
    return np.asarray(best / size, np.float64)


def _meet(name: str, X: FloatArray, x: FloatArray, d: FloatArray, line: IntArray, best: FloatArray) -> None:
    """Solve for reference coordinates and place along the line together; improve the best place of each line."""
    kind = shape(name)
    if not len(X):
        return
    middle = kind.ref_nodes[: kind.n_corners].mean(axis=0)
    xi = np.repeat(middle[None], len(X), axis=0)
    t = ((X.mean(axis=1) - x) * d).sum(axis=1)
    XT = X.transpose(0, 2, 1)
    for _ in range(STEPS):
        gap = x + t[:, None] * d - np.matmul(XT, kind.N(xi)[:, :, None])[..., 0]
        step = solve_small(np.concatenate([np.matmul(XT, kind.dN(xi)), -d[:, :, None]], axis=2), gap)
        xi = np.clip(xi + step[:, :-1], middle - 10, middle + 10)
        t = t + step[:, -1]
        if np.abs(step).max() <= 1e-14:
            break
    size = np.linalg.norm(np.ptp(X, axis=1), axis=1)
    image = np.matmul(XT, kind.N(xi)[:, :, None])[..., 0]
    hit = (overshoot(name, xi) <= EDGE) & (np.linalg.norm(image - x - t[:, None] * d, axis=1) <= EDGE * size)
    order = np.flatnonzero(hit)[np.argsort(-np.abs(t[hit]), kind="stable")]
    # The last write counts: the place of smallest size comes last.
    found = np.full(len(best), np.nan)
    found[line[order]] = t[order]
    better = np.isfinite(found) & ~(np.abs(best) <= np.abs(found))
    best[better] = found[better]
