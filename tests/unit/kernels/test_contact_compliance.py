"""The approximate stiffness of the pairs that learns from solutions with the true one."""

import numpy as np
import pytest

from gibiane_ops.kernels.contact.compliance import PairStiffness

RNG = np.random.default_rng(4)
A = RNG.normal(size=(6, 6))
EXACT = A @ A.T / 6 + np.eye(6)
EXCESS = RNG.normal(size=(6, 2))
STIFF = PairStiffness(EXACT + EXCESS @ EXCESS.T, 1.0, np.zeros((6, 0)), exact=False)


def test_each_solution_takes_one_direction_of_the_excess_away() -> None:
    one = STIFF.learned(EXCESS[:, 0], EXACT @ EXCESS[:, 0])
    assert one.S @ EXCESS[:, 0] == pytest.approx(EXACT @ EXCESS[:, 0])
    assert np.allclose(one.S, one.S.T)
    assert np.linalg.eigvalsh(one.S - EXACT).min() > -1e-12
    assert np.linalg.eigvalsh(STIFF.S - one.S).min() > -1e-12
    both = one.learned(EXCESS[:, 1], EXACT @ EXCESS[:, 1])
    assert np.allclose(both.S, EXACT, atol=1e-10)


def test_what_would_stiffen_or_is_no_larger_than_the_noise_is_not_learned() -> None:
    soft = PairStiffness(EXACT - 0.1 * np.eye(6), 1.0, np.zeros((6, 0)), exact=False)
    dw = EXCESS[:, 0]
    assert soft.learned(dw, EXACT @ dw) is soft
    error = float(np.linalg.norm(STIFF.S @ dw - EXACT @ dw))
    assert STIFF.learned(dw, EXACT @ dw, noise=error) is STIFF
    assert STIFF.learned(dw, EXACT @ dw, noise=error / 100) is not STIFF


def test_free_motions_are_left_alone() -> None:
    free = np.ones((6, 1)) / np.sqrt(6)
    keep = np.eye(6) - free @ free.T
    stiff = PairStiffness(keep @ STIFF.S @ keep, 1.0, free, exact=False)
    found = stiff.learned(EXCESS[:, 0] + 1e6 * free[:, 0], keep @ EXACT @ keep @ EXCESS[:, 0])
    assert np.abs(found.S @ free).max() < 1e-12
    assert found.S @ EXCESS[:, 0] == pytest.approx(keep @ EXACT @ keep @ EXCESS[:, 0], rel=1e-6)
