"""Bars: a truss by hand, curved bars, balance of forces."""

import numpy as np
import pytest

from gibiane_ops.kernels.bars import bar_forces, bar_stiffness, bar_strains
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import InvertedElement

EA = np.array([[5.0]])


def test_stiffness_of_an_inclined_bar_by_hand() -> None:
    """Length 5 along (3, 4) / 5: K = EA / L [t t^T, -t t^T; ...]."""
    t = np.array([0.6, 0.8])
    block = 5.0 / 5.0 * np.outer(t, t)
    K = bar_stiffness(shape("SEG2"), np.array([[[1.0, 1.0], [4.0, 5.0]]]), EA)[0]
    assert np.allclose(K, np.block([[block, -block], [-block, block]]), atol=1e-14)


@pytest.mark.parametrize("name", ["SEG2", "SEG3"])
@pytest.mark.parametrize("dim", [2, 3])
def test_rigid_motions_cost_nothing_and_stretching_is_found(name: str, dim: int) -> None:
    of = shape(name)
    X = np.random.default_rng(3).uniform(-1, 1, (4, 2, dim)) if name == "SEG2" else _arcs(dim)
    K = bar_stiffness(of, X, EA)
    turn = np.zeros((dim, dim))
    turn[0, 1], turn[1, 0] = -1.0, 1.0
    spin = (X @ turn.T).reshape(len(X), -1, 1)
    assert np.abs(K @ spin).max() < 1e-12
    assert np.abs(K @ np.tile(np.eye(dim), (of.n_nodes, 1))).max() < 1e-12
    # u = e x stretches by e in every direction.
    strain = bar_strains(of, X, 0.01 * X, of.gauss[0])
    assert np.allclose(strain, 0.01)


def _arcs(dim: int) -> np.ndarray:
    angle = np.array([0.0, 0.8, 0.4])
    X = np.zeros((1, 3, dim))
    X[0, :, 0], X[0, :, 1] = np.cos(angle), np.sin(angle)
    return X


@pytest.mark.parametrize("name", ["SEG2", "SEG3"])
def test_forces_are_the_stiffness_times_the_displacement(name: str) -> None:
    of = shape(name)
    X = _arcs(3) if name == "SEG3" else np.array([[[0.0, 0, 0], [1, 2, 2]]])
    U = np.random.default_rng(5).standard_normal(X.shape)
    tension = 5.0 * bar_strains(of, X, U, of.gauss[0])
    expected = (bar_stiffness(of, X, EA) @ U.reshape(1, -1, 1)).reshape(U.shape)
    assert np.allclose(bar_forces(of, X, tension), expected, atol=1e-13)


def test_a_bar_without_length_is_refused() -> None:
    with pytest.raises(InvertedElement):
        bar_stiffness(shape("SEG2"), np.zeros((1, 2, 3)), EA)


def test_green_and_lagrange_strain_of_a_bar():
    # From (0, 0)-(2, 0) to (0, 0)-(2.2, 0.3): (2.2^2 + 0.3^2 - 2^2) / (2 x 2^2); a rotation gives nothing.
    of = shape("SEG2")
    X = np.array([[[0.0, 0.0], [2.0, 0.0]]])
    for end, expected in (([2.2, 0.3], 0.93 / 8), ([0.0, 2.0], 0.0)):
        strain = bar_strains(of, X, np.array([[[0.0, 0.0], end]]) - X, of.gauss[0], quadratic=True)
        assert strain == pytest.approx(expected, abs=1e-15)
