"""Bounds that the law of contact and friction sets on tractions while they are improved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray

MARGIN = 1e-3
"""What tractions are pushed back to: this part of the mean pressure, or of the friction bound, inside the law."""


@dataclass(frozen=True, eq=False)
class Limits:
    """Sides whose tractions must push, and slide no more than a bound lets them.

    Attributes
    ----------
    normal : (n_sides, d) float64
        Unit normals of the sides in contact, leaving their first cell; zero elsewhere.
    keep : (n_sides,) float64, force
        Pressure that is to be kept.
    bound : (n_sides, d) float64, force
        Largest tangential traction at each corner where it may change; infinite elsewhere.
    """

    normal: FloatArray
    keep: FloatArray
    bound: FloatArray

    def passed(self, tau: FloatArray, sides: IntArray) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """Find the corners that are past the law, or nearly.

        Parameters
        ----------
        tau : (k, d, d) float64, force
            Tractions at the corners of `sides`.
        sides : (k,) int64

        Returns
        -------
        row, corner : (m,) int64
            Places in `tau`; a corner may be past both limits.
        direction : (m, d) float64
            Unit vector in which the traction is to be diminished.
        over : (m,) float64, force
            By how much.
        """
        normal, bound = self.normal[sides], self.bound[sides]
        contact = (np.abs(normal).max(axis=1, initial=0.0) > 0)[:, None]
        pull, slide, along = _parts(tau, normal)
        tight = pull + self.keep[sides, None]
        held = np.where(np.isfinite(bound), bound, 0.0)
        loose = np.where(np.isfinite(bound), slide - (1 - MARGIN) * held, -1.0)
        a, b = np.nonzero((tight > 0) & contact)
        c, d = np.nonzero((loose > 0) & contact)
        size = np.maximum(slide[c, d], np.finfo(float).tiny)[:, None]
        return (
            np.concatenate([a, c]),
            np.concatenate([b, d]),
            np.concatenate([normal[a], along[c, d] / size]),
            np.concatenate([tight[a, b], loose[c, d]]),
        )

    def step(self, tau: FloatArray, change: FloatArray, sides: IntArray) -> FloatArray:
        """Return how far each side can go along a change and stay within the law, (k,) float64, 1 at most.

        Corners that are outside already set no limit.
        """
        normal, bound = self.normal[sides], self.bound[sides]
        contact = (np.abs(normal).max(axis=1, initial=0.0) > 0)[:, None]
        pull, slide, along = _parts(tau, normal)
        rise, _, across = _parts(change, normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            push = np.where((pull <= 0) & (pull + rise > 0), -pull / rise, 1.0)
            # |along + s across| = bound
            a, b = (across**2).sum(axis=2), (along * across).sum(axis=2)
            c = np.where(np.isfinite(bound), slide**2 - bound**2, -1.0)
            out = np.isfinite(bound) & (c <= 0) & (a + 2 * b + c > 0)
            grip = np.where(out, (-b + np.sqrt(np.maximum(b * b - a * c, 0.0))) / a, 1.0)
        found = np.where(contact, np.minimum(push, grip), 1.0)
        return np.asarray(np.clip(found, 0.0, 1.0).min(axis=1, initial=1.0), np.float64)

    def excess(self, tau: FloatArray) -> float:
        """Return the largest violation over the largest traction of the sides in contact; not positive within the law.

        Parameters
        ----------
        tau : (n_sides, d, d) float64, force
        """
        sides = np.flatnonzero(np.abs(self.normal).max(axis=1, initial=0.0) > 0)
        pull, slide, _ = _parts(tau[sides], self.normal[sides])
        bound = self.bound[sides]
        over = max(float(pull.max(initial=-np.inf)), float((slide - bound).max(initial=-np.inf)))
        largest = float(np.abs(tau[sides]).max(initial=0.0))
        return over / largest if largest else 0.0


def _parts(tau: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Split tractions: normal part (k, d), length of the tangential one (k, d), and that one (k, d, d)."""
    pull = np.einsum("kai,ki->ka", tau, normal)
    along = tau - pull[..., None] * normal[:, None]
    return pull, np.linalg.norm(along, axis=2), along
