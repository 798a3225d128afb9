"""Exact contact with friction by a semi-smooth Newton method on the condensed problem."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.balance import raise_if_runaway, raise_if_unbalanced
from gibiane_ops.kernels.contact.drift import without_drift
from gibiane_ops.kernels.contact.history import History
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction, friction
from gibiane_ops.kernels.contact.newton_steps import (
    SOFT_GAMMA,
    Iterate,
    first_guess,
    newton_steps,
    other_paths,
    robust_steps,
)
from gibiane_ops.kernels.contact.outcome import physical_state
from gibiane_ops.kernels.contact.problem import BoolArray, Problem
from gibiane_ops.kernels.contact.report import STICK, ContactState, check_state
from gibiane_ops.kernels.contact.splitting import splitting_steps
from gibiane_ops.kernels.errors import NotConverged

_FEW = 20
"""Steps of an attempt that either succeeds soon or not at all."""

_FROZEN = 12
"""Problems with a frozen bound before Newton's steps take over."""

_SPLITTINGS = 6000
"""Alternations of the last attempt."""


def solve_coulomb(
    interface: Interface,
    mu: float | FloatArray | Friction,
    *,
    gamma: float = 1.0,
    tolerance: float = 1e-10,
    max_iter: int = 60,
    start: ContactState | None = None,
    slip_origin: FloatArray | None = None,
) -> ContactState:
    """Solve unilateral contact with friction.

    Parameters
    ----------
    interface : Interface
    mu : float, (n,) float64 or Friction
        Friction coefficients, not negative: 0 is frictionless, infinity contact without slip; or a whole law.
    gamma : float
        Parameter of the method over ``interface.kref``; it changes the path, not the solution.
    tolerance : float
        Largest residual, in force, over the largest condensed load.
    max_iter : int
        Newton steps of one attempt; full steps go on up to twice the number of pairs while they make progress.
    start : ContactState, optional
        First guess, for instance at another coefficient; the tied bodies when left out.
    slip_origin : (n, d - 1) float64, optional
        Tangential displacements at the start of the load step: slip is counted from there.

    Returns
    -------
    ContactState

    Raises
    ------
    ContactUnbalanced
        When no admissible contact force balances the load: the body slides, tips over or flies off.
    NotConverged
        When no solution was found although the load can be balanced; ``best`` holds the best state.
    BadValue
        When a coefficient is negative.

    Notes
    -----
    With ``a = r - gamma (w - gap n)``: open when ``a_n >= 0`` (r = 0), stick when ``abs(a_t) <= mu abs(a_n)`` (w_t = 0)
    and slip otherwise (``r_t = mu abs(r_n) a_t / abs(a_t)``). Coulomb solutions are unique for small coefficients only:
    for large ones this is one solution. When full steps fail, the load is first checked against the cone on the free
    motions; then come a start without friction, a softer gamma, damped steps, growing coefficients, and the slow but
    steady splitting of the bipotential, from which Newton's steps finish; all are counted. With adhesion
    the pairs that touch start bonded, and those whose tension exceeds it come off, the worst first, each set for good.

    Source
    ------
    Alart and Curnier 1991, CMAME 92; Hueber, Stadler and Wohlmuth 2008, SIAM J. Sci. Comput. 30.

    Cost
    ----
    A step solves a dense system whose unknowns are the tangential components of slipping pairs and all components of
    open ones. Adhesion repeats the whole for each set of pairs that comes off.
    """
    law = Friction.of(interface.n_pairs, mu)
    history = History()
    bonded = bonded_at_start(interface, law)
    while True:
        problem = Problem.of(interface, law, gamma, slip_origin, bonded=bonded)
        state = _solve(interface, law, problem, tolerance, max_iter, start, history, slip_origin)
        excess = np.where(bonded, state.r[:, 0] - law.adhesion, 0.0)
        if not (excess > tolerance * problem.force).any():
            return state
        bonded = bonded & (excess < (1 - 1e-6) * excess.max())
        start = state


def bonded_at_start(interface: Interface, law: Friction) -> BoolArray:
    """Find the pairs that adhesion holds: those with adhesion that touch before the load."""
    return (law.adhesion > 0) & (interface.gap <= 1e-9 * interface.length_scale) & interface.active[:, 0]


def solve_tied(interface: Interface) -> ContactState:
    """Give the state of tied bodies: no relative displacement, whatever the sign of the reaction.

    Parameters
    ----------
    interface : Interface

    Returns
    -------
    ContactState
    """
    n, d = interface.n_pairs, interface.dim
    r = np.where(interface.active, -interface.f.reshape(n, d), 0.0)
    status = np.full(n, STICK)
    return check_state(interface, np.zeros((n, d)), r, status, friction(n, mu=np.inf), [], None)


