"""Degree and size of each element of the next mesh: the fewest unknowns for a prescribed error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.adapt.sizes import FLOOR, limit_growth, nodal_sizes
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.topology import Block

BoolArray = NDArray[np.bool_]

NODES = {
    "TRI3": 0.5, "TRI6": 2.0, "QUA4": 1.0, "QUA8": 3.0, "TET4": 0.18, "TE10": 1.36, "CUB8": 1.0, "CU20": 4.0,
}  # fmt: skip
"""Nodes per element of a large mesh: what an element costs."""

ROUNDS = 4
"""Times that degrees and sizes are planned, with the sizes that the last plan gave."""

LEFT_BY_DEGREE = 1 / 60
"""Share of the squared error that the second degree leaves, for elements as large as the slope of the stress varies."""

ROUND_OFF = 1e-10
"""Change of a stress over an element, in units of the largest, below which it is none."""

LEFT_AT_PEAK = 0.25
"""The same in elements that touch a singularity of order one half: p^(-4 lambda)."""


@dataclass(frozen=True, eq=False)
class Choices:
    """What each element may become: row 0 linear, row 1 quadratic.

    Attributes
    ----------
    error2 : (2, m) float64
        Squared errors at the sizes of now.
    order : (2, m) float64
        Orders of convergence.
    nodes : (2, m) float64
        Nodes per element, see `NODES`.
    allowed : (2, m) bool
        At least one of the two.
    """

    error2: FloatArray
    order: FloatArray
    nodes: FloatArray
    allowed: BoolArray


@dataclass(frozen=True, eq=False)
class Plan:
    """What to do with each element.

    Attributes
    ----------
    quadratic : (m,) bool
    ratios : (m,) float64
        New over old size.
    predicted : float
        Error of the whole expected then.
    nodes : float
        Nodes expected then.
    """

    quadratic: BoolArray
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
    return np.where(peak, LEFT_AT_PEAK, np.minimum(LEFT_BY_DEGREE * (size / length) ** 2, 1.0))


def plan(of: Choices, target: float, dim: int, largest: float | FloatArray = np.inf) -> Plan:
    """Choose the degree and the size of each element that give the prescribed error with the fewest nodes.

    Parameters
    ----------
    of : Choices
    target : float
        Error wanted of the whole.
    dim : int
    largest : float or (m,) float64
        Most that sizes may grow, as a ratio.

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
    the better of its two choices, ``r = (d c / (2 A q e^2))^(1/(2q+d))`` in both: linear with its error and order,
    quadratic with its own. The error falls as A grows, so that A is found by bisection; where elements change their
    choice the error jumps, and the plan stays below the target.
    """
    if not target > 0:
        raise BadValue("target", target, "target > 0")
    m = of.error2.shape[1]
    if not of.error2.any():
        now = of.allowed[1] & ~of.allowed[0]
        return Plan(now, np.ones(m), 0.0, float(np.where(now, of.nodes[1], of.nodes[0]).sum()))
    e2 = np.maximum(of.error2, FLOOR * of.error2[of.allowed].mean())

    def choice(log_a: float) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
        r = np.exp((np.log(dim * of.nodes / (2 * of.order * e2)) - log_a) / (2 * of.order + dim))
        r = np.minimum(r, largest)
        error, nodes = r ** (2 * of.order) * e2, of.nodes * r**-dim
        price = np.where(of.allowed, nodes + np.exp(log_a) * error, np.inf)
        quadratic = price[1] < price[0]
        r, error, nodes = (np.where(quadratic, each[1], each[0]) for each in (r, error, nodes))
        return r, error, nodes, quadratic

    middle = float(np.log(of.nodes.sum() / e2.sum()))
    low, high = middle - 80.0, middle + 80.0
    for _ in range(70):
        log_a = 0.5 * (low + high)
        low, high = (log_a, high) if choice(log_a)[1].sum() > target**2 else (low, log_a)
    r, error, nodes, quadratic = choice(high)
    return Plan(quadratic, r, float(np.sqrt(error.sum())), float(nodes.sum()))


def degree_map(
    points: FloatArray,
    blocks: Sequence[Block],
    size: FloatArray,
    of: Choices,
    target: float,
    *,
    growth: float = 2.0,
    pairs: IntArray | None = None,
) -> tuple[FloatArray, Plan]:
    """Bring the plan to the nodes, and plan again with the sizes that the neighbours let elements have.

    Parameters
    ----------
    points : (n, dim) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)
    size : (n_cells,) float64, length
        Sizes of now.
    of, target
        See `plan`.
    growth : float
        See `limit_growth`.
    pairs : (k, 2) int64, optional
        See `nodal_sizes`.

    Returns
    -------
    nodal : (n,) float64, length
        Sizes wanted.
    plan : Plan
        With the sizes that elements get from the nodes.

    Notes
    -----
    Beside small elements large ones are small too, and then quadratic ones cost more than they gain: the sizes that
    elements get bound the next plan, `ROUNDS` times. One factor on all sizes restores the error that means between
    neighbours change.
    """
    corner = topology.corner_blocks(blocks)
    dim = points.shape[1]
    edges = topology.edges(corner)
    links = edges if pairs is None else np.concatenate([edges, pairs])
    largest: FloatArray = np.full(len(size), np.inf)
    for _ in range(ROUNDS):
        found = plan(of, target, dim, largest)
        nodal = nodal_sizes(len(points), corner, found.ratios * size, pairs=pairs)
        nodal = limit_growth(points, links, nodal, growth)
        got = np.concatenate([np.exp(np.log(nodal[cells]).mean(axis=1)) for _, cells in corner]) / size
        row = found.quadratic.astype(np.int64)[None]
        order, error2, nodes = (np.take_along_axis(each, row, 0)[0] for each in (of.order, of.error2, of.nodes))
        predicted = float(np.sqrt((got ** (2 * order) * error2).sum()))
        final = Plan(found.quadratic, got, predicted, float((nodes * got**-dim).sum()))
        largest = np.where(got < found.ratios, got, np.inf)
    middles = topology.middles(blocks)
    nodal[middles[:, 2]] = nodal[middles[:, :2]].mean(axis=1)
    return nodal, final


def raise_only(
    error2: FloatArray, target: float, *, left: FloatArray, added: FloatArray, may_rise: BoolArray
) -> tuple[BoolArray, float]:
    """Raise the elements that gain most per node, until the error expected is met or none is left.

    Parameters
    ----------
    error2 : (m,) float64
    target : float
    left : (m,) float64
        See `left_by_degree`.
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
        inside = [on[cells[:, list(n)]].all(axis=1) for _, n in shape(name).faces]
        found.append(np.asarray(np.stack(inside, 1).any(axis=1), np.bool_))
    return np.concatenate(found)
