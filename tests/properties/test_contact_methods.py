"""A contact method returns a solution of its law or says that it has none; it never depends on units."""

import itertools

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from interfaces import bare_interface

from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction, friction
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.outcome import accepted
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.errors import ContactUnbalanced, NotConverged, StatusCycle
from gibiane_ops.values.methods import Method

SEEDS = st.integers(0, 2**32 - 1)
EXACT = [
    Method("NEWT"), Method("TRES"), Method("MULT"), Method("PROJ", max_iter=300), Method("AUGM", r=1.0),
    Method("AUGM", r=1e3), Method("UZAW", r=1.0), Method("UZAW", r=1e4),
    Method("UZAW", r=1e-4, tolerance=1e-4, max_iter=50), Method("BIPO", r=1.0, max_iter=300),
]  # fmt: skip
SPRINGS = [Method(name, r=r) for name in ("PENA", "PERT") for r in (1e-2, 1.0, 1e3)]
FAILURES = (NotConverged, StatusCycle, ContactUnbalanced)


def random_interface(seed: int, n: int, dim: int, *, gap: bool, loose: bool) -> Interface:
    """Random stiffness, stiff or with one rigid motion along the surface, and a load of either sign."""
    rng = np.random.default_rng(seed)
    size = n * dim
    A = rng.normal(size=(size, size)) / np.sqrt(size)
    S = 0.3 * np.eye(size) + A @ A.T
    if loose:
        slide = np.tile(np.eye(dim)[1], n) / np.sqrt(n)
        keep = np.eye(size) - np.outer(slide, slide)
        S = keep @ S @ keep
    f = rng.normal(size=size)
    f[::dim] += 1.0
    return bare_interface(S, f, dim, np.abs(rng.normal(size=n)) * gap)


def attempt(method: Method, interface: Interface, mu: float) -> ContactState | None:
    law = friction(interface.n_pairs, mu=mu)
    try:
        return method.solve(interface, law)
    except FAILURES:
        return None


def found_or_best(interface: Interface, law: Friction) -> ContactState:
    """Solve by the default method, or give the best iterate."""
    try:
        return solve_coulomb(interface, law)
    except NotConverged as failure:
        return failure.best


def name_of(method: Method) -> str:
    return method.title


CASES = {
    "seed": SEEDS, "n": st.integers(1, 6), "dim": st.sampled_from([2, 3]), "mu": st.floats(0, 1.5),
    "gap": st.booleans(), "loose": st.booleans(),
}  # fmt: skip
SLOW = settings(deadline=None, max_examples=6, suppress_health_check=[HealthCheck.too_slow])


@SLOW
@given(**CASES)
@pytest.mark.parametrize("method", EXACT, ids=name_of)
def test_what_an_exact_method_returns_obeys_every_law(method, seed, n, dim, mu, gap, loose):
    interface = random_interface(seed, n, dim, gap=gap, loose=loose)
    state = attempt(method, interface, mu)
    if state is None:
        return
    w, r = state.w, state.r
    force = max(np.abs(r).max(), interface.force_scale)
    length = max(np.abs(w).max(), force / interface.kref)
    # what the report may say is 1e-5, or a hundred tolerances
    limit = 2 * max(1e-5, 100 * (method.tolerance or 0))
    near = limit * max(1.0, n)
    opening, friction_force = interface.gap - w[:, 0], np.linalg.norm(r[:, 1:], axis=1)
    assert np.abs(interface.S @ w.ravel() - interface.f - r.ravel()).max() <= near * force
    assert opening.min() >= -near * length
    assert r[:, 0].max() <= near * force
    assert np.abs(r[:, 0] * opening).max() <= near * force * length
    bound = -mu * r[:, 0]
    assert (friction_force - bound).max() <= near * max(bound.max(), 1e-6 * force)
    slip = np.linalg.norm(w[:, 1:], axis=1)
    assert np.abs(bound * slip + (r[:, 1:] * w[:, 1:]).sum(axis=1)).max() <= near * force * length


@settings(deadline=None, max_examples=30, suppress_health_check=[HealthCheck.too_slow])
@given(SEEDS, st.integers(1, 6), st.sampled_from([2, 3]), st.sampled_from([0.0, 0.2]), st.booleans())
def test_cohesion_acts_on_pairs_in_contact_only(seed, n, dim, mu, gap):
    """Forces with cohesion and Tresca's bound, where pairs open: a state that obeys the law is not refused."""
    interface = random_interface(seed, n, dim, gap=gap, loose=False)
    cohesion = np.random.default_rng(seed).uniform(0, 0.5, n)
    law = friction(n, mu=mu, cohesion=cohesion)
    state = found_or_best(interface, law)
    if state.history and state.history[-1] > 1e-9:
        # what has not converged is not taken for a solution by the measures either
        assert state.report.worst > 1e-6
        return
    assert accepted(state, None) is state
    closed = state.r[:, 0] < -1e-9
    assert (np.linalg.norm(state.r[~closed], axis=1) <= 1e-8).all()
    size = np.linalg.norm(state.r[:, 1:], axis=1)
    bound = cohesion - mu * state.r[:, 0]
    assert (size[closed] <= bound[closed] + 1e-8).all()
    sticks = closed & (size < bound - 1e-7)
    assert (np.abs(state.w[sticks, 1:]) <= 1e-7).all()


