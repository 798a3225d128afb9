"""Putting points on simple surfaces, along the perpendicular to the axis or the centre."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.mesh.transforms import direction


def to_sphere(points: FloatArray, centre: FloatArray, on: FloatArray) -> FloatArray:
    """Put points on a sphere, from its centre.

    Parameters
    ----------
    points : (k, 3) float64, length
    centre, on : (3,) float64, length
        The centre, and a point of the sphere.

    Returns
    -------
    (k, 3) float64, length

    Raises
    ------
    BadValue
        A point is at the centre.
    """
    away = points - centre
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    if (distance == 0).any():
        raise BadValue("distance to the centre", 0.0, "a patch that does not hold the centre")
    return np.asarray(centre + away * (float(np.linalg.norm(on - centre)) / distance), np.float64)


def _radial(points: FloatArray, a: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return abscissas along an axis, distances to it, and unit vectors away from it."""
    along = (points - a) @ u
    away = points - a - along[:, None] * u
    distance = np.linalg.norm(away, axis=1)
    if (distance == 0).any():
        raise BadValue("distance to the axis", 0.0, "a patch that does not meet the axis")
    return along, distance, away / distance[:, None]


def to_cylinder(points: FloatArray, a: FloatArray, b: FloatArray, on: FloatArray) -> FloatArray:
    """Put points on a cylinder, perpendicularly to its axis.

    Parameters
    ----------
    points : (k, 3) float64, length
    a, b, on : (3,) float64, length
        Two points of the axis, and a point of the cylinder.

    Returns
    -------
    (k, 3) float64, length

    Raises
    ------
    BadValue
        A point is on the axis.
    """
    u = direction(a, b)
    along, _, away = _radial(points, a, u)
    _, radius, _ = _radial(on[None], a, u)
    return np.asarray(a + along[:, None] * u + radius[0] * away, np.float64)


def to_cone(points: FloatArray, apex: FloatArray, b: FloatArray, on: FloatArray) -> FloatArray:
    """Put points on a cone, perpendicularly to its axis.

    Parameters
    ----------
    points : (k, 3) float64, length
    apex, b, on : (3,) float64, length
        The apex, a second point of the axis, and a point of the cone.

    Returns
    -------
    (k, 3) float64, length

    Raises
    ------
    BadValue
        A point is on the axis, or the point of the cone in the plane of its apex.
    """
    u = direction(apex, b)
    along, _, away = _radial(points, apex, u)
    height, radius, _ = _radial(on[None], apex, u)
    if height[0] == 0:
        raise BadValue("height of the cone", 0.0, "a point that is not level with the apex")
    return np.asarray(apex + along[:, None] * u + (along * radius[0] / height[0])[:, None] * away, np.float64)


def to_torus(points: FloatArray, centre: FloatArray, b: FloatArray, small: FloatArray, on: FloatArray) -> FloatArray:
    """Put points on a torus, from its circle of centres.

    Parameters
    ----------
    points : (k, 3) float64, length
    centre, b, small, on : (3,) float64, length
        The centre, a second point of the axis, the centre of a small circle, and a point of the torus.

    Returns
    -------
    (k, 3) float64, length

    Raises
    ------
    BadValue
        A point is on the axis, or on the circle of centres.
    """
    u = direction(centre, b)
    along, radius, away = _radial(points, centre, u)
    height, large, _ = _radial(small[None], centre, u)
    own, own_radius, _ = _radial(on[None], centre, u)
    size = float(np.hypot(own - height, own_radius - large)[0])
    up, out = along - height, radius - large
    distance = np.hypot(up, out)
    if (distance == 0).any():
        raise BadValue("distance to the circle of centres", 0.0, "a patch that does not meet it")
    grow = size / distance
    return np.asarray(centre + (height + grow * up)[:, None] * u + (large + grow * out)[:, None] * away, np.float64)
