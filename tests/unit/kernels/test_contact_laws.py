"""Contact laws on a few pairs, against closed forms: nothing here needs a mesh."""

from dataclasses import replace

import numpy as np
import pytest
from interfaces import bare_interface

from gibiane_ops.kernels.contact.cone import orthogonal_projection, radial_projection
from gibiane_ops.kernels.contact.newton import solve_coulomb, solve_tied
from gibiane_ops.kernels.contact.report import OPEN, SLIP, STICK, ContactState
from gibiane_ops.kernels.contact.status import solve_statuses
from gibiane_ops.kernels.contact.uniqueness import compare_starts
from gibiane_ops.kernels.errors import BadValue, ContactUnbalanced


def test_projections_differ_and_are_what_they_say():
    r = np.array([[-1.0, 3.0, 4.0]])
    mu = np.array([0.5])
    np.testing.assert_allclose(radial_projection(r, mu), [[-1, 0.3, 0.4]])
    # (p + mu t) / (1 + mu^2) = 3.5 / 1.25 = 2.8
    np.testing.assert_allclose(orthogonal_projection(r, mu), [[-2.8, 0.84, 1.12]])
    tension = np.array([[2.0, 3.0, 4.0]])
    np.testing.assert_allclose(radial_projection(tension, mu), 0, atol=0)
    np.testing.assert_allclose(orthogonal_projection(tension, np.array([0.4])), 0, atol=0)
    np.testing.assert_allclose(radial_projection(r, np.array([np.inf])), r)


THREE = bare_interface(np.array([[1, 0.8], [0.8, 1]]), np.array([1, 1.5]), 2)


@pytest.mark.parametrize(
    ("w", "r", "status"),
    [([0, 0], [-1, -1.5], STICK), ([0, 5 / 6], [-1 / 3, -2 / 3], SLIP), ([-5 / 9, 35 / 18], [0, 0], OPEN)],
)
def test_one_pair_with_three_solutions(w, r, status):
    # with mu = 2 and this coupling the answer depends on the start: each solution must be recognised as one
    base = solve_tied(THREE)
    start = ContactState(np.array([w]), np.array([r]), np.array([status]), base.law, [], base.report)
    found = solve_coulomb(THREE, 2.0, start=start)
    np.testing.assert_allclose(found.w, [w], atol=1e-10)
    np.testing.assert_allclose(found.r, [r], atol=1e-10)
    assert found.status[0] == status
    assert found.report.worst < 1e-9


def test_other_solutions_are_found():
    stuck = solve_coulomb(THREE, 2.0)
    assert stuck.status[0] == STICK
    found = compare_starts(THREE, 2.0, stuck)
    assert not found.unique
    assert [int(other.status[0]) for other in found.others] == [OPEN, SLIP]
    # mu |S_nt| < S_tt: one solution
    assert compare_starts(THREE, 0.4, solve_coulomb(THREE, 0.4)).unique


