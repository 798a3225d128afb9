"""Lagrange multipliers with an active set, exact or perturbed: statuses, a saddle-point system, new statuses."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.history import History
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.newton_steps import first_guess
from gibiane_ops.kernels.contact.outcome import finished, physical_state
from gibiane_ops.kernels.contact.penalty import check_stiffness, sprung
from gibiane_ops.kernels.contact.problem import Problem
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.errors import StatusCycle

ROUND_OFF = 1e-14


def solve_multipliers(
    interface: Interface,
    mu: float | FloatArray | Friction,
    *,
    perturbation: float | None = None,
    tolerance: float = 1e-10,
    max_iter: int = 100,
    start: ContactState | None = None,
    slip_origin: FloatArray | None = None,
) -> ContactState:
    """Solve contact with friction by multipliers and an active set.

    Parameters
    ----------
    interface : Interface
    mu : float, (n,) float64 or Friction
    perturbation : float, optional
        g over ``interface.kref`` of the perturbed Lagrangian, whose result is that of the penalty g; the exact
        multipliers when left out.
    tolerance : float
        Largest residual over the largest condensed load.
    max_iter : int
        Saddle-point systems.
    start : ContactState, optional
    slip_origin : (n, d - 1) float64, optional

    Returns
    -------
    ContactState

    Raises
    ------
    StatusCycle
        When the same statuses come back a third time.
    ContactUnbalanced, NotConverged
    UnsupportedLaw
        With adhesion.

    Notes
    -----
    Displacements and multipliers are solved for together, with the conditions that the present statuses give:
    ``w_n + lambda_n / g = gap`` on closed pairs, ``w_t + lambda_t / g = 0`` on sticking ones, ``lambda_t = (mu
    abs(lambda_n) + c) e`` on slipping ones, e linearised, and 1/g = 0 for exact multipliers. Without friction, and in
    the plane, the equations are linear once the statuses are known, and the method ends after a few changes of them.
    There is no safeguard: statuses may cycle, which is detected and reported.

    Source
    ------
    Simo, Wriggers and Taylor 1985, CMAME 50 (perturbed Lagrangian); Hintermuller, Ito and Kunisch 2002, SIAM J. Optim.
    13 (active set).

    Cost
    ----
    Each iteration solves a dense system of twice the size of the interface, indefinite and not symmetric.
    """
    law = Friction.of(interface.n_pairs, mu)
    law.need_no_adhesion("the method of multipliers")
    if perturbation is not None:
        check_stiffness(perturbation)
    problem = Problem.of(interface, law, perturbation or 1.0, slip_origin, penalty=perturbation is not None)
    w, r = sprung(problem, start) if problem.penalty else first_guess(problem, start)
    history = History()
    seen: list[IntArray] = []
    before = None
    best, converged = (w, r, problem.merit(w, r)), False
    for _ in range(max_iter):
        status = problem.project(problem.augmented(w, r))[1]
        if before is not None and not np.array_equal(status, before):
            best_state = _state(interface, law, problem, best, history, slip_origin)
            _raise_if_back(seen, status, history, best_state)
        before = status
        try:
            w, r = _saddle(problem, w, r)
        except np.linalg.LinAlgError:
            break
        history.add(problem.merit(w, r), problem.project(problem.augmented(w, r))[1])
        polished = converged
        if history[-1] < best[2]:
            best = w, r, history[-1]
        converged = best[2] <= tolerance
        # a last iteration after convergence leaves round-off only
        if best[2] <= ROUND_OFF or polished:
            break
    return finished(interface, _state(interface, law, problem, best, history, slip_origin), converged)


def _saddle(problem: Problem, w: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Solve the saddle-point system of the present statuses for corrections of w and of the multipliers."""
    n, d = w.shape
    size = n * d
    P = problem.derivative(problem.augmented(w, r))
    E1, E2 = problem.residuals(w, r)
    place = np.arange(size).reshape(n, d)
    A = np.zeros((2 * size, 2 * size))
    A[:size, :size] = problem.S_newton
    A[range(size), range(size, 2 * size)] = -1.0
    A[size + place[:, :, None], place[:, None, :]] = problem.gamma * P
    A[size + place[:, :, None], size + place[:, None, :]] = np.eye(d) if problem.penalty else np.eye(d) - P
    change = np.linalg.solve(A, -np.concatenate([E2.ravel(), E1.ravel()]))
    return w + change[:size].reshape(n, d), r + change[size:].reshape(n, d)


def _state(
    interface: Interface,
    law: Friction,
    problem: Problem,
    found: tuple[FloatArray, FloatArray, float],
    history: list[float],
    slip_origin: FloatArray | None,
) -> ContactState:
    w, r, _ = found
    status = problem.project(problem.augmented(w, r))[1]
    return physical_state(interface, law, problem, w, r, status, history, slip_origin)


def _raise_if_back(seen: list[IntArray], status: IntArray, history: list[float], state: ContactState) -> None:
    """Compare statuses that have just changed with all earlier ones; twice may be a detour, three times is a cycle."""
    before = [i for i, old in enumerate(seen) if np.array_equal(old, status)]
    seen.append(status)
    if len(before) >= 2:
        loop = np.stack(seen[before[-1] :])
        raise StatusCycle(len(seen) - 1 - before[-1], np.flatnonzero(np.ptp(loop, axis=0)), history, state)
