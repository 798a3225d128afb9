"""Bounds that the law of contact and friction sets on tractions while they are improved."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray

KEPT = 1e-3
"""Pressure to be kept, over the mean one: less is pushed back to it."""

SPENT, LEAST, MOST = 2e-4, 1e-5, 1e-2
"""Part of the squared estimate at the beginning that may be spent on keeping inside the friction bound, and what that
may be: a fraction of the bound. Inside there is room to move; on the bound itself the next change would be stopped."""

TOUCH = 1e-8
"""Excess over a limit that is round-off."""


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
    slide : (n_sides, d, d) float64, length
        ``int N_a (u_first - u_second) / measure`` of the displacements of both cells at each corner: its product with
        the traction is the work of the contact, twice of which is part of the squared estimate.
    margin : float
        Fraction of the bound that tractions are pushed back inside.
    """

    normal: FloatArray
    keep: FloatArray
    bound: FloatArray
    slide: FloatArray
    margin: float = LEAST

    def passed(
        self, tau: FloatArray, sides: IntArray, also: NDArray[np.bool_] | None = None
    ) -> tuple[IntArray, IntArray, IntArray, FloatArray, FloatArray]:
        """Find the corners that are past the law, or nearly.

        Parameters
        ----------
        tau : (k, d, d) float64, force
            Tractions at the corners of `sides`.
        sides : (k,) int64
        also : (k, 2, d) bool, optional
            Corners to be found wherever they are, by kind; then others only where they are past.

        Returns
        -------
        row, corner, kind : (m,) int64
            Places in `tau`; kind 0 pulls, 1 slides more than the bound.
        direction : (m, d) float64
            Unit vector in which the traction is to be diminished.
        over : (m,) float64, force
            By how much.
        """
        normal, bound = self.normal[sides], self.bound[sides]
        contact = (np.abs(normal).max(axis=1, initial=0.0) > 0)[:, None]
        pull, slide, along = _parts(tau, normal)
        held = np.isfinite(bound)
        tight = pull + self.keep[sides, None]
        loose = np.where(held, slide - (1 - self.margin) * np.where(held, bound, 0.0), -1.0)
        room = np.where(held, bound, 0.0)
        if also is None:
            past = np.stack([tight > 0, held & (loose > -0.5 * self.margin * room)], axis=1)
        else:
            far = TOUCH * float(np.abs(tau).max(initial=0.0))
            past = np.stack([tight > far, held & (loose > TOUCH * room)], axis=1) | also
        past &= contact[:, None]
        row, kind, corner = np.nonzero(past)
        size = np.maximum(slide[row, corner], np.finfo(float).tiny)[:, None]
        direction = np.where((kind == 0)[:, None], normal[row], along[row, corner] / size)
        return row, corner, kind, direction, np.where(kind == 0, tight[row, corner], loose[row, corner])

    def step(self, tau: FloatArray, change: FloatArray, sides: IntArray) -> FloatArray:
        """Return how far each side can go along a change and stay within the law, (k,) float64, 1 at most.

        Corners that are outside already set no limit.
        """
        normal, bound = self.normal[sides], self.bound[sides]
        contact = (np.abs(normal).max(axis=1, initial=0.0) > 0)[:, None]
        pull, slide, along = _parts(tau, normal)
        rise, _, across = _parts(change, normal)
        held = np.isfinite(bound)
        limit = np.where(held, bound, 0.0)
        # |along + s across| = bound; corners at their limits may be past them by round-off
        a, b, c = (across**2).sum(axis=2), (along * across).sum(axis=2), slide**2 - limit**2
        far = float(np.abs(tau).max(initial=0.0))
        pull = np.where(pull <= TOUCH * far, np.minimum(pull, 0.0), pull)
        c = np.where(c <= TOUCH * limit**2, np.minimum(c, 0.0), c)
        with np.errstate(divide="ignore", invalid="ignore"):
            push = np.where((pull <= 0) & (pull + rise > 0), -pull / rise, 1.0)
            out = held & (c <= 0) & (a + 2 * b + c > 0)
            grip = np.where(out, (-b + np.sqrt(np.maximum(b * b - a * c, 0.0))) / a, 1.0)
        found = np.where(contact, np.minimum(push, grip), 1.0)
        return np.asarray(np.clip(found, 0.0, 1.0).min(axis=1, initial=1.0), np.float64)

    def spending(self, square: float) -> Limits:
        """Return the same with the margin that costs a small part of the squared estimate at the beginning."""
        work = float((np.where(np.isfinite(self.bound), self.bound, 0.0) * np.linalg.norm(self.slide, axis=2)).sum())
        return replace(self, margin=float(np.clip(SPENT * square / work, LEAST, MOST)) if work else MOST)

    def work(self, tau: FloatArray) -> FloatArray:
        """Return the work of the tractions of each side in its slip, (n_sides,) float64, energy."""
        return np.asarray(np.einsum("sai,sai->s", tau, self.slide), np.float64)

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
