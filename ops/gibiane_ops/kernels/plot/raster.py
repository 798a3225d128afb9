"""Exact hidden surfaces: triangles to pixels with a depth buffer, in numpy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.plot.camera import FloatArray

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

CHUNK = 1 << 20
"""Pixels handled at once; bounds the memory to some tens of megabytes."""


@dataclass(frozen=True)
class Hits:
    """The nearest triangle at each pixel.

    Attributes
    ----------
    triangle : (height, width) int64
        Row 0 is the bottom one; -1 where nothing is seen.
    depth : (height, width) float64, length
        Towards the eye; minus infinity where nothing is seen.
    """

    triangle: IntArray
    depth: FloatArray


def barycentric(xy: FloatArray) -> FloatArray:
    """Compute the coefficients of the barycentric coordinates of triangles.

    Parameters
    ----------
    xy : (n_triangles, 3, 2) float64
        Corners in pixels.

    Returns
    -------
    (n_triangles, 3, 3) float64
        Coordinate k at (x, y) is ``c[k, 0] x + c[k, 1] y + c[k, 2]``; all zero for a triangle seen edge-on.
    """
    after, last = np.roll(xy, -1, axis=1), np.roll(xy, -2, axis=1)
    coefficients = np.stack(
        [
            after[..., 1] - last[..., 1],
            last[..., 0] - after[..., 0],
            after[..., 0] * last[..., 1] - last[..., 0] * after[..., 1],
        ],
        axis=2,
    )
    double_area = coefficients[..., 2].sum(axis=1)
    seen = np.abs(double_area) > 1e-9
    inverse = np.where(seen, 1.0, 0.0) / np.where(seen, double_area, 1.0)
    return coefficients * inverse[:, None, None]


def rasterize(xy: FloatArray, depth: FloatArray, width: int, height: int) -> Hits:
    """Find the triangle nearest to the eye at the centre of each pixel.

    Parameters
    ----------
    xy : (n_triangles, 3, 2) float64
        Corners in pixels.
    depth : (n_triangles, 3) float64, length
        Of the corners, towards the eye.
    width, height : int
        Size of the image.

    Returns
    -------
    Hits

    Notes
    -----
    Triangles are cut into rows of pixels; the depth is linear in a row. Of two triangles at the same depth the later
    wins.

    Cost
    ----
    Proportional to the area of the triangles in pixels, some tens of nanoseconds for each pixel.
    """
    triangle = np.full(width * height, -1, np.int64)
    nearest = np.full(width * height, -np.inf)
    coefficients = barycentric(xy)
    plane = np.einsum("tk,tki->ti", depth, coefficients)
    for owner, row, first, count in _spans(xy, coefficients, width, height):
        start = row * width + first
        pixel = np.arange(count.sum()) + np.repeat(start - np.cumsum(count) + count, count)
        at_first = plane[owner, 0] * (first + 0.5) + plane[owner, 1] * (row + 0.5) + plane[owner, 2]
        slope = plane[owner, 0]
        z = np.repeat(at_first - slope * start, count) + np.repeat(slope, count) * pixel
        np.maximum.at(nearest, pixel, z)
        wins = z >= nearest[pixel]
        triangle[pixel[wins]] = np.repeat(owner, count)[wins]
    return Hits(triangle.reshape(height, width), nearest.reshape(height, width))


def _spans(
    xy: FloatArray, coefficients: FloatArray, width: int, height: int
) -> Iterator[tuple[IntArray, IntArray, IntArray, IntArray]]:
    """Enumerate the rows of pixels of the triangles by chunks: triangle, row, first column, number of pixels."""
    seen = np.abs(coefficients).max(axis=(1, 2)) > 0.0
    low = np.clip(np.ceil(xy[..., 1].min(axis=1) - 0.5).astype(np.int64), 0, height)
    high = np.clip(np.floor(xy[..., 1].max(axis=1) + 0.5).astype(np.int64), 0, height)
    rows = np.where(seen, np.maximum(high - low, 0), 0)
    owner = np.repeat(np.arange(len(xy)), rows)
    row = np.arange(len(owner)) - np.repeat(np.cumsum(rows) - rows, rows) + low[owner]
    c = coefficients[owner]
    constant = c[..., 1] * (row + 0.5)[:, None] + c[..., 2]
    along = c[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        bound = -constant / along
    outside = ((along == 0.0) & (constant < 0.0)).any(axis=1)
    left = np.where(along > 0.0, bound, -np.inf).max(axis=1)
    right = np.where(along < 0.0, bound, np.inf).min(axis=1)
    # centres on a side belong to both neighbours, else rounding could leave holes between them
    first = np.clip(np.ceil(left - 0.5 - 1e-9), 0, width).astype(np.int64)
    last = np.clip(np.floor(right - 0.5 + 1e-9), -1, width - 1).astype(np.int64)
    count = np.where(outside, 0, np.maximum(last - first + 1, 0))
    kept = np.flatnonzero(count)
    ends = np.cumsum(count[kept])
    cuts = np.searchsorted(ends, np.arange(CHUNK, ends[-1] if len(ends) else 0, CHUNK))
    for some in np.split(kept, cuts):
        if len(some):
            yield owner[some], row[some], first[some], count[some]


def visible_runs(
    start: FloatArray, end: FloatArray, depth: FloatArray, slack: float, step: float = 2.0
) -> tuple[FloatArray, FloatArray]:
    """Cut segments to the parts that no surface hides.

    Parameters
    ----------
    start, end : (n_segments, 3) float64
        Ends: column, row (pixels) and depth (length, towards the eye).
    depth : (height, width) float64, length
        Depth buffer, minus infinity where nothing is seen.
    slack : float, length
        A segment is seen when it is at most that far behind the surface.
    step : float
        Length of a tested piece in pixels.

    Returns
    -------
    (n_runs, 2) float64, (n_runs, 2) float64
        Both ends of the visible parts, in pixels.
    """
    pieces = np.maximum(1, np.ceil(np.linalg.norm((end - start)[:, :2], axis=1) / step)).astype(np.int64)
    owner = np.repeat(np.arange(len(start)), pieces)
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    middle = start[owner] + (end - start)[owner] * ((rank + 0.5) / pieces[owner])[:, None]
    height, width = depth.shape
    column = np.clip(middle[:, 0].astype(np.int64), 0, width - 1)
    row = np.clip(middle[:, 1].astype(np.int64), 0, height - 1)
    seen = middle[:, 2] >= depth[row, column] - slack
    new_segment = np.r_[True, owner[1:] != owner[:-1], True]
    opens = seen & (new_segment[:-1] | ~np.r_[False, seen[:-1]])
    closes = seen & (new_segment[1:] | ~np.r_[seen[1:], False])
    first, last = np.flatnonzero(opens), np.flatnonzero(closes)

    def at(piece: IntArray, shift: int) -> FloatArray:
        along = (rank[piece] + shift) / pieces[owner[piece]]
        ends: FloatArray = (start[owner[piece]] + (end - start)[owner[piece]] * along[:, None])[:, :2]
        return ends

    return at(first, 0), at(last, 1)
