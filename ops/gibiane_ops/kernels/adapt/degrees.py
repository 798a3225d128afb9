"""Divide or raise the degree: what each element gains per unknown, and which elements suffice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.topology import Block

BoolArray = NDArray[np.bool_]

ADDED = {"TRI3": 3.0, "QUA4": 2.0, "TET4": 7.0, "CUB8": 3.0}
"""Nodes that mid-nodes add to those of a linear mesh, as a multiple: a large mesh has so many edges per node."""

LAYERS = 2
"""Layers of elements around a singular node that stay linear."""

MOST_HALVINGS = 3
"""How many times the size of an element is halved at once: further predictions mean little."""

ENOUGH = 0.8
"""Share of the possible gain that is taken when the target is out of reach of one change of the mesh."""

SLACK = 0.2
"""How far below the degree the order of an element may be for its degree to be raised."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What to do with each element.

    Attributes
    ----------
    raised : (m,) bool
        Elements whose degree goes up.
    halvings : (m,) int64
        How many times the size of an element is halved.
    predicted : float
        Error of the whole expected then.
    """

    raised: BoolArray
    halvings: IntArray
    predicted: float


def smoothness(points: FloatArray, blocks: Sequence[Block], stress: Sequence[FloatArray]) -> FloatArray:
    """Measure the length over which a smooth stress varies around each element.

    Parameters
    ----------
    points : (n, dim) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)
    stress : sequence of (m, n_nodes, c) float64
        Smoothed stress at the nodes of each element.

    Returns
    -------
    (n_cells,) float64, length
        Root of the sum of |s|^2 over that of |grad s|^2, over the elements that share a node with it; infinite where
        the stress is constant.
    """
    size, slope = [], []
    for (name, cells), values in zip(blocks, stress, strict=True):
        of = shape(name)
        xi, weights = of.gauss
        X = points[cells]
        gradients, density = geometry.gradients(of, X, xi)
        weight = density * weights
        at = np.einsum("qn,mnc->mqc", of.N(xi), values)
        grad = np.einsum("mqnd,mnc->mqcd", gradients, values)
        size.append((weight * (at**2).sum(axis=2)).sum(axis=1))
        slope.append((weight * (grad**2).sum(axis=(2, 3))).sum(axis=1))
    sums = [_over_stars(len(points), blocks, np.concatenate(each)) for each in (size, slope)]
    with np.errstate(divide="ignore"):
        return np.asarray(np.sqrt(sums[0] / sums[1]), np.float64)


def _over_stars(n_points: int, blocks: Sequence[Block], values: FloatArray) -> FloatArray:
    """Add values over the elements of each node, then take the mean over the nodes of each element."""
    total = np.zeros(n_points)
    start = 0
    for _, cells in blocks:
        own = values[start : start + len(cells)]
        np.add.at(total, cells, own[:, None])
        start += len(cells)
    return np.concatenate([total[cells].mean(axis=1) for _, cells in blocks])


def near_singular(n_points: int, blocks: Sequence[Block], singular: BoolArray, layers: int = LAYERS) -> BoolArray:
    """Add layers of neighbours to marked elements.

    Parameters
    ----------
    n_points : int
    blocks : sequence of (str, (m, n_nodes) int64)
    singular : (n_cells,) bool
    layers : int

    Returns
    -------
    (n_cells,) bool
    """
    corner = topology.corner_blocks(blocks)
    result = singular.copy()
    for _ in range(layers):
        node = np.zeros(n_points, bool)
        start = 0
        for _, cells in corner:
            node[cells[result[start : start + len(cells)]]] = True
            start += len(cells)
        result = np.concatenate([node[cells].any(axis=1) for _, cells in corner])
    return result


def plan(
    error2: FloatArray,
    target: float,
    *,
    order: FloatArray,
    may_rise: BoolArray,
    ratio: FloatArray,
    added: FloatArray,
    dim: int,
    may_halve: bool = True,
) -> Plan:
    """Choose the elements to divide and to raise, the most profitable first, until the error expected is met.

    Parameters
    ----------
    error2 : (m,) float64
        Squared errors.
    target : float
        Error wanted of the whole.
    order : (m,) float64
        Order of convergence of each element.
    may_rise : (m,) bool
        Linear elements away from singularities.
    ratio : (m,) float64
        Size over the length over which the stress varies, see `smoothness`.
    added : (m,) float64
        Unknowns that raising adds, in those of the element, see `ADDED`; dividing adds ``2^dim - 1``.
    dim : int
    may_halve : bool

    Returns
    -------
    Plan

    Notes
    -----
    Halving leaves ``e^2 2^(-2q)`` and each further time that share again, at 2^dim times the unknowns; raising leaves
    ``e^2 (h/L)^2``; gains are divided by the unknowns added. When all that may be done does not meet the target, the
    most profitable part of it is done that brings `ENOUGH` of its gain.
    """
    split = 2.0**dim
    left_h = 2.0 ** (-2 * order)
    left_p = np.where(may_rise, np.minimum(ratio**2, 1.0), 1.0)
    times = np.arange(MOST_HALVINGS if may_halve else 0)
    gain_h = error2[:, None] * left_h[:, None] ** times * (1 - left_h[:, None])
    rate_h = gain_h / ((split - 1) * split**times)
    gain_p = error2 * (1 - left_p)
    rate_p = gain_p / added
    rise = rate_p > rate_h[:, :1].max(axis=1, initial=0.0)
    gain = np.where(rise[:, None], 0.0, gain_h)
    rate = np.where(rise[:, None], 0.0, rate_h)
    gain = np.column_stack([np.where(rise, gain_p, 0.0), gain])
    rate = np.column_stack([np.where(rise, rate_p, 0.0), rate]).ravel()
    ranked = np.argsort(-rate, kind="stable")
    ranked = ranked[rate[ranked] > 0]
    saved = np.cumsum(gain.ravel()[ranked])
    needed = error2.sum() - target**2
    if len(saved) and saved[-1] < needed:
        needed = ENOUGH * saved[-1]
    enough = int(np.searchsorted(saved, needed)) + 1 if needed > 0 else 0
    picked = np.zeros(gain.size, bool)
    picked[ranked[:enough]] = True
    chosen = picked.reshape(gain.shape)
    remaining = max(float(error2.sum() - gain[chosen].sum()), 0.0)
    return Plan(chosen[:, 0], chosen[:, 1:].sum(axis=1), float(np.sqrt(remaining)))
