"""Steps of Newton's method on a contact problem: full, damped, and with a softer augmentation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.history import History
from gibiane_ops.kernels.contact.problem import Problem
from gibiane_ops.kernels.contact.report import ContactState

ROUND_OFF = 1e-14
"""Residual, over the largest load, that no step improves."""

SOFT_GAMMA = 1e-3
"""Second value of gamma: pairs whose slip is small and turns back and forth settle with it."""

_STALL = 8
"""Full steps without a better residual after which another attempt is made."""

_REACH = 1.0
"""Largest damped step, over the displacements and the natural length."""

_MEMORY = 4
"""A damped step must improve on the worst of the last few residuals, not on the last one."""


@dataclass(frozen=True, eq=False)
class Iterate:
    """A pair (w, r) in the units of a problem, with its statuses and residual."""

    w: FloatArray
    r: FloatArray
    status: IntArray
    residual: float
    converged: bool

    @staticmethod
    def of(problem: Problem, w: FloatArray, r: FloatArray, tolerance: float) -> Iterate:
        """Measure w and r."""
        residual = problem.merit(w, r)
        status = problem.project(problem.augmented(w, r))[1]
        return Iterate(w, r, status, residual, residual <= tolerance)

    def better(self, other: Iterate) -> Iterate:
        """Return the one with the smaller residual."""
        return other if other.residual < self.residual else self


def newton_steps(
    problem: Problem,
    first: tuple[FloatArray, FloatArray],
    tolerance: float,
    max_iter: int,
    history: History,
    *,
    damped: bool = False,
) -> tuple[Iterate, Iterate]:
    """Run Newton steps from a first guess and give the best iterate met, and the last.

    Parameters
    ----------
    problem : Problem
    first : tuple of (n, d) float64
        w and r in the units of the problem.
    tolerance : float
    max_iter : int
    history : History
        Grows by one residual a step.
    damped : bool
        Shorten each step until the residual is below the worst of the last few.

    Returns
    -------
    best, last : Iterate
    """
    w, r = first
    recent = [_energy(problem, w, r)]
    best = now = Iterate.of(problem, w, r, tolerance)
    stalled, polished = 0, False
    for _ in range(max_iter):
        # a last step after convergence costs little and leaves round-off only, even where friction is weak
        if best.residual <= ROUND_OFF or (best.converged and polished):
            break
        polished = best.converged
        try:
            dw, dr = problem.step(w, r)
        except np.linalg.LinAlgError:
            break
        t = 1.0
        if damped:
            # where every pair slips a free body is not held, and the step along its motion has no end
            t = min(1.0, _REACH * (1 + float(np.abs(w).max(initial=0))) / (float(np.abs(dw).max(initial=0)) or 1.0))
        smallest = 1e-3 * t
        while damped and t >= smallest:
            if _energy(problem, w + t * dw, r + t * dr) <= (1 - 1e-4 * t) * max(recent):
                break
            t /= 2
        w, r = w + t * dw, r + t * dr
        recent = [*recent[-_MEMORY + 1 :], _energy(problem, w, r)]
        now = Iterate.of(problem, w, r, tolerance)
        history.add(now.residual, now.status)
        best = best.better(now)
        stalled = 0 if best is now else stalled + 1
        if not damped and stalled >= _STALL:
            break
    return best, now


def first_guess(problem: Problem, start: ContactState | None) -> tuple[FloatArray, FloatArray]:
    """Give w and r of a state in the units of a problem; of tied bodies without a state."""
    if start is None:
        return problem.tied()
    return start.w / problem.length, start.r / problem.force


def robust_steps(
    problem: Problem, first: tuple[FloatArray, FloatArray], tolerance: float, max_iter: int, history: History
) -> Iterate:
    """Run full steps, then if needed softer and damped ones, and give the best iterate met.

    Parameters
    ----------
    problem : Problem
    first : tuple of (n, d) float64
    tolerance : float
    max_iter : int
        Steps of each attempt.
    history : History
        Grows by one residual a step.

    Returns
    -------
    Iterate
    """
    best = newton_steps(problem, first, tolerance, max_iter, history)[0]
    return best if best.converged else best.better(other_paths(problem, first, tolerance, max_iter, history))


def other_paths(
    problem: Problem, first: tuple[FloatArray, FloatArray], tolerance: float, max_iter: int, history: History
) -> Iterate:
    """Run the same steps with a softer gamma, damped, and both; robust_steps has tried the full ones."""
    # the gamma of a penalty is its stiffness and stays
    soft = problem if problem.penalty else replace(problem, gamma=min(problem.gamma, SOFT_GAMMA))
    best = Iterate.of(problem, *first, tolerance)
    for attempt, damped in ((soft, False), (problem, True), (soft, True)):
        if not best.converged:
            best = best.better(newton_steps(attempt, first, tolerance, max_iter, history, damped=damped)[0])
    return best


def _energy(problem: Problem, w: FloatArray, r: FloatArray) -> float:
    E1, E2 = problem.residuals(w, r)
    return float(np.sqrt((E1**2).sum() + (E2**2).sum()))
