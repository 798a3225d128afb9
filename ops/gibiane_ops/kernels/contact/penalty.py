"""Penalty: the pairs are springs, a compression needs a penetration and a friction force an elastic slip."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.history import History
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.newton_steps import Iterate, first_guess, newton_steps
from gibiane_ops.kernels.contact.outcome import finished, physical_state
from gibiane_ops.kernels.contact.problem import Problem
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.errors import BadValue


def solve_penalty(
    interface: Interface,
    mu: float | FloatArray | Friction,
    stiffness: float,
    *,
    tolerance: float = 1e-10,
    max_iter: int = 60,
    start: ContactState | None = None,
    slip_origin: FloatArray | None = None,
) -> ContactState:
    """Solve contact with friction by penalty.

    Parameters
    ----------
    interface : Interface
    mu : float, (n,) float64 or Friction
    stiffness : float
        Of the springs, over ``interface.kref``.
    tolerance : float
        Largest residual of the penalised equations over the largest condensed load.
    max_iter : int
        Newton steps of one attempt: full ones, then damped ones from the same start.
    start : ContactState, optional
        The springs carry its forces, or those of tied bodies that are compressed.
    slip_origin : (n, d - 1) float64, optional

    Returns
    -------
    ContactState
        Converged to the penalty law; ``report`` measures it against the exact law, which it breaks by a penetration.
        ``history`` holds every step made.

    Raises
    ------
    ContactUnbalanced, NotConverged, UnsupportedLaw
    BadValue
        When the stiffness is not positive.

    Notes
    -----
    ``r = law(-g (w - gap n))``: normal force ``-g`` times the penetration, tangential force ``-g w_t`` cut at the
    bound. The error of displacements and forces is proportional to 1/g; the conditioning of the unreduced matrix
    ``K + g C^T C`` grows like g, which on the condensed interface costs nothing: 1e4 to 1e6 leave 4 to 6 digits. A g
    below 1 gives a wrong answer with an excellent residual. Where friction is weak and the contact opens, full
    steps go round in circles and damped ones of limited length follow; nothing else is tried.

    Source
    ------
    Oden and Kikuchi 1982; Wriggers 2006, Computational Contact Mechanics, chapter 6.

    Cost
    ----
    Some 3 to 8 dense factorisations of all components, whatever g.
    """
    law = Friction.of(interface.n_pairs, mu)
    law.need_no_adhesion("the penalty method")
    check_stiffness(stiffness)
    problem = Problem.of(interface, law, stiffness, slip_origin, penalty=True)
    history = History()
    found = penalty_steps(problem, sprung(problem, start), tolerance, max_iter, history)
    state = physical_state(interface, law, problem, found.w, found.r, found.status, history, slip_origin)
    return finished(interface, state, found.converged)


def penalty_steps(
    problem: Problem,
    first: tuple[FloatArray, FloatArray],
    tolerance: float,
    max_iter: int,
    history: History,
) -> Iterate:
    """Solve a penalised problem by full Newton steps, then by damped ones from the same start.

    Parameters
    ----------
    problem : Problem
        With ``penalty``.
    first : tuple of (n, d) float64
    tolerance : float
    max_iter : int
        Steps of each attempt.
    history : History
        Grows by one residual a step, those of both attempts.

    Returns
    -------
    Iterate
    """
    found = newton_steps(problem, first, tolerance, max_iter, history)[0]
    if found.converged:
        return found
    return found.better(newton_steps(problem, first, tolerance, max_iter, history, damped=True)[0])


def check_stiffness(r: float) -> None:
    """Raise BadValue unless a penalty, over kref, is positive and finite.

    Raises
    ------
    BadValue
    """
    if not (0 < r < np.inf):
        raise BadValue("penalty r", r, "r > 0, a multiple of the stiffness of the interface")


def sprung(problem: Problem, start: ContactState | None) -> tuple[FloatArray, FloatArray]:
    """Give a first guess whose springs carry the forces of a state, or of the tied bodies."""
    w, r = first_guess(problem, start)
    if start is None:
        # closed pairs pass the tied force on to their springs, those in tension stay at their gap
        w = problem.origin - np.where(r[:, :1] < 0, r, 0.0) / problem.gamma
        w = np.where(problem.holds[:, None], w, 0.0)
    return w, r
