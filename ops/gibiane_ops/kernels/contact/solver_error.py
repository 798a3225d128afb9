"""What the contact iterations have left: the distance in energy from an iterate to the solution of its equations."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.newton import bonded_at_start
from gibiane_ops.kernels.contact.problem import Problem
from gibiane_ops.kernels.contact.report import OPEN, ContactState

STEPS = 8
"""Newton steps at most; one suffices where it changes no status."""

SETTLED = 0.2
"""A step below this share of the distance found so far is the last."""

EXACT = 1e-12
"""Residual, over the largest load, of a step that has arrived."""


def solver_error(interface: Interface, state: ContactState, slip_origin: FloatArray | None = None) -> float | None:
    """Estimate how far the displacement of a state is from the exact solution of the discrete problem.

    Parameters
    ----------
    interface : Interface
        Its ``S w - f`` is the force of the bodies on the state, its stiffness elsewhere exact or as near as known.
    state : ContactState
        Of any method, at any iteration.
    slip_origin : (n, d - 1) float64, optional

    Returns
    -------
    float or None
        ``sqrt(dw . S dw)``, square root of an energy, the energy norm of the difference of displacements of the
        bodies; None where the Newton matrix is singular, so that nothing is known.

    Notes
    -----
    dw leads to the end of semi-smooth Newton steps from w and the forces ``S w - f`` that hold it in equilibrium. The
    forces of the state are left aside: they do not enter the displacement, and many methods cut them to the cone, on
    which a step cannot tell sliding from sticking and finds nothing to correct. One step is exact when no status
    changes; others follow until they settle.

    Cost
    ----
    As many Newton steps, dense: one near the solution.
    """
    law = state.law
    bonded = bonded_at_start(interface, law) & (state.status != OPEN)
    problem = Problem.of(interface, law, 1.0, slip_origin, bonded=bonded)
    start = state.w / problem.length
    r = (problem.S @ start.ravel() - problem.f).reshape(start.shape)
    w, r = start, np.where(interface.active, r, 0.0)
    least, found = np.inf, None
    for _ in range(STEPS):
        before = problem.project(problem.augmented(w, r))[1]
        try:
            dw, dr = problem.step(w, r)
        except np.linalg.LinAlgError:
            break
        w, r = w + dw, r + dr
        far, moved = (max(float(x.ravel() @ problem.S @ x.ravel()), 0.0) ** 0.5 for x in (w - start, dw))
        merit = problem.merit(w, r)
        if merit < least:
            least, found = merit, far
        same = np.array_equal(before, problem.project(problem.augmented(w, r))[1])
        if merit <= EXACT or (same and moved <= SETTLED * far):
            break
    return None if found is None else found * float(np.sqrt(problem.force * problem.length))
