"""Every contact method against the exact Newton solution on two blocks, and the numbers that characterise each."""

from dataclasses import replace

import numpy as np
import pytest
from interfaces import bare_interface
from two_blocks import blocks, load_push

from gibiane_ops.kernels.contact.augmented import solve_augmented_newton, solve_uzawa
from gibiane_ops.kernels.contact.bipotential import solve_bipotential
from gibiane_ops.kernels.contact.conditioning import condensed_condition, spring_condition
from gibiane_ops.kernels.contact.gauss_seidel import solve_gauss_seidel
from gibiane_ops.kernels.contact.law import friction
from gibiane_ops.kernels.contact.multipliers import solve_multipliers
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.outcome import accepted
from gibiane_ops.kernels.contact.penalty import solve_penalty
from gibiane_ops.kernels.contact.projected_cg import solve_projected_cg
from gibiane_ops.kernels.contact.report import STICK
from gibiane_ops.kernels.contact.status import solve_statuses
from gibiane_ops.kernels.contact.tresca import solve_tresca_sequence
from gibiane_ops.kernels.errors import BadValue, ContactUnbalanced, NotConverged, StatusCycle, UnsupportedLaw

METHODS = {
    # method, and how far its forces and displacements may be from Newton's, over the largest
    "tresca": (solve_tresca_sequence, 1e-7),
    "multipliers": (solve_multipliers, 1e-9),
    "augmented newton": (lambda i, mu: solve_augmented_newton(i, mu, 10.0), 1e-9),
    "uzawa": (lambda i, mu: solve_uzawa(i, mu, 100.0), 1e-7),
    "gauss-seidel": (solve_gauss_seidel, 1e-6),
    "bipotential": (lambda i, mu: solve_bipotential(i, mu, 1.0), 2e-6),
}


def close_to(found, exact, share):
    np.testing.assert_allclose(found.r, exact.r, atol=share * np.abs(exact.r).max())
    np.testing.assert_allclose(found.w, exact.w, atol=share * np.abs(exact.w).max())


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("mu", [0.0, 0.05, 0.2, 0.4])
@pytest.mark.parametrize("scene", ["T1_2", "T1_2h"])
def test_same_solution_as_newton(scene, mu, method):
    interface = blocks(scene).interface
    solve, share = METHODS[method]
    exact, found = solve_coulomb(interface, mu), solve(interface, mu)
    close_to(found, exact, share)
    assert found.report.worst < 1e-6
    assert found.history
    assert len(found.changes) == len(found.history)
    # the first iteration leaves the tied statuses, and a converged method has settled
    assert found.changes[-1] == 0 or len(found.changes) == 1
    assert (found.report.n_open, found.report.n_slip) == (exact.report.n_open, exact.report.n_slip)


@pytest.mark.parametrize("scene", ["T1_2", "T1_2h"])
def test_projected_cg_without_friction(scene):
    interface = blocks(scene).interface
    found = solve_projected_cg(interface)
    close_to(found, solve_coulomb(interface, 0.0), 1e-8)
    assert found.iterations <= 40
    with pytest.raises(UnsupportedLaw):
        solve_projected_cg(interface, 0.2)


# relative error of the slip, of the nodal forces, largest penetration in mm, for g / kref on T1, h = 12.5 mm, mu = 0.2
PENALTY = {
    1e-3: (4e3, 0.27, 0.43),
    1e-1: (42, 0.22, 4e-3),
    1.0: (4.6, 0.11, 5e-4),
    10.0: (0.49, 1.8e-2, 5e-5),
    1e2: (5e-2, 2e-3, 5e-6),
    1e4: (5e-4, 2e-5, 5e-8),
    1e6: (5e-6, 2e-7, 5e-10),
    1e8: (5e-8, 2e-9, 5e-12),
}


def penalty_errors(g):
    interface = blocks("T1_2").interface
    exact, found = solve_coulomb(interface, 0.2), solve_penalty(interface, 0.2, g)
    slip, force = np.abs(found.w - exact.w).max(), np.abs(found.r - exact.r).max()
    return slip / np.abs(exact.w).max(), force / np.abs(exact.r).max(), (found.w[:, 0] - interface.gap).max(), found


@pytest.mark.parametrize("g", PENALTY)
def test_penalty_errors(g):
    *errors, found = penalty_errors(g)
    for error, expected in zip(errors, PENALTY[g], strict=True):
        assert expected / 2 < error < 2 * expected
    assert found.iterations <= 8
    assert found.report.penetration > 0