@SLOW
@given(**CASES)
@pytest.mark.parametrize("method", SPRINGS, ids=name_of)
def test_what_a_penalty_returns_are_the_forces_of_its_springs(method, seed, n, dim, mu, gap, loose):
    interface = random_interface(seed, n, dim, gap=gap, loose=loose)
    state = attempt(method, interface, mu)
    if state is None:
        return
    w, r = state.w, state.r
    g = method.r * interface.kref
    pressure = g * np.maximum(w[:, 0] - interface.gap, 0.0)
    elastic = -g * w[:, 1:]
    size = np.linalg.norm(elastic, axis=1)
    cut = np.where(size > mu * pressure, mu * pressure / np.maximum(size, 1e-300), 1.0)
    scale = 1e-7 * max(interface.force_scale, np.abs(r).max())
    np.testing.assert_allclose(r, np.column_stack([-pressure, cut[:, None] * elastic]), atol=scale * max(1.0, method.r))
    np.testing.assert_allclose(interface.S @ w.ravel(), interface.f + r.ravel(), atol=scale)
    # it is far from the exact law as its penetration is, and says so
    assert state.report.penetration >= 0.99 * (w[:, 0] - interface.gap).max(initial=0) / max(
        np.abs(w).max(), max(np.abs(r).max(), interface.force_scale) / interface.kref
    )


@settings(deadline=None, max_examples=4)
@given(SEEDS, st.floats(-9, 9), st.floats(-9, 9), st.floats(0.05, 0.6))
@pytest.mark.parametrize("method", [*EXACT, *SPRINGS, Method("STATUT")], ids=name_of)
def test_units_change_nothing(method, seed, force, length, mu):
    a = random_interface(seed, 4, 3, gap=True, loose=False)
    # powers of two leave every bit in place
    F, L = 2.0 ** round(3 * force), 2.0 ** round(3 * length)
    b = bare_interface(a.S * F / L, a.f * F, 3, a.gap * L)
    one, other = attempt(method, a, mu), attempt(method, b, mu)
    assert (one is None) == (other is None)
    if one is not None and other is not None:
        assert one.iterations == other.iterations
        np.testing.assert_array_equal(one.status, other.status)
        np.testing.assert_allclose(other.r, F * one.r, atol=1e-9 * F * a.force_scale)
        np.testing.assert_allclose(other.w, L * one.w, atol=1e-9 * L * a.length_scale)


def states_in_the_plane(interface: Interface, law: Friction) -> list[tuple[int, ...]]:
    """List every set of statuses that obeys the law, by solving for each: open, stick, and slip either way."""
    n, found = interface.n_pairs, []
    for statuses in itertools.product(range(4), repeat=n):
        # unknowns: relative displacements, then forces; two rows a pair besides the equilibrium
        A, b = np.zeros((4 * n, 4 * n)), np.zeros(4 * n)
        A[: 2 * n] = np.hstack([interface.S, -np.eye(2 * n)])
        b[: 2 * n] = interface.f
        for i, status in enumerate(statuses):
            row, w, r = 2 * n + 2 * i, 2 * i, 2 * n + 2 * i
            if status == 0:
                A[row, r] = A[row + 1, r + 1] = 1
                continue
            A[row, w], b[row] = 1, interface.gap[i]
            if status == 1:
                A[row + 1, w + 1] = 1
            else:
                way = 1 if status == 2 else -1
                A[row + 1, r + 1], A[row + 1, r], b[row + 1] = 1, way * law.mu[i], way * law.cohesion[i]
        w, r = np.linalg.solve(A, b).reshape(2, n, 2)
        is_open, slips = np.array(statuses) == 0, np.array(statuses) > 1
        way = np.where(np.array(statuses) == 2, 1, -1)
        bound = law.cohesion - law.mu * r[:, 0]
        obeys = np.where(is_open, w[:, 0] <= interface.gap + 1e-9, r[:, 0] <= 1e-9)
        obeys &= is_open | np.where(slips, way * w[:, 1] <= 1e-9, np.abs(r[:, 1]) <= bound + 1e-9)
        if obeys.all():
            found.append(statuses)
    return found


@settings(deadline=None, max_examples=25)
@given(SEEDS, st.integers(1, 3), st.sampled_from([0.0, 0.2, 0.5]), st.booleans())
@example(24, 1, 0.0, True)
@example(99, 3, 0.0, True)
def test_a_state_with_cohesion_is_found_where_there_is_one(seed, n, mu, gap):
    """A pair that opens loses its cohesion at once, so that there may be none: then no method returns one."""
    interface = random_interface(seed, n, 2, gap=gap, loose=False)
    law = friction(n, mu=mu, cohesion=np.random.default_rng(seed).uniform(0, 0.8, n))
    exists = bool(states_in_the_plane(interface, law))
    for method in (Method("NEWT"), Method("TRES"), Method("PROJ", max_iter=300)):
        try:
            method.solve(interface, law)
        except FAILURES:
            assert not exists or method.name != "NEWT"
        else:
            assert exists
