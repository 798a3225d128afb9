"""Projected conjugate gradients for contact without friction: a quadratic energy with bounds."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.history import History
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.newton_steps import first_guess
from gibiane_ops.kernels.contact.outcome import finished, physical_state
from gibiane_ops.kernels.contact.problem import Problem
from gibiane_ops.kernels.contact.report import OPEN, SLIP, ContactState
from gibiane_ops.kernels.errors import UnsupportedLaw


def solve_projected_cg(
    interface: Interface,
    mu: float | FloatArray | Friction = 0.0,
    *,
    tolerance: float = 1e-10,
    max_iter: int = 5000,
    start: ContactState | None = None,
) -> ContactState:
    """Solve contact without friction by projected conjugate gradients.

    Parameters
    ----------
    interface : Interface
    mu : float, (n,) float64 or Friction
        Must be zero: friction makes the problem no quadratic program.
    tolerance : float
        Largest component of the projected gradient over the largest condensed load.
    max_iter : int
        Products by S.
    start : ContactState, optional
        The pairs at rest when left out.

    Returns
    -------
    ContactState

    Raises
    ------
    ContactUnbalanced, NotConverged
    UnsupportedLaw
        With friction.

    Notes
    -----
    Minimises ``w.S.w / 2 - f.w`` under ``w_n <= gap``: conjugate gradients on the free components, an expansion with a
    fixed step where a bound stops them, and a release of the bounds when their gradient dominates (modified
    proportioning with reduced gradient projections). Always converges when the energy has a minimum; the number of
    steps is that of conjugate gradients on S, a few tens, times the changes of the set of closed pairs.

    Source
    ------
    Dostal and Schoberl 2005, Computational Optimization and Applications 30.

    Cost
    ----
    One product by S a step; the largest eigenvalue of S at the start.
    """
    law = Friction.of(interface.n_pairs, mu)
    if law.rubs.any() or law.adhesion.any():
        raise UnsupportedLaw("projected CG", "contact without friction")
    problem = Problem.of(interface, law, 1.0)
    S, f = problem.S, problem.f
    limits = np.full(problem.origin.shape, np.inf)
    limits[problem.holds, 0] = problem.origin[problem.holds, 0]
    bound: FloatArray = limits.ravel()
    w = np.minimum(np.zeros(len(f)) if start is None else first_guess(problem, start)[0].ravel(), bound)
    fixed_step = 1 / float(np.linalg.eigvalsh(S)[-1])
    g = S @ w - f
    p = np.where(w < bound, g, 0.0)
    history = History()
    converged = False
    while len(history) < max_iter:
        free = w < bound
        phi, beta = np.where(free, g, 0.0), np.where(free, 0.0, np.maximum(g, 0.0))
        closed = ~free.reshape(problem.origin.shape)[:, 0]
        history.add(float(np.abs(phi + beta).max(initial=0)), np.where(closed, SLIP, OPEN))
        if history[-1] <= tolerance:
            converged = True
            break
        # the free gradient, cut where a step would leave the bounds at once
        reduced = np.where(free, np.maximum(phi, -(bound - w) / fixed_step), 0.0)
        if beta @ beta > reduced @ phi:
            w, g = _descend(S, w, g, beta)
            p = np.where(w < bound, g, 0.0)
            continue
        Sp = S @ p
        curvature = float(p @ Sp)
        if curvature <= 1e-14 * float(p @ p):
            # a motion without stiffness and under load: there is no minimum unless a bound stops it
            reach = _reach(w, p, bound)
            if not np.isfinite(reach):
                break
            w, g = w - reach * p, g - reach * Sp
            w = np.minimum(w, bound)
            p = np.where(w < bound, g, 0.0)
            continue
        step, reach = float(g @ p) / curvature, _reach(w, p, bound)
        if step <= reach:
            w, g = w - step * p, g - step * Sp
            phi = np.where(w < bound, g, 0.0)
            p = phi - float(phi @ Sp) / curvature * p
        else:
            w, g = w - reach * p, g - reach * Sp
            w = np.minimum(w - fixed_step * np.where(w < bound, g, 0.0), bound)
            g = S @ w - f
            p = np.where(w < bound, g, 0.0)
    shape = problem.origin.shape
    w = w.reshape(shape)
    r, status = problem.project(problem.augmented(w, np.where(w < limits, 0.0, g.reshape(shape))))
    return finished(interface, physical_state(interface, law, problem, w, r, status, history, None), converged)


def _reach(w: FloatArray, p: FloatArray, bound: FloatArray) -> float:
    """Give the longest step against p that stays within the bounds."""
    towards = p < 0
    return float(((w - bound)[towards] / p[towards]).min(initial=np.inf))


def _descend(S: FloatArray, w: FloatArray, g: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Step along released bounds to the minimum."""
    Sd = S @ d
    step = float(g @ d) / float(d @ Sd)
    return w - step * d, g - step * Sd
