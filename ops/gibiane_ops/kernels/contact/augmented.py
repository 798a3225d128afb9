"""Augmented Lagrangian: by one Newton method on all unknowns, or by Uzawa's updates of the multipliers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.history import History
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.newton_steps import first_guess, newton_steps
from gibiane_ops.kernels.contact.outcome import finished, physical_state
from gibiane_ops.kernels.contact.penalty import check_stiffness, penalty_steps, sprung
from gibiane_ops.kernels.contact.problem import Problem
from gibiane_ops.kernels.contact.report import ContactState


def solve_augmented_newton(
    interface: Interface,
    mu: float | FloatArray | Friction,
    r: float,
    *,
    tolerance: float = 1e-10,
    max_iter: int = 60,
    start: ContactState | None = None,
    slip_origin: FloatArray | None = None,
) -> ContactState:
    """Solve contact with friction by Newton's method on the augmented Lagrangian, without safeguard.

    Parameters
    ----------
    interface : Interface
    mu : float, (n,) float64 or Friction
    r : float
        Parameter of the augmented Lagrangian over ``interface.kref``.
    tolerance : float
        Largest residual over the largest condensed load.
    max_iter : int
        Newton steps.
    start : ContactState, optional
    slip_origin : (n, d - 1) float64, optional

    Returns
    -------
    ContactState

    Raises
    ------
    ContactUnbalanced, NotConverged, UnsupportedLaw
    BadValue
        When r is not positive.

    Notes
    -----
    The equations of ``solve_coulomb`` with gamma = r, full steps only: the textbook method, for comparison. The
    solution does not depend on r, the convergence does: with a large r and pairs that slip in space, full steps may
    oscillate.

    Source
    ------
    Alart and Curnier 1991, CMAME 92.

    Cost
    ----
    One dense factorisation a step.
    """
    law = Friction.of(interface.n_pairs, mu)
    law.need_no_adhesion("the augmented Lagrangian")
    check_stiffness(r)
    problem = Problem.of(interface, law, r, slip_origin)
    history = History()
    found = newton_steps(problem, first_guess(problem, start), tolerance, max_iter, history)[0]
    state = physical_state(interface, law, problem, found.w, found.r, found.status, history, slip_origin)
    return finished(interface, state, found.converged)


def solve_uzawa(
    interface: Interface,
    mu: float | FloatArray | Friction,
    r: float,
    *,
    tolerance: float = 1e-8,
    max_iter: int = 400,
    start: ContactState | None = None,
    slip_origin: FloatArray | None = None,
) -> ContactState:
    """Solve contact with friction by Uzawa's method on the augmented Lagrangian.

    Parameters
    ----------
    interface : Interface
    mu : float, (n,) float64 or Friction
    r : float
        Penalty over ``interface.kref``.
    tolerance : float
        Largest change of a multiplier over the largest condensed load; the residual of the exact equations must also
        be below a hundred times as much, since the updates of a small r change little far from the solution.
    max_iter : int
        Updates of the multipliers.
    start : ContactState, optional
        Whose forces are the first multipliers; zero when left out, so that the first pass is the penalty method.
    slip_origin : (n, d - 1) float64, optional

    Returns
    -------
    ContactState
        ``history`` holds the relative change of the multipliers after each update.

    Raises
    ------
    ContactUnbalanced, NotConverged, UnsupportedLaw
    BadValue
        When r is not positive.

    Notes
    -----
    Each pass solves the penalty problem with the multipliers as an added force, then takes the forces found as the
    new multipliers: ``lambda = law(lambda - g (w - gap n))``. The error falls by about 1 / (1 + r) a pass: a few passes
    from r = 100 on, hundreds at r = 0.1, and no end below; there is no upper limit on a condensed interface. A pass
    whose inner problem is not solved ends the method, unconverged: see ``solve_penalty`` for where that happens.

    Source
    ------
    Glowinski and Le Tallec 1989, Augmented Lagrangian and Operator-Splitting Methods; Simo and Laursen 1992, Computers
    and Structures 42.

    Cost
    ----
    Some 2 to 6 dense factorisations a pass.
    """
    law = Friction.of(interface.n_pairs, mu)
    law.need_no_adhesion("Uzawa's method")
    check_stiffness(r)
    problem = Problem.of(interface, law, r, slip_origin, penalty=True)
    now = sprung(problem, start)
    if start is not None:
        problem = replace(problem, multiplier=now[1])
    exact = Problem.of(interface, law, 1.0, slip_origin)
    history = History()
    converged, reason = False, ""
    for _ in range(max_iter):
        inner = History()
        # the inner residual adds to the error of the multipliers: keep it well below
        accuracy = min(1e-10, 0.01 * tolerance)
        found = penalty_steps(problem, now, accuracy, 60, inner)
        now = found.w, found.r
        change = float(np.abs(found.r - problem.multiplier).max(initial=0))
        history.add(change, exact.project(exact.augmented(*now))[1])
        problem = replace(problem, multiplier=found.r)
        converged = history[-1] <= tolerance and exact.merit(*now) <= 100 * tolerance
        if converged or not found.converged:
            converged = converged and found.converged
            if not found.converged:
                reason = "inner"
            break
    status = exact.project(exact.augmented(*now))[1]
    state = physical_state(interface, law, problem, *now, status, history, slip_origin)
    return finished(interface, state, converged, reason, number=len(history), steps=len(inner))
