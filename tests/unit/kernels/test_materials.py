"""Hooke laws against hand-computed values."""

import numpy as np
import pytest

from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.materials import compliance, isotropic

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
