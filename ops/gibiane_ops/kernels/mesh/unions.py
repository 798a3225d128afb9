"""Comparing lists of elements by their nodes."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import IntArray

BoolArray = NDArray[np.bool_]


def is_in(cells: IntArray, others: IntArray) -> BoolArray:
    """Tell which elements are also in another list, whatever the order of their nodes.

    Parameters
    ----------
    cells : (m, n) int64
    others : (k, n) int64

    Returns
    -------
    (m,) bool

    Cost
    ----
    Only elements all of whose nodes are in both lists are compared: two meshes that touch along a surface cost one
    look-up per node.
    """
    found = np.zeros(len(cells), bool)
    if len(cells) == 0 or len(others) == 0:
        return found
    top = int(max(cells.max(), others.max())) + 1
    here, there = np.zeros(top, bool), np.zeros(top, bool)
    here[cells.ravel()] = True
    there[others.ravel()] = True
    shared = here & there
    mine = np.flatnonzero(functools.reduce(np.logical_and, shared[cells].T))
    theirs = np.flatnonzero(functools.reduce(np.logical_and, shared[others].T))
    if len(mine) and len(theirs):
        group, _ = topology.group_by_nodes(np.concatenate([others[theirs], cells[mine]]))
        known = np.zeros(int(group.max()) + 1, bool)
        known[group[: len(theirs)]] = True
        found[mine] = known[group[len(theirs) :]]
    return found


def not_in(cells: IntArray, others: IntArray) -> IntArray:
    """Return the rows of the elements that are not in another list, (k,) int64; arguments as for `is_in`."""
    return np.flatnonzero(~is_in(cells, others)).astype(np.int64)
