"""Condense an elastic problem on its contact pairs, with one factorisation of the tied bodies.

Change of variables: ``u1 = v + w`` and ``u2 = v`` on a pair. Holding w = 0 ties the bodies, so the matrix of v is that
of the tied bodies, positive definite as soon as one of them is held. Eliminating v leaves ``S w = f + r``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.frames import local_frames
from gibiane_ops.kernels.contact.interface import FREE_LIMIT, Interface
from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.solve import Factor, factorize

BoolArray = NDArray[np.bool_]

BLOCK = 64
"""Right-hand sides solved together: enough for the dense kernels, few enough to keep the memory low."""


@dataclass(frozen=True, eq=False)
class Condensation:
    """Tied matrix, its factor and the Schur complement on the pairs: whatever does not depend on the load.

    Attributes
    ----------
    contact : ContactPairs
    factor : Factor
        Of the tied matrix.
    S : (n d, n d) float64
        See ``Interface``.
    """

    contact: ContactPairs
    factor: Factor
    S: FloatArray
    kref: float
    frames: FloatArray
    active: BoolArray
    rigid: FloatArray
    _shortening: FloatArray
    _K: sp.csr_array
    _Bv: sp.csr_array
    _Bw: sp.csr_array
    _B0: sp.csr_array
    _Kvw: sp.csr_array
    _fixed: IntArray

    def interface(self, F: FloatArray, values: FloatArray | None = None) -> Interface:
        """Condense a load and prescribed displacements on the pairs.

        Parameters
        ----------
        F : (n_dofs,) float64, force
        values : (n_fixed,) float64, optional
            Prescribed displacements, in the order of ``fixed`` given to ``condense``; zero when left out.

        Returns
        -------
        Interface

        Cost
        ----
        One solution with the tied matrix.
        """
        values = np.zeros(len(self._fixed)) if values is None else np.asarray(values, dtype=np.float64)
        U0 = self._B0 @ values
        F0 = F - self._K @ U0
        x0 = self.factor.solve(self._Bv.T @ F0)
        f = self._Bw.T @ F0 - self._Kvw.T @ x0
        slave, master = self.contact.pairs.T
        d = self.active.shape[1]
        # prescribed displacements of both nodes of a pair: part of the gap is already used up
        offset = (U0.reshape(-1, d)[slave] - U0.reshape(-1, d)[master]) * self.contact.normals
        gap = (self.contact.gap - offset.sum(axis=1)) / self._shortening

        def expand(w: FloatArray) -> FloatArray:
            flat = np.ravel(w)
            x = x0 - self.factor.solve(self._Kvw @ flat)
            return np.asarray(self._Bv @ x + self._Bw @ flat + U0)

        return Interface(self.S, np.asarray(f), gap, self.frames, self.active, self.rigid, self.kref, expand)


def condense(
    K: sp.csr_array, contact: ContactPairs, *, fixed: IntArray | None = None, method: str = "auto"
) -> Condensation:
    """Factorise the tied bodies and compute the Schur complement on the contact pairs.

    Parameters
    ----------
    K : (n_dofs, n_dofs) CSR, symmetric
        Stiffness of all bodies, not constrained; component c of node i is unknown ``d i + c``.
    contact : ContactPairs
        Pairs of all zones.
    fixed : (n_fixed,) int64, optional
        Unknowns whose displacement is prescribed.
    method : str
        Package, see ``factorize``.

    Returns
    -------
    Condensation

    Raises
    ------
    SingularSystem
        When the tied bodies are not held.
    BadValue
        When pairs close a loop, so that their relative displacements are not independent.

    Notes
    -----
    ``S = Kww - Kwv Kvv^-1 Kvw``. A pair component prescribed on both sides is dropped; prescribed on one side only, it
    stays and the other side moves. Whatever the side, the force that does work on w is that on body 1.

    Cost
    ----
    One factorisation, one back substitution per active component of w, (n d)^2 numbers of memory.
    """
    fixed = np.zeros(0, dtype=np.int64) if fixed is None else np.asarray(fixed, dtype=np.int64)
    d = contact.normals.shape[1]
    Bv, Bw, B0, free = _tie(K.shape[0], d, contact.pairs, fixed)
    frames, active, shortening = local_frames(contact.normals, free)
    Bw = (Bw @ _to_global(frames, active)).tocsr()
    KBw = K @ Bw
    Kvw = (Bv.T @ KBw).tocsr()
    factor = factorize(Bv.T @ K @ Bv, method=method)
    S = _schur(factor, Kvw, (Bw.T @ KBw).toarray(), np.flatnonzero(active.ravel()))
    kref = float(np.diag(S)[active.ravel()].mean()) if active.any() else 1.0
    inactive = np.flatnonzero(~active.ravel())
    S[inactive, inactive] = kref
    rigid = _free_motions(S, contact, frames, active, kref)
    return Condensation(contact, factor, S, kref, frames, active, rigid, shortening, K, Bv, Bw, B0, Kvw, fixed)


def _schur(factor: Factor, Kvw: sp.csr_array, S: FloatArray, columns: IntArray) -> FloatArray:
    """Subtract ``Kwv Kvv^-1 Kvw`` by blocks of columns; only the rows that Kvw touches are kept."""
    rows = np.flatnonzero(np.diff(Kvw.indptr))
    touched = Kvw[rows].T.tocsr()
    right = Kvw.tocsc()
    for start in range(0, len(columns), BLOCK):
        block = columns[start : start + BLOCK]
        X = factor.solve(right[:, block].toarray())
        S[:, block] -= touched @ X[rows]
    return (S + S.T) / 2


def _tie(
    n_dofs: int, d: int, pairs: IntArray, fixed: IntArray
) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array, BoolArray]:
    """Write every displacement as ``U = Bv v + Bw w + B0 values``, w in global components.

    Each unknown starts from a prescribed one, or from a master's, and the others of its group follow through their
    pairs; a node may so be slave in one zone and master in another.
    """
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


def _to_global(frames: FloatArray, active: BoolArray) -> sp.csr_array:
    """Give the matrix from active local components to global ones, block diagonal."""
    n, d = active.shape
    blocks = np.where(active[:, None, :], np.swapaxes(frames, 1, 2), 0.0)
    return sp.bsr_array((blocks, np.arange(n), np.arange(n + 1)), shape=(n * d, n * d)).tocsr()


def _free_motions(
    S: FloatArray, contact: ContactPairs, frames: FloatArray, active: BoolArray, kref: float
) -> FloatArray:
    """Find the relative rigid motions without stiffness, zone by zone, as an orthonormal basis."""
    modes = [
        np.einsum("nij,njk->nik", frames, _rigid_modes(contact.points, contact.zone == zone)).reshape(active.size, -1)
        for zone in np.unique(contact.zone)
    ]
    candidates = _orthonormal(np.hstack(modes))
    # keep the combinations that leave blocked components at rest
    blocked = candidates[~active.ravel()]
    if len(blocked):
        _, values, Vt = np.linalg.svd(blocked, full_matrices=True)
        at_rest = np.r_[values, np.zeros(len(Vt) - len(values))] <= FREE_LIMIT
        candidates = _orthonormal(candidates @ Vt[at_rest].T)
    values, vectors = np.linalg.eigh(candidates.T @ S @ candidates)
    return np.asarray(candidates @ vectors[:, values < FREE_LIMIT * kref])


def _rigid_modes(points: FloatArray, member: BoolArray) -> FloatArray:
    """Build the 3 or 6 rigid motions of the members, (n, d, k), in global components and of order 1."""
    n, d = points.shape
    x = points - points[member].mean(axis=0)
    x = x / max(float(np.abs(x[member]).max()), np.finfo(float).tiny)
    planes = [(i, j) for i in range(d) for j in range(i + 1, d)]
    modes = np.zeros((n, d, d + len(planes)))
    modes[:, range(d), range(d)] = 1
    for k, (i, j) in enumerate(planes):
        modes[:, i, d + k] = -x[:, j]
        modes[:, j, d + k] = x[:, i]
    modes[~member] = 0
    return modes


def _orthonormal(columns: FloatArray) -> FloatArray:
    """Give an orthonormal basis of the span; one pair or pairs on a line have fewer motions than six."""
    U, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(U[:, values > FREE_LIMIT * values.max(initial=1.0)])
