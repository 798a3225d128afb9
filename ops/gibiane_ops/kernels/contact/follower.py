"""The bodies themselves, that follow the relative displacements of a small model of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.condensation import Condensation, TiedSolution
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.tied import PASSES

LOOSE = 1e-9
"""Relative residual of the tied solution, for iterations, at which contact may stop."""

PARTLY = 1e-5
"""Relative residual of a solution with a factor in single precision that suffices: one substitution, as a rule."""

ENTIRELY = 1e-12
"""And that of the result, over the load."""

CAUTION = 10.0
"""What a solution leaves in energy norm, over its residual in the mean square, is at most this much more."""


class Follower:
    """The bodies themselves, that follow the relative displacements of the small model.

    Attributes
    ----------
    w : (n d,) float64
        Relative displacements so far.
    x : (n_v,) float64
        Solution of ``Kvv x = Kvw w``, but for ``rest``.
    y : (n d,) float64
        ``S w``.
    rest : (n_v,) float64
        What is left of the equations of x; each solution takes the rest of the one before with it.
    missed : float
        Estimate of the energy norm of what the rest leaves out of x.
    """

    def __init__(self, bodies: Condensation, load: TiedSolution) -> None:
        self._bodies, self._load = bodies, load
        self._tied = bodies.tied
        self._size = float(np.linalg.norm(self._tied.A @ load.x))
        self.w, self.y = np.zeros(len(load.f)), np.zeros(len(load.f))
        self.x, self.rest = np.zeros(len(load.x)), np.zeros(len(load.x))
        self.missed = 0.0

    def interface(self, gap: FloatArray) -> Interface:
        """Put together the interface whose force on w is the true one, ``y - f``."""
        learned = self._bodies.learned
        assert learned is not None
        f = self._load.f
        if not self._tied.exact:
            f = learned.still(learned.S @ self.w - self.y) + f
        return replace(self._bodies.interface_of(self._load, learned, gap), f=f)

    def move(self, w: FloatArray) -> None:
        """Go to w with one solution, which takes the rest of the one before with it."""
        bodies, tied = self._bodies, self._tied
        assert bodies.learned is not None
        if tied.direct:
            # of the change alone: round-off of a body that has slid far would hide the last corrections
            dw = w - self.w
            self.rest = self.rest + bodies.coupling(dw)
            self.w = w
            self._correct(dw, PARTLY)
            return
        right = bodies.coupling(w)
        if not self.x.any():
            self.x = bodies.recalled(w)
        before = right - tied.A @ self.x
        x = self.x + tied.once(before)
        x = x + bodies.small().solve(right - tied.A @ x)
        rest = right - tied.A @ x
        self.missed = _left(before, rest, x - self.x)
        self.w, self.x, self.rest = w, x, rest
        self.y = bodies.learned.still(bodies.force(w, x))

    def settle(self) -> bool:
        """Solve for the rest, until the displacement is as accurate as the forces; tell whether it was not."""
        tied = self._tied
        size = max(float(np.linalg.norm(self._bodies.coupling(self.w))), self._size)
        wanted = ENTIRELY if tied.direct else LOOSE
        for count in range(PASSES):
            if float(np.linalg.norm(self.rest)) <= wanted * size:
                return count > 0
            if tied.direct:
                self._correct(np.zeros(len(self.w)), wanted * size / float(np.linalg.norm(self.rest)))
            else:
                dx = tied.once(self.rest)
                self.x, self.rest = self.x + dx, self.rest - tied.A @ dx
        return True

    def _correct(self, dw: FloatArray, tolerance: float) -> None:
        """Solve for the rest, to a relative residual, and add a change of w whose force the rest holds."""
        dx = self._tied.once(self.rest, tolerance)
        self.x = self.x + dx
        before, self.rest = self.rest, self.rest - self._tied.A @ dx
        self.missed = _left(before, self.rest, dx)
        learned = self._bodies.learned
        assert learned is not None
        self.y = self.y + learned.still(self._bodies.force(dw, dx))


def _left(before: FloatArray, after: FloatArray, dx: FloatArray) -> float:
    """Estimate the energy norm of what a solution dx for one rest leaves, from the rest after it."""
    size = float(np.linalg.norm(before))
    if size == 0:
        return 0.0
    return CAUTION * float(np.linalg.norm(after)) / size * float(np.sqrt(max(float(before @ dx), 0.0)))
