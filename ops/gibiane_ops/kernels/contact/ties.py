"""Displacements of tied bodies plus relative displacements of the pairs."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.errors import BadValue

BoolArray = NDArray[np.bool_]


def tie(
    n_dofs: int, d: int, pairs: IntArray, fixed: IntArray
) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array, BoolArray]:
    """Write every displacement as ``U = Bv v + Bw w + B0 values``, w in global components.

    Parameters
    ----------
    n_dofs, d : int
        Unknowns, and components of a node.
    pairs : (n, 2) int64
        Slave and master nodes; a master of -1 is the ground, which does not move.
    fixed : (n_fixed,) int64
        Unknowns that are prescribed.

    Returns
    -------
    Bv : (n_dofs, n_v) csr_array
    Bw : (n_dofs, n d) csr_array
    B0 : (n_dofs, n_fixed) csr_array
    free : (n, d) bool
        Components of w that can vary: not those prescribed on both sides.

    Raises
    ------
    BadValue
        When pairs close a loop.

    Notes
    -----
    Each group of unknowns that pairs connect starts from a prescribed one, or from a master's, and the others follow
    pair by pair; a node may so be slave in one zone and master in another.
    """
    if (pairs < 0).any():
        # the ground is one more node, prescribed; its unknowns are the last
        ground = n_dofs + np.arange(d)
        whole = np.where(pairs < 0, n_dofs // d, pairs)
        Bv, Bw, B0, free = tie(n_dofs + d, d, whole, np.concatenate([fixed, ground]))
        return Bv[:n_dofs], Bw[:n_dofs], B0[:n_dofs, : len(fixed)], free
    component = np.arange(d)
    slave, master = (d * pairs[:, :1] + component).ravel(), (d * pairs[:, 1:] + component).ravel()
    known = np.zeros(n_dofs, dtype=bool)
    known[fixed] = True
    free = ~(known[slave] & known[master])
    group, has_fixed = _groups(n_dofs, slave[free], master[free], fixed)
    _refuse_loops(group, slave[free], has_fixed, fixed, d)
    roots = np.full(len(has_fixed), n_dofs)
    np.minimum.at(roots, group, np.arange(n_dofs))
    in_pair = np.full(len(has_fixed), n_dofs)
    np.minimum.at(in_pair, group[master[free]], master[free])
    roots = np.where(in_pair < n_dofs, in_pair, roots)[~has_fixed]
    known[roots] = True
    v = sp.csr_array((np.ones(len(roots)), (roots, np.arange(len(roots)))), (n_dofs, len(roots)))
    q = sp.csr_array((np.ones(len(fixed)), (fixed, np.arange(len(fixed)))), (n_dofs, len(fixed)))
    B = sp.hstack([v, sp.csr_array((n_dofs, len(slave))), q], format="csr")
    waiting = np.flatnonzero(free)
    while len(waiting):
        forward = ~known[slave[waiting]] & known[master[waiting]]
        backward = known[slave[waiting]] & ~known[master[waiting]]
        now = waiting[forward | backward]
        sign = np.where(forward, 1.0, -1.0)[forward | backward]
        target = np.where(sign > 0, slave[now], master[now])
        source = np.where(sign > 0, master[now], slave[now])
        place = sp.csr_array((np.ones(len(now)), (target, np.arange(len(now)))), (n_dofs, len(now)))
        step = sp.csr_array((sign, (np.arange(len(now)), len(roots) + now)), (len(now), B.shape[1]))
        B = B + place @ (B[source] + step)
        known[target] = True
        waiting = waiting[~(forward | backward)]
    split = len(roots), len(roots) + len(slave)
    return B[:, : split[0]], B[:, split[0] : split[1]], B[:, split[1] :], free.reshape(-1, d)


def _groups(n_dofs: int, slave: IntArray, master: IntArray, fixed: IntArray) -> tuple[IntArray, BoolArray]:
    """Give the group of unknowns that pairs connect, for each unknown, and whether a group has a prescribed one."""
    from scipy.sparse.csgraph import connected_components

    links = sp.csr_array((np.ones(len(slave)), (slave, master)), (n_dofs, n_dofs))
    n_groups, group = connected_components(links, directed=False)
    has_fixed = np.zeros(n_groups, dtype=bool)
    has_fixed[group[fixed]] = True
    return group.astype(np.int64), has_fixed


def _refuse_loops(group: IntArray, slave: IntArray, has_fixed: BoolArray, fixed: IntArray, d: int) -> None:
    """Check that a group of m unknowns, k of them prescribed, has no more than m - max(k, 1) links."""
    members = np.bincount(group, minlength=len(has_fixed))
    prescribed = np.bincount(group[fixed], minlength=len(has_fixed))
    links = np.bincount(group[slave], minlength=len(has_fixed))
    bad = np.flatnonzero(links > members - np.maximum(prescribed, 1))
    if len(bad):
        nodes = np.unique(np.flatnonzero(np.isin(group, bad)) // d)
        raise BadValue("contact nodes", nodes.tolist(), "pairs whose relative displacements are independent")
