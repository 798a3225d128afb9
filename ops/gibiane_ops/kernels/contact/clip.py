"""Common parts of convex polygons, many pairs at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray

BoolArray = NDArray[np.bool_]


def clip(subject: FloatArray, window: FloatArray) -> tuple[FloatArray, IntArray]:
    """Cut convex polygons by convex windows, pair by pair.

    Parameters
    ----------
    subject : (k, n, 2) float64, length
        Counterclockwise.
    window : (k, m, 2) float64, length
        Counterclockwise; a repeated corner does no harm, so that triangles fit among quadrangles.

    Returns
    -------
    polygon : (k, n + m, 2) float64, length
        Common parts; what follows the last corner repeats it.
    count : (k,) int64
        Corners of each, 0 for an empty one.

    Source
    ------
    I. E. Sutherland, G. W. Hodgman, Comm. ACM 17, 1974.
    """
    polygon, count = subject, np.full(len(subject), subject.shape[1])
    for i in range(window.shape[1]):
        a, along = window[:, i], window[:, (i + 1) % window.shape[1]] - window[:, i]
        polygon, count = _cut(polygon, count, a, along)
    return polygon, count


def _cut(polygon: FloatArray, count: IntArray, a: FloatArray, along: FloatArray) -> tuple[FloatArray, IntArray]:
    """Keep the left of a line."""
    k, n = polygon.shape[:2]
    rest = polygon - a[:, None]
    height = along[:, None, 0] * rest[..., 1] - along[:, None, 1] * rest[..., 0]
    real = np.arange(n) < count[:, None]
    after = np.where(np.arange(n) + 1 < count[:, None], np.arange(n) + 1, 0)
    next_height = np.take_along_axis(height, after, axis=1)
    following = np.take_along_axis(polygon, after[..., None], axis=1)
    inside = real & (height >= 0)
    crossing = real & (height * next_height < 0)
    span = np.where(crossing, height - next_height, 1.0)
    cut = polygon + (height / span)[..., None] * (following - polygon)
    # each corner gives itself if inside, then the crossing of the side that follows it
    out = np.stack([polygon, cut], axis=2).reshape(k, 2 * n, 2)
    kept = np.stack([inside, crossing], axis=2).reshape(k, 2 * n)
    order = np.argsort(~kept, axis=1, kind="stable")[:, : n + 1]
    count = kept.sum(axis=1)
    last = np.minimum(np.arange(n + 1), np.maximum(count - 1, 0)[:, None])
    return np.take_along_axis(out, np.take_along_axis(order, last, axis=1)[..., None], axis=1), count


def fan(polygon: FloatArray, count: IntArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Cut convex polygons into triangles from their first corner.

    Parameters
    ----------
    polygon : (k, n, 2) float64, length
    count : (k,) int64

    Returns
    -------
    owner : (t,) int64
        Polygon of each triangle.
    triangle : (t, 3, 2) float64, length
    area : (t,) float64, length^2
        Positive; those without are left out.
    """
    n = polygon.shape[1]
    first = np.broadcast_to(polygon[:, None, 0], (len(polygon), n - 2, 2))
    every = np.stack([first, polygon[:, 1:-1], polygon[:, 2:]], axis=2)
    one, two = every[..., 1, :] - every[..., 0, :], every[..., 2, :] - every[..., 0, :]
    area = 0.5 * (one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0])
    kept = (np.arange(n - 2) + 2 < count[:, None]) & (area > 0)
    owner = np.nonzero(kept)[0]
    return owner, every[kept], area[kept]
