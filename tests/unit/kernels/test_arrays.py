"""Order of components and conversions."""

import numpy as np

from gibiane_ops.kernels import arrays


def test_order_is_xx_yy_zz_xy_xz_yz() -> None:
    assert arrays.COMPONENTS == ("xx", "yy", "zz", "xy", "xz", "yz")
    assert [arrays.component_of(i, j) for i, j in arrays.PAIRS] == list(range(6))
    assert arrays.component_of(1, 0) == 3


def test_stress_tensor_by_hand() -> None:
    tensor = arrays.stress_tensor(np.array([1.0, 2, 3, 4, 5, 6]))
    assert np.array_equal(tensor, [[1, 4, 5], [4, 2, 6], [5, 6, 3]])
    assert np.array_equal(arrays.stress_vector(tensor), [1, 2, 3, 4, 5, 6])


def test_plane_stress_tensor_keeps_zz() -> None:
    tensor = arrays.stress_tensor(np.array([1.0, 2, 3, 4]))
    assert np.array_equal(tensor, [[1, 4, 0], [4, 2, 0], [0, 0, 3]])
    assert np.array_equal(arrays.stress_vector(tensor, 4), [1, 2, 3, 4])


def test_strain_vector_doubles_shears_and_back() -> None:
    strain = np.array([1.0, 2, 3, 8, 10, 12])
    tensor = arrays.strain_tensor(strain)
    assert np.array_equal(tensor, [[1, 4, 5], [4, 2, 6], [5, 6, 3]])
    assert np.array_equal(arrays.strain_vector(tensor), strain)


def test_product_of_vectors_is_the_double_contraction() -> None:
    rng = np.random.default_rng(1)
    stress, strain = rng.standard_normal((2, 5, 6))
    full = np.einsum("nij,nij->n", arrays.stress_tensor(stress), arrays.strain_tensor(strain))
    assert np.allclose(full, (stress * strain).sum(axis=1), rtol=1e-14)


def test_traction_by_hand() -> None:
    stress = np.array([1.0, 2, 3, 4, 5, 6])
    assert np.array_equal(arrays.traction(stress, np.array([0.0, 0, 1])), [5, 6, 3])
    assert np.array_equal(arrays.traction(stress[:4], np.array([0.0, 1])), [4, 2])