@pytest.mark.parametrize("mu", [0.001, 0.01, 0.1, 1.0])
@pytest.mark.parametrize("scene", ["T1_1h", "T1_2h", "T4_2h"])
def test_penalty_on_an_opening_contact_converges_by_its_own_steps_or_says_so(scene, mu):
    # full steps go round in circles where friction is weak: damped ones of limited length settle, nothing is borrowed
    interface, outcomes, histories = blocks(scene).interface, [], []
    for g in 10.0 ** np.arange(-2, 7, 2):
        try:
            found = solve_penalty(interface, mu, g)
        except NotConverged as failure:
            outcomes.append(False)
            histories.append(failure.history)
        else:
            outcomes.append(True)
            assert found.report.balance < 1e-8
            # normal forces are those of the springs at the penetration found
            push = -g * interface.kref * np.maximum(found.w[:, 0] - interface.gap, 0.0)
            np.testing.assert_allclose(found.r[:, 0], push, atol=1e-7 * interface.force_scale)
    assert all(history[-1] > 1e-10 for history in histories)
    assert any(outcomes) or mu == 0.001
    assert all(outcomes) or mu == 0.001 or scene != "T1_1h"


@pytest.mark.parametrize("method", ["penalty", "uzawa"])
def test_weak_friction_on_an_opening_contact_needs_short_steps(method):
    interface = blocks("T1_1h").interface
    exact = solve_coulomb(interface, 0.01)
    found = (solve_penalty if method == "penalty" else solve_uzawa)(interface, 0.01, 1e4)
    np.testing.assert_allclose(found.r, exact.r, atol=(1e-3 if method == "penalty" else 1e-6) * np.abs(exact.r).max())


def test_newton_without_safeguard_says_that_it_cycles_on_an_opening_contact():
    with pytest.raises(NotConverged) as caught:
        solve_augmented_newton(blocks("T1_1h").interface, 0.01, 1e4)
    assert caught.value.history[-1] > 1e-3


# condition number of K + g C^T C, for g / kref on T1, h = 12.5 mm
CONDITION = {1e-3: 4e5, 1e-1: 6e3, 1.0: 4e3, 10.0: 6e3, 1e2: 5e4, 1e4: 4e6, 1e6: 4e8, 1e8: 4e10}


def springs_of(scene):
    """Product by K and springs on every pair, and interface of a load without gap."""
    slave, master = scene.pairs.pairs.T
    free = np.ones(len(scene.F))
    free[scene.reduction.fixed] = 0

    def apply(u, stiffness):
        u = free * np.ravel(u)
        relative = stiffness * (u.reshape(-1, 3)[slave] - u.reshape(-1, 3)[master])
        forces = (scene.K @ u).reshape(-1, 3)
        np.add.at(forces, slave, relative)
        np.add.at(forces, master, -relative)
        return free * forces.ravel()

    return apply, lambda F: scene.tied.interface(F, np.zeros(len(F)))


@pytest.mark.parametrize("g", CONDITION)
def test_conditioning_of_the_penalty(g):
    scene = blocks("T1_2")
    apply, condensed = springs_of(scene)
    exact = solve_coulomb(scene.interface, 0.2)
    stiffness = g * scene.interface.kref
    found = spring_condition(scene.interface, exact, g, lambda u: apply(u, stiffness), condensed, len(scene.F))
    assert CONDITION[g] / 2 < found < 2 * CONDITION[g]


@pytest.mark.parametrize("r", [0.1, 1.0, 100.0])
def test_conditioning_of_a_model_of_two_nodes(r):
    # two springs of stiffness 1 and 2 end to end on supports, and r times kref between them when closed
    K, C = np.diag([1.0, 1.0, 2.0, 2.0]), np.hstack([np.eye(2), -np.eye(2)])
    kref = 2 / 3
    S = kref * np.eye(2)
    A = K + r * kref * C.T @ C

    def condensed(F):
        # w = u1 - u2 with v = u2: v (k1 + k2) = F1 + F2 - k1 w
        f = F[:2] - (F[:2] + F[2:]) / 3
        total = (F[:2] + F[2:]) / 3

        def expand(w):
            return np.concatenate([total + 2 * w.ravel() / 3, total - w.ravel() / 3])

        return replace(bare_interface(S, f, 2), expander=expand)

    closed = solve_coulomb(bare_interface(S, np.array([1.0, 0.1]), 2), 0.5)
    found = spring_condition(bare_interface(S, np.array([1.0, 0.1]), 2), closed, r, lambda u: A @ u, condensed, 4)
    assert found == pytest.approx(np.linalg.cond(A), rel=1e-9)


def test_matrices_on_the_interface():
    interface = blocks("T1_2").interface
    exact = solve_coulomb(interface, 0.2)
    shifted = [condensed_condition(interface, exact, "shifted", r) for r in (1e-4, 1.0, 1e4)]
    assert shifted[0] > 1e3
    assert shifted[2] == pytest.approx(1, abs=1e-2)
    # a springy saddle-point system is better conditioned than the springs, which is why it exists
    assert condensed_condition(interface, exact, "saddle", 1.0) < 1e3
    assert condensed_condition(interface, exact, "newton", 1.0) < 1e3


def test_penalty_error_is_inverse_to_the_penalty():
    grid = 10.0 ** np.arange(2, 7)
    for column in range(3):
        slope = np.polyfit(np.log(grid), [np.log(penalty_errors(g)[column]) for g in grid], 1)[0]
        assert slope == pytest.approx(-1, abs=0.02)


