"""Arcs of circle in space."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.mesh.transforms import direction

# Below this sine two directions count as parallel.
FLAT = 1e-6


@dataclass(frozen=True, eq=False)
class Arc:
    """An arc whose radius goes linearly from one end to the other (they are equal up to round-off in the data).

    Attributes
    ----------
    centre : (3,) float64, length
    start, across : (3,) float64
        Unit vectors of its plane: towards the first end, and perpendicular to it on the side of the arc.
    angle : float, radians
    radii : tuple of float, length
        At the first and the last end.
    """

    centre: FloatArray
    start: FloatArray
    across: FloatArray
    angle: float
    radii: tuple[float, float]

    @property
    def length(self) -> float:
        """Length of the arc."""
        return self.angle * (self.radii[0] + self.radii[1]) / 2

    def __call__(self, places: FloatArray) -> FloatArray:
        """Return points at parts of the angle, (k,) from 0 to 1, as (k, 3)."""
        turn = places[:, None] * self.angle
        radius = self.radii[0] + places[:, None] * (self.radii[1] - self.radii[0])
        return np.asarray(self.centre + radius * (np.cos(turn) * self.start + np.sin(turn) * self.across), np.float64)


def about(a: FloatArray, centre: FloatArray, b: FloatArray) -> Arc | None:
    """Make the shorter arc between two points about a centre.

    Parameters
    ----------
    a, centre, b : (3,) float64, length
        The ends at (nearly) equal distances from the centre.

    Returns
    -------
    Arc or None
        None when the ends are opposite: the plane of the arc, or its side, is then unknown.
    """
    ra, rb = float(np.linalg.norm(a - centre)), float(np.linalg.norm(b - centre))
    u, w = (a - centre) / ra, (b - centre) / rb
    across = w - (w @ u) * u
    sine, cosine = float(np.linalg.norm(across)), float(w @ u)
    if cosine < 0 and sine < FLAT:
        return None
    if sine == 0:
        return Arc(centre, u, u, 0.0, (ra, rb))
    return Arc(centre, u, across / sine, math.atan2(sine, cosine), (ra, rb))


def through(a: FloatArray, middle: FloatArray, b: FloatArray) -> Arc | None:
    """Make the arc from one point to another through a third.

    Parameters
    ----------
    a, middle, b : (3,) float64, length

    Returns
    -------
    Arc or None
        None when the three are on one line.

    Notes
    -----
    The centre is the circumcentre; the angle may exceed a half turn.
    """
    p, q = middle - a, b - a
    normal = np.cross(p, q)
    n2 = float(normal @ normal)
    if not n2 > (FLAT * np.linalg.norm(p) * np.linalg.norm(q)) ** 2:
        return None
    centre = a + np.cross(float(p @ p) * q - float(q @ q) * p, normal) / (2 * n2)
    radius = float(np.linalg.norm(a - centre))
    u = (a - centre) / radius
    across = np.cross(normal / math.sqrt(n2), u)
    angle = math.atan2(float((b - centre) @ across), float((b - centre) @ u)) % (2 * math.pi)
    return Arc(centre, u, across, angle, (radius, radius))


def distance_to_axis(points: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distances of points to the line through two points.

    Parameters
    ----------
    points : (k, 3) float64, length
    a, b : (3,) float64, length

    Returns
    -------
    (k,) float64, length
    """
    return np.asarray(np.linalg.norm(np.cross(points - a, direction(a, b)), axis=1), np.float64)
