"""Hanging nodes as a matrix, for assemblies made by hand."""

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import IntArray


def relation_matrix(n_points: int, nodes: IntArray, masters: IntArray) -> sp.csr_array:
    """Write hanging nodes by the nodes that are free.

    Parameters
    ----------
    n_points : int
    nodes, masters
        From `hanging_nodes`; a master may hang itself.

    Returns
    -------
    (n_points, n_free) csr_array
        Row i gives node i by the free nodes, in their order; rows add up to 1.
    """
    used = masters >= 0
    row = np.repeat(np.arange(len(nodes)), used.sum(axis=1))
    share = np.repeat(1.0 / used.sum(axis=1), used.sum(axis=1))
    free = np.ones(n_points, bool)
    free[nodes] = False
    own = np.flatnonzero(free)
    step = sp.csr_array(
        (
            np.concatenate([share, np.ones(len(own))]),
            (np.concatenate([nodes[row], own]), np.concatenate([masters[used], own])),
        ),
        shape=(n_points, n_points),
    )
    T = step
    while True:
        further = sp.csr_array(T @ step)
        if abs(further - T).max() == 0:
            return sp.csr_array(T[:, own])
        T = further
