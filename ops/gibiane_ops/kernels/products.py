"""Products of sparse matrices that keep their pattern."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

TINY = 1e-200
"""What stands for an entry of value zero, over the largest entry, while products are made."""


def whole_product(B: sp.csr_array, K: sp.csr_array) -> sp.csr_array:
    """Compute ``B.T K B`` with the zeros that K holds as entries, which SciPy's product leaves out.

    Parameters
    ----------
    B : (n, m) csr_array
    K : (n, n) csr_array

    Returns
    -------
    (m, m) csr_array, its indices sorted

    Notes
    -----
    The unknowns of a node have one pattern as long as these zeros are there, and an ordering that finds this works on
    nodes: of 106 000 unknowns, in 0.8 s instead of 2.5.

    Cost
    ----
    Two products.
    """
    size = float(np.abs(K.data).max(initial=0.0)) or 1.0
    entries = np.where(K.data == 0, TINY * size, K.data)
    found = sp.csr_array(B.T @ sp.csr_array((entries, K.indices, K.indptr), shape=K.shape) @ B)
    found.data[np.abs(found.data) <= 1e10 * TINY * size] = 0.0
    found.sort_indices()
    return found
