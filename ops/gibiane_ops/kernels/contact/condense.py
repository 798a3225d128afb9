"""Condense an elastic problem on its contact pairs, with one factorisation of the tied bodies.

Change of variables: ``u1 = v + w`` and ``u2 = v`` on a pair. Holding w = 0 ties the bodies, so the matrix of v is that
of the tied bodies, positive definite as soon as one of them is held. Eliminating v leaves ``S w = f + r``. A stop
``c . u <= value`` is one more pair, of which only the normal counts: ``w_n = c . u``, and its gap is the value.
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
from gibiane_ops.kernels.contact.ties import tie_contact
from gibiane_ops.kernels.errors import SingularSystem, TooLarge
from gibiane_ops.kernels.solve import Factor, factorize

BoolArray = NDArray[np.bool_]

MEMORY_LIMIT = 4e9
"""Bytes that the dense interface may take when the caller sets no limit."""

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
    n_stops: int
    _shortening: FloatArray
    _K: sp.csr_array
    _Kvw: sp.csr_array
    _fields: _Fields
    _reduction: Reduction

    def interface(
        self,
        F: FloatArray,
        offset: FloatArray | None = None,
        stop_values: FloatArray | None = None,
        gap: FloatArray | None = None,
    ) -> Interface:
        """Condense a load and prescribed displacements on the pairs.

        Parameters
        ----------
        F : (n_dofs,) float64, force
        offset : (n_dofs,) float64, optional
            ``Reduction.offset`` of the same conditions with other prescribed values; those given to ``condense`` when
            left out.
        stop_values : (n_stops,) float64, optional
            Largest values of the stops, zero when left out.
        gap : (n_pairs,) float64, length, optional
            Initial gaps, those of the pairs when left out.

        Returns
        -------
        Interface
            The pairs, then the stops.

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
        relative = self.contact.matrix(len(U0) // d) @ U0.reshape(-1, d)
        start = self.contact.gap if gap is None else gap
        start = (start - (relative * self.contact.normals).sum(axis=1)) / self._shortening
        stops = np.zeros(self.n_stops) if stop_values is None else stop_values

        def expand(w: FloatArray) -> FloatArray:
            flat = np.ravel(w)
            x = x0 - self.factor.solve(self._Kvw @ flat)
            return np.asarray(fields.Bv @ x + fields.Bw @ flat + U0)

        return Interface(
            self.S, f, np.concatenate([start, stops]), self.frames, self.active, self.rigid, self.kref, expand
        )


def condense(
    K: sp.csr_array,
    contact: ContactPairs,
    reduction: Reduction,
    *,
    stops: sp.csr_array | None = None,
    method: str = "auto",
    memory_limit: float = MEMORY_LIMIT,
) -> Condensation:
    """Factorise the tied bodies and compute the Schur complement on the contact pairs.

    Parameters
    ----------
    K : (n_dofs, n_dofs) CSR, symmetric
        Stiffness of all bodies, not constrained; component c of node i is unknown ``d i + c``.
    contact : ContactPairs
        Pairs of all zones.
    reduction : Reduction
        Conditions other than contact, from ``reduce_conditions`` with one column of prescribed values.
    stops : (n_stops, n_dofs) CSR, optional
        Unilateral conditions ``stops @ u <= value``, independent of each other and of the conditions of ``reduction``.
    method : str
        Package, see ``factorize``.
    memory_limit : float
        Bytes that the dense interface may take.

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
        When a linear relation holds a relative displacement alone, other than component by component, or a stop acts
        on what the conditions or another stop already hold.
    TooLarge
        When the dense interface would take more than ``memory_limit``.

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
    n_stops = 0 if stops is None else stops.shape[0]
    needed = interface_memory(len(contact.pairs) + n_stops, d)
    if needed > memory_limit:
        raise TooLarge(f"the dense interface of {len(contact.pairs) + n_stops} pairs", needed, memory_limit)
    Bv, Bw, B0, free = tie_contact(n_dofs, d, contact, reduction.fixed)
    frames, active, shortening = local_frames(contact.normals, free)
    Bw = sp.csr_array(Bw @ _to_global(frames, active))
    if stops is not None and n_stops:
        Bw = sp.hstack([Bw, sp.csr_array((n_dofs, n_stops * d))], format="csr")
        frames = np.concatenate([frames, np.broadcast_to(np.eye(d), (n_stops, d, d))])
        active = np.concatenate([active, np.broadcast_to(np.arange(d) == 0, (n_stops, d))])
    fields = _Fields.of(Bv, Bw, B0, reduction, stops, d)
    KBw = K @ fields.Bw
    Kvw = sp.csr_array(fields.Bv.T @ KBw)
    try:
        factor = factorize(fields.Bv.T @ K @ fields.Bv, method=method)
    except SingularSystem as error:
        moving = np.unique(fields.Bv[:, error.unknowns].nonzero()[0])
        raise SingularSystem(f"tied bodies: {error.message}", np.unique(moving // d), moving) from error
    S = _schur(factor, Kvw, (fields.Bw.T @ KBw).toarray(), np.flatnonzero(active.ravel()))
    kref = _natural_stiffness(K, S, active)
    inactive = np.flatnonzero(~active.ravel())
    S[inactive, inactive] = kref
    candidates = np.eye(len(S))[:, active.ravel()] if n_stops else _rigid_candidates(contact, frames, active)
    values, vectors = np.linalg.eigh(candidates.T @ S @ candidates)
    rigid = np.asarray(candidates @ vectors[:, values < FREE_LIMIT * kref])
    return Condensation(
        contact, factor, S, kref, frames, active, rigid, n_stops, shortening, K, Kvw, fields, reduction
    )  # fmt: skip


def _natural_stiffness(K: sp.csr_array, S: FloatArray, active: BoolArray) -> float:
    """Average the active diagonal of S, or that of K when every relative motion is rigid."""
    if not active.any():
        return 1.0
    mean, elastic = float(np.diag(S)[active.ravel()].mean()), float(K.diagonal().mean())
    return mean if mean > FREE_LIMIT * elastic else elastic


def interface_memory(n_pairs: int, dim: int) -> float:
    """Predict the memory of the dense interface: S, its scaled copies and the matrix of a Newton step.

    Parameters
    ----------
    n_pairs, dim : int

    Returns
    -------
    float
        Bytes.
    """
    return 5 * 8.0 * (n_pairs * dim) ** 2


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
    def of(
        Bv: sp.csr_array, Bw: sp.csr_array, B0: sp.csr_array, reduction: Reduction, stops: sp.csr_array | None, d: int
    ) -> _Fields:
        """Add the linear relations, ``u[tied] = relation u[free] + offset[tied]``, as conditions on v given w.

        A stop adds ``c . u = w_n``, w_n being the first component of its pair, and the pairs of stops are the last.
        """
        n_dofs, tied = reduction.n, reduction.tied
        select = sp.eye_array(n_dofs, format="csr")
        relations = sp.csr_array(select[tied] - reduction.relation @ select[reduction.free])
        unit = sp.csr_array((len(tied), Bw.shape[1]))
        if stops is not None and stops.shape[0]:
            n_stops = stops.shape[0]
            own = sp.csr_array(
                (np.ones(n_stops), (np.arange(n_stops), Bw.shape[1] - d * np.arange(n_stops, 0, -1))),
                (n_stops, Bw.shape[1]),
            )
            relations, unit = sp.vstack([relations, stops], format="csr"), sp.vstack([unit, own], format="csr")
        if not relations.shape[0]:
            return _Fields(Bv, Bw, B0, reduction.fixed, tied, relations, Bv)
        right = sp.csc_array(unit - relations @ Bw)
        touched = np.flatnonzero(np.diff(right.indptr))
        if not len(touched):
            touched = np.zeros(1, np.int64)  # relations away from contact: one column of zeros
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
        if self.relations.shape[0]:
            values = np.zeros(self.relations.shape[0])
            values[: len(self.tied)] = offset[self.tied]
            rest = values - self.relations @ U0
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
    if not n:
        return sp.csr_array((0, 0))
    blocks = np.where(active[:, None, :], np.swapaxes(frames, 1, 2), 0.0)
    return sp.bsr_array((blocks, np.arange(n), np.arange(n + 1)), shape=(n * d, n * d)).tocsr()


def _rigid_candidates(contact: ContactPairs, frames: FloatArray, active: BoolArray) -> FloatArray:
    """Span the relative rigid motions of each zone that blocked components allow, by an orthonormal basis."""
    points = contact.on_pairs(contact.points)
    modes = [
        np.einsum("nij,njk->nik", frames, _rigid_modes(points, contact.zone == zone)).reshape(active.size, -1)
        for zone in np.unique(contact.zone)
    ]
    candidates = _orthonormal(np.hstack(modes))
    # keep the combinations that leave blocked components at rest
    blocked = candidates[~active.ravel()]
    if len(blocked):
        _, values, Vt = np.linalg.svd(blocked, full_matrices=True)
        at_rest = np.r_[values, np.zeros(len(Vt) - len(values))] <= FREE_LIMIT
        candidates = _orthonormal(candidates @ Vt[at_rest].T)
    return candidates


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
