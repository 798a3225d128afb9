"""Maps of the plane onto spheres, cylinders, cones and tori that keep angles.

A mesh made in the plane of such a map, with the sizes divided by its scale, keeps the shape of its elements on the
surface.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue, MeshingFailed
from gibiane_ops.kernels.mesh.transforms import direction

# A point further from the surface than this part of the size of the contour is not on it.
ON_SURFACE = 1e-3
# Lines around the axis at both ends are mapped to circles; beyond this ratio of radii gmsh loses the small one.
LARGEST_RATIO = 1e4


class Chart(ABC):
    """A conformal map between a plane and a surface."""

    @abstractmethod
    def flat(self, loops: list[FloatArray]) -> list[FloatArray]:
        """Return closed contours, (k, 3) each, in the plane, (k, 2) each."""

    @abstractmethod
    def space(self, plane: FloatArray) -> FloatArray:
        """Return points of the plane, (k, 2), on the surface, (k, 3)."""

    @abstractmethod
    def nearest(self, points: FloatArray) -> FloatArray:
        """Return the points of the surface nearest to others that are close to it, (k, 3)."""

    @abstractmethod
    def scale(self, plane: FloatArray) -> FloatArray:
        """Return by how much lengths of the plane grow on the surface, (k,)."""


def _frame(u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors that make a direct frame with u."""
    helper = np.eye(3)[int(np.argmin(np.abs(u)))]
    v = np.cross(u, helper)
    v = v / np.linalg.norm(v)
    return v, np.cross(u, v)


class Sphere(Chart):
    """Stereographic projection of a sphere from the point opposite to the middle of the contours.

    Parameters
    ----------
    centre : (3,) float64, length
    points : (k, 3) float64, length
        Nodes of the contours.

    Raises
    ------
    BadValue
        When the points are not at one distance from the centre, or surround it evenly.
    """

    def __init__(self, centre: FloatArray, points: FloatArray) -> None:
        away = points - centre
        radius = np.linalg.norm(away, axis=1)
        self.centre, self.radius = centre, float(radius.mean())
        _check("distance to the centre", radius, np.full(len(radius), self.radius))
        middle = (away / radius[:, None]).mean(axis=0)
        if np.linalg.norm(middle) < 1e-6:
            # Contours that surround the centre, such as an equator: their plane says where the middle is.
            middle = np.linalg.svd(away)[2][2]
            middle = middle * np.sign(middle[np.argmax(np.abs(middle))])
        self.pole = middle / np.linalg.norm(middle)
        self.x, self.y = _frame(self.pole)

    def flat(self, loops: list[FloatArray]) -> list[FloatArray]:
        """Return contours in the plane."""
        found = []
        for loop in loops:
            away = (loop - self.centre) / np.linalg.norm(loop - self.centre, axis=1, keepdims=True)
            height = 1 + away @ self.pole
            if (height < 1e-6).any():
                raise MeshingFailed("the contour reaches the point opposite to its middle")
            found.append(np.stack([away @ self.x, away @ self.y], axis=1) / height[:, None])
        return found

    def space(self, plane: FloatArray) -> FloatArray:
        """Return points on the sphere."""
        r2 = (plane**2).sum(axis=1, keepdims=True)
        away = 2 * plane[:, :1] * self.x + 2 * plane[:, 1:] * self.y + (1 - r2) * self.pole
        return np.asarray(self.centre + self.radius * away / (1 + r2), np.float64)

    def nearest(self, points: FloatArray) -> FloatArray:
        """Return the nearest points of the sphere."""
        away = points - self.centre
        return np.asarray(self.centre + self.radius * away / np.linalg.norm(away, axis=1, keepdims=True), np.float64)

    def scale(self, plane: FloatArray) -> FloatArray:
        """Return the growth of lengths."""
        return np.asarray(2 * self.radius / (1 + (plane**2).sum(axis=1)), np.float64)


