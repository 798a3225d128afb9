"""What every method does at its end: measure its state, return it when it has converged, else say why it has not."""

from __future__ import annotations

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.balance import raise_if_unbalanced
from gibiane_ops.kernels.contact.drift import without_drift
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.problem import Problem
from gibiane_ops.kernels.contact.report import ContactState, check_state
from gibiane_ops.kernels.errors import NotConverged

PATIENCE = 500
"""Iterations of a slow method after which the load is checked: what no contact force balances needs no more."""

DEPARTURE = 1e-5
"""Departure from the exact laws, relative, above which a state is no solution of them."""


def physical_state(
    interface: Interface,
    law: Friction,
    problem: Problem,
    w: FloatArray,
    r: FloatArray,
    status: IntArray,
    history: list[float],
    slip_origin: FloatArray | None,
) -> ContactState:
    """Go back to physical units and measure a state against the exact laws.

    Parameters
    ----------
    interface : Interface
    law : Friction
        In physical units.
    problem : Problem
        Whose units w and r have.
    w, r : (n, d) float64
    status : (n,) int64
    history : list of float
    slip_origin : (n, d - 1) float64 or None

    Returns
    -------
    ContactState
    """
    w = w * problem.length
    if not law.rubs.any():
        w = without_drift(w, interface)
    return check_state(interface, w, r * problem.force, status, law, history, slip_origin, bonded=problem.bonded)


def finished(
    interface: Interface, state: ContactState, converged: bool, reason: str = "", **fields: object
) -> ContactState:
    """Return a converged state; otherwise raise the error that explains the failure.

    Parameters
    ----------
    interface : Interface
    state : ContactState
    converged : bool
    reason : str
        What stopped the method, see ``NotConverged``; `fields` are its numbers.

    Returns
    -------
    ContactState

    Raises
    ------
    ContactUnbalanced
        When no admissible contact force balances the load.
    NotConverged
        Otherwise; ``best`` holds the state.
    """
    if not converged:
        raise_if_unbalanced(interface, state)
        raise NotConverged(state.history, state, reason, fields)
    return state


def accepted(state: ContactState, tolerance: float | None) -> ContactState:
    """Return a state that obeys the exact laws, whatever the criterion on which its method stopped.

    Parameters
    ----------
    state : ContactState
        Called converged by a method that solves the exact problem.
    tolerance : float or None
        Of the method.

    Returns
    -------
    ContactState

    Raises
    ------
    NotConverged
        When a departure exceeds ``DEPARTURE``, or a hundred times the tolerance if this is more.
    """
    if not state.report.worst <= max(DEPARTURE, 100 * (tolerance or 0.0)):
        raise NotConverged(state.history, state, "laws", {"size": f"{state.report.worst:.2g}"})
    return state
