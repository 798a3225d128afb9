"""Products of sparse matrices that keep their pattern."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

TINY = 1e-200
"""What stands for an entry of value zero, over the largest entry, while products are made."""

FEW = 0.1
"""Share of unknowns that follow others up to which the rest is better selected than multiplied."""


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

    Where most columns of B stand for one unknown each, as those of tied bodies do, their rows and columns of K are
    taken as they are, and products are made of the few other unknowns only.

    Cost
    ----
    A selection of rows and columns, or two products.
    """
    alone = np.flatnonzero(np.diff(B.indptr) == 1)
    alone = alone[B.data[B.indptr[alone]] == 1.0]
    own = np.full(B.shape[1], -1, np.int64)
    own[B.indices[B.indptr[alone[::-1]]]] = alone[::-1]
    rest = np.diff(B.indptr) > 0
    rest[own[own >= 0]] = False
    others = np.flatnonzero(rest)
    size = float(np.abs(K.data).max(initial=0.0)) or 1.0
    if (own < 0).any() or len(others) > FEW * len(own):
        whole = _marked(sp.csr_array(K), size)
        found = sp.csr_array(B.T @ whole @ B)
    else:
        found = sp.csr_array(K[own][:, own])
        if len(others):
            found, follow, rows = _marked(found, size), sp.csr_array(B[others]), _marked(sp.csr_array(K[others]), size)
            cross = sp.csr_array(follow.T @ rows[:, own])
            found = sp.csr_array(found + (cross + cross.T + follow.T @ rows[:, others] @ follow))
    found.data[np.abs(found.data) <= 1e10 * TINY * size] = 0.0
    found.sort_indices()
    return found


def _marked(A: sp.csr_array, size: float) -> sp.csr_array:
    """Put tiny numbers in the place of the zeros, which products and sums leave out."""
    return sp.csr_array((np.where(A.data == 0, TINY * size, A.data), A.indices, A.indptr), shape=A.shape)
