"""Degree and size of each element of the next mesh: the fewest unknowns for a prescribed error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.adapt.sizes import FLOOR
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.topology import Block

BoolArray = NDArray[np.bool_]

NODES = {
    "TRI3": 0.5, "TRI6": 2.0, "QUA4": 1.0, "QUA8": 3.0, "TET4": 0.18, "TE10": 1.36, "CUB8": 1.0, "CU20": 4.0,
}  # fmt: skip
"""Nodes per element of a large mesh: what an element costs."""

LEFT_BY_DEGREE = 1 / 60
"""Share of the squared error that the second degree leaves, for elements as large as the slope of the stress varies."""

LEFT_AT_PEAK = 0.25
"""The same in elements that touch a singularity of order one half: p^(-4 lambda)."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What to do with each element.

    Attributes
    ----------
    raised : (m,) bool
        Elements whose degree goes up.
    ratios : (m,) float64
        New over old size.
    predicted : float
        Error of the whole expected then.
    nodes : float
        Nodes expected then.
    """

    raised: BoolArray
    ratios: FloatArray
    predicted: float
    nodes: float


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
    first, second = [], []
    for (name, cells), weight in zip(topology.corner_blocks(blocks), weights, strict=True):
        of = shape(name)
        at = mean[cells]
        each, density = geometry.gradients(of, points[cells], of.gauss[0])
        curved = np.einsum("mqnd,mnce->mqcde", each, at)
        inside = np.einsum("qn,mnce->mqce", of.N(of.gauss[0]), at)
        weight = density * of.gauss[1]
        first.append((weight * (inside**2).sum(axis=(2, 3))).sum(axis=1))
        second.append((weight * (curved**2).sum(axis=(2, 3, 4))).sum(axis=1))
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
    return np.where(peak, LEFT_AT_PEAK, np.minimum(LEFT_BY_DEGREE * (size / length) ** 2, 1.0))


def plan(
    error2: FloatArray,
    target: float,
    *,
    order: FloatArray,
    raised_order: FloatArray,
    left: FloatArray,
    cost: FloatArray,
    raised_cost: FloatArray,
    may_rise: BoolArray,
    dim: int,
    largest: float = np.inf,
) -> Plan:
    """Choose the degree and the size of each element that give the prescribed error with the fewest nodes.

    Parameters
    ----------
    error2 : (m,) float64
        Squared errors.
    target : float
        Error wanted of the whole.
    order, raised_order : (m,) float64
        Order of convergence of each element as it is, and raised.
    left : (m,) float64
        Share of the squared error that raising leaves at the size of now, see `left_by_degree`.
    cost, raised_cost : (m,) float64
        Nodes per element, see `NODES`, as it is and raised.
    may_rise : (m,) bool
    dim : int
    largest : float
        Most that a size may grow, as a ratio.

    Returns
    -------
    Plan

    Raises
    ------
    BadValue
        When the target is not positive.

    Notes
    -----
    The sum of ``c r^-d`` is least under ``sum r^(2q) e^2 = target^2``. For a multiplier A each element takes alone
    the better of its two choices, ``r = (d c / (2 A q e^2))^(1/(2q+d))`` in both: linear elements with their error and
    order, quadratic ones with theirs. The error falls as A grows, so that A is found by bisection; where elements
    change their choice the error jumps, and the plan stays below the target.
    """
    if not target > 0:
        raise BadValue("target", target, "target > 0")
    if not error2.any():
        return Plan(np.zeros(len(error2), bool), np.ones(len(error2)), 0.0, float(cost.sum()))
    floored = np.maximum(error2, FLOOR * error2.mean())
    e2 = np.stack([floored, floored * np.maximum(left, FLOOR)])
    q, c = np.stack([order, raised_order]), np.stack([cost, raised_cost])

    def choice(log_a: float) -> tuple[FloatArray, FloatArray, BoolArray]:
        r = np.exp((np.log(dim * c / (2 * q * e2)) - log_a) / (2 * q + dim))
        r = np.minimum(r, largest)
        error, nodes = r ** (2 * q) * e2, c * r**-dim
        price = nodes + np.exp(log_a) * error
        rise = may_rise & (price[1] < price[0])
        pick = rise.astype(np.int64)[None]
        return (*(np.take_along_axis(each, pick, 0)[0] for each in (r, error)), rise)

    middle = float(np.log(cost.sum() / floored.sum()))
    low, high = middle - 80.0, middle + 80.0
    for _ in range(70):
        log_a = 0.5 * (low + high)
        if choice(log_a)[1].sum() > target**2:
            low = log_a
        else:
            high = log_a
    r, error, rise = choice(high)
    nodes = np.where(rise, raised_cost, cost) * r**-dim
    return Plan(rise, r, float(np.sqrt(error.sum())), float(nodes.sum()))


def raise_only(
    error2: FloatArray, target: float, *, left: FloatArray, added: FloatArray, may_rise: BoolArray
) -> tuple[BoolArray, float]:
    """Raise the elements that gain most per node, until the error expected is met or none is left.

    Parameters
    ----------
    error2 : (m,) float64
    target : float
    left : (m,) float64
        See `plan`.
    added : (m,) float64
        Nodes that raising an element adds.
    may_rise : (m,) bool

    Returns
    -------
    raised : (m,) bool
    predicted : float
        Error of the whole expected then.
    """
    gain = np.where(may_rise, error2 * (1 - left), 0.0)
    rate = gain / added
    ranked = np.argsort(-rate, kind="stable")
    ranked = ranked[rate[ranked] > 0]
    saved = np.cumsum(gain[ranked])
    needed = float(error2.sum()) - target**2
    enough = min(int(np.searchsorted(saved, needed)) + 1, len(ranked)) if needed > 0 else 0
    raised = np.zeros(len(error2), bool)
    raised[ranked[:enough]] = True
    return raised, float(np.sqrt(max(float(error2.sum() - gain[raised].sum()), 0.0)))


def with_facet_on(blocks: Sequence[Block], on: BoolArray) -> BoolArray:
    """Find the elements one of whose facets has all its corners among given nodes.

    Parameters
    ----------
    blocks : sequence of (str, (m, n_nodes) int64)
    on : (n,) bool

    Returns
    -------
    (n_cells,) bool
    """
    found: list[BoolArray] = []
    for name, cells in topology.corner_blocks(blocks):
        found.append(np.stack([on[cells[:, list(n)]].all(axis=1) for _, n in shape(name).faces], 1).any(axis=1))
    return np.concatenate(found)
