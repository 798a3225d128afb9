"""Assembly of element matrices and vectors into sparse matrices and vectors.

Unknowns are numbered by node, ``d * node + component``. Blocks of cells come as ``(cells, element arrays)`` so that
meshes of several shapes assemble in one call.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray, IntArray


def assemble(n_nodes: int, d: int, blocks: Sequence[tuple[IntArray, FloatArray]]) -> sp.csr_array:
    """Assemble element matrices.

    Parameters
    ----------
    n_nodes : int
    d : int
        Unknowns per node; 1 for a scalar mass matrix.
    blocks : sequence of (cells, Ke)
        cells : (m, n) int64 and Ke : (m, n * d, n * d) float64.

    Returns
    -------
    (n_nodes * d, n_nodes * d) csr_array, sorted indices
        Explicit zeros are kept, so that every d x d block is whole.

    Cost
    ----
    About 0.5 s and 350 Mbyte at the peak for 33 000 CUB8.
    """
    indptr, indices, gather = _node_graph(n_nodes, [cells for cells, _ in blocks])
    pairs = [
        Ke.reshape(len(c), c.shape[1], d, c.shape[1], d).transpose(0, 1, 3, 2, 4).reshape(-1, d * d) for c, Ke in blocks
    ]
    data = (gather @ (pairs[0] if len(pairs) == 1 else np.concatenate(pairs))).reshape(-1, d, d)
    size = n_nodes * d
    return sp.csr_array(sp.bsr_array((data, indices, indptr), shape=(size, size)).tocsr())


def assemble_vector(n_nodes: int, d: int, blocks: Sequence[tuple[IntArray, FloatArray]]) -> FloatArray:
    """Assemble element vectors.

    Parameters
    ----------
    n_nodes : int
    d : int
    blocks : sequence of (cells, Fe)
        cells : (m, n) int64 and Fe : (m, n, d) float64.

    Returns
    -------
    (n_nodes * d,) float64
    """
    total = np.zeros((n_nodes, d))
    for cells, Fe in blocks:
        nodes = cells.ravel()
        for i in range(d):
            total[:, i] += np.bincount(nodes, Fe[..., i].ravel(), minlength=n_nodes)
    return total.ravel()


def _node_graph(n_nodes: int, cells: Sequence[IntArray]) -> tuple[IntArray, IntArray, sp.csr_array]:
    """Find the node pairs that share a cell: rows and columns, CSR, and what sums the pairs of the cells into them."""
    keys = np.concatenate([(c[:, :, None] * np.int64(n_nodes) + c[:, None, :]).ravel() for c in cells])
    order = np.argsort(keys)
    keys = keys[order]
    first = np.flatnonzero(np.r_[True, keys[1:] != keys[:-1]]) if len(keys) else np.zeros(0, np.int64)
    rows, columns = np.divmod(keys[first], n_nodes)
    indptr = np.r_[0, np.cumsum(np.bincount(rows, minlength=n_nodes))].astype(np.int32)
    starts = np.r_[first, len(keys)].astype(np.int32)
    gather = sp.csr_array((np.ones(len(keys)), order.astype(np.int32), starts), shape=(len(first), len(keys)))
    return indptr, columns.astype(np.int32), gather
