"""Displacements of tied bodies plus relative displacements of the pairs."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.kernels.errors import BadValue

BoolArray = NDArray[np.bool_]

NONE = 1e-10
"""Coefficients below this one are round-off."""

HELD = 0.5
"""A component of the normal above this one is what contact acts on."""

WORST = 1e8
"""Largest displacement that a unit relative displacement may cause."""


def tie_contact(
    n_dofs: int, d: int, contact: ContactPairs, fixed: IntArray
) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array, BoolArray]:
    """Write every displacement as ``U = Bv v + Bw w + B0 values``, w in global components.

    Parameters
    ----------
    n_dofs, d : int
        Unknowns, and components of a node.
    contact : ContactPairs
    fixed : (n_fixed,) int64
        Unknowns that are prescribed.

    Returns
    -------
    Bv : (n_dofs, n_v) csr_array
    Bw : (n_dofs, n d) csr_array
    B0 : (n_dofs, n_fixed) csr_array
    free : (n, d) bool
        Components of w that can vary.

    Raises
    ------
    BadValue
        When the relative displacements are not independent.

    Notes
    -----
    Plain pairs come first, see ``tie``. An interpolated pair then gives the displacement of its slave node. Where this
    one is prescribed: along a tangent, where nodes of the master are held likewise (a plane of symmetry that crosses
    the contact surface), the component drops out; else the master follows.
    """
    plain = contact.plain
    if plain.all():
        return tie(n_dofs, d, contact.pairs, fixed, _shared(n_dofs, d, contact, fixed))
    left_out = _shared(n_dofs, d, contact, fixed)
    Bv, part, B0, free_plain = tie(n_dofs, d, contact.pairs[plain], fixed, left_out[plain])
    n = len(plain)
    free = np.zeros((n, d), dtype=bool)
    free[plain] = free_plain
    own = np.flatnonzero(np.repeat(plain, d))
    Bw = sp.csr_array(part @ sp.eye_array(n * d, format="csr")[own])
    rows = sp.csr_array(sp.kron(contact.matrix(n_dofs // d)[~plain], sp.eye_array(d), format="csr"))
    place = np.flatnonzero(np.repeat(~plain, d))
    slave = (d * contact.pairs[~plain, :1] + np.arange(d)).ravel()
    return *_interpolated(rows, place, slave, contact.normals[~plain], left_out[~plain], Bv, Bw, B0, free), free


def _shared(n_dofs: int, d: int, contact: ContactPairs, fixed: IntArray) -> BoolArray:
    """Share out the displacement of nodes in a corner of obstacles or of one master node: each pair has its normal.

    What slides along one side moves towards the other; friction of these nodes is left out. Corners that are not along
    the axes stay as they are, and are refused.
    """
    left_out = np.zeros(contact.normals.shape, dtype=bool)
    held = np.zeros(n_dofs + d, dtype=bool)
    held[fixed] = True
    held[n_dofs:] = True
    master = np.where(contact.pairs[:, 1] < 0, n_dofs // d, contact.pairs[:, 1])
    still = held[d * master[:, None] + np.arange(d)].all(axis=1) & contact.plain
    rows = contact.matrix(n_dofs // d)
    axis = np.abs(contact.normals).argmax(axis=1)
    along = np.abs(contact.normals).max(axis=1) > 1 - NONE
    nodes, count = np.unique(contact.pairs[:, 0], return_counts=True)
    for node in nodes[count > 1]:
        mine = np.flatnonzero(contact.pairs[:, 0] == node)
        same = still[mine].all() or np.abs(rows[mine] - rows[mine[[0] * len(mine)]]).max() < 1e-9
        if same and along[mine].all() and len(np.unique(axis[mine])) == len(mine):
            left_out[mine] = True
            left_out[mine, axis[mine]] = False
    return left_out


def _interpolated(
    rows: sp.csr_array,
    place: IntArray,
    slave: IntArray,
    normals: FloatArray,
    left_out: BoolArray,
    Bv: sp.csr_array,
    Bw: sp.csr_array,
    B0: sp.csr_array,
    free: BoolArray,
) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
    """Solve ``rows U = w[place]`` for as many of v; sets the components that stay free."""
    d = normals.shape[1]
    G = _cleaned(rows @ Bv)
    lead = _leading(Bv, Bw, B0, slave)
    held = lead.reshape(-1, d) < 0
    # a normal that is held needs the master to move; on a plane of symmetry that of facets is only nearly free
    on_normal = (held & (np.abs(normals) > HELD)).any(axis=1, keepdims=True)
    master_held: BoolArray = np.reshape(np.diff(_cleaned(rows @ B0).indptr), (-1, d)) > 1
    empty: BoolArray = np.reshape(np.diff(G.indptr), (-1, d)) == 0
    wanted = np.asarray(~(held & (empty | (master_held & ~on_normal))) & ~left_out).ravel()
    pivot, wanted = _pivots(G, lead, wanted)
    chosen = np.flatnonzero(wanted)
    free.reshape(-1)[place[chosen]] = True
    G, pivot = G[chosen], pivot[chosen]
    rest = np.setdiff1d(np.arange(Bv.shape[1]), pivot)
    own = sp.csr_array(
        (np.ones(len(chosen)), (np.arange(len(chosen)), place[chosen])), shape=(len(chosen), Bw.shape[1])
    )
    inverse = _inverse(sp.csr_array(G[:, pivot]), slave[chosen] // d)
    by_w, by_v, by_0 = (
        _cleaned(inverse @ each) for each in (own - rows[chosen] @ Bw, -G[:, rest], -(rows[chosen] @ B0))
    )
    of_pivot = Bv[:, pivot]
    return (
        _cleaned(Bv[:, rest] + of_pivot @ by_v),
        _cleaned(Bw + of_pivot @ by_w),
        _cleaned(B0 + of_pivot @ by_0),
    )


def _cleaned(matrix: sp.csr_array) -> sp.csr_array:
    """Drop entries that are round-off."""
    found = sp.csr_array(matrix)
    found.data[np.abs(found.data) < NONE] = 0.0
    found.eliminate_zeros()
    return found


def _leading(Bv: sp.csr_array, Bw: sp.csr_array, B0: sp.csr_array, dofs: IntArray) -> IntArray:
    """Give the entry of v that is the displacement of each unknown, -1 where it depends on anything else."""
    single = (np.diff(Bv.indptr) == 1) & (np.diff(Bw.indptr) == 0) & (np.diff(B0.indptr) == 0)
    found = np.full(len(dofs), -1, np.int64)
    mine = single[dofs]
    found[mine] = Bv.indices[Bv.indptr[dofs[mine]]]
    return found


def _pivots(G: sp.csr_array, lead: IntArray, wanted: BoolArray) -> tuple[IntArray, BoolArray]:
    """Choose one entry of v for each row: the slave's, or where it is held or taken the largest of the master."""
    pivot = np.full(len(lead), -1, np.int64)
    able = np.flatnonzero(wanted & (lead >= 0))
    first = able[np.unique(lead[able], return_index=True)[1]]
    pivot[first] = lead[first]
    owner = np.full(G.shape[1], -1, np.int64)
    owner[pivot[first]] = first
    wanted = wanted.copy()
    for i in np.flatnonzero(wanted & (pivot < 0)):
        row = np.zeros(G.shape[1])
        row[G.indices[G.indptr[i] : G.indptr[i + 1]]] = G.data[G.indptr[i] : G.indptr[i + 1]]
        j = lead[i]
        if j >= 0 and owner[j] >= 0:
            # the same node in front of another facet: what is left once its displacement is known
            k = owner[j]
            columns, values = G.indices[G.indptr[k] : G.indptr[k + 1]], G.data[G.indptr[k] : G.indptr[k + 1]]
            row[columns] -= row[j] / values[columns == j][0] * values
        row[owner >= 0] = 0.0
        best = int(np.abs(row).argmax())
        if abs(row[best]) < 1e-6:
            # the same point twice, or nothing that can still move
            wanted[i] = False
            continue
        pivot[i], owner[best] = best, i
    return pivot, wanted


