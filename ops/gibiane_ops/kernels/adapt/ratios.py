"""Ratios of sizes, new over old, of the elements of the coarsest mesh expected to meet a prescribed error."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import NotConverged

FLOOR = 1e-12
"""Smallest squared error of an element, in units of the mean: an element without error still has a size."""


def uniform_order_ratios(error2: FloatArray, target: float, order: float, dim: int) -> FloatArray:
    """Find the ratios of sizes, new over old, when the whole solution converges with one order.

    Parameters
    ----------
    error2 : (m,) float64
        Squared error of each element.
    target : float
        Prescribed error: the new squares add up to ``target^2``.
    order : float
        An element of error e gets ``e r^order``.
    dim : int

    Returns
    -------
    (m,) float64
        ``r_E = target^(1/q) / (e_E^(2/(2q+d)) (sum e_E^(2d/(2q+d)))^(1/(2q)))``.

    Notes
    -----
    Fewest elements, ``sum r_E^-d`` least, under ``sum r_E^(2q) e_E^2 = target^2``.

    Source
    ------
    Coorevits, Ladeveze and Pelle 1995.
    """
    e2 = _floored(error2)
    power = 1 / (2 * order + dim)
    return np.asarray(target ** (1 / order) / (e2**power * (e2 ** (dim * power)).sum() ** (1 / (2 * order))))


def ratios_by_order(
    error2: FloatArray, target: float, orders: FloatArray, dim: int, *, equal: bool = False
) -> FloatArray:
    """Find the ratios of sizes, new over old, when each element has its own order of convergence.

    Parameters
    ----------
    error2 : (m,) float64
    target : float
    orders : (m,) float64
        Positive.
    dim : int
    equal : bool
        Ask for one error on all new elements instead of the fewest elements: q_E goes from under the fraction. The two
        agree where the orders are the same.

    Returns
    -------
    (m,) float64
        ``r_E = (d / (2 A q_E e_E^2))^(1/(2 q_E + d))``, A such that ``sum r_E^(2 q_E) e_E^2 = target^2``.

    Raises
    ------
    NotConverged
        When the root is not found; not expected.

    Notes
    -----
    In log A the logarithm of the sum is convex and decreasing: Newton converges from anywhere.

    Source
    ------
    Coorevits, Ladeveze and Pelle 1994 (orders by element near singularities); the thesis, (2.68) and (2.69).
    """
    e2 = _floored(error2)
    power = 1 / (2 * orders + dim)
    log_ratio = power * (np.log(dim / (2 * (1.0 if equal else orders))) - np.log(e2))  # with A = 1
    log_A, history = 0.0, []
    for _ in range(100):
        terms = 2 * orders * (log_ratio - power * log_A) + np.log(e2)
        top = terms.max()
        weights = np.exp(terms - top)
        excess = top + np.log(weights.sum()) - 2 * np.log(target)
        history.append(abs(float(excess)))
        if history[-1] <= 1e-14 * max(1.0, abs(2 * np.log(target))):
            break
        log_A += float(excess / ((weights * 2 * orders * power).sum() / weights.sum()))
    if history[-1] > 1e-12:
        raise NotConverged(history)
    return np.asarray(np.exp(log_ratio - power * log_A), np.float64)


def _floored(error2: FloatArray) -> FloatArray:
    """Replace vanishing errors by a tiny share of the mean."""
    return np.asarray(np.maximum(error2, FLOOR * error2.mean()), np.float64)
