"""Functions given by points: straight lines between them, or a cubic spline through them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.errors import BadValue

FloatArray = NDArray[np.float64]


def linear(x: FloatArray, xs: FloatArray, ys: FloatArray) -> FloatArray:
    """Interpolate along straight lines; beyond the ends the end values hold.

    Parameters
    ----------
    x : (n,) float64
        Where to interpolate.
    xs, ys : (m,) float64
        Points of the function, m >= 1; `xs` never decreases, or never increases.

    Returns
    -------
    (n,) float64

    Raises
    ------
    BadValue
        When there is no point, or `xs` turns back.
    """
    xs, ys = _increasing(xs, ys)
    return np.interp(x, xs, ys)


def spline(
    x: FloatArray, xs: FloatArray, ys: FloatArray, left: float | None = None, right: float | None = None
) -> FloatArray:
    """Interpolate along the cubic spline through all points.

    Parameters
    ----------
    x : (n,) float64
        Where to interpolate; beyond the ends the end values hold.
    xs, ys : (m,) float64
        Points of the function, m >= 2; `xs` strictly increases or strictly decreases.
    left, right : float, optional
        First derivative at the smallest and at the largest abscissa; without it the second derivative is zero there.

    Returns
    -------
    (n,) float64

    Raises
    ------
    BadValue
        When there are fewer than two points, or `xs` turns back or stays.

    Source
    ------
    C. de Boor, A Practical Guide to Splines, 1978, chapter 4.
    """
    from scipy.interpolate import CubicSpline

    xs, ys = _increasing(xs, ys)
    if len(xs) < 2:
        raise BadValue("number of points", len(xs), "at least two")
    steps = np.diff(xs)
    if not np.all(steps > 0):
        raise BadValue("abscissa", float(xs[int(np.argmin(steps)) + 1]), "a value different from the one before")
    ends = ((2, 0.0) if left is None else (1, left), (2, 0.0) if right is None else (1, right))
    curve = CubicSpline(xs, ys, bc_type=ends)
    return np.asarray(curve(np.clip(x, xs[0], xs[-1])), dtype=np.float64)


def crossings(x: float, xs: FloatArray, ys: FloatArray) -> FloatArray:
    """Return every ordinate that a broken line has at an abscissa, in the order in which the line passes.

    Parameters
    ----------
    x : float
        The abscissa.
    xs, ys : (m,) float64
        Points of the line, in its order; `xs` may turn back.

    Returns
    -------
    (n,) float64
        Empty when the line never reaches `x`; on a vertical piece its two ends; a common end of two pieces once.
    """
    found: list[float] = []
    for i in range(len(xs)):
        if xs[i] == x:
            found.append(float(ys[i]))
        elif i and (xs[i - 1] - x) * (xs[i] - x) < 0:
            part = (x - xs[i - 1]) / (xs[i] - xs[i - 1])
            found.append(float(ys[i - 1] + part * (ys[i] - ys[i - 1])))
    return np.array(found, dtype=np.float64)


def integral(xs: FloatArray, ys: FloatArray, low: float, high: float, *, absolute: bool = False) -> float:
    """Integrate a broken line between two abscissae.

    Parameters
    ----------
    xs, ys : (m,) float64
        Points of the line, m >= 1; `xs` never decreases, or never increases.
    low, high : float
        Bounds, inside the range of `xs`; from the larger to the smaller the integral changes its sign.
    absolute : bool
        Integrate the absolute value.

    Returns
    -------
    float

    Raises
    ------
    BadValue
        When there is no point, `xs` turns back, or a bound is outside their range.

    Notes
    -----
    Trapezoidal rule, exact for a broken line; where it crosses zero, |y| is integrated on both sides.
    """
    xs, ys = _increasing(xs, ys)
    for bound in (low, high):
        if not xs[0] <= bound <= xs[-1]:
            raise BadValue("bound", bound, f"{xs[0]:g} to {xs[-1]:g}")
    sign = 1.0
    if low > high:
        low, high, sign = high, low, -1.0
    inside = (xs > low) & (xs < high)
    x = np.concatenate([[low], xs[inside], [high]])
    y = np.concatenate([np.interp([low], xs, ys), ys[inside], np.interp([high], xs, ys)])
    left, right = y[:-1], y[1:]
    mean = (left + right) / 2
    if absolute:
        total = np.abs(left) + np.abs(right)
        crossing = left * right < 0
        mean = np.where(crossing, (left**2 + right**2) / (2 * np.where(crossing, total, 1.0)), total / 2)
    return sign * float(np.sum(mean * np.diff(x)))


def _increasing(xs: FloatArray, ys: FloatArray) -> tuple[FloatArray, FloatArray]:
    if not len(xs):
        raise BadValue("number of points", 0, "at least one")
    steps = np.diff(xs)
    if np.all(steps >= 0):
        return xs, ys
    if np.all(steps <= 0):
        return xs[::-1], ys[::-1]
    turn = int(np.flatnonzero(np.sign(steps) * np.sign(steps[np.flatnonzero(steps)[0]]) < 0)[0])
    raise BadValue("abscissa", float(xs[turn + 1]), "an order that never turns back")
