"""Distances of points to simple surfaces and lines, and nodes that are close to one another."""

from __future__ import annotations

import functools

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.mesh.arcs import distance_to_axis
from gibiane_ops.kernels.mesh.transforms import direction, normal_of

CROWD = 40
"""Points in one cell of the grid above which `close_pairs` makes the cells smaller."""


def to_line(points: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distances to the line through two points; all arrays (., 3), length."""
    return distance_to_axis(points, a, b)


def to_plane(points: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return the distances to the plane through three points; all arrays (., 3), length."""
    return np.asarray(np.abs((points - a) @ normal_of(a, b, c)), np.float64)


def to_sphere(points: FloatArray, centre: FloatArray, on: FloatArray) -> FloatArray:
    """Return the distances to the sphere of given centre through a point; all arrays (., 3), length."""
    return np.asarray(np.abs(np.linalg.norm(points - centre, axis=1) - np.linalg.norm(on - centre)), np.float64)


def to_cylinder(points: FloatArray, a: FloatArray, b: FloatArray, on: FloatArray) -> FloatArray:
    """Return the distances to the cylinder of axis a-b through a point; all arrays (., 3), length."""
    return np.asarray(np.abs(distance_to_axis(points, a, b) - distance_to_axis(on[None], a, b)[0]), np.float64)


def to_cone(points: FloatArray, apex: FloatArray, b: FloatArray, on: FloatArray) -> FloatArray:
    """Return the distances to the cone of given apex and axis through a point.

    Parameters
    ----------
    points : (k, 3) float64, length
    apex, b, on : (3,) float64, length
        The apex, a second point of the axis, a point of the cone.

    Returns
    -------
    (k,) float64, length
        To the whole cone, both nappes.

    Raises
    ------
    BadValue
        The apex and b coincide, or the apex and the point of the cone.
    """
    u = direction(apex, b)
    side = direction(apex, on, "side of the cone")
    cosine = abs(float(side @ u))
    sine = float(np.sqrt(max(0.0, 1.0 - cosine * cosine)))
    along = np.abs((points - apex) @ u)
    away = distance_to_axis(points, apex, b)
    inside = along * cosine + away * sine
    # Behind the apex, the apex itself is the nearest point of the cone.
    return np.asarray(np.where(inside < 0, np.hypot(along, away), np.abs(away * cosine - along * sine)), np.float64)


def to_torus(points: FloatArray, centre: FloatArray, b: FloatArray, small: FloatArray, on: FloatArray) -> FloatArray:
    """Return the distances to a torus.

    Parameters
    ----------
    points : (k, 3) float64, length
    centre, b : (3,) float64, length
        Centre and second point of the axis.
    small, on : (3,) float64, length
        Centre of a small circle, and a point of the torus.

    Returns
    -------
    (k,) float64, length
    """
    u = direction(centre, b)
    large = float(distance_to_axis(small[None], centre, b)[0])

    def from_ring(x: FloatArray) -> FloatArray:
        return np.asarray(np.hypot((x - centre) @ u, distance_to_axis(x, centre, b) - large), np.float64)

    return np.asarray(np.abs(from_ring(points) - from_ring(on[None])[0]), np.float64)


def nearest(points: FloatArray, target: FloatArray) -> int:
    """Return the row of the point nearest to a target; the first among equals.

    Parameters
    ----------
    points : (k, 3) float64, length
    target : (3,) float64, length

    Returns
    -------
    int
    """
    return int(np.linalg.norm(points - target, axis=1).argmin())


def close_pairs(points: FloatArray, tolerance: float) -> IntArray:
    """Find the points of one set that are close to one another.

    Parameters
    ----------
    points : (k, 3) float64, length
    tolerance : float, length

    Returns
    -------
    (p, 2) int64
        Pairs of rows, the smaller first, sorted.

    Raises
    ------
    BadValue
        The tolerance is negative.

    Cost
    ----
    One sort of the points, by the cells of a grid.
    """
    if tolerance < 0:
        raise BadValue("distance", tolerance, "distance >= 0")
    if len(points) < 2:
        return np.zeros((0, 2), np.int64)
    low = np.array([column.min() for column in points.T])
    size = np.array([column.max() for column in points.T]) - low
    wide = size[size > 0]
    # about one point a cell, more where they stand on surfaces: then the cells become smaller
    cell = float((np.prod(wide / wide.max()) / len(points)) ** (1 / len(wide)) * wide.max()) if len(wide) else 0.0
    for _ in range(6):
        if cell < 8 * tolerance or not cell > 0 or float(np.log2(size / cell + 3).sum()) > 62:
            break
        found = _pairs_in_cells(points, (points - low) / cell, tolerance, tolerance / cell, size / cell)
        if found is not None:
            return found
        cell /= 4
    from scipy.spatial import cKDTree

    pairs = np.asarray(cKDTree(points).query_pairs(tolerance, output_type="ndarray"), np.int64).reshape(-1, 2)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def _pairs_in_cells(
    points: FloatArray, place: FloatArray, tolerance: float, margin: float, size: FloatArray
) -> IntArray | None:
    """Find close pairs among the points of each cell of a grid; None when a cell holds too many.

    `place` and `size` are coordinates and extents counted in cells; a point nearer than `margin` to the border of its
    cell stands in the neighbours too.
    """
    # twice the margin: round-off in `place` must not lose a pair
    last = np.floor(place + 2 * margin)
    border = np.flatnonzero(functools.reduce(np.logical_or, (place - 2 * margin < last).T))
    last = last.astype(np.int64) + 1
    count = (size + 3).astype(np.int64)
    step = np.r_[1, np.cumprod(count[:-1])]
    keys, rows = [_dot(last, step)], [np.arange(len(points))]
    high, low = last[border], np.floor(place[border] - 2 * margin).astype(np.int64) + 1
    for corner in range(1, 2 ** points.shape[1]):
        side = np.array([(corner >> i) & 1 for i in range(points.shape[1])], bool)
        moved = np.flatnonzero((low != high)[:, side].all(axis=1))
        keys.append(_dot(np.where(side, low[moved], high[moved]), step))
        rows.append(border[moved])
    key, row = _sorted_together(np.concatenate(keys), np.concatenate(rows))
    if len(key) > CROWD and (key[CROWD:] == key[:-CROWD]).any():
        return None
    found = []
    for shift in range(1, CROWD + 1):
        near = np.flatnonzero(key[shift:] == key[:-shift])
        if not len(near):
            break
        a, b = row[near], row[near + shift]
        gap = points[a] - points[b]
        close = np.einsum("ij,ij->i", gap, gap) <= tolerance**2
        found.append(np.minimum(a, b)[close] * len(points) + np.maximum(a, b)[close])
    code = np.sort(np.concatenate([np.zeros(0, np.int64), *found]))
    code = code[np.r_[True, code[1:] != code[:-1]][: len(code)]]
    return np.stack(np.divmod(code, len(points)), axis=1)


def _dot(rows: IntArray, step: IntArray) -> IntArray:
    """Multiply integer rows by a vector; no package does it faster than column by column."""
    return functools.reduce(np.add, [column * s for column, s in zip(rows.T, step, strict=True)])


def _sorted_together(key: IntArray, row: IntArray) -> tuple[IntArray, IntArray]:
    """Sort keys, not negative, with their rows; in one integer where both fit, which sorts several times faster."""
    bits = int(row.max()).bit_length()
    if int(key.max()).bit_length() + bits > 62:
        order = np.argsort(key)
        return key[order], row[order]
    both = np.sort((key << bits) | row)
    return both >> bits, both & ((1 << bits) - 1)


def facing_pairs(first: FloatArray, second: FloatArray, tolerance: float) -> IntArray:
    """Find for each point of a second set the nearest of a first one, if it is close.

    Parameters
    ----------
    first : (k, 3) float64, length
    second : (m, 3) float64, length
    tolerance : float, length

    Returns
    -------
    (p, 2) int64
        Row in `first`, row in `second`.

    Raises
    ------
    BadValue
        The tolerance is negative.
    """
    from scipy.spatial import cKDTree

    if tolerance < 0:
        raise BadValue("distance", tolerance, "distance >= 0")
    if len(first) == 0 or len(second) == 0:
        return np.zeros((0, 2), np.int64)
    distance, row = cKDTree(first).query(second)
    kept = np.flatnonzero(distance <= tolerance)
    return np.stack([row[kept], kept], axis=1).astype(np.int64)
