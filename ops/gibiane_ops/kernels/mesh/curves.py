"""Polynomial curves in space, with their lengths."""

from __future__ import annotations

import numpy as np
from numpy.polynomial.legendre import leggauss

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue

# Panels and Gauss points per panel of the length; 64 x 6 leave an error below 1e-12 on a smooth curve.
PANELS, POINTS = 64, 6


class Curve:
    """The curve ``P(u) = sum c_k u^k`` between two values of its parameter.

    Parameters
    ----------
    coefficients : (n, 3) float64, length
        Of 1, u, u^2, ...
    start, end : float
        Values of u at the ends.

    Raises
    ------
    BadValue
        When the curve has no length.

    Notes
    -----
    The length is integrated by Gauss's rule on equal panels; its inverse starts from linear interpolation between the
    panels and takes Newton steps.
    """

    def __init__(self, coefficients: FloatArray, start: float = 0.0, end: float = 1.0) -> None:
        self.coefficients = np.asarray(coefficients, np.float64)
        self.start, self.end = start, end
        self._ends = np.linspace(start, end, PANELS + 1)
        self._lengths = np.concatenate([[0.0], np.cumsum(self._part(self._ends[:-1], self._ends[1:]))])
        if not self.length > 0:
            raise BadValue("length", 0.0, "length > 0")

    @property
    def length(self) -> float:
        """Length of the curve."""
        return abs(float(self._lengths[-1]))

    def at(self, u: FloatArray) -> FloatArray:
        """Return points, (k,) to (k, 3)."""
        return np.asarray(np.vander(u, len(self.coefficients), increasing=True) @ self.coefficients, np.float64)

    def _speed(self, u: FloatArray) -> FloatArray:
        """Return the length of the derivative, (k,)."""
        n = len(self.coefficients)
        derivative = np.arange(1, n)[:, None] * self.coefficients[1:]
        return np.asarray(np.linalg.norm(np.vander(u, n - 1, increasing=True) @ derivative, axis=1), np.float64)

    def _part(self, first: FloatArray, last: FloatArray) -> FloatArray:
        """Return the lengths between pairs of values of the parameter, (k,)."""
        x, w = leggauss(POINTS)
        half = (last - first)[:, None] / 2
        places = (last + first)[:, None] / 2 + half * x
        return np.asarray((self._speed(places.ravel()).reshape(-1, POINTS) * w * half).sum(axis=1), np.float64)

    def _length_to(self, u: FloatArray) -> FloatArray:
        step = (self.end - self.start) / PANELS
        panel = np.clip(((u - self.start) / step).astype(np.int64), 0, PANELS - 1)
        return np.asarray(self._lengths[panel] + self._part(self._ends[panel], u), np.float64)

    def by_parameter(self, places: FloatArray) -> FloatArray:
        """Return points at parts of the parameter, (k,) from 0 to 1, as (k, 3)."""
        return self.at(self.start + places * (self.end - self.start))

    def by_length(self, places: FloatArray) -> FloatArray:
        """Return points at parts of the length, (k,) from 0 to 1, as (k, 3)."""
        return self.at(self.parameters(places))

    def parameters(self, places: FloatArray) -> FloatArray:
        """Return the values of the parameter at parts of the length, (k,) from 0 to 1."""
        wanted = places * self._lengths[-1]
        u = np.interp(places, self._lengths / self._lengths[-1], self._ends)
        low, high = min(self.start, self.end), max(self.start, self.end)
        for _ in range(4):
            speed = self._speed(u)
            step = np.divide(wanted - self._length_to(u), speed, out=np.zeros_like(u), where=speed > 0)
            u = np.clip(u + step, low, high)
        return np.asarray(u, np.float64)


def parabola(a: FloatArray, tip: FloatArray, b: FloatArray) -> Curve:
    """Make the arc of parabola from a to b whose tangents at the ends meet at `tip`, (3,) each, length."""
    return Curve(np.stack([a, 2 * (tip - a), a - 2 * tip + b]))


def hermite(a: FloatArray, from_a: FloatArray, to_b: FloatArray, b: FloatArray) -> Curve:
    """Make the cubic from a to b whose derivatives at the ends are `from_a` and `to_b`, (3,) each, length."""
    return Curve(np.stack([a, from_a, 3 * (b - a) - 2 * from_a - to_b, 2 * (a - b) + from_a + to_b]))


def cubic_through(points: FloatArray) -> Curve:
    """Make the cubic through four points; its parameter at them goes as the lengths of the chords.

    Parameters
    ----------
    points : (4, 3) float64, length

    Raises
    ------
    BadValue
        Two points that follow one another are at the same place.
    """
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if not (chords > 0).all():
        raise BadValue("chord", 0.0, "points at different places")
    u = np.concatenate([[0.0], np.cumsum(chords) / chords.sum()])
    return Curve(np.asarray(np.linalg.solve(np.vander(u, 4, increasing=True), points), np.float64))
