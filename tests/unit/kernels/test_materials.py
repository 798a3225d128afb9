"""Hooke laws against hand-computed values."""

import numpy as np
import pytest

from gibiane_ops.kernels.arrays import stress_vector
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.materials import compliance, isotropic, orthotropic, orthotropic_compliance, thermal_strain

# E = 2.6, nu = 0.3: G = 1, lambda = 1.5
E, NU = 2.6, 0.3


def test_3d_by_hand() -> None:
    expected = np.zeros((6, 6))
    expected[:3, :3] = 1.5
    expected[[0, 1, 2], [0, 1, 2]] = 3.5
    expected[[3, 4, 5], [3, 4, 5]] = 1.0
    assert np.allclose(isotropic(E, NU), expected, rtol=1e-14)


def test_plane_strain_is_the_3d_law_cut_to_the_plane() -> None:
    assert np.array_equal(isotropic(E, NU, "DEFO"), isotropic(E, NU)[:4, :4])


def test_plane_stress_by_hand() -> None:
    D = isotropic(E, NU, "CONT")
    a = 2.6 / 0.91
    assert np.allclose(D, [[a, 0.3 * a, 0, 0], [0.3 * a, a, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]], rtol=1e-14)


def test_plane_stress_leaves_no_stress_through_the_thickness() -> None:
    strain = np.array([1e-3, -4e-4, 0.0, 7e-4])
    stress = isotropic(E, NU, "CONT") @ strain
    full = compliance(E, NU, "CONT") @ stress
    assert np.allclose(full[[0, 1, 3]], strain[[0, 1, 3]], rtol=1e-12)
    assert full[2] == pytest.approx(-0.3 / 0.7 * (1e-3 - 4e-4))


@pytest.mark.parametrize("mode", ["TRID", "DEFO"])
def test_compliance_against_stiffness(mode: str) -> None:
    D, S = isotropic(E, NU, mode), compliance(E, NU, mode)
    if mode == "TRID":
        assert np.allclose(S @ D, np.eye(6), atol=1e-14)
    else:
        # eps_zz = 0 is part of the plane strain law: compare on the strains that it allows.
        strain = np.array([1.0, 2, 0, 3])
        assert np.allclose(S @ D @ strain, strain, atol=1e-13)


def test_one_law_per_element() -> None:
    D = isotropic(np.array([E, 2 * E]), NU)
    assert D.shape == (2, 6, 6)
    assert np.allclose(D[1], 2 * D[0])


@pytest.mark.parametrize(
    ("young", "poisson", "mode", "what"),
    [(0.0, 0.3, "TRID", "E"), (1.0, 0.5, "TRID", "nu"), (1.0, -1.0, "DEFO", "nu"), (1.0, 0.3, "COQUE", "mode")],
)
def test_meaningless_laws_are_refused(young: float, poisson: float, mode: str, what: str) -> None:
    with pytest.raises(BadValue) as caught:
        isotropic(young, poisson, mode)
    assert caught.value.what == what


def test_not_a_number_is_refused() -> None:
    with pytest.raises(BadValue):
        isotropic(1.0, float("nan"))


E3 = np.array([40.0, 10.0, 8.0])
NU3 = np.array([0.3, 0.25, 0.4])
G3 = np.array([5.0, 4.0, 3.0])


def axes_at_random() -> np.ndarray:
    Q, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))
    return Q * np.sign(np.linalg.det(Q))


@pytest.mark.parametrize("mode", ["TRID", "DEFO", "CONT", "AXIS"])
def test_equal_moduli_are_isotropic_in_any_axes(mode: str) -> None:
    axes = axes_at_random() if mode == "TRID" else np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1.0]])
    same = np.full(3, 1.0)
    D = orthotropic(E * same, NU * same, 1.0 * same, axes, mode)
    assert np.allclose(D, isotropic(E, NU, mode), atol=1e-13)
    assert np.allclose(orthotropic_compliance(E * same, NU * same, same, axes, mode), compliance(E, NU, mode))


def test_orthotropic_by_hand() -> None:
    S = orthotropic_compliance(E3, NU3, G3)
    assert np.allclose(np.diag(S), [1 / 40, 1 / 10, 1 / 8, 1 / 5, 1 / 4, 1 / 3])
    assert S[0, 1] == S[1, 0] == -0.3 / 40
    assert S[0, 2] == -0.25 / 40
    assert S[1, 2] == -0.4 / 10
    assert np.allclose(orthotropic(E3, NU3, G3) @ S, np.eye(6), atol=1e-13)


def test_a_quarter_turn_swaps_the_axes() -> None:
    """Axis 1 along y, axis 2 along -x: xx and yy change places, xz and yz too."""
    S = orthotropic_compliance(E3, NU3, G3)
    turned = orthotropic_compliance(E3, NU3, G3, np.array([[0, 1.0, 0], [-1.0, 0, 0], [0, 0, 1.0]]))
    order = [1, 0, 2, 3, 5, 4]
    assert np.allclose(turned, S[np.ix_(order, order)])


def test_energy_does_not_depend_on_the_axes() -> None:
    axes = axes_at_random()
    tensor = np.array([[3.0, 1.0, -2.0], [1.0, 5.0, 0.5], [-2.0, 0.5, -4.0]])
    here, there = stress_vector(tensor), stress_vector(axes @ tensor @ axes.T)
    energy = there @ orthotropic_compliance(E3, NU3, G3) @ there
    assert here @ orthotropic_compliance(E3, NU3, G3, axes) @ here == pytest.approx(energy, rel=1e-13)


def test_one_orthotropic_law_per_element() -> None:
    axes = np.stack([np.eye(3), axes_at_random()])
    D = orthotropic(E3, NU3, G3, axes)
    assert D.shape == (2, 6, 6)
    assert np.allclose(D[0], orthotropic(E3, NU3, G3))
    assert np.allclose(D[1], orthotropic(E3, NU3, G3, axes[1]))


@pytest.mark.parametrize(
    ("young", "poisson"), [([1.0, 1.0, 1.0], [1.2, 0, 0]), ([1.0, -1.0, 1.0], [0, 0, 0]), ([1.0, 0.0, 1.0], [0, 0, 0])]
)
def test_unstable_moduli_are_refused(young: list[float], poisson: list[float]) -> None:
    with pytest.raises(BadValue):
        orthotropic(young, poisson, [1.0, 1.0, 1.0])


def test_thermal_strain() -> None:
    alpha = np.array([1e-5, 2e-5, 3e-5])
    assert np.allclose(thermal_strain(alpha), [1e-5, 2e-5, 3e-5, 0, 0, 0])
    half = np.sqrt(0.5)
    axes = np.array([[half, half, 0], [-half, half, 0], [0, 0, 1.0]])
    # Bisecting axes share the mean; the shear is the difference (engineering).
    assert np.allclose(thermal_strain(alpha, axes, "CONT"), [1.5e-5, 1.5e-5, 3e-5, -1e-5])
