"""Affine transformations of points: translation, rotation, symmetry, homothety, affinity."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue


@dataclass(frozen=True, eq=False)
class Affine:
    """The map ``x -> matrix x + offset``.

    Attributes
    ----------
    matrix : (3, 3) float64
    offset : (3,) float64, length
    """

    matrix: FloatArray
    offset: FloatArray

    def __call__(self, points: FloatArray) -> FloatArray:
        """Apply the map to points, (n, 3)."""
        return np.asarray(points @ self.matrix.T + self.offset, np.float64)

    @property
    def turns_over(self) -> bool:
        """Whether it exchanges left and right."""
        return bool(np.linalg.det(self.matrix) < 0)


def _about(centre: FloatArray, matrix: FloatArray) -> Affine:
    return Affine(matrix, centre - matrix @ centre)


def direction(a: FloatArray, b: FloatArray, what: str = "axis") -> FloatArray:
    """Return the unit vector from one point to another.

    Parameters
    ----------
    a, b : (3,) float64, length
    what : str
        What it is for, in the error.

    Returns
    -------
    (3,) float64

    Raises
    ------
    BadValue
        The points coincide.
    """
    vector = b - a
    size = float(np.linalg.norm(vector))
    if not size > 1e-14 * max(float(np.abs(a).max()), float(np.abs(b).max())):
        raise BadValue(what, size, "two different points")
    return np.asarray(vector / size, np.float64)


def normal_of(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return the unit normal of the plane through three points.

    Parameters
    ----------
    a, b, c : (3,) float64, length

    Returns
    -------
    (3,) float64

    Raises
    ------
    BadValue
        The points are on one line.
    """
    normal = np.cross(b - a, c - a)
    size = float(np.linalg.norm(normal))
    if not size > 1e-12 * float(np.linalg.norm(b - a)) * float(np.linalg.norm(c - a)):
        raise BadValue("plane", size, "three points that are not on one line")
    return np.asarray(normal / size, np.float64)


def translation(vector: FloatArray) -> Affine:
    """Make a translation by a vector, (3,), length."""
    return Affine(np.eye(3), np.asarray(vector, np.float64))


def rotation(angle: float, a: FloatArray, b: FloatArray) -> Affine:
    """Make a rotation about the axis from a to b, positive by the rule of the screw.

    Parameters
    ----------
    angle : float, degrees
        Multiples of 90 are exact.
    a, b : (3,) float64, length

    Returns
    -------
    Affine

    Notes
    -----
    Rodrigues: ``R = cos I + sin [u] + (1 - cos) u u^T``.

    Raises
    ------
    BadValue
        The two points coincide.
    """
    u = direction(a, b)
    quarter, rest = divmod(angle, 90.0)
    if rest == 0.0:
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    else:
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    cross = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
    return _about(a, c * np.eye(3) + s * cross + (1.0 - c) * np.outer(u, u))


def symmetry_point(centre: FloatArray, plane: bool = False) -> Affine:
    """Make a symmetry about a point, (3,); `plane` keeps the third coordinate (a half turn)."""
    return _about(centre, np.diag([-1.0, -1.0, 1.0 if plane else -1.0]))


def symmetry_line(a: FloatArray, b: FloatArray, plane: bool = False) -> Affine:
    """Make a symmetry about the line through two points, (3,): a half turn in space, a reflection in the plane."""
    u = direction(a, b)
    matrix = 2.0 * np.outer(u, u) - np.eye(3)
    if plane:
        matrix[2, 2] = 1.0
    return _about(a, matrix)


def symmetry_plane(a: FloatArray, b: FloatArray, c: FloatArray) -> Affine:
    """Make a reflection in the plane through three points, (3,)."""
    n = normal_of(a, b, c)
    return _about(a, np.eye(3) - 2.0 * np.outer(n, n))


def homothety(ratio: float, centre: FloatArray) -> Affine:
    """Make a homothety of given ratio about a point, (3,)."""
    return _about(centre, ratio * np.eye(3))


def affinity(ratio: float, a: FloatArray, b: FloatArray) -> Affine:
    """Make an affinity: distances along a direction from a fixed point are multiplied by a ratio.

    Parameters
    ----------
    ratio : float
    a, b : (3,) float64, length
        The fixed point, and a second point that gives the direction.

    Returns
    -------
    Affine
        Points of the plane through a perpendicular to the direction do not move.
    """
    u = direction(a, b)
    return _about(a, np.eye(3) + (ratio - 1.0) * np.outer(u, u))
