"""Degree and size of each element of the next mesh: the fewest unknowns for a prescribed error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane_ops.kernels import topology
from gibiane_ops.kernels.adapt.ratios import FLOOR
from gibiane_ops.kernels.adapt.sizes import SizeMap, size_map
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.topology import Block

BoolArray = NDArray[np.bool_]

NODES = {
    "TRI3": 0.5, "TRI6": 2.0, "QUA4": 1.0, "QUA8": 3.0, "TET4": 0.18, "TE10": 1.36, "CUB8": 1.0, "CU20": 4.0,
}  # fmt: skip
"""Nodes per element of a large mesh: what an element costs."""

DOUBT = 4.0
"""Factor on the squared errors of linear elements in the choice: beside them quadratic ones lose mid-nodes, and what is
known of them is the least error that they can have. Measured: with 1 hp needed as many nodes as before the choice on
the L-shaped plate, and 4 % more on the footing."""


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


def plan(
    of: Choices, target: float, dim: int, largest: float | FloatArray = np.inf, around: sp.csr_array | None = None
) -> Plan:
    """Choose the degree and the size of each element that give the prescribed error with the fewest nodes.

    Parameters
    ----------
    of : Choices
    target : float
        Error wanted of the whole.
    dim : int
    largest : float or (m,) float64
        Most that sizes may grow, as a ratio.
    around : (m, m) csr_array, optional
        Mean over neighbours of what the second degree saves, before elements choose.

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
        price = nodes + np.exp(log_a) * error
        both = of.allowed.all(axis=0)
        saved = np.where(both, price[0] - price[1], 0.0)
        quadratic = np.where(both, (saved if around is None else around @ saved) > 0, of.allowed[1])
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
    of: Choices,
    target: float,
    *,
    pairs: IntArray | None = None,
    max_count: float | None = None,
) -> tuple[SizeMap, BoolArray]:
    """Choose the degree of each element, then the sizes of the coarsest mesh of these degrees.

    Parameters
    ----------
    points : (n, dim) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)
    of, target
        See `plan`.
    pairs
        See `size_map`.
    max_count : float, optional
        Elements at most.

    Returns
    -------
    sizes : SizeMap
        Its `reachable` is what the number of elements allows.
    quadratic : (m,) bool

    Raises
    ------
    BadValue
        When the target or the number of elements is not positive.

    Notes
    -----
    The choice supposes that elements do not grow (those of the first mesh cannot), takes the errors of linear elements
    for `DOUBT` times what they are, and averages over the stars of the nodes what the second degree saves: a lone
    element gains nothing. Sizes follow from the errors and orders of the degrees chosen, as without a choice.
    """
    corner = topology.corner_blocks(blocks)
    if max_count is not None and not max_count > 0:
        raise BadValue("largest number of elements", max_count, "a positive number")
    doubted = replace(of, error2=of.error2 * np.array([[DOUBT], [1.0]]))
    found = plan(doubted, target, points.shape[1], largest=1.0, around=_star_mean(len(points), corner))
    row = found.quadratic.astype(np.int64)[None]
    order, error2 = (np.take_along_axis(each, row, 0)[0] for each in (of.order, of.error2))
    sizes = size_map(points, blocks, np.sqrt(error2), target, order=order, pairs=pairs)
    if max_count is not None and sizes.count > max_count:
        wider = (sizes.count / max_count) ** (1 / points.shape[1])
        expected = float(np.sqrt((error2 * (wider * sizes.ratios) ** (2 * order)).sum()))
        sizes = replace(sizes, nodal=wider * sizes.nodal, count=float(max_count), reachable=expected)
    return sizes, found.quadratic


def _star_mean(n_points: int, blocks: Sequence[Block]) -> sp.csr_array:
    """Give the mean over the nodes of each element of the means over the elements of each node, (m, m)."""
    row, column, start = [], [], 0
    for _, cells in blocks:
        row.append(np.repeat(start + np.arange(len(cells)), cells.shape[1]))
        column.append(cells.ravel())
        start += len(cells)
    entries = (np.ones(sum(map(len, row))), (np.concatenate(row), np.concatenate(column)))
    member = sp.csr_array(entries, shape=(start, n_points))

    def averaged(matrix: sp.csr_array) -> sp.csr_array:
        return sp.csr_array(sp.diags_array(1 / np.maximum(matrix.sum(axis=1), 1.0)) @ matrix)

    return sp.csr_array(averaged(member) @ averaged(sp.csr_array(member.T)))


def raise_only(
    error2: FloatArray, target: float, *, left: FloatArray, added: FloatArray, may_rise: BoolArray
) -> tuple[BoolArray, float]:
    """Raise the elements that gain most per node, until the error expected is met or none is left.

    Parameters
    ----------
    error2 : (m,) float64
    target : float
    left : (m,) float64
        See `shares.left_by_degree`.
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
