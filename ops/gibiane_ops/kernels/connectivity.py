"""Which cells stand around the nodes of a mesh, which nodes see each other, and which pieces the mesh falls into.

Meshes are sequences of blocks of cells, as in `topology`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.topology import Block


def node_to_cells(blocks: Sequence[Block], n_nodes: int) -> tuple[IntArray, IntArray]:
    """List the cells around each node.

    Parameters
    ----------
    blocks : sequence of (str, (m, n_nodes) int64)
    n_nodes : int
        Number of nodes of the mesh.

    Returns
    -------
    indptr : (n_nodes + 1,) int64
    cells : (indptr[-1],) int64
        Those of node i are ``cells[indptr[i]:indptr[i + 1]]``, increasing.
    """
    nodes = [np.zeros(0, np.int64)]
    numbers = [np.zeros(0, np.int64)]
    start = 0
    for _, cells in blocks:
        nodes.append(cells.ravel())
        numbers.append(np.repeat(np.arange(start, start + len(cells)), cells.shape[1]))
        start += len(cells)
    node, number = np.concatenate(nodes), np.concatenate(numbers)
    order = np.argsort(node, kind="stable")
    indptr = np.r_[0, np.cumsum(np.bincount(node, minlength=n_nodes))]
    return indptr.astype(np.int64), number[order]


def node_graph(blocks: Sequence[Block], n_nodes: int) -> sp.csr_array:
    """Build the graph of the nodes that share a cell.

    Parameters
    ----------
    blocks : sequence of (str, (m, n_nodes) int64)
    n_nodes : int

    Returns
    -------
    (n_nodes, n_nodes) csr_array of int32
        Entry (i, j) counts the cells that hold both nodes; the diagonal counts the cells of a node.
    """
    indptr, cells = node_to_cells(blocks, n_nodes)
    n_cells = sum(len(each) for _, each in blocks)
    incidence = sp.csr_array((np.ones(len(cells), np.int32), cells, indptr), shape=(n_nodes, n_cells))
    return sp.csr_array(incidence @ incidence.T)


def solids(blocks: Sequence[Block], n_nodes: int) -> tuple[int, IntArray]:
    """Split the mesh into pieces that share no node.

    Parameters
    ----------
    blocks : sequence of (str, (m, n_nodes) int64)
    n_nodes : int

    Returns
    -------
    n_solids : int
    solid : (n_nodes,) int64
        Number of the piece of each node, in order of the first node; -1 for a node that no cell uses.
    """
    from scipy.sparse.csgraph import connected_components

    indptr, cells = node_to_cells(blocks, n_nodes)
    n_cells = sum(len(each) for _, each in blocks)
    if n_cells == 0:
        return 0, np.full(n_nodes, -1, np.int64)
    # Nodes and cells are the two sides of one graph, much smaller than the graph of node pairs.
    rows = np.repeat(np.arange(n_nodes), np.diff(indptr))
    links = sp.csr_array((np.ones(len(cells), np.int8), (rows, cells + n_nodes)), shape=(n_nodes + n_cells,) * 2)
    _, label = connected_components(links, directed=False)
    solid = np.where(np.diff(indptr) > 0, label[:n_nodes], -1)
    names, first = np.unique(solid[solid >= 0], return_index=True)
    rank = np.full(label.max() + 1, -1, np.int64)
    rank[names[np.argsort(first)]] = np.arange(len(names))
    return len(names), np.where(solid >= 0, rank[solid], -1)
