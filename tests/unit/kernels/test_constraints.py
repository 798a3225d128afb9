"""Elimination of equality conditions on small systems, checked against the full saddle-point solution."""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels.constraints import Reduction, reduce_conditions
from gibiane_ops.kernels.errors import ContradictoryConditions

N = 8


def system(columns: int = 0) -> tuple[sp.csr_array, np.ndarray]:
    rng = np.random.default_rng(11)
    A = rng.standard_normal((N, N))
    return sp.csr_array(A @ A.T + np.eye(N)), rng.standard_normal((N, columns) if columns else N)


def conditions(*rows: dict[int, float]) -> sp.csr_array:
    C = sp.lil_array((len(rows), N))
    for i, row in enumerate(rows):
        for unknown, value in row.items():
            C[i, unknown] = value
    return C.tocsr()


def solve(reduction: Reduction, K: sp.csr_array, F: np.ndarray) -> np.ndarray:
    return reduction.expand(np.linalg.solve(reduction.matrix(K).toarray(), reduction.load(K, F)))


def saddle(K: sp.csr_array, F: np.ndarray, C: sp.csr_array, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solve [K -C^T; C 0] (u, m) = (F, d), for independent rows."""
    m = C.shape[0]
    full = np.block([[K.toarray(), -C.toarray().T], [C.toarray(), np.zeros((m, m))]])
    both = np.linalg.solve(full, np.concatenate([F, d]))
    return both[:N], both[N:]


@pytest.mark.parametrize(
    "C",
    [
        conditions({2: 1}, {5: -4}),
        conditions({0: 1, 1: -1}),
        conditions({0: 1, 1: -0.5, 2: -0.5}, {1: 1}, {4: 1, 3: 1, 5: 1, 6: 1}),
        conditions({0: 1, 1: -1}, {1: 1, 2: -1}, {2: 1, 3: -1}, {3: 1, 4: -1}),
        conditions({0: 1, 1: 2, 2: 3}, {0: 3, 1: 1, 2: 2}, {2: 1, 3: 1}),
        conditions({0: 1, 1: 1, 2: 1}, {0: 1, 1: -1, 2: 1}, {0: 1, 1: 1, 2: -2}),
        conditions({0: 1e-3, 1: 1.0}, {1: 1.0, 2: -1.0}, {2: 1.0, 1: 2.0}),
        conditions(*[{i: float(i == j) + 1 / (1 + i + j) for i in range(N)} for j in range(5)]),
    ],
)
@pytest.mark.parametrize("zero", [True, False])
def test_against_the_saddle_point_system(C: sp.csr_array, zero: bool) -> None:
    K, F = system()
    d = np.zeros(C.shape[0]) if zero else np.arange(1.0, C.shape[0] + 1)
    reduction = reduce_conditions(C, None if zero else d)
    u = solve(reduction, K, F)
    exact, multipliers = saddle(K, F, C, d)
    assert np.allclose(u, exact, atol=1e-10)
    assert np.allclose(C @ u, d, atol=1e-11)
    r = reduction.reactions(K, u, F)
    assert np.allclose(K @ u, F + r, atol=1e-9)
    assert np.allclose(reduction.multipliers(r), multipliers, atol=1e-8)
    reduced = reduction.matrix(K).toarray()
    assert np.allclose(reduced, reduced.T, atol=1e-12)
    assert np.linalg.eigvalsh(reduced).min() > 0


def test_reaction_of_a_spring() -> None:
    # Two springs of stiffness 3 in series, one end held, the other pulled by 0.5: force 0.75.
    K = sp.csr_array(3.0 * np.array([[1, -1, 0], [-1, 2, -1], [0, -1, 1.0]]))
    reduction = reduce_conditions(sp.csr_array(np.array([[1.0, 0, 0], [0, 0, 2.0]])), np.array([0.0, 1.0]))
    u = reduction.expand(reduction.load(K, np.zeros(3)) / reduction.matrix(K).toarray()[0, 0])
    assert u == pytest.approx([0, 0.25, 0.5])
    r = reduction.reactions(K, u, np.zeros(3))
    assert r == pytest.approx([-0.75, 0, 0.75])
    assert reduction.multipliers(r) == pytest.approx([-0.75, 0.375])


def test_several_load_cases_and_values() -> None:
    K, F = system(3)
    C = conditions({0: 1}, {1: 1, 2: -1})
    d = np.array([[0.0, 1, 2], [3, 4, 5]])
    reduction = reduce_conditions(C, d)
    u = solve(reduction, K, F)
    for k in range(3):
        alone = reduce_conditions(C, d[:, k])
        assert np.allclose(u[:, k], solve(alone, K, F[:, k]), atol=1e-12)
    one_load = solve(reduction, K, F[:, 0])
    assert one_load.shape == (N, 3)
    assert np.allclose(C @ one_load, d)
    r = reduction.reactions(K, one_load, F[:, 0])
    assert np.allclose(C.T @ reduction.multipliers(r), r, atol=1e-10)
    fixed_values = reduce_conditions(C, d[:, 1])
    assert np.allclose(C @ solve(fixed_values, K, F), d[:, 1:2])


def test_redundant_conditions_are_dropped_and_named() -> None:
    C = conditions({0: 1}, {0: 2}, {1: 1, 2: -1}, {0: 1, 1: 1, 2: -1}, {3: 1, 4: 1, 5: 1}, {3: 2, 4: 2, 5: 2}, {})
    reduction = reduce_conditions(C, np.array([1.0, 2, 3, 4, 5, 10, 0]))
    assert set(reduction.redundant) | set(reduction.kept) == set(range(7))
    assert len(reduction.redundant) == 4
    assert {1, 6} <= set(reduction.redundant.tolist())
    K, F = system()
    u = solve(reduction, K, F)
    assert np.allclose(C @ u, [1, 2, 3, 4, 5, 10, 0])
    r = reduction.reactions(K, u, F)
    assert np.allclose(C.T @ reduction.multipliers(r), r, atol=1e-10)


@pytest.mark.parametrize(
    ("C", "d", "rows"),
    [
        (conditions({0: 1}, {3: 1}, {0: 2}), [1.0, 0, 3], [0, 2]),
        (conditions({0: 1}, {1: 1}, {5: 1}, {0: 1, 1: -1}), [0.0, 0, 0, 0.1], [0, 1, 3]),
        (conditions({0: 1}, {0: 1, 1: -1}, {1: 1, 2: -1}, {2: 1}), [0.0, 0, 0, 1], [0, 1, 2, 3]),
        (conditions({0: 1, 1: -1}, {1: 1, 2: -1}, {4: 1, 5: 1}, {0: 1, 2: -1}), [1.0, 1, 0, 3], [0, 1, 3]),
        (conditions({4: 1}, {}), [0.0, 2], [1]),
    ],
)
def test_contradictions_name_their_rows(C: sp.csr_array, d: list[float], rows: list[int]) -> None:
    with pytest.raises(ContradictoryConditions) as caught:
        reduce_conditions(C, np.array(d))
    assert caught.value.rows.tolist() == rows
    assert caught.value.residual > 0


def test_round_off_is_no_contradiction() -> None:
    third = 1 / 3
    reduction = reduce_conditions(conditions({0: 3}, {0: 1}), np.array([1.0, third + 1e-16]))
    assert reduction.redundant.tolist() == [1]
    tilted = np.cos(np.pi / 2)
    assert reduce_conditions(conditions({0: 1, 1: tilted})).fixed.tolist() == [0]


def test_no_condition() -> None:
    K, F = system()
    reduction = reduce_conditions(sp.csr_array((0, N)))
    assert np.allclose(K @ solve(reduction, K, F), F)
    assert not reduction.reactions(K, np.ones(N), F).any()
    assert reduction.multipliers(np.zeros(N)).shape == (0,)


def test_everything_fixed() -> None:
    K, _ = system()
    reduction = reduce_conditions(sp.eye_array(N, format="csr"), np.arange(float(N)))
    u = reduction.expand(np.zeros(0))
    assert np.array_equal(u, np.arange(N))
    assert reduction.matrix(K).shape == (0, 0)


def test_long_chain_of_ties() -> None:
    n = 300
    C = sp.diags_array([np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n)).tocsr()
    reduction = reduce_conditions(C, np.full(n - 1, -1.0))
    assert len(reduction.free) == 1
    u = reduction.expand(np.array([5.0]))
    assert np.allclose(np.diff(u), 1.0, atol=1e-12)
    K = sp.eye_array(n, format="csr")
    assert reduction.matrix(K).toarray() == pytest.approx(n)


def test_no_unknown_is_solved_for_through_a_small_coefficient() -> None:
    reduction = reduce_conditions(conditions({0: 1e-6, 1: 1}, {1: 1, 2: 1, 3: 1e-6}))
    assert np.abs(reduction.relation).max() <= 10.0


@pytest.mark.parametrize(
    "C",
    [
        conditions({0: 1.0}, {4: 2.0}, {5: 1.0}),
        conditions({0: 1.0}, {3: 1.0, 1: -0.5, 2: -0.5}),
        conditions({0: 1.0, 5: -1.0}, {1: 1.0, 4: 2.0}, {2: 3.0}),
        conditions(),
    ],
)
@pytest.mark.parametrize("block", [1, 2, 4])
def test_the_whole_matrix_gives_the_same_solution(C: sp.csr_array, block: int) -> None:
    K, F = system()
    reduction = reduce_conditions(C, np.linspace(0.1, 0.3, C.shape[0]))
    whole = reduction.whole_matrix(K, block)
    assert whole.blocksize == (block, block)
    b = np.zeros(len(F))
    b[reduction.free] = reduction.load(K, F)
    x = np.linalg.solve(whole.toarray(), b)
    np.testing.assert_allclose(whole.toarray(), whole.toarray().T)
    eliminated = np.setdiff1d(np.arange(len(F)), reduction.free)
    np.testing.assert_array_equal(x[eliminated], 0)
    np.testing.assert_allclose(reduction.expand(x[reduction.free]), solve(reduction, K, F), rtol=1e-11)
