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
from gibiane_ops.kernels.constraints import Reduction, reduce_conditions
from gibiane_ops.kernels.contact.frames import local_frames
from gibiane_ops.kernels.contact.interface import FREE_LIMIT, Interface
from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.kernels.contact.ties import tie
from gibiane_ops.kernels.errors import SingularSystem
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
    _Kvw: sp.csr_array
    _fields: _Fields
    _reduction: Reduction

    def interface(self, F: FloatArray, offset: FloatArray | None = None) -> Interface:
        """Condense a load and prescribed displacements on the pairs.

        Parameters
        ----------
        F : (n_dofs,) float64, force
        offset : (n_dofs,) float64, optional
            ``Reduction.offset`` of the same conditions with other prescribed values; those given to ``condense`` when
            left out.

        Returns
        -------
        Interface

        Cost
        ----
        One solution with the tied matrix.
        """
        fields = self._fields
        U0 = fields.constant(self._reduction.offset if offset is None else offset)
        F0 = F - self._K @ U0
        x0 = self.factor.solve(fields.Bv.T @ F0)
        f = np.asarray(fields.Bw.T @ F0 - self._Kvw.T @ x0)
        # prescribed displacements of both nodes of a pair: part of the gap is already used up
        d = self.active.shape[1]
        slave, master = self.contact.pairs.T
        imposed = (U0.reshape(-1, d)[slave] - U0.reshape(-1, d)[master]) * self.contact.normals
        gap = (self.contact.gap - imposed.sum(axis=1)) / self._shortening

        def expand(w: FloatArray) -> FloatArray:
            flat = np.ravel(w)
            x = x0 - self.factor.solve(self._Kvw @ flat)
            return np.asarray(fields.Bv @ x + fields.Bw @ flat + U0)

        return Interface(self.S, f, gap, self.frames, self.active, self.rigid, self.kref, expand)


def condense(K: sp.csr_array, contact: ContactPairs, reduction: Reduction, *, method: str = "auto") -> Condensation:
    """Factorise the tied bodies and compute the Schur complement on the contact pairs.

    Parameters
    ----------
    K : (n_dofs, n_dofs) CSR, symmetric
        Stiffness of all bodies, not constrained; component c of node i is unknown ``d i + c``.
    contact : ContactPairs
        Pairs of all zones.
    reduction : Reduction
        Conditions other than contact, from ``reduce_conditions`` with one column of prescribed values.
    method : str
        Package, see ``factorize``.

    Returns
    -------
    Condensation

    Raises
    ------
    SingularSystem
        When the tied bodies are not held; ``nodes`` says which part moves.
    BadValue
        When pairs close a loop, so that their relative displacements are not independent.
    ContradictoryConditions
        When a linear relation holds a relative displacement alone, other than component by component.

    Notes
    -----
    ``S = Kww - Kwv Kvv^-1 Kvw``. A pair component prescribed on both sides is dropped; prescribed on one side only, it
    stays and the other side moves. Whatever the side, the force that does work on w is that on body 1.

    Cost
    ----
    One factorisation, one back substitution per active component of w, (n d)^2 numbers of memory.
    """
    d = contact.normals.shape[1]
    n_dofs = K.shape[0]
    Bv, Bw, B0, free = tie(n_dofs, d, contact.pairs, reduction.fixed)
    frames, active, shortening = local_frames(contact.normals, free)
    fields = _Fields.of(Bv, sp.csr_array(Bw @ _to_global(frames, active)), B0, reduction)
    KBw = K @ fields.Bw
    Kvw = sp.csr_array(fields.Bv.T @ KBw)
    try:
        factor = factorize(fields.Bv.T @ K @ fields.Bv, method=method)
    except SingularSystem as error:
        moving = np.unique(fields.Bv[:, error.unknowns].nonzero()[0])
        raise SingularSystem(f"tied bodies: {error.message}", np.unique(moving // d), moving) from error
    S = _schur(factor, Kvw, (fields.Bw.T @ KBw).toarray(), np.flatnonzero(active.ravel()))
    kref = float(np.diag(S)[active.ravel()].mean()) if active.any() else 1.0
    inactive = np.flatnonzero(~active.ravel())
    S[inactive, inactive] = kref
    rigid = _free_motions(S, contact, frames, active, kref)
    return Condensation(contact, factor, S, kref, frames, active, rigid, shortening, K, Kvw, fields, reduction)


@dataclass(frozen=True, eq=False)
class _Fields:
    """Every admissible displacement, ``U = Bv x + Bw w + constant``, w in local components."""

    Bv: sp.csr_array
    Bw: sp.csr_array
    B0: sp.csr_array
    fixed: IntArray
    tied: IntArray
    relations: sp.csr_array
    tie_matrix: sp.csr_array

    @staticmethod
    def of(Bv: sp.csr_array, Bw: sp.csr_array, B0: sp.csr_array, reduction: Reduction) -> _Fields:
        """Add the linear relations, ``u[tied] = relation u[free] + offset[tied]``, as conditions on v given w."""
        n_dofs, tied = reduction.n, reduction.tied
        select = sp.eye_array(n_dofs, format="csr")
        relations = sp.csr_array(select[tied] - reduction.relation @ select[reduction.free])
        if not len(tied):
            return _Fields(Bv, Bw, B0, reduction.fixed, tied, relations, Bv)
        right = sp.csc_array(-(relations @ Bw))
        touched = np.flatnonzero(np.diff(right.indptr))
        second = reduce_conditions(relations @ Bv, right[:, touched].toarray())
        chosen = sp.eye_array(Bv.shape[1], format="csr")
        T = chosen[:, second.free] + chosen[:, second.tied] @ second.relation
        follow = sp.csr_array(second.offset) @ sp.eye_array(Bw.shape[1], format="csr")[touched]
        return _Fields(
            sp.csr_array(Bv @ T), sp.csr_array(Bw + Bv @ follow), B0, reduction.fixed, tied, relations, Bv
        )  # fmt: skip

    def constant(self, offset: FloatArray) -> FloatArray:
        """Compute the displacement at x = 0 and w = 0."""
        U0 = np.asarray(self.B0 @ offset[self.fixed])
        if len(self.tied):
            rest = offset[self.tied] - self.relations @ U0
            U0 = U0 + self.tie_matrix @ reduce_conditions(self.relations @ self.tie_matrix, rest).offset
        return U0


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