def _solve(
    interface: Interface,
    law: Friction,
    problem: Problem,
    tolerance: float,
    max_iter: int,
    start: ContactState | None,
    history: History,
    slip_origin: FloatArray | None,
) -> ContactState:
    """Try full steps, then softer, damped and gradual ones."""
    first = first_guess(problem, start)

    def state(found: Iterate) -> ContactState:
        return physical_state(interface, law, problem, found.w, found.r, found.status, history, slip_origin)

    best, last = newton_steps(problem, first, tolerance, max_iter, history)
    if not best.converged:
        raise_if_unbalanced(interface, state(best))
        if law.rubs.any():
            best = best.better(_from_frictionless(interface, problem, tolerance, history))
    if not best.converged and law.cohesion.any() and not law.adhesion.any():
        best = best.better(_from_frozen_bounds(problem, tolerance, max_iter, history))
    if not best.converged:
        # slip may spread from pair to pair, one a step: go on as long as there is progress
        more, last = newton_steps(problem, (last.w, last.r), tolerance, 2 * interface.n_pairs, history)
        best = best.better(more)
    if not best.converged:
        best = best.better(other_paths(problem, first, tolerance, max_iter, history))
    soft = replace(problem, gamma=min(problem.gamma, SOFT_GAMMA))
    if not best.converged and law.rubs.any():
        best = best.better(_grow_friction(soft, first, tolerance, max_iter, history))
    if not best.converged and problem.law.is_coulomb and law.rubs.any():
        best = best.better(_from_splitting(problem, first, tolerance, history))
    if not best.converged:
        raise_if_runaway(interface, state(last), state(best))
        wavering = int(np.count_nonzero(best.status != last.status))
        reason = "wavering" if wavering else ""
        raise NotConverged(history, state(best), reason, {"count": wavering})
    return state(best)


def _from_frictionless(interface: Interface, problem: Problem, tolerance: float, history: History) -> Iterate:
    """Start from contact without friction: near it when friction is weak and only settles where the body drifts to."""
    nothing = np.zeros(interface.n_pairs)
    smooth = replace(problem, law=replace(problem.law, mu=nothing, cohesion=nothing), gamma=min(problem.gamma, 0.01))
    free = newton_steps(smooth, problem.tied(), tolerance, _FEW, history)[0]
    first = without_drift(free.w * problem.length, interface) / problem.length, free.r
    return newton_steps(replace(smooth, law=problem.law), first, tolerance, _FEW, history, damped=True)[0]


def _from_frozen_bounds(problem: Problem, tolerance: float, max_iter: int, history: History) -> Iterate:
    """Freeze the bound of friction and update it: with cohesion it jumps where a pair opens, and full steps may cycle.

    The last of the problems with a frozen bound, each a convex one, gives Newton's first guess.
    """
    guess = problem.tied()
    for _ in range(_FROZEN):
        frozen = problem.with_bound(problem.friction_bound(*guess))
        found = robust_steps(frozen, guess, tolerance, max_iter, history)
        guess = found.w, found.r
    return newton_steps(problem, guess, tolerance, _FEW, history)[0]


def _grow_friction(
    problem: Problem, first: tuple[FloatArray, FloatArray], tolerance: float, max_iter: int, history: History
) -> Iterate:
    """Follow the solution from a small friction to the given one."""
    guess, law = first, problem.law
    for part in (0.1, 0.25, 0.5, 0.75, 0.9):
        milder = replace(problem, law=replace(law, mu=part * law.mu, cohesion=part * law.cohesion))
        found = newton_steps(milder, guess, tolerance, max_iter, history, damped=True)[0]
        guess = found.w, found.r
    return newton_steps(problem, guess, tolerance, max_iter, history, damped=True)[0]


def _from_splitting(
    problem: Problem, first: tuple[FloatArray, FloatArray], tolerance: float, history: History
) -> Iterate:
    """Alternate equilibrium and cone, and try to finish with Newton's steps now and then."""
    best = Iterate.of(problem, *first, tolerance)
    for number, (w, r) in enumerate(islice(splitting_steps(problem, first, 1.0), _SPLITTINGS), 1):
        history.add(problem.merit(w, r), problem.project(problem.augmented(w, r))[1])
        if number % 200 == 0:
            best = best.better(newton_steps(problem, (w, r), tolerance, _FEW, history)[0])
            if best.converged:
                break
    return best
