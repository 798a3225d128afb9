"""Systems without symmetry against dense ones, and complementarity against all the sets that might act."""

import itertools

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels.errors import NotConverged, SingularSystem
from gibiane_ops.kernels.unsymmetric import LARGE, ConditionedFactor, complementary


@pytest.mark.parametrize("size", [1.0, 1e11])
@pytest.mark.parametrize("n", [12, LARGE + 1])
def test_conditions_with_their_own_reactions(n: int, size: float) -> None:
    rng = np.random.default_rng(n)
    K = sp.random_array((n, n), density=3 / n, rng=rng) + sp.diags_array(np.full(n, 4.0))
    K = sp.csr_array(size * K)
    C, R = (sp.random_array((3, n), density=0.4, rng=rng, format="csr") for _ in range(2))
    R = sp.csr_array(R + C)
    F, d = size * rng.standard_normal((n, 2)), rng.standard_normal((3, 2))
    u, m = ConditionedFactor(K, C, R).solve(F, d)
    np.testing.assert_allclose(C @ u, d, atol=1e-9)
    np.testing.assert_allclose((K @ u - R.T @ m) / size, F / size, atol=1e-8)


def test_no_condition_and_no_unknown() -> None:
    none, K = sp.csr_array((0, 2)), sp.csr_array([[2.0, 1.0], [0.0, 4.0]])
    u, m = ConditionedFactor(K, none, none).solve(np.array([[4.0], [8.0]]), np.zeros((0, 1)))
    np.testing.assert_allclose(u, [[1.0], [2.0]])
    assert m.shape == (0, 1)
    empty = sp.csr_array((0, 0))
    assert ConditionedFactor(empty, empty, empty).solve(np.zeros((0, 1)), np.zeros((0, 1)))[0].shape == (0, 1)


def test_reaction_that_cannot_resist() -> None:
    K, C, R = sp.eye_array(2, format="csr"), sp.csr_array([[1.0, 0.0]]), sp.csr_array([[0.0, 1.0]])
    with pytest.raises(SingularSystem):
        ConditionedFactor(K, C, R).solve(np.ones((2, 1)), np.zeros((1, 1)))


def every_solution(M: np.ndarray, q: np.ndarray) -> list[np.ndarray]:
    """Try all sets of active unknowns."""
    found = []
    for active in itertools.product([False, True], repeat=len(q)):
        a = np.flatnonzero(active)
        z = np.zeros(len(q))
        z[a] = np.linalg.solve(M[np.ix_(a, a)], -q[a])
        if (z >= 0).all() and (M @ z + q >= -1e-9).all():
            found.append(z)
    return found


@pytest.mark.parametrize("seed", range(40))
def test_complementarity_of_positive_matrices_without_symmetry(seed: int) -> None:
    rng = np.random.default_rng(seed)
    k = rng.integers(1, 7)
    turn = rng.standard_normal((k, k))
    half = rng.standard_normal((k, k))
    M = half @ half.T + 0.1 * np.eye(k) + 3 * (turn - turn.T)  # positive definite, so one solution and one only
    q = rng.standard_normal(k)
    (expected,) = every_solution(M, q)
    np.testing.assert_allclose(complementary(M, q), expected, atol=1e-8)


def test_complementarity_without_solution() -> None:
    with pytest.raises(NotConverged):
        complementary(np.array([[-1.0]]), np.array([-1.0]))
    assert complementary(np.array([[-1.0]]), np.array([1.0])).tolist() == [0.0]
