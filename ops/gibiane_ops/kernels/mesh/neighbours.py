"""Elements put in an order in which each touches those before it."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from gibiane_ops.kernels.arrays import IntArray


def by_vicinity(cells: IntArray, common: int) -> IntArray:
    """Order elements outwards from the first, piece by piece.

    Parameters
    ----------
    cells : (m, n_nodes) int64
    common : int
        Nodes that two neighbours share at least: 2 in a surface, 3 in a volume.

    Returns
    -------
    (m,) int64
        Rows, breadth first.
    """
    from scipy.sparse.csgraph import breadth_first_order

    m, n = cells.shape
    _, local = np.unique(cells, return_inverse=True)
    incidence = csr_array((np.ones(m * n, np.int64), (np.repeat(np.arange(m), n), local.reshape(-1))))
    shared = (incidence @ incidence.T).tocsr()
    shared.data = np.where(shared.data >= common, 1, 0)
    shared.eliminate_zeros()
    left = np.ones(m, bool)
    order: list[IntArray] = []
    while left.any():
        piece = breadth_first_order(shared, int(np.flatnonzero(left)[0]), directed=False, return_predecessors=False)
        left[piece] = False
        order.append(np.asarray(piece, np.int64))
    return np.concatenate(order) if order else np.zeros(0, np.int64)
