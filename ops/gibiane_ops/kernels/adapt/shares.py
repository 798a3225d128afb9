"""What the second degree leaves of the error of linear elements: predicted from a smoothed stress, or measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.topology import Block

BoolArray = NDArray[np.bool_]

LEFT_BY_DEGREE = 1 / 60
"""Share of the squared error that the second degree leaves, for elements as large as the slope of the stress varies."""

ROUND_OFF = 1e-10
"""Change of a stress over an element, in units of the largest, below which it is none."""

LEAST_LEFT = 1e-4
"""Least share: no prediction reaches further."""

LEFT_AT_PEAK = 0.25
"""The same in elements that touch a singularity of order one half: p^(-4 lambda)."""


def smoothness(points: FloatArray, blocks: Sequence[Block], stress: Sequence[FloatArray]) -> FloatArray:
    """Measure the length over which the slope of a stress varies around each element.

    Parameters
    ----------
    points : (n, dim) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)
    stress : sequence of (m, n_nodes, c) float64
        Smoothed stress at the nodes of each element.

    Returns
    -------
    (n_cells,) float64, length
        Root of the sum of |grad s|^2 over that of |grad grad s|^2, over the elements that share a node with it;
        infinite where the stress is linear.

    Notes
    -----
    The slope at a corner is the mean of those of its elements, weighted by their measures; second derivatives are the
    gradients of this field, linear in each element.
    """
    n = len(points)
    gradients, weights, slopes = [], [], []
    total = np.zeros(n)
    for (name, cells), values in zip(blocks, stress, strict=True):
        of = shape(name)
        each, density = geometry.gradients(of, points[cells], of.gauss[0])
        weight = density * of.gauss[1]
        gradients.append(each)
        weights.append(weight)
        slopes.append(np.einsum("mqnd,mnc->mqcd", each, values))
        np.add.at(total, cells[:, : of.n_corners], weight.sum(axis=1)[:, None])
    mean = np.zeros((n, *slopes[0].shape[2:]))
    for (name, cells), weight, slope in zip(blocks, weights, slopes, strict=True):
        integral = np.einsum("mq,mqcd->mcd", weight, slope)
        np.add.at(mean, cells[:, : shape(name).n_corners], integral[:, None])
    mean[total > 0] /= total[total > 0][:, None, None]
    highest = max(float(np.abs(values).max(initial=0.0)) for values in stress)
    first, second = [], []
    for (name, cells), weight in zip(topology.corner_blocks(blocks), weights, strict=True):
        of = shape(name)
        at = mean[cells]
        each, density = geometry.gradients(of, points[cells], of.gauss[0])
        curved = np.einsum("mqnd,mnce->mqcde", each, at)
        inside = np.einsum("qn,mnce->mqce", of.N(of.gauss[0]), at)
        weight = density * of.gauss[1]
        first.append((weight * (inside**2).sum(axis=(2, 3))).sum(axis=1))
        bend = (weight * (curved**2).sum(axis=(2, 3, 4))).sum(axis=1)
        measure = weight.sum(axis=1)
        # round-off of a linear stress is no curvature
        noise = ROUND_OFF**2 * highest**2 * measure ** (1 - 4 / of.dim)
        second.append(np.where(bend > noise, bend, 0.0))
    sums = [_over_stars(n, blocks, np.concatenate(each)) for each in (first, second)]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(sums[1] > 0, np.sqrt(sums[0] / sums[1]), np.inf), np.float64)


def _over_stars(n_points: int, blocks: Sequence[Block], values: FloatArray) -> FloatArray:
    """Add values over the elements of each node, then take the mean over the nodes of each element."""
    total = np.zeros(n_points)
    start = 0
    for _, cells in blocks:
        own = values[start : start + len(cells)]
        np.add.at(total, cells, own[:, None])
        start += len(cells)
    return np.concatenate([total[cells].mean(axis=1) for _, cells in blocks])


def left_by_degree(size: FloatArray, length: FloatArray, peak: BoolArray) -> FloatArray:
    """Predict the share of the squared error of linear elements that the second degree leaves.

    Parameters
    ----------
    size, length : (m,) float64, length
        Size of the elements, and `smoothness` around them.
    peak : (m,) bool
        Elements that touch a singularity.

    Returns
    -------
    (m,) float64
        At most 1: quadratic elements hold the linear ones.

    Notes
    -----
    ``h^2 |grad grad s|^2 / (60 |grad s|^2)``: on a segment the least distance of ``x^2 / 2`` to the linear functions
    is ``h^5 / 720``, that of ``x`` to the constants ``h^3 / 12``. Measured on smooth fields, 1/60 holds within a factor
    2 for triangles, squares, bricks, and on average for tetrahedra. At a singularity ``p^(-4 lambda)`` (Babuska and
    Suri 1987).
    """
    return np.where(peak, LEFT_AT_PEAK, np.clip(LEFT_BY_DEGREE * (size / length) ** 2, LEAST_LEFT, 1.0))


def left_measured(of: Shape, X: FloatArray, smooth: FloatArray, stress: FloatArray) -> FloatArray:
    """Measure the share of the squared error of linear elements that quadratic ones have left.

    Parameters
    ----------
    of : Shape
        Of second degree.
    X : (m, n_nodes, dim) float64, length
    smooth : (m, n_nodes, c) float64
        Smoothed stress at the nodes.
    stress : (m, n_points, c) float64
        Stress of the solution at the points of ``of.gauss``.

    Returns
    -------
    (m,) float64
        Between `LEAST_LEFT` and 1.

    Notes
    -----
    ``|s* - s|^2 / |s* - mean s*|^2``: the stress of a linear simplex is constant, at best the mean.
    """
    xi, weights = of.gauss
    weight = geometry.measure_densities(of, X, xi) * weights
    at = np.matmul(of.N(xi), smooth)
    mean = np.einsum("mq,mqc->mc", weight, at) / weight.sum(axis=1)[:, None]
    own = (weight * ((at - stress) ** 2).sum(axis=2)).sum(axis=1)
    whole = (weight * ((at - mean[:, None]) ** 2).sum(axis=2)).sum(axis=1)
    share = np.divide(own, whole, out=np.ones_like(own), where=whole > 0)
    return np.asarray(np.clip(share, LEAST_LEFT, 1.0), np.float64)
