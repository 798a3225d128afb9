"""Products that keep the pattern."""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels.products import whole_product


def grid(n):
    """Return the matrix of a row of n nodes of two unknowns, zeros held as entries."""
    pairs = [
        (2 * i + a, 2 * j + b) for i in range(n) for j in range(n) if abs(i - j) <= 1 for a in (0, 1) for b in (0, 1)
    ]
    row, column = np.array(pairs).T
    value = np.where(row % 2 == column % 2, 1.0 + np.abs(row - column), 0.0)
    found = sp.csr_array((value, (row, column)), shape=(2 * n, 2 * n))
    assert (found.data == 0).any()
    return found


@pytest.mark.parametrize("n", [30, 60])
@pytest.mark.parametrize("case", ["tied", "weights", "sums", "permuted"])
def test_product_and_pattern(n, case):
    K = grid(n)
    B = sp.lil_array((2 * n, 2 * n - 4))
    for i in range(2 * n - 4):
        B[i + 2, i] = 1.0
    if case == "tied":
        B[[0, 1], [10, 11]] = 1.0
    elif case == "weights":
        B[0, [10, 12]] = 0.5
    elif case == "sums":
        B[: 2 * n // 2] *= 0.5
    B = sp.csr_array(B)
    if case == "permuted":
        B = sp.csr_array(B[:, ::-1])
    found = whole_product(B, K)
    assert np.abs(found - B.T @ K @ B).max() <= 1e-14 * np.abs(K).max()
    assert found.has_sorted_indices
    pattern = sp.csr_array((np.ones(K.nnz), K.indices, K.indptr), shape=K.shape)
    assert found.nnz == (np.abs(B).T @ pattern @ np.abs(B)).nnz
