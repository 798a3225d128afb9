"""Properties of contact laws and of the condensed problem on random data."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from interfaces import bare_interface

from gibiane_ops.kernels.contact.cone import friction_bound, norms, orthogonal_projection, radial_projection
from gibiane_ops.kernels.contact.frames import local_frames
from gibiane_ops.kernels.contact.newton import solve_coulomb

SEEDS = st.integers(0, 2**32 - 1)
FRICTION = st.floats(0, 3)


def in_cone(r, mu, tolerance=1e-12):
    return (r[:, 0] <= tolerance) & (norms(r[:, 1:]) <= friction_bound(r[:, 0], mu) + tolerance * (1 + np.abs(r[:, 0])))


@given(SEEDS, FRICTION)
def test_projections_reach_the_cone_and_stay_there(seed, mu):
    r = np.random.default_rng(seed).normal(size=(50, 3))
    mu = np.full(50, mu)
    for project in (radial_projection, orthogonal_projection):
        once = project(r, mu)
        assert in_cone(once, mu).all()
        np.testing.assert_allclose(project(once, mu), once, atol=1e-12)
    inside = in_cone(r, mu, 0.0)
    np.testing.assert_array_equal(orthogonal_projection(r, mu)[inside], r[inside])


@given(SEEDS, FRICTION)
def test_orthogonal_projection_is_the_nearest_point(seed, mu):
    rng = np.random.default_rng(seed)
    mu = np.full(50, mu)
    r, other = rng.normal(size=(50, 3)), radial_projection(rng.normal(size=(50, 3)), mu)
    found = orthogonal_projection(r, mu)
    # nearest point of a convex set: every other point is seen at an obtuse angle
    assert (np.einsum("ni,ni->n", r - found, other - found) <= 1e-12).all()


@given(SEEDS, FRICTION)
def test_bipotential_inequality(seed, mu):
    """Check that ``mu abs(r_n) abs(w_t) + r . w >= 0`` for any admissible w and any r of the cone."""
    rng = np.random.default_rng(seed)
    mu = np.full(200, mu)
    r = radial_projection(rng.normal(size=(200, 3)), mu)
    w = rng.normal(size=(200, 3))
    w[:, 0] = -np.abs(w[:, 0])
    power = friction_bound(r[:, 0], mu) * norms(w[:, 1:]) + np.einsum("ni,ni->n", r, w)
    assert (power >= -1e-12).all()


@settings(deadline=None, max_examples=60)
@given(SEEDS, st.integers(1, 12), st.sampled_from([2, 3]), st.floats(0, 0.4), st.booleans())
def test_solution_obeys_every_law(seed, n, dim, mu, with_gap):
    """Solve a random well-conditioned interface: all laws hold, and equality holds in the bipotential inequality."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n * dim, n * dim)) / np.sqrt(n * dim)
    S = np.eye(n * dim) + 0.3 * (A @ A.T)
    gap = np.abs(rng.normal(size=n)) * with_gap
    interface = bare_interface(S, rng.normal(size=n * dim), dim, gap)
    state = solve_coulomb(interface, mu)
    report = state.report
    assert report.worst < 1e-8
    assert in_cone(state.r, np.full(n, mu), 1e-8).all()
    assert (state.w[:, 0] <= gap + 1e-8).all()
    np.testing.assert_allclose(S @ state.w.ravel(), interface.f + state.r.ravel(), atol=1e-8)
    power = friction_bound(state.r[:, 0], state.law.mu) * norms(state.w[:, 1:]) + np.einsum(
        "ni,ni->n", state.r, state.w
    )
    np.testing.assert_allclose(power - state.r[:, 0] * gap, 0, atol=1e-7)
    assert report.dissipation >= -1e-9
    assert report.n_open + report.n_stick + report.n_slip == n
    # the reaction is a fixed point of the bipotential method, another characterisation of the same law
    R = state.r - (state.w - np.eye(dim)[0] * gap[:, None])
    R[:, 0] += mu * norms(state.w[:, 1:])
    np.testing.assert_allclose(orthogonal_projection(R, state.law.mu), state.r, atol=1e-7)


@given(SEEDS, st.sampled_from([2, 3]))
def test_frames_are_orthonormal_and_follow_the_supports(seed, d):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(40, d))
    normals[:20] = np.eye(d)[rng.integers(d, size=20)] * rng.choice([-1, 1], size=(20, 1))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    free = rng.random((40, d)) > 0.3
    frames, active, shortening = local_frames(normals, free)
    np.testing.assert_allclose(frames @ frames.swapaxes(1, 2), np.broadcast_to(np.eye(d), (40, d, d)), atol=1e-12)
    # active directions span exactly what the supports leave free
    spanned = np.einsum("nij,ni,nik->njk", frames, active, frames)
    expected = free[:, :, None] * np.eye(d)
    holds = active[:, 0]
    np.testing.assert_allclose(spanned[holds], expected[holds], atol=1e-5)
    # w_n measures the part of the normal that is free
    w = np.where(free, rng.normal(size=(40, d)), 0.0)
    local = np.einsum("nij,nj->ni", frames, w)
    full = np.einsum("ni,ni->n", normals, w)
    np.testing.assert_allclose((shortening * local[:, 0])[holds], full[holds], atol=1e-12)
