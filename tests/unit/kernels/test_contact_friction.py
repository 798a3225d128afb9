"""Friction laws beyond Coulomb on one pair, against closed forms, by every method that treats them."""

from dataclasses import replace

import numpy as np
import pytest
from interfaces import bare_interface

from gibiane_ops.kernels.contact.augmented import solve_augmented_newton, solve_uzawa
from gibiane_ops.kernels.contact.gauss_seidel import solve_gauss_seidel
from gibiane_ops.kernels.contact.law import friction
from gibiane_ops.kernels.contact.multipliers import solve_multipliers
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.penalty import solve_penalty
from gibiane_ops.kernels.contact.report import OPEN, SLIP, STICK
from gibiane_ops.kernels.contact.tresca import solve_tresca_sequence
from gibiane_ops.kernels.errors import BadValue, ContactUnbalanced

# pressed by 10, pulled by 4 along (3, 4)/5; tangential spring of stiffness 5
PULLED = bare_interface(np.diag([7.0, 5.0, 5.0]), np.array([10, 2.4, 3.2]), 3)
DIRECTION = np.array([0.6, 0.8])
METHODS = {
    "newton": solve_coulomb,
    "tresca": solve_tresca_sequence,
    "multipliers": solve_multipliers,
    "augmented newton": lambda i, law: solve_augmented_newton(i, law, 10.0),
    "uzawa": lambda i, law: solve_uzawa(i, law, 1000.0),
    "gauss-seidel": solve_gauss_seidel,
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("law", "held"),
    [
        ({"mu": 0.2}, 2.0),
        ({"mu": 0.2, "cohesion": 0.5}, 2.5),
        ({"cohesion": 1.5}, 1.5),
        ({"mu": 0.2, "slip_stiffness": 3.0}, 1.5),  # 4 k / (5 + k): below the bound, elastic slip
        ({"mu": 0.2, "slip_stiffness": 45.0}, 2.0),  # 3.6 is beyond the bound
        ({"mu": 0.2, "exponent": 1.0, "slip_scale": 0.5}, 16 / 9),  # viscous: 2 w / 0.5 + 5 w = 4
        # 2 sqrt(w / 0.5) + 5 w = 4
        ({"mu": 0.2, "exponent": 0.5, "slip_scale": 0.5}, 4 - 5 * ((np.sqrt(88) - np.sqrt(8)) / 10) ** 2),
    ],
)
def test_one_pulled_pair(law, held, method):
    found = METHODS[method](PULLED, friction(1, **law))
    np.testing.assert_allclose(found.r[0], [-10, *(-held * DIRECTION)], rtol=1e-7)
    np.testing.assert_allclose(found.w[0], [0, *((4 - held) / 5 * DIRECTION)], rtol=1e-6, atol=1e-10)
    assert found.report.worst < 1e-7


def test_norton_tends_to_coulomb():
    sharp = solve_coulomb(PULLED, friction(1, mu=0.2, exponent=0.005, slip_scale=0.4))
    np.testing.assert_allclose(sharp.r, solve_coulomb(PULLED, 0.2).r, rtol=1e-3)


def test_penalty_and_elastic_slip_are_springs_in_series():
    found = solve_penalty(PULLED, friction(1, mu=1.0, slip_stiffness=6.0), 3.0 / PULLED.kref)
    # 3 and 6 in series make 2: 4 * 2 / (5 + 2)
    np.testing.assert_allclose(found.r[0, 1:], -8 / 7 * DIRECTION, rtol=1e-10)


def test_elastic_slip_loaded_and_unloaded():
    # stiffness 5 beside 45, bound 2: elastic up to 2/45 of slip; unloading follows the elastic slope
    law = friction(1, mu=0.2, slip_stiffness=45.0)
    loaded = solve_coulomb(PULLED, law)
    origin = law.slip_of(loaded.w[:, 1:], loaded.r[:, 1:])
    less = replace(PULLED, f=np.array([10, *(3.5 * DIRECTION)]))
    found = solve_coulomb(less, law, slip_origin=origin)
    # 5 w + 45 (w - p) = 3.5 with p = 0.4 - 2 / 45
    np.testing.assert_allclose(found.w[0, 1:], (3.5 + 45 * 0.4 - 2) / 50 * DIRECTION, rtol=1e-9)
    assert found.status[0] == STICK
    assert found.report.worst < 1e-9


@pytest.mark.parametrize(("pull", "opening", "force", "status"), [(1.0, 0, 1.0, STICK), (2.0, 1.0, 0, OPEN)])
def test_adhesion_holds_up_to_its_strength(pull, opening, force, status):
    interface = bare_interface(np.diag([2.0, 2.0, 2.0]), np.array([-pull, 0, 0.1]), 3)
    found = solve_coulomb(interface, friction(1, cohesion=0.5, adhesion=1.5))
    np.testing.assert_allclose(found.w[0, 0], -opening, atol=1e-12)
    np.testing.assert_allclose(found.r[0, 0], force, atol=1e-12)
    assert found.status[0] == status
    assert found.report.worst < 1e-9