@pytest.mark.parametrize("g", PENALTY)
@pytest.mark.parametrize("scene", ["T1_2", "T1_2h"])
def test_perturbed_lagrangian_is_the_penalty_method(scene, g):
    interface = blocks(scene).interface
    close_to(solve_multipliers(interface, 0.2, perturbation=g), solve_penalty(interface, 0.2, g), 1e-10)


@pytest.mark.parametrize(("r", "passes"), [(0.1, 218), (1.0, 32), (10.0, 10), (100.0, 5), (1000.0, 4)])
def test_uzawa_passes(r, passes):
    interface = blocks("T1_2").interface
    assert solve_uzawa(interface, 0.2, r).iterations == pytest.approx(passes, abs=1)


def test_uzawa_with_a_small_penalty_says_that_it_did_not_converge():
    with pytest.raises(NotConverged) as caught:
        solve_uzawa(blocks("T1_2").interface, 0.2, 0.01)
    assert len(caught.value.history) == 400
    assert caught.value.best.report.worst > 1e-5


@pytest.mark.parametrize("scene", ["T1_2", "T1_2h"])
def test_uzawa_with_a_tiny_penalty_does_not_mistake_small_updates_for_convergence(scene):
    # with r = 1E-5 the multipliers hardly move, far from the solution: the change alone would say converged at once
    with pytest.raises(NotConverged) as caught:
        solve_uzawa(blocks(scene).interface, 0.2, 1e-5, tolerance=1e-4, max_iter=20)
    assert caught.value.best.report.worst > 1e-2


def test_a_state_that_breaks_the_laws_is_refused():
    interface = blocks("T1_2").interface
    exact, springy = solve_coulomb(interface, 0.2), solve_penalty(interface, 0.2, 100.0)
    assert accepted(exact, None) is exact
    with pytest.raises(NotConverged) as caught:
        accepted(springy, None)
    assert caught.value.best is springy


def test_tresca_contracts_more_slowly_with_more_friction():
    interface, _ = load_push("T1_1", 0.45, on_top=False)
    counts = [solve_tresca_sequence(interface, mu).iterations for mu in (0.5, 0.8, 1.2)]
    for mu in (0.5, 0.8, 1.2):
        close_to(solve_tresca_sequence(interface, mu), solve_coulomb(interface, mu), 1e-6)
    assert max(counts) > 7


@pytest.mark.parametrize("method", METHODS)
def test_a_load_that_friction_cannot_balance_is_never_a_result(method):
    interface, _ = load_push("T1_1", 0.21, on_top=True)
    with pytest.raises(ContactUnbalanced):
        METHODS[method][0](interface, 0.2)


def test_penalty_beyond_the_limit_of_friction():
    interface, _ = load_push("T1_1", 0.21, on_top=True)
    with pytest.raises(ContactUnbalanced):
        solve_penalty(interface, 0.2, 1e4)


@pytest.mark.parametrize("r", [0.0, -1.0, np.nan, np.inf])
def test_bad_penalty(r):
    interface = blocks("T1_1").interface
    for solve in (solve_penalty, solve_uzawa, solve_augmented_newton, solve_bipotential):
        with pytest.raises(BadValue):
            solve(interface, 0.2, r)


def test_laws_that_a_method_cannot_treat():
    interface = blocks("T1_1").interface
    with pytest.raises(UnsupportedLaw):
        solve_bipotential(interface, friction(9, mu=0.2, cohesion=1.0), 1.0)
    for solve in (solve_tresca_sequence, solve_gauss_seidel, solve_multipliers):
        with pytest.raises(UnsupportedLaw):
            solve(interface, friction(9, mu=0.2, adhesion=1.0))


@pytest.mark.parametrize(("scene", "limit"), [("T1_2h", 25), ("T4_2h", 45)])
@pytest.mark.parametrize("mu", [0.001, 0.003, 0.01])
def test_weak_friction_on_an_opening_contact(scene, limit, mu):
    # friction only settles where the block drifts to: full steps from the tied bodies go round in circles
    state = solve_coulomb(blocks(scene).interface, mu)
    assert state.iterations <= limit
    assert state.report.worst < 1e-9
    assert state.report.n_open > 0


def test_statuses_that_hold_sticking_pairs():
    interface = blocks("T1_2").interface
    exact = solve_coulomb(interface, 0.2)
    slip = np.linalg.norm(exact.w[:, 1:], axis=1)
    found = solve_statuses(interface, 0.2, sticking_distance=1e-3 * slip.max())
    assert np.abs(found.w[found.status == STICK, 1:]).max() < 1e-12
    assert found.report.worst < 1.0
    with pytest.raises(StatusCycle) as caught:
        solve_statuses(interface, 0.2, sticking_distance=0.5 * slip.max())
    assert caught.value.period >= 1
    assert len(caught.value.pairs) > 0
    assert len(caught.value.history) < 100
