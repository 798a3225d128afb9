"""Contact by a small model of the bodies that solutions with the tied matrix correct (reduced compliance)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.condensation import Condensation, TiedSolution
from gibiane_ops.kernels.contact.follower import Follower
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.newton import solve_tied
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.contact.solver_error import solver_error
from gibiane_ops.kernels.errors import ContactUnbalanced, NotConverged, StatusCycle

AGREEMENT = 1e-9
"""Largest difference between the forces of the small model and the true ones, over the largest force."""

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
        Estimate of ``solver_error``, with what the solutions leave, below which the corrections stop early; 0 never.
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
    most as many corrections as there are components. With an exact factor f~ is f at every pass. What iterations leave
    of a solution goes into the next (a factor in single precision iterates like multigrid, but far faster), a change of
    w that these rests could hide is not learned from, and with multigrid the small model removes its smooth part, rigid
    motions above all: the forces then have no work on free motions, without which a body without friction would drift.

    Cost
    ----
    Three to six solutions with the tied matrix in most scenes, and as many solutions of the dense small problem.
    """
    bodies.small()
    assert bodies.learned is not None
    follower = Follower(bodies, load)
    differences: list[float] = []
    before: ContactState | None = None
    left = 0.0
    interface = follower.interface(gap)
    while True:
        if again is None or before is None:
            state = run(interface)
        else:
            state = again(interface, before)
            state = replace(state, history=[*before.history, *state.history])
        before = state
        w, y, rest = follower.w, follower.y, follower.rest
        follower.move(state.w.ravel())
        bodies.learned = bodies.learned.learned(
            follower.w - w, follower.y - y, float(np.linalg.norm(rest) + np.linalg.norm(follower.rest))
        )
        differences.append(_difference(bodies, load, interface, state, follower.y))
        if differences[-1] <= AGREEMENT and follower.settle():
            differences[-1] = _difference(bodies, load, interface, state, follower.y)
        if tell is not None:
            tell(len(differences), differences[-1])
        interface = follower.interface(gap)
        if differences[-1] <= AGREEMENT:
            break
        if enough:
            error = solver_error(interface, state, slip_origin)
            if error is not None and error + follower.missed < enough:
                left = error + follower.missed
                break
        recent = differences[-PATIENCE:]
        if len(differences) >= MOST or (
            len(differences) > PATIENCE and min(recent) > 0.5 * min(differences[:-PATIENCE])
        ):
            raise Stalled(differences, state)
    if not left:
        follower.settle()
    report = replace(state.report, balance=max(state.report.balance, differences[-1]))
    displacement = bodies.displacement(load, follower.w, follower.x)
    bodies.remember(follower.w, follower.x)
    return Corrected(replace(state, report=report), interface, displacement, len(differences), False, left)


def _difference(
    bodies: Condensation, load: TiedSolution, interface: Interface, state: ContactState, y: FloatArray
) -> float:
    """Measure the true forces against those of the state, over the largest."""
    scale = max(float(np.abs(state.r).max(initial=0)), interface.force_scale) or 1.0
    return float(np.abs(y - load.f - state.r.ravel())[bodies.active.ravel()].max(initial=0)) / scale


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
