"""Coulomb friction as a sequence of Tresca problems: the bound frozen, solved, updated."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.history import History
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.newton_steps import first_guess, robust_steps
from gibiane_ops.kernels.contact.outcome import finished, physical_state
from gibiane_ops.kernels.contact.problem import Problem
from gibiane_ops.kernels.contact.report import ContactState


def solve_tresca_sequence(
    interface: Interface,
    mu: float | FloatArray | Friction,
    *,
    tolerance: float = 1e-8,
    max_iter: int = 100,
    start: ContactState | None = None,
    slip_origin: FloatArray | None = None,
) -> ContactState:
    """Solve contact with friction by the fixed point on the friction bound.

    Parameters
    ----------
    interface : Interface
    mu : float, (n,) float64 or Friction
    tolerance : float
        Largest change of a bound over the largest bound.
    max_iter : int
        Tresca problems.
    start : ContactState, optional
        Whose normal forces give the first bound; the tied bodies when left out.
    slip_origin : (n, d - 1) float64, optional

    Returns
    -------
    ContactState
        ``history`` holds the relative change of the bound after each Tresca problem.

    Raises
    ------
    ContactUnbalanced
    NotConverged
        After ``max_iter`` problems: the sequence does not contract. ``best`` holds the last state.
    UnsupportedLaw
        With adhesion.

    Notes
    -----
    With ``g = mu abs(r_n) + cohesion`` frozen, the problem is that of the minimum of a convex energy, with a symmetric
    matrix; it is solved by semi-smooth Newton steps. The error is multiplied at each update by a ratio that grows with
    mu: fast for weak friction, slow near the limit of slip, not convergent for large coefficients. The ratio is the
    simplest test of whether the solution is a contracting one, hence unique.

    Source
    ------
    Necas, Jarusek and Haslinger 1980; Haslinger, Hlavacek and Necas 1996, Handbook of Numerical Analysis IV.

    Cost
    ----
    Some 4 to 20 Tresca problems of 2 to 5 dense factorisations each.
    """
    law = Friction.of(interface.n_pairs, mu)
    law.need_no_adhesion("the Tresca fixed point")
    problem = Problem.of(interface, law, 1.0, slip_origin)
    now = first_guess(problem, start)
    bound = problem.friction_bound(*now)
    history = History()
    converged = False
    for _ in range(max_iter):
        found = robust_steps(problem.with_bound(bound), now, 1e-10, 60, History())
        now = found.w, found.r
        new = problem.friction_bound(*now)
        scale = float(new.max(initial=0))
        change = float(np.abs(new - bound).max(initial=0))
        history.add(change / scale if scale else change, problem.project(problem.augmented(*now))[1])
        bound = new
        if history[-1] <= tolerance or not found.converged:
            converged = found.converged
            break
    status = problem.project(problem.augmented(*now))[1]
    state = physical_state(interface, law, problem, *now, status, history, slip_origin)
    return finished(interface, state, converged)