def _inverse(A: sp.csr_array, nodes: IntArray) -> sp.csr_array:
    """Invert a sparse matrix that is diagonal but for few rows."""
    diagonal = A.diagonal()
    rest = _cleaned(A - sp.diags_array(diagonal))
    if rest.nnz == 0:
        return sp.csr_array(sp.diags_array(1 / diagonal))
    if (np.abs(diagonal) > NONE).all():
        # triangular after a permutation: the series ends
        D = sp.csr_array(sp.diags_array(1 / diagonal))
        term = inverse = D
        for _ in range(6):
            term = _cleaned(-D @ rest @ term)
            inverse = inverse + term
            if term.nnz == 0:
                return sp.csr_array(inverse)
    from scipy.sparse.linalg import splu

    try:
        lu = splu(sp.csc_array(A))
    except RuntimeError:
        raise _dependent(nodes) from None
    columns = []
    for start in range(0, A.shape[0], 256):
        unit = np.eye(A.shape[0], min(256, A.shape[0] - start), -start)
        columns.append(_cleaned(sp.csr_array(lu.solve(unit))))
    inverse = sp.csr_array(sp.hstack(columns, format="csr"))
    if not np.isfinite(inverse.data).all() or np.abs(inverse.data).max(initial=0.0) > WORST:
        raise _dependent(nodes)
    return inverse


def _dependent(nodes: IntArray) -> BadValue:
    return BadValue("contact nodes", np.unique(nodes).tolist(), "pairs whose relative displacements are independent")


def tie(
    n_dofs: int, d: int, pairs: IntArray, fixed: IntArray, left_out: BoolArray | None = None
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
    left_out : (n, d) bool, optional
        Components of w that do not count.

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
        Bv, Bw, B0, free = tie(n_dofs + d, d, whole, np.concatenate([fixed, ground]), left_out)
        return Bv[:n_dofs], Bw[:n_dofs], B0[:n_dofs, : len(fixed)], free
    component = np.arange(d)
    slave, master = (d * pairs[:, :1] + component).ravel(), (d * pairs[:, 1:] + component).ravel()
    known = np.zeros(n_dofs, dtype=bool)
    known[fixed] = True
    free = ~(known[slave] & known[master])
    if left_out is not None:
        free &= ~left_out.ravel()
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
