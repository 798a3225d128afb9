"""Equivalent stresses, principal values and invariants against values known by hand and their own properties."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gibiane_ops.kernels.arrays import stress_tensor, stress_vector
from gibiane_ops.kernels.invariants import invariants, principal, tresca, von_mises

STRESS = arrays(np.float64, 6, elements=st.floats(-100, 100, allow_subnormal=False))


def test_tension_and_shear():
    tension, shear = np.array([3.0, 0, 0, 0, 0, 0]), np.array([0, 0, 0, 2.0, 0, 0])
    assert von_mises(tension) == pytest.approx(3.0)
    assert tresca(tension) == pytest.approx(3.0)
    assert von_mises(shear) == pytest.approx(2.0 * np.sqrt(3))
    assert tresca(shear) == pytest.approx(4.0)


def test_plane_components_keep_the_one_across():
    plane = np.array([3.0, 1.0, -2.0, 0.0])
    whole = np.array([3.0, 1.0, -2.0, 0.0, 0.0, 0.0])
    assert von_mises(plane) == pytest.approx(von_mises(whole))
    assert tresca(plane) == pytest.approx(5.0)


@given(STRESS, st.floats(-50, 50))
def test_pressure_changes_no_equivalent_stress(stress, p):
    shifted = stress + p * np.array([1, 1, 1, 0, 0, 0])
    assert von_mises(shifted) == pytest.approx(float(von_mises(stress)), abs=1e-9)
    assert tresca(shifted) == pytest.approx(float(tresca(stress)), abs=1e-9)


@given(STRESS)
def test_principal_values_rebuild_the_tensor(stress):
    tensor = stress_tensor(stress)
    values, axes = principal(tensor)
    assert values[0] >= values[1] >= values[2]
    np.testing.assert_allclose(np.einsum("k,ki,kj->ij", values, axes, axes), tensor, atol=1e-10)
    assert (np.take_along_axis(axes, np.abs(axes).argmax(axis=1)[:, None], axis=1) > 0).all()


@given(STRESS)
def test_invariants_of_principal_values(stress):
    values, _ = principal(stress_tensor(stress))
    first, second, third = invariants(stress_tensor(stress))
    a, b, c = values
    assert first == pytest.approx(a + b + c, abs=1e-9)
    assert second == pytest.approx(a * b + b * c + c * a, abs=1e-7)
    assert third == pytest.approx(a * b * c, abs=1e-5)


def test_in_a_plane_the_third_direction_stays_across():
    values, axes = principal(stress_tensor(np.array([[1.0, 2.0, 9.0, 0.5]])), in_plane=True)
    assert values[0, 2] == 9.0
    assert values[0, 0] > values[0, 1]
    np.testing.assert_array_equal(axes[0, 2], [0, 0, 1])
    rebuilt = np.einsum("nk,nki,nkj->nij", values, axes, axes)
    np.testing.assert_allclose(stress_vector(rebuilt, 4), [[1.0, 2.0, 9.0, 0.5]], atol=1e-14)
