"""The estimate of what contact iterations have left against the true distance to the converged solution."""

from dataclasses import replace

import numpy as np
import pytest
from two_blocks import blocks

from gibiane_ops.kernels.contact.augmented import solve_augmented_newton, solve_uzawa
from gibiane_ops.kernels.contact.gauss_seidel import solve_gauss_seidel
from gibiane_ops.kernels.contact.law import friction
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.problem import Problem
from gibiane_ops.kernels.contact.report import SLIP, check_state
from gibiane_ops.kernels.contact.solver_error import solver_error
from gibiane_ops.kernels.contact.status import solve_statuses
from gibiane_ops.kernels.errors import NotConverged

METHODS = {
    "NEWT": (solve_coulomb, (), (1, 2, 3, 4)),
    "AUGM": (solve_augmented_newton, (1.0,), (1, 2, 3, 4)),
    "PROJ": (solve_gauss_seidel, (), (1, 3, 10, 30, 100)),
    "UZAW": (solve_uzawa, (1.0,), (1, 2, 4, 8, 16)),
    "STATUT": (solve_statuses, (), (1, 2, 4, 8)),
}
FLOOR = 1e-8
"""Distance over the energy norm of the solution below which round-off may be seen."""


def truncated(solver, interface, mu, given, count):
    try:
        return solver(interface, mu, *given, max_iter=count)
    except NotConverged as failure:
        return failure.best


def compare(interface, mu, name, counts):
    """Return pairs of true and estimated distances over the norm of the relative displacements."""
    solver, given, _ = METHODS[name]
    exact = solve_coulomb(interface, mu, tolerance=1e-13)
    found = []
    scale = np.sqrt(max(exact.w.ravel() @ interface.S @ exact.w.ravel(), np.finfo(float).tiny))
    for count in counts:
        state = truncated(solver, interface, mu, given, count)
        away = (state.w - exact.w).ravel()
        true = np.sqrt(max(away @ interface.S @ away, 0.0))
        found.append((true / scale, solver_error(interface, state) / scale))
    return found


@pytest.mark.parametrize("mu", [0.05, 0.2, 0.5, 5.0])
@pytest.mark.parametrize("name", list(METHODS))
@pytest.mark.parametrize("scene", ["T1_1", "T1_1h", "T1_2", "T1_2h"])
def test_within_a_factor_of_three(scene, name, mu):
    for true, estimate in compare(blocks(scene).interface, mu, name, METHODS[name][2]):
        if true > FLOOR:
            assert true / 3 <= estimate <= 3 * true
        else:
            assert estimate <= 3 * FLOOR


@pytest.mark.parametrize("scene", ["T1_1h", "T1_2h"])
def test_forces_cut_to_the_cone_with_everything_sticking(scene):
    """Forces on the cone satisfy the law without any slip: nothing but the equilibrium tells that they are wrong."""
    interface = blocks(scene).interface
    law = friction(interface.n_pairs, mu=0.2)
    problem = Problem.of(interface, law, 1.0)
    w = np.zeros_like(problem.origin)
    r, status = problem.project(-problem.f.reshape(w.shape))
    r[:, 1:] *= 1 - 1e-12
    assert (problem.project(problem.augmented(w, r))[1] != SLIP).all()
    state = check_state(interface, w, r * problem.force, status, law, [], None)
    exact = solve_coulomb(interface, 0.2, tolerance=1e-13)
    true = np.sqrt(exact.w.ravel() @ interface.S @ exact.w.ravel())
    assert solver_error(interface, state) == pytest.approx(true, rel=0.01)


def test_slips_of_earlier_load_steps_count():
    interface = blocks("T1_1h").interface
    first = solve_coulomb(interface, 0.2)
    origin = first.w[:, 1:]
    half = replace(interface, f=0.5 * interface.f)
    exact = solve_coulomb(half, 0.2, slip_origin=origin, start=first, tolerance=1e-13)
    state = truncated(solve_gauss_seidel, half, 0.2, (), 3)
    away = (state.w - exact.w).ravel()
    assert solver_error(half, state, origin) == pytest.approx(np.sqrt(away @ half.S @ away), rel=0.01)
    assert solver_error(half, exact, origin) <= 1e-8 * np.sqrt(exact.w.ravel() @ half.S @ exact.w.ravel())
