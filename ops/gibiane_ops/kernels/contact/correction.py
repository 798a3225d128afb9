"""Contact by a small model of the bodies that solutions with the tied matrix correct (reduced compliance)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.condense import Condensation, TiedSolution
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.newton import solve_tied
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.contact.solver_error import solver_error
from gibiane_ops.kernels.contact.tied import PASSES
from gibiane_ops.kernels.errors import ContactUnbalanced, NotConverged, StatusCycle

AGREEMENT = 1e-9
"""Largest difference between the forces of the small model and the true ones, over the largest force."""

REST = 1e-11
"""Norm of the forces that a solution with a factor in single precision may leave, over the largest force."""

ROUGHEST = 1e-5
"""Largest relative residual of such a solution: less would spoil what the small model learns from it."""

LOOSE = 1e-9
"""Relative residual of the tied solution, for iterations, at which contact may stop."""

MOST = 40
"""Corrections after which the loop is given up."""

PATIENCE = 8
"""Corrections in a row without halving the best difference after which the loop is given up."""

Run = Callable[[Interface], ContactState]
Again = Callable[[Interface, ContactState], ContactState]
Failure = (NotConverged, StatusCycle, ContactUnbalanced)


@dataclass(frozen=True, eq=False)
class Corrected:
    """A contact state of the bodies themselves.

    Attributes
    ----------
    state : ContactState
    interface : Interface
        Its stiffness is exact on the state when ``exact`` is false, everywhere when it is true.
    displacement : (n_dofs,) float64
    corrections : int
        Solutions with the tied matrix beyond that of the load; 0 when the tied bodies were the solution.
    exact : bool
    left : float
        Estimate of the energy norm of what was left when the corrections stopped early; 0 when they did not.
    """

    state: ContactState
    interface: Interface
    displacement: FloatArray
    corrections: int
    exact: bool
    left: float = 0.0


class Stalled(Exception):
    """The corrections do not converge.

    Attributes
    ----------
    differences : list of float
        Relative errors of the forces so far.
    state : ContactState
        The last one.
    """

    def __init__(self, differences: list[float], state: ContactState) -> None:
        super().__init__(f"{len(differences)} corrections, last difference {differences[-1]:.1e}")
        self.differences = differences
        self.state = state


def tied_holds(interface: Interface, law: Friction, slip_origin: FloatArray | None) -> bool:
    """Tell whether the tied bodies are a solution: no gap, no tension, every friction force within its bound.

    Parameters
    ----------
    interface : Interface
        Its stiffness is not used.
    law : Friction
    slip_origin : (n, d - 1) float64 or None

    Returns
    -------
    bool
        False also where elastic slip or a viscous law gives a slip to any force.
    """
    if law.is_elastic or (law.exponent > 0).any() or not law.rubs.all() or (interface.gap != 0).any():
        return False
    if slip_origin is not None and np.any(slip_origin):
        return False
    if not interface.active[:, 0].all():
        return False
    r = -interface.f.reshape(interface.n_pairs, interface.dim)
    bound = law.bound(r[:, 0], np.zeros(interface.n_pairs, dtype=bool))
    return bool((r[:, 0] <= 0).all() and (np.sqrt((r[:, 1:] ** 2).sum(axis=1)) <= bound).all())


def solve_corrected(
    bodies: Condensation,
    load: TiedSolution,
    gap: FloatArray,
    run: Run,
    *,
    again: Again | None = None,
    enough: float = 0.0,
    slip_origin: FloatArray | None = None,
    tell: Callable[[int, float], None] | None = None,
) -> Corrected:
    """Solve contact on the small model, correct its forces by a solution with the tied matrix, and again.

    Parameters
    ----------
    bodies : Condensation
        Its small model learns: another coefficient, load or method starts from what this one found.
    load : TiedSolution
    gap : (n,) float64
    run : callable
        Any method: from an interface to a state; each pass runs it anew.
    again : callable, optional
        The method from the state before, for the passes after the first; their steps are added to its history.
    enough : float
        Estimate of ``solver_error`` below which the corrections stop early; 0 never.
    slip_origin : (n, d - 1) float64, optional
        For that estimate.
    tell : callable, optional
        Called with the number of the correction and the relative difference of the forces.

    Returns
    -------
    Corrected
        Its forces are within ``AGREEMENT`` of equilibrium with the bodies themselves, unless ``left`` says otherwise.

    Raises
    ------
    Stalled
        When the forces do not converge.
    NotConverged, StatusCycle, ContactUnbalanced
        From the method, on the small model.

    Notes
    -----
    The method finds ``S~ w = f~ + r`` with ``f~ = S~ w0 - S w0 + f``, w0 the displacement before; one tied solution
    gives ``S w``, and a change of rank one makes ``S~ w`` exact. S~ is never less stiff than S, and equals it after at
    most as many corrections as there are components. With a factor f~ is f at every pass. What iterations leave of a
    solution goes into the next, and the small model removes its smooth part, rigid motions above all: the forces then
    have no work on free motions, without which a body without friction would drift.

    Cost
    ----
    Three to six solutions with the tied matrix in most scenes, and as many solutions of the dense small problem.
    """
    bodies.small()
    assert bodies.learned is not None
    size = len(load.f)
    w, x, y = np.zeros(size), np.zeros(len(load.x)), np.zeros(size)
    differences: list[float] = []
    before: ContactState | None = None
    left = 0.0
    interface = _around(bodies, load, gap, w, y)
    while True:
        if again is None or before is None:
            state = run(interface)
        else:
            state = again(interface, before)
            state = replace(state, history=[*before.history, *state.history])
        before = state
        new_w = state.w.ravel()
        scale = max(float(np.abs(state.r).max(initial=0)), interface.force_scale) or 1.0
        x, y_new = _true_force(bodies, new_w, w, x, y, rest=REST * scale)
        bodies.learned = bodies.learned.learned(new_w - w, y_new - y)
        true = y_new - load.f
        active = bodies.active.ravel()
        differences.append(float(np.abs(true - state.r.ravel())[active].max(initial=0)) / scale)
        w, y = new_w, y_new
        if tell is not None:
            tell(len(differences), differences[-1])
        interface = _around(bodies, load, gap, w, y)
        if differences[-1] <= AGREEMENT:
            break
        if enough:
            error = solver_error(interface, state, slip_origin)
            if error is not None and error < enough:
                left = error
                break
        recent = differences[-PATIENCE:]
        if len(differences) >= MOST or (
            len(differences) > PATIENCE and min(recent) > 0.5 * min(differences[:-PATIENCE])
        ):
            raise Stalled(differences, state)
    x = _settled(bodies, load, w, x)
    report = replace(state.report, balance=max(state.report.balance, differences[-1]))
    displacement = bodies.displacement(load, w, x)
    bodies.remember(w, x)
    return Corrected(replace(state, report=report), interface, displacement, len(differences), False, left)


def solve_stuck(bodies: Condensation, load: TiedSolution, gap: FloatArray) -> Corrected:
    """Give the state of tied bodies with their displacement.

    Parameters
    ----------
    bodies : Condensation
    load : TiedSolution
    gap : (n,) float64

    Returns
    -------
    Corrected
    """
    interface = bodies.interface_of(load, bodies.unloaded_stiffness(), gap)
    zero = np.zeros(len(load.f))
    displacement = bodies.displacement(load, zero, np.zeros(len(load.x)))
    return Corrected(solve_tied(interface), interface, displacement, 0, False)


def _around(bodies: Condensation, load: TiedSolution, gap: FloatArray, w: FloatArray, y: FloatArray) -> Interface:
    """Put together the interface whose force on w is the true one, ``y - f``."""
    learned = bodies.learned
    assert learned is not None
    f = load.f if bodies.tied.direct else learned.still(learned.S @ w - y) + load.f
    return replace(bodies.interface_of(load, learned, gap), f=f)


def _true_force(
    bodies: Condensation, w: FloatArray, w_before: FloatArray, x_before: FloatArray, y_before: FloatArray, rest: float
) -> tuple[FloatArray, FloatArray]:
    """Solve ``Kvv x = Kvw w`` once, from the x before, and give x and ``S w``; a factor leaves less than the rest."""
    assert bodies.learned is not None
    if bodies.tied.direct:
        # of the change alone: round-off of a body that has slid far would hide the last corrections
        dw = w - w_before
        right = bodies.coupling(dw)
        size = float(np.linalg.norm(right))
        dx = bodies.tied.once(right, min(rest / size, ROUGHEST) if size else None)
        return x_before + dx, y_before + bodies.learned.still(bodies.force(dw, dx))
    right = bodies.coupling(w)
    x = x_before if x_before.any() else bodies.recalled(w)
    x = x + bodies.tied.once(right - bodies.tied.A @ x)
    x = x + bodies.small().solve(right - bodies.tied.A @ x)
    return x, bodies.learned.still(bodies.force(w, x))


def _settled(bodies: Condensation, load: TiedSolution, w: FloatArray, x: FloatArray) -> FloatArray:
    """Go on with the iterations until the displacement is as accurate as the forces."""
    if bodies.tied.direct:
        return x
    right = bodies.coupling(w)
    size = max(float(np.linalg.norm(right)), float(np.linalg.norm(bodies.tied.A @ load.x)))
    for _ in range(PASSES):
        rest = right - bodies.tied.A @ x
        if float(np.linalg.norm(rest)) <= LOOSE * size:
            break
        x = x + bodies.tied.once(rest)
    return x
