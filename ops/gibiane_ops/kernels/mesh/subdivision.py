"""How many elements a line gets, and where its nodes stand, from the sizes wanted at its two ends."""

from __future__ import annotations

import math

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue

# Two sizes closer than this make a line of equal elements.
EQUAL = 1e-5


def growth(length: float, start: float, end: float) -> float:
    """Compute the ratio of the sizes of neighbouring elements.

    Parameters
    ----------
    length : float, length
    start, end : float, length
        Sizes wanted at the two ends.

    Returns
    -------
    float
        ``exp(2 asinh((d2 - d1) / 2))`` with d the sizes divided by the length: the geometric progression whose
        middle slope is that of the sizes along the line.
    """
    return math.exp(2.0 * math.asinh((end - start) / (2.0 * length)))


def count_elements(length: float, start: float, end: float) -> int:
    """Choose the number of elements of a line.

    Parameters
    ----------
    length : float, length
    start, end : float, length
        Sizes wanted at the two ends, positive.

    Returns
    -------
    int
        At least 1: the integer nearest, in ratio, to the real number x for which x elements in progression have the
        sizes wanted.
    """
    ratio = growth(length, start, end)
    exact = length / start if abs(ratio - 1.0) <= EQUAL else math.log(end / start) / math.log(ratio)
    count = max(1, int(exact))
    return count + 1 if exact / count > (count + 1) / exact else count


def abscissas(length: float, start: float, end: float, count: int | None = None) -> FloatArray:
    """Place the nodes of a line.

    Parameters
    ----------
    length : float, length
    start, end : float, length
        Sizes wanted at the two ends; not used when `count` is positive.
    count : int, optional
        Positive: that many equal elements. Negative: that many elements in progression. None or 0: as many as the
        sizes ask for.

    Returns
    -------
    (n + 1,) float64
        Positions divided by the length, from 0 to 1.

    Raises
    ------
    BadValue
        A size that is not positive is needed, or the length is not.
    """
    if not length > 0:
        raise BadValue("length", length, "length > 0")
    if count is not None and count > 0:
        return np.linspace(0.0, 1.0, count + 1)
    for size in (start, end):
        if not size > 0:
            raise BadValue("density", size, "density > 0")
    n = abs(count) if count else count_elements(length, start, end)
    ratio = growth(length, start, end)
    if abs(ratio - 1.0) <= EQUAL:
        return np.linspace(0.0, 1.0, n + 1)
    # (1 - r^k) / (1 - r^n), written so that neither overflows nor cancels.
    steps = np.arange(n + 1) * math.log(ratio)
    if ratio > 1.0:
        steps = steps - steps[-1]
        places = (np.exp(steps) - math.exp(steps[0])) / -math.expm1(steps[0])
    else:
        places = np.expm1(steps) / math.expm1(steps[-1])
    places[0], places[-1] = 0.0, 1.0
    return np.asarray(places, np.float64)
