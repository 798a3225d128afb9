"""Orthographic camera: from points in space to the screen, and the frame that holds a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

DEFAULT_VIEW = (1.0, -1.75, 1.0)
"""Direction of the eye when none is asked for: from the front (-y), the right (+x) and above."""


@dataclass(frozen=True)
class Camera:
    """An orthographic view.

    Attributes
    ----------
    axes : (3, 3) float64
        Unit vectors of the screen: to the right, upwards, towards the eye.
    """

    axes: FloatArray

    def project(self, points: FloatArray) -> FloatArray:
        """Give screen coordinates.

        Parameters
        ----------
        points : (n_points, 2 or 3) float64, length

        Returns
        -------
        (n_points, 3) float64, length
            To the right, upwards, towards the eye (the largest is the nearest).
        """
        screen: FloatArray = in_space(points) @ self.axes.T
        return screen


def in_space(points: FloatArray) -> FloatArray:
    """Give plane points a third coordinate, zero.

    Parameters
    ----------
    points : (n_points, 2 or 3) float64, length

    Returns
    -------
    (n_points, 3) float64, length
    """
    points = np.asarray(points, np.float64)
    if points.shape[1] == 3:
        return points
    return np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])


def look_from(direction: tuple[float, float, float] | FloatArray) -> Camera:
    """Make the camera that looks from a direction, z upwards (y when the eye is on the z axis).

    Parameters
    ----------
    direction : (3,) float64
        From the object to the eye, of any length but zero.

    Returns
    -------
    Camera
    """
    towards = np.asarray(direction, np.float64)
    towards = towards / np.linalg.norm(towards)
    up = np.array([0.0, 1.0, 0.0]) if abs(towards[2]) > 0.9999 else np.array([0.0, 0.0, 1.0])
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    return Camera(np.array([right, np.cross(towards, right), towards]))


@dataclass(frozen=True)
class Frame:
    """A window of the screen plane, of the shape of the image that shows it.

    Attributes
    ----------
    left, bottom : float, length
        Lower left corner, in screen coordinates.
    pixel : float, length
        Side of a pixel.
    width, height : int
        Size of the image in pixels.
    """

    left: float
    bottom: float
    pixel: float
    width: int
    height: int

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top in screen coordinates."""
        return (
            self.left,
            self.left + self.width * self.pixel,
            self.bottom,
            self.bottom + self.height * self.pixel,
        )

    def pixels(self, screen: FloatArray) -> FloatArray:
        """Give pixel coordinates (column, row counted from the bottom); pixel centres are at halves.

        Parameters
        ----------
        screen : (n, 2 or more) float64, length

        Returns
        -------
        (n, 2) float64
        """
        pixels: FloatArray = (screen[:, :2] - np.array([self.left, self.bottom])) / self.pixel
        return pixels

    def finer(self, factor: int) -> Frame:
        """Give the same window with more pixels."""
        return Frame(self.left, self.bottom, self.pixel / factor, self.width * factor, self.height * factor)


def fit(screen: FloatArray, width: int, height: int, margin: float = 0.04) -> Frame:
    """Centre points in an image without changing their proportions.

    Parameters
    ----------
    screen : (n, 2 or more) float64, length
        Everything that has to be seen, n >= 1.
    width, height : int
        Size of the image in pixels.
    margin : float
        Empty part on each side.

    Returns
    -------
    Frame
    """
    low, high = screen[:, :2].min(axis=0), screen[:, :2].max(axis=0)
    span = high - low
    pixel = float(np.max(span / (np.array([width, height]) * (1.0 - 2.0 * margin))))
    if pixel == 0.0:
        pixel = 1.0 / width
    corner = 0.5 * (low + high) - 0.5 * pixel * np.array([width, height])
    return Frame(float(corner[0]), float(corner[1]), pixel, width, height)