@pytest.mark.parametrize("f", [1.0, 5.0, -1.0])
@pytest.mark.parametrize("gap", [0.0, 0.3])
def test_spring_closing_a_gap(f, gap):
    # a spring of stiffness 2 pushed by f towards an obstacle: free up to the gap, then held
    interface = bare_interface(np.diag([2.0, 2.0, 2.0]), np.array([f, 0, 0]), 3, np.array([gap]))
    found = solve_coulomb(interface, 0.3)
    w = min(f / 2, gap)
    np.testing.assert_allclose(found.w, [[w, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(found.r, [[2 * w - f, 0, 0]], atol=1e-12)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_press_fit_without_any_load(unit):
    # an overlap of 0.3 pushes the spring of stiffness 2 back by 0.3, in any unit of length
    interface = bare_interface(np.diag([2.0, 2.0, 2.0]), np.zeros(3), 3, np.array([-0.3 * unit]))
    found = solve_coulomb(interface, 0.3)
    np.testing.assert_allclose(found.w, [[-0.3 * unit, 0, 0]], rtol=1e-12)
    np.testing.assert_allclose(found.r, [[-0.6 * unit, 0, 0]], rtol=1e-12)


def test_frictionless_drift_is_zero():
    # nothing holds the tangential motions together: only their difference matters
    S = np.diag([4.0, 1.0, 4.0, 1.0])
    S[1, 3] = S[3, 1] = -1.0
    interface = bare_interface(S, np.array([10, 0.7, 6, -0.7]), 2)
    base = solve_tied(interface)
    moved = ContactState(np.array([[0, 5.0], [0, 5.0]]), base.r, base.status, base.law, [], base.report)
    for start in (None, moved):
        np.testing.assert_allclose(solve_coulomb(interface, 0.0, start=start).w, [[0, 0.35], [0, -0.35]], atol=1e-12)


def test_slip_of_an_elastic_pair():
    # pressed by 10, pulled by 4 along (3, 4)/5 with mu = 0.2: friction takes 2, the spring of stiffness 5 the rest
    interface = bare_interface(np.diag([7.0, 5.0, 5.0]), np.array([10, 2.4, 3.2]), 3)
    found = solve_coulomb(interface, 0.2)
    np.testing.assert_allclose(found.r, [[-10, -1.2, -1.6]], rtol=1e-12)
    np.testing.assert_allclose(found.w, [[0, 1.2 / 5, 1.6 / 5]], rtol=1e-12, atol=1e-14)
    assert found.report.dissipation == pytest.approx(2 * 0.4)


def test_slip_counts_from_its_origin():
    # the same spring unloaded: it slips back only when the spring beats friction, and keeps part of the slip
    interface = bare_interface(np.diag([7.0, 5.0]), np.array([10, 4.0]), 2)
    loaded = solve_coulomb(interface, 0.2)
    assert loaded.w[0, 1] == pytest.approx(0.4)
    half = solve_coulomb(replace(interface, f=np.array([10, 2.0])), 0.2, slip_origin=loaded.w[:, 1:])
    assert half.status[0] == STICK
    np.testing.assert_allclose(half.w, loaded.w, atol=1e-12)
    back = solve_coulomb(replace(interface, f=np.array([10, -3.0])), 0.2, slip_origin=half.w[:, 1:])
    assert back.status[0] == SLIP
    assert back.w[0, 1] == pytest.approx(-0.2)
    assert back.r[0, 1] == pytest.approx(2.0)


def strip(n, length, stiffness, force_per_node):
    """Bar on a Coulomb floor, pulled at its last node; pressed by a given force on each node."""
    k = stiffness * n / length
    S = np.zeros((2 * (n + 1), 2 * (n + 1)))
    normal, tangent = np.arange(0, 2 * (n + 1), 2), np.arange(1, 2 * (n + 1), 2)
    S[normal, normal] = k
    for i in range(n):
        S[np.ix_(tangent[i : i + 2], tangent[i : i + 2])] += k * np.array([[1, -1], [-1, 1]])
    f = np.zeros(2 * (n + 1))
    f[normal] = force_per_node
    f[normal[[0, -1]]] /= 2
    return S, f


def test_strip_on_a_floor_loaded_unloaded_and_loaded_again():
    # slip length c with s H = mu p c; end displacement s c / 2E, s c / 4E after unloading, s c / 2E again
    n, length, E, mu, p, s = 80, 4.0, 1000.0, 0.25, 8.0, 3.0
    S, f = strip(n, length, E, p * length / n)
    bar = bare_interface(S, f, 2)
    c = s / (mu * p)

    def pull(value, before):
        load = f.copy()
        load[-1] = value
        return solve_coulomb(replace(bar, f=load), mu, start=before, slip_origin=before and before.w[:, 1:])

    first = pull(s, None)
    rest = pull(0.0, first)
    again = pull(s, rest)
    for state, expected in ((first, s * c / (2 * E)), (rest, s * c / (4 * E)), (again, s * c / (2 * E))):
        # c is a whole number of elements: linear displacement per element is then exact at the nodes
        assert state.w[-1, 1] == pytest.approx(expected, rel=1e-7)
        assert state.report.worst < 1e-8
    assert (first.status == SLIP).sum() == pytest.approx(c * n / length, abs=2)
    assert again.w[-1, 1] == pytest.approx(first.w[-1, 1], rel=1e-7)


def test_strip_pulled_beyond_its_friction_slides():
    S, f = strip(20, 1.0, 1000.0, 1.0)
    f[-1] = 1.01 * 0.3 * 20
    with pytest.raises(ContactUnbalanced) as caught:
        solve_coulomb(bare_interface(S, f, 2), 0.3)
    assert caught.value.kind == "sliding"
    assert 0 < caught.value.share < 0.05
    assert np.ptp(caught.value.motion[:, 1]) < 1e-9
    f[-1] = 0.99 * 0.3 * 20
    slow = solve_coulomb(bare_interface(S, f, 2), 0.3)
    assert slow.report.worst < 1e-8
    assert np.abs(slow.r[:, 1]).sum() == pytest.approx(f[-1], rel=1e-9)


@pytest.mark.parametrize("unit", [1.0, 1e6])
@pytest.mark.parametrize(
    ("degrees", "mu"), [(5.0, 0.2), (10.0, 0.2), (11.0, 0.2), (12.0, 0.2), (30.0, 0.2), (30.0, 0.6)]
)
def test_wedge_pushed_between_walls_and_released(degrees, mu, unit):
    # half a wedge: a spring k across, nothing along; N = P / 2 / (sin a + mu cos a), and it stays when tan a <= mu
    a, k, push = np.radians(degrees), 50.0 * unit, 10.0 * unit
    axes = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    wedge = bare_interface(axes @ np.diag([k, 0.0]) @ axes.T, axes @ np.array([0, -push / 2]), 2)
    pushed = solve_coulomb(wedge, mu)
    N = push / 2 / (np.sin(a) + mu * np.cos(a))
    np.testing.assert_allclose(pushed.r, [[-N, mu * N]], rtol=1e-9)
    # the spring balances both forces of the wall
    slip = N * (np.cos(a) - mu * np.sin(a)) / (k * np.sin(a))
    np.testing.assert_allclose(pushed.w, [[0, -slip]], rtol=1e-9, atol=1e-12)
    bare = replace(wedge, f=np.zeros(2))
    stuck = replace(pushed, r=(bare.S @ pushed.w.ravel()).reshape(1, 2))
    released = solve_coulomb(bare, mu, start=stuck, slip_origin=pushed.w[:, 1:])
    kept = k * slip * np.sin(a) * np.cos(a) if np.tan(a) <= mu else 0.0
    np.testing.assert_allclose(released.r[0, 0], -kept, rtol=1e-9, atol=1e-9 * N)
    np.testing.assert_allclose(released.r[0, 1], -kept * np.tan(a), rtol=1e-9, atol=1e-9 * N)
    assert released.report.worst < 1e-6


def test_pulled_off():
    S = np.diag([1.0, 1.0, 1.0])
    S[0, 0] = 0.0
    with pytest.raises(ContactUnbalanced) as caught:
        solve_coulomb(bare_interface(S, np.array([-1.0, 0, 0]), 3), 0.3)
    assert caught.value.kind == "separation"


def test_no_load_no_motion():
    interface = bare_interface(np.eye(6), np.zeros(6), 3)
    for state in (solve_coulomb(interface, 0.2), solve_coulomb(interface, 0.0), solve_tied(interface)):
        np.testing.assert_array_equal(state.w, 0)
        np.testing.assert_array_equal(state.r, 0)


def test_bad_coefficient():
    with pytest.raises(BadValue):
        solve_coulomb(THREE, -0.1)
    with pytest.raises(BadValue):
        solve_coulomb(THREE, np.nan)
    with pytest.raises(BadValue):
        THREE.expand(np.zeros((1, 2)))


def test_statuses_leave_a_pair_below_its_bound_free_to_slide():
    # two pairs coupled tangentially: one beyond its bound, one below; only exact Coulomb holds the second
    S = np.diag([4.0, 3.0, 4.0, 3.0])
    S[1, 3] = S[3, 1] = -1.0
    interface = bare_interface(S, np.array([10, 5.0, 10, 1.0]), 2)
    statuses = solve_statuses(interface, 0.3)
    exact = solve_coulomb(interface, 0.3)
    np.testing.assert_array_equal(statuses.status, [SLIP, STICK])
    np.testing.assert_allclose(statuses.r, [[-10, -3], [-10, -1]], atol=1e-12)
    # 3 w1 - w2 = 2, 3 w2 - w1 = 0
    np.testing.assert_allclose(statuses.w, [[0, 0.75], [0, 0.25]], atol=1e-12)
    np.testing.assert_allclose(exact.w, [[0, 2 / 3], [0, 0]], atol=1e-12)
    assert statuses.report.friction_power > 1e-2
    assert exact.report.friction_power < 1e-12


def test_statuses_open_and_close():
    # the normal coupling lifts the second pair once the first is pressed
    S = np.diag([4.0, 1.0, 4.0, 1.0])
    S[0, 2] = S[2, 0] = 2.0
    interface = bare_interface(S, np.array([10, 0, -1.0, 0]), 2)
    for state in (solve_statuses(interface, 0.3), solve_coulomb(interface, 0.3)):
        np.testing.assert_array_equal(state.status, [STICK, OPEN])
        np.testing.assert_allclose(state.w[:, 0], [0, -0.25], atol=1e-12)
        np.testing.assert_allclose(state.r[:, 0], [-10.5, 0], atol=1e-12)
