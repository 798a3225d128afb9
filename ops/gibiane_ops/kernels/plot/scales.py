"""From values to colours: limits of the bands, their colours, the numbers on the bar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.plot.camera import FloatArray

UNDEFINED = (0.78, 0.78, 0.78)
"""Colour of not-a-number."""


@dataclass(frozen=True)
class Scale:
    """How the values of a picture become colours.

    Attributes
    ----------
    title : str
        Name of the quantity, written above the colour bar.
    bands : int
        Wanted number of bands; the limits are round numbers, so there may be fewer.
    limits : (n,) float64, optional
        Exact limits of the bands, increasing, n >= 2; replaces `bands`, `low` and `high`.
    low, high : float, optional
        Range shown; by default that of the values. Values beyond take the end colours.
    log : bool
        Bands of equal ratio; the values have to be positive, zero takes the first colour.
    colormap : str
        A name of matplotlib, e.g. ``turbo``, ``viridis``, ``RdBu_r``.
    """

    title: str = ""
    bands: int = 12
    limits: FloatArray | None = None
    low: float | None = None
    high: float | None = None
    log: bool = False
    colormap: str = "turbo"


@dataclass(frozen=True)
class Bands:
    """A scale applied to the values of a picture.

    Attributes
    ----------
    limits : (n_bands + 1,) float64
        Increasing.
    colors : (n_bands, 3) float64
        Red, green, blue from 0 to 1.
    low, high : float
        Smallest and largest finite value.
    """

    limits: FloatArray
    colors: FloatArray
    low: float
    high: float

    def paint(self, values: FloatArray) -> FloatArray:
        """Give the colour of values.

        Parameters
        ----------
        values : (n,) float64

        Returns
        -------
        (n, 3) float64
        """
        # comparing with the inner limits alone sends what lies beyond to the end bands
        band = np.searchsorted(self.limits[1:-1], values, side="right")
        painted: NDArray[np.float64] = self.colors[band]
        painted[np.isnan(values)] = UNDEFINED
        return painted


def bands_for(scale: Scale, values: FloatArray) -> Bands:
    """Choose the bands for the values of a picture.

    Parameters
    ----------
    scale : Scale
    values : (n,) float64
        Values that are seen; not-a-number is ignored.

    Returns
    -------
    Bands

    Raises
    ------
    BadValue
        When no value is finite, when a logarithmic scale has no positive value, or when limits do not increase.
    """
    from matplotlib import colormaps

    finite = values[np.isfinite(values)]
    if not len(finite):
        raise BadValue(f"field {scale.title}".strip(), "without a finite value", "at least one")
    limits = scale.limits
    if limits is None:
        limits = _log_limits(scale, finite) if scale.log else _limits(scale, finite)
    limits = np.asarray(limits, np.float64)
    if len(limits) < 2 or (np.diff(limits) <= 0.0).any():
        raise BadValue("limits of the bands", limits.tolist(), "at least two increasing numbers")
    # the very ends of most maps are too dark to show the edges of elements
    colors = colormaps[scale.colormap](np.linspace(0.07, 0.93, len(limits) - 1))[:, :3]
    return Bands(limits, colors, float(finite.min()), float(finite.max()))


def _limits(scale: Scale, values: FloatArray) -> FloatArray:
    """Choose round limits that hold the range; one band around a constant."""
    low = float(values.min()) if scale.low is None else scale.low
    high = float(values.max()) if scale.high is None else scale.high
    size = max(abs(low), abs(high))
    if high - low <= 1e-9 * size or size == 0.0:
        spread = 0.5 * size or 0.5
        return np.array([low - spread, high + spread])
    return _round_steps(low, high, scale.bands)


def _log_limits(scale: Scale, values: FloatArray) -> FloatArray:
    """Choose limits in equal ratio that hold the positive range."""
    positive = values[values > 0.0]
    if not len(positive):
        raise BadValue(f"field {scale.title} on a logarithmic scale".replace("  ", " "), float(values.max()), "> 0")
    low = float(positive.min()) if scale.low is None else scale.low
    high = float(positive.max()) if scale.high is None else scale.high
    if low <= 0.0:
        raise BadValue("lower end of a logarithmic scale", low, "> 0")
    if high <= low * (1.0 + 1e-9):
        return np.array([low / 2.0, low * 2.0])
    exponents: FloatArray = _round_steps(float(np.log10(low)), float(np.log10(high)), scale.bands)
    return 10.0**exponents


def _round_steps(low: float, high: float, at_most: int) -> FloatArray:
    """Cover a range by equal steps of a round size, at most so many."""
    raw = (high - low) / max(at_most, 1)
    power = 10.0 ** np.floor(np.log10(raw))
    for mantissa in (1.0, 2.0, 2.5, 5.0, 10.0, 20.0):
        step = mantissa * power
        # the small shift keeps a bound that is a multiple of the step from opening one more band
        first, last = np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)
        if last - first <= at_most:
            break
    limits: FloatArray = np.arange(first, last + 1.0) * step
    return limits


def bar_labels(limits: FloatArray) -> list[str]:
    """Write the limits with the digits that tell them apart, at most five.

    Parameters
    ----------
    limits : (n,) float64
        Increasing.

    Returns
    -------
    list of str
    """
    largest = float(abs(limits).max())
    steps = np.diff(limits)
    # equal steps are read as a column: one notation for all
    power = None if steps.max() > 1.5 * steps.min() else not 1e-2 <= largest < 1e5
    trials = [[short(limit, digits, power) for limit in limits] for digits in (2, 3, 4, 5)]
    for texts in trials:
        if all(abs(float(text) - limit) <= 1e-6 * largest for text, limit in zip(texts, limits, strict=True)):
            return texts
    return next((texts for texts in trials if len(set(texts)) == len(texts)), trials[-1])


def short(value: float, digits: int, power: bool | None = None) -> str:
    """Write a number briefly: ``0.25``, ``1430``, ``1.2e5``, ``3e-7``.

    Parameters
    ----------
    value : float
    digits : int
        Significant digits.
    power : bool, optional
        With a power of ten, or without; by default only from 1e5 and below 1e-2.

    Returns
    -------
    str
    """
    if value == 0.0:
        return "0"
    if power is None:
        power = not 1e-2 <= abs(value) < 1e5
    if not power:
        return f"{float(f'{value:.{digits}g}'):.12g}"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    if "." in mantissa:
        mantissa = mantissa.rstrip("0").rstrip(".")
    return f"{mantissa}e{int(exponent)}"
