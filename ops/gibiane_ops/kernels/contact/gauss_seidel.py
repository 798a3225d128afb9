"""Projected Gauss-Seidel on the condensed interface: pair after pair, the law applied to each in turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.balance import raise_if_unbalanced
from gibiane_ops.kernels.contact.history import History
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.newton_steps import first_guess
from gibiane_ops.kernels.contact.outcome import PATIENCE, finished, physical_state
from gibiane_ops.kernels.contact.problem import Problem
from gibiane_ops.kernels.contact.report import ContactState

_LOOSE = 1e-6
"""Least stiffness of a pair in a sweep, over kref."""

_CHECK = 5
"""Sweeps between two measures of the residual."""


def solve_gauss_seidel(
    interface: Interface,
    mu: float | FloatArray | Friction,
    *,
    tolerance: float = 1e-8,
    max_iter: int = 20000,
    start: ContactState | None = None,
    slip_origin: FloatArray | None = None,
) -> ContactState:
    """Solve contact with friction by projected Gauss-Seidel sweeps.

    Parameters
    ----------
    interface : Interface
    mu : float, (n,) float64 or Friction
    tolerance : float
        Largest residual over the largest condensed load.
    max_iter : int
        Sweeps.
    start : ContactState, optional
        The pairs at rest when left out.
    slip_origin : (n, d - 1) float64, optional

    Returns
    -------
    ContactState
        ``history`` holds the residual after each sweep, in the units of the problem; between two full measures the
        last one is repeated.

    Raises
    ------
    ContactUnbalanced, NotConverged, UnsupportedLaw

    Notes
    -----
    The normal displacement of a pair minimises the energy with the others held, cut at its gap; its tangential
    displacement likewise, against the friction of the normal force just found. Without friction, and for Tresca's
    bound, the energy falls at each sweep and the method always converges; with Coulomb it has no proof and is robust.
    No matrix is factorised and nothing is shared with the Newton methods: an independent check. The number of sweeps
    grows with the freedom of the bodies: a flexible strip, or a body about to slide, needs thousands.

    Source
    ------
    Jourdan, Alart and Jean 1998, CMAME 155.

    Cost
    ----
    A sweep costs (n d)^2 operations and a Python loop over the pairs; tens to hundreds of sweeps.
    """
    law = Friction.of(interface.n_pairs, mu)
    law.need_no_adhesion("projected Gauss-Seidel")
    problem = Problem.of(interface, law, 1.0, slip_origin)
    w = (np.zeros_like(problem.origin) if start is None else first_guess(problem, start)[0]).copy()
    history = History()
    converged = False
    sweep = _Sweep(problem)
    r = np.zeros_like(w)

    def state() -> ContactState:
        balance = (problem.S @ w.ravel() - problem.f).reshape(w.shape)
        forces, status = problem.project(problem.augmented(w, np.where(interface.active, balance, 0.0)))
        return physical_state(interface, law, problem, w, forces, status, history, slip_origin)

    for number in range(max_iter):
        sweep.run(w, r)
        if number % _CHECK == 0 or number == max_iter - 1:
            # the forces of equilibrium, so that the residual is that of the law alone
            balance = (problem.S @ w.ravel() - problem.f).reshape(w.shape)
            forces = np.where(interface.active, balance, 0.0)
            residual, status = problem.merit(w, forces), problem.project(problem.augmented(w, forces))[1]
            sweep.restart(w)
        history.add(residual, status)
        if residual <= tolerance:
            converged = True
            break
        if number == PATIENCE:
            raise_if_unbalanced(interface, state())
    return finished(interface, state(), converged)


class _Sweep:
    """One pass over the pairs, with the residual ``S w - f`` kept up to date."""

    def __init__(self, problem: Problem) -> None:
        n, d = problem.origin.shape
        self.problem, self.n, self.d = problem, n, d
        self.columns = np.ascontiguousarray(problem.S.reshape(n * d, n, d).transpose(1, 0, 2))
        local = problem.S.reshape(n, d, n, d)[np.arange(n), :, np.arange(n)]
        # a pair alone on a free motion has no stiffness of its own: it moves far, which is what happens
        self.normal = np.maximum(local[:, 0, 0], _LOOSE)
        tangent = np.linalg.norm(local[:, 1:, 1:], ord=2, axis=(1, 2)) if d > 1 else np.ones(n)
        self.tangent = np.maximum(tangent, _LOOSE)
        self.laws = [_pair(problem.law, i) for i in range(n)]
        self.g = -problem.f.copy()

    def restart(self, w: FloatArray) -> None:
        """Compute the residual anew, against the growth of round-off."""
        self.g = self.problem.S @ w.ravel() - self.problem.f

    def run(self, w: FloatArray, r: FloatArray) -> None:
        """Update w and r in place."""
        origin, holds, d = self.problem.origin, self.problem.holds, self.d
        for i in range(self.n):
            here = slice(i * d, i * d + d)
            stiffness = self.normal[i]
            new = w[i, 0] - self.g[i * d] / stiffness
            if holds[i] and new > origin[i, 0]:
                r[i, 0] = -stiffness * (new - origin[i, 0])
                new = origin[i, 0]
            else:
                r[i, 0] = 0.0
            self.g += self.columns[i, :, 0] * (new - w[i, 0])
            w[i, 0] = new
            k = self.tangent[i]
            pull = self.g[here][1:] - k * (w[i, 1:] - origin[i, 1:])
            t = float(np.sqrt(pull @ pull))
            law = self.laws[i]
            s = law.length(np.array([t]), law.bound(r[i, :1]), k)[0][0]
            r[i, 1:] = (s / t if t > 0 else 0.0) * pull
            change = origin[i, 1:] + (r[i, 1:] - pull) / k - w[i, 1:]
            self.g += self.columns[i, :, 1:] @ change
            w[i, 1:] += change


def _pair(law: Friction, i: int) -> Friction:
    """Take the law of one pair."""
    one = slice(i, i + 1)
    return replace(
        law, mu=law.mu[one], cohesion=law.cohesion[one], slip_stiffness=law.slip_stiffness[one],
        exponent=law.exponent[one], slip_scale=law.slip_scale[one], adhesion=law.adhesion[one],
    )  # fmt: skip