def test_adhesion_needs_contact_at_the_start():
    interface = bare_interface(np.diag([2.0, 2.0]), np.array([-1.0, 0]), 2, np.array([0.1]))
    found = solve_coulomb(interface, friction(1, adhesion=1.5))
    np.testing.assert_allclose(found.w[0], [-0.5, 0], atol=1e-12)


def test_peeling_goes_from_pair_to_pair():
    # a beam of springs lifted at its end: pairs come off one after the other until the tension is below the strength
    n = 12
    S = np.zeros((2 * n, 2 * n))
    normal = np.arange(0, 2 * n, 2)
    S[normal, normal] = 0.05
    S[normal + 1, normal + 1] = 1.0
    for i in range(n - 1):
        S[np.ix_(normal[i : i + 2], normal[i : i + 2])] += np.array([[1, -1], [-1, 1.0]])
    f = np.zeros(2 * n)
    f[normal[-1]] = -2.0
    found = solve_coulomb(bare_interface(S, f, 2), friction(n, adhesion=1.0))
    off = np.flatnonzero(found.status == OPEN)
    assert 0 < len(off) < n
    np.testing.assert_array_equal(off, np.arange(n - len(off), n))
    assert found.r[:, 0].max() <= 1.0
    assert found.report.worst < 1e-9


def test_tresca_bound_is_a_limit():
    S = np.diag([7.0, 0.0])
    with pytest.raises(ContactUnbalanced) as caught:
        solve_coulomb(bare_interface(S, np.array([10, 2.0]), 2), friction(1, cohesion=1.9))
    assert caught.value.kind == "sliding"
    found = solve_coulomb(bare_interface(S, np.array([10, 1.8]), 2), friction(1, cohesion=1.9))
    assert found.status[0] == STICK
    assert solve_coulomb(PULLED, friction(1, cohesion=1.9)).status[0] == SLIP


@pytest.mark.parametrize(
    "wrong",
    [
        {"mu": -0.1}, {"cohesion": -1.0}, {"cohesion": np.inf}, {"slip_stiffness": 0.0}, {"exponent": 1.5},
        {"slip_scale": 0.0}, {"adhesion": np.nan},
    ],
)  # fmt: skip
def test_properties_out_of_range(wrong):
    with pytest.raises(BadValue):
        friction(2, **wrong)


@pytest.mark.parametrize("gamma", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("law", [{"mu": 0.3, "exponent": 0.3, "slip_scale": 0.2}, {"mu": 0.3, "slip_stiffness": 2.0}])
def test_derivative_of_the_law(law, gamma):
    pairs = friction(50, cohesion=0.05, **law)
    rng = np.random.default_rng(3)
    t, bound = rng.uniform(0.01, 3, 50), rng.uniform(0.1, 1, 50)
    s, by_t, by_bound = pairs.length(t, bound, gamma)
    h = 1e-7
    np.testing.assert_allclose((pairs.length(t + h, bound, gamma)[0] - s) / h, by_t, atol=1e-5)
    np.testing.assert_allclose((pairs.length(t, bound + h, gamma)[0] - s) / h, by_bound, atol=1e-5)
    if "exponent" in law:
        np.testing.assert_allclose(s + gamma * 0.2 * (s / bound) ** (1 / 0.3), t, rtol=1e-12)


def test_a_bonded_pair_in_tension_loses_friction():
    # mu N + cohesion with N below zero: 2 - 0.5 x 3, nothing once this is negative; pressed it gains as any pair.
    law = friction(3, mu=0.5, cohesion=2.0, adhesion=10.0)
    normal = np.array([3.0, 5.0, -4.0])
    assert law.bound(normal, np.full(3, True)) == pytest.approx([0.5, 0.0, 4.0])
    assert law.bound(normal) == pytest.approx([0.0, 0.0, 4.0])


@pytest.mark.parametrize(
    ("properties", "expected"),
    [
        ({"mu": 0.5}, [-2.0, 1.0]),
        ({"mu": 0.5, "cohesion": 1.0}, [-1.6, 1.8]),  # apex at 2: (-3, 3) falls on (-3.6, 1.8)
        ({"mu": 0.5, "adhesion": 0.5}, [-1.9, 1.2]),  # apex at 0.5
        ({"cohesion": 1.0}, [-1.0, 1.0]),
        ({"cohesion": 4.0}, [-1.0, 3.0]),
    ],
)
def test_the_nearest_force_that_a_law_admits(properties, expected):
    assert friction(1, **properties).nearest_possible(np.array([[-1.0, 3.0]])) == pytest.approx(np.array([expected]))