class Revolution(Chart):
    """A surface of revolution: its angle, and the integral of ``dl / radius`` along its meridian.

    Where contours go round the axis the strip is rolled into a ring by the exponential.

    Parameters
    ----------
    a, b : (3,) float64, length
        Two points of the axis.
    """

    def __init__(self, a: FloatArray, b: FloatArray) -> None:
        self.a, self.u = a, direction(a, b)
        self.x, self.y = _frame(self.u)
        self.ring, self.shift = False, 0.0
        # After which the second coordinate of the strip comes back to the same place.
        self.period = np.inf

    @abstractmethod
    def _strip(self, along: FloatArray, radius: FloatArray) -> FloatArray:
        """Return the second coordinate of the strip from those along and away from the axis, (k,)."""

    @abstractmethod
    def _meridian(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the coordinates along and away from the axis from the second one of the strip, (k,) each."""

    def flat(self, loops: list[FloatArray]) -> list[FloatArray]:
        """Return contours in the plane."""
        strips, turns = [], []
        for loop in loops:
            away = loop - self.a
            x, y, along = away @ self.x, away @ self.y, away @ self.u
            angle = np.unwrap(np.concatenate([np.arctan2(y, x), np.arctan2(y, x)[:1]]))
            turns.append(round(float(angle[-1] - angle[0]) / (2 * np.pi)))
            strips.append(np.stack([angle[:-1], self._strip(along, np.hypot(x, y))], axis=1))
        self.ring = any(turns)
        if self.ring:
            s = np.concatenate([strip[:, 1] for strip in strips])
            if np.ptp(s) > np.log(LARGEST_RATIO):
                raise MeshingFailed("the surface goes round the axis and is too long for its radius: cut it along it")
            if sum(1 for turn in turns if turn) != 2:
                raise MeshingFailed("one contour alone goes round the axis: it bounds no surface")
            self.shift = float(s.mean())
            return [
                np.exp(strip[:, 1:] - self.shift) * np.stack([np.cos(strip[:, 0]), np.sin(strip[:, 0])], axis=1)
                for strip in strips
            ]
        for strip in strips[1:]:
            for column, period in ((0, 2 * np.pi), (1, self.period)):
                gap = float(strip[:, column].mean() - strips[0][:, column].mean())
                if np.isfinite(period):
                    strip[:, column] -= period * round(gap / period)
        return strips

    def _strip_of(self, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
        if not self.ring:
            return plane[:, 0], plane[:, 1]
        return np.arctan2(plane[:, 1], plane[:, 0]), self.shift + np.log(_away(plane))

    def space(self, plane: FloatArray) -> FloatArray:
        """Return points on the surface."""
        angle, s = self._strip_of(plane)
        along, radius = self._meridian(s)
        around = np.cos(angle)[:, None] * self.x + np.sin(angle)[:, None] * self.y
        return np.asarray(self.a + along[:, None] * self.u + radius[:, None] * around, np.float64)

    @abstractmethod
    def _put(self, along: FloatArray, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the nearest point of the meridian, by its coordinates along and away from the axis."""

    def nearest(self, points: FloatArray) -> FloatArray:
        """Return the nearest points of the surface."""
        along, radius = _cylindrical(points, self.a, self.u)
        around = (points - self.a - along[:, None] * self.u) / radius[:, None]
        along, radius = self._put(along, radius)
        return np.asarray(self.a + along[:, None] * self.u + radius[:, None] * around, np.float64)

    def scale(self, plane: FloatArray) -> FloatArray:
        """Return the growth of lengths."""
        _, radius = self._meridian(self._strip_of(plane)[1])
        return radius / _away(plane) if self.ring else radius


class Cylinder(Revolution):
    """A cylinder: two points of its axis, and the nodes of the contours, (k, 3), length."""

    def __init__(self, a: FloatArray, b: FloatArray, points: FloatArray) -> None:
        super().__init__(a, b)
        _, radius = _cylindrical(points, a, self.u)
        self.radius = float(radius.mean())
        _check("distance to the axis", radius, np.full(len(radius), self.radius))

    def _strip(self, along: FloatArray, radius: FloatArray) -> FloatArray:
        return along / self.radius

    def _meridian(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return s * self.radius, np.full(len(s), self.radius)

    def _put(self, along: FloatArray, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        return along, np.full(len(radius), self.radius)


class Cone(Revolution):
    """A cone: its apex, a point of its axis, and the nodes of the contours, (k, 3), length."""

    def __init__(self, apex: FloatArray, b: FloatArray, points: FloatArray) -> None:
        super().__init__(apex, b)
        along, radius = _cylindrical(points, apex, self.u)
        distance = np.hypot(along, radius)
        if not (radius > 1e-9 * distance.max()).all():
            raise BadValue("distance to the axis", 0.0, "a contour that does not meet the apex")
        self.side = float(np.sign(along.sum())) or 1.0
        angle = np.arctan2(radius, self.side * along)
        self.angle = float(angle.mean())
        _check("angle with the axis", angle * distance, np.full(len(angle), self.angle) * distance)

    def _strip(self, along: FloatArray, radius: FloatArray) -> FloatArray:
        return np.asarray(np.log(np.hypot(along, radius)) / np.sin(self.angle), np.float64)

    def _meridian(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        distance = np.exp(s * np.sin(self.angle))
        return self.side * distance * np.cos(self.angle), distance * np.sin(self.angle)

    def _put(self, along: FloatArray, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        distance = self.side * along * np.cos(self.angle) + radius * np.sin(self.angle)
        return self.side * distance * np.cos(self.angle), distance * np.sin(self.angle)


class Torus(Revolution):
    """A torus: its centre, a point of its axis, the centre of a small circle, and the nodes of the contours, (k, 3)."""

    def __init__(self, centre: FloatArray, b: FloatArray, small: FloatArray, points: FloatArray) -> None:
        super().__init__(centre, b)
        height, large = _cylindrical(small[None], centre, self.u)
        self.height, self.large = float(height[0]), float(large[0])
        along, radius = _cylindrical(points, centre, self.u)
        distance = np.hypot(along - self.height, radius - self.large)
        self.small = float(distance.mean())
        _check("distance to the small circle's centre", distance, np.full(len(distance), self.small))
        if not self.small < self.large:
            raise BadValue("small radius of the torus", self.small, f"less than the large radius {self.large:.6g}")
        self.root = float(np.sqrt(self.large**2 - self.small**2))
        self.period = 2 * np.pi * self.small / self.root

    def _strip(self, along: FloatArray, radius: FloatArray) -> FloatArray:
        turn = np.arctan2(along - self.height, radius - self.large)
        closed = np.unwrap(np.concatenate([turn, turn[:1]]))
        if abs(closed[-1] - closed[0]) > 1:
            raise MeshingFailed("a contour goes round the small circle of the torus: cut the surface in two")
        turn = closed[:-1]
        half = np.arctan(np.sqrt((self.large - self.small) / (self.large + self.small)) * np.tan(turn / 2))
        # The arctangent jumps where the angle passes half a turn.
        return np.asarray(2 * self.small / self.root * (half + np.pi * np.round(turn / (2 * np.pi))), np.float64)

    def _meridian(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        half = s * self.root / (2 * self.small)
        whole = np.round(half / np.pi)
        slope = np.sqrt((self.large + self.small) / (self.large - self.small))
        turn = 2 * np.arctan(slope * np.tan(half - np.pi * whole)) + 2 * np.pi * whole
        return self.height + self.small * np.sin(turn), self.large + self.small * np.cos(turn)

    def _put(self, along: FloatArray, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        height, out = along - self.height, radius - self.large
        grow = self.small / np.hypot(height, out)
        return self.height + grow * height, self.large + grow * out


def _away(plane: FloatArray) -> FloatArray:
    """Return distances to the middle of the ring, (k,); the middle itself, which is no part of it, counts as near."""
    return np.asarray(np.maximum(np.hypot(plane[:, 0], plane[:, 1]), 1e-2 / LARGEST_RATIO), np.float64)


def _cylindrical(points: FloatArray, a: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return coordinates along an axis and distances to it, (k,) each."""
    along = (points - a) @ u
    return along, np.asarray(np.linalg.norm(points - a - along[:, None] * u, axis=1), np.float64)


def _check(what: str, found: FloatArray, wanted: FloatArray) -> None:
    off = np.abs(found - wanted)
    if off.max() > ON_SURFACE * np.abs(wanted).max():
        worst = int(off.argmax())
        raise BadValue(what, f"{found[worst]:.6g}", f"{wanted[worst]:.6g} like the other nodes of the contour")
