"""Reduction of a symmetric system by equality conditions ``C u = d``: elimination, expansion, reactions, multipliers.

Most conditions fix one unknown; the others (ties, hanging nodes, mean values) are solved for one unknown each. What
remains is symmetric positive definite whenever the conditions stop every zero-energy motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elimination import Elimination


@dataclass(frozen=True, eq=False)
class Reduction:
    """Result of the elimination: ``u = T v + offset`` satisfies every condition for every v.

    Attributes
    ----------
    n : int
        Number of unknowns of the full system.
    free : (n_free,) int64
        Unknowns that remain, increasing; v holds their values.
    fixed : (n_fixed,) int64
        Unknowns whose value the conditions prescribe, increasing.
    tied : (n_tied,) int64
        Unknowns that follow the free ones.
    relation : (n_tied, n_free) csr_array
        ``u[tied] = relation v + offset[tied]``.
    offset : (n,) or (n, k) float64
        u at v = 0; the second form when d holds several columns.
    kept, pivots : (n_kept,) int64
        Independent conditions, and the unknown for which each was solved.
    redundant : (n_redundant,) int64
        Conditions that follow from the kept ones; they have been dropped.
    conditions : (m, n) csr_array
        The matrix C as given.
    """

    n: int
    free: IntArray
    fixed: IntArray
    tied: IntArray
    relation: sp.csr_array
    offset: FloatArray
    kept: IntArray
    pivots: IntArray
    redundant: IntArray
    conditions: sp.csr_array

    def matrix(self, K: sp.sparray) -> sp.csr_array:
        """Reduce the matrix, ``T^T K T``.

        Parameters
        ----------
        K : (n, n) sparse, symmetric

        Returns
        -------
        (n_free, n_free) csr_array, symmetric

        Cost
        ----
        A selection of rows and columns; the products touch tied unknowns only. A condition that ties one unknown to
        s others fills an s x s block.
        """
        K = sp.csr_array(K)
        rows = K[self.free]
        reduced = rows[:, self.free]
        if len(self.tied):
            A = self.relation
            cross = rows[:, self.tied] @ A
            reduced = reduced + cross + cross.T + A.T @ (K[self.tied][:, self.tied] @ A)
        return sp.csr_array(reduced)

    def whole_matrix(self, K: sp.sparray, block: int) -> sp.bsr_array:
        """Reduce the matrix without changing its size: the rows and columns of the unknowns eliminated are empty.

        Parameters
        ----------
        K : (n, n) sparse, symmetric
        block : int
            Unknowns per node.

        Returns
        -------
        (n, n) bsr_array, symmetric, blocks of (block, block)
            ``T^T K T`` on the free unknowns, the diagonal of K on the others. Solve it with the reduced right-hand
            side at the free unknowns and zero elsewhere: the values at the free unknowns are v.

        Notes
        -----
        Multigrid methods aggregate nodes; taking single unknowns out of the matrix breaks the blocks of the nodes and
        makes them ten times slower.
        """
        K = sp.csr_array(K)
        diagonal = K.diagonal()
        eliminated = np.ones(self.n, bool)
        eliminated[self.free] = False
        if len(self.tied):
            entries = self.relation.tocoo()
            rows = np.r_[self.free, self.tied[entries.row]]
            columns = np.r_[self.free, self.free[entries.col]]
            T = sp.csr_array((np.r_[np.ones(len(self.free)), entries.data], (rows, columns)), shape=K.shape)
            K = sp.csr_array(T.T @ K @ T)
        # Entries of the diagonal that the products may have left out come back as zeros.
        B = (K if not len(self.tied) else K + sp.diags_array(eliminated * 1.0)).tobsr(blocksize=(block, block))
        keep = ~eliminated.reshape(-1, block)
        row = np.repeat(np.arange(len(keep)), np.diff(B.indptr))
        data = B.data * (keep[row][:, :, None] & keep[B.indices][:, None, :])
        own = np.flatnonzero(row == B.indices)
        size = np.where(diagonal > 0, diagonal, diagonal.mean()).reshape(-1, block)
        each = np.arange(block)
        data[own[:, None], each, each] += np.where(keep[row[own]], 0.0, size[row[own]])
        return sp.bsr_array((data, B.indices, B.indptr), shape=B.shape)

    def load(self, K: sp.sparray, F: FloatArray) -> FloatArray:
        """Reduce the right-hand side, ``T^T (F - K offset)``.

        Parameters
        ----------
        K : (n, n) sparse, symmetric
        F : (n,) or (n, k) float64

        Returns
        -------
        (n_free,) or (n_free, k) float64
        """
        moved = np.asarray(K @ self.offset)
        if F.ndim != moved.ndim:
            F, moved = (F.reshape(self.n, -1), moved.reshape(self.n, -1))
        rest = F - moved
        return np.asarray(rest[self.free] + self.relation.T @ rest[self.tied], np.float64)

    def expand(self, v: FloatArray) -> FloatArray:
        """Rebuild the full field, ``u = T v + offset``.

        Parameters
        ----------
        v : (n_free,) or (n_free, k) float64

        Returns
        -------
        (n,) or (n, k) float64
        """
        offset = self.offset.reshape(self.n, -1) if v.ndim == 2 else self.offset
        u = np.zeros((self.n, *v.shape[1:])) + offset
        u[self.free] += v
        u[self.tied] += self.relation @ v
        return u

    def reactions(self, K: sp.sparray, u: FloatArray, F: FloatArray) -> FloatArray:
        """Compute the forces that the conditions exert, ``K u = F + r``.

        Parameters
        ----------
        K : (n, n) sparse, symmetric
        u, F : (n,) or (n, k) float64
            One F serves every column of u.

        Returns
        -------
        (n,) or (n, k) float64, the shape of u
            Zero on the unknowns that no condition touches.
        """
        r = np.asarray(K @ u, np.float64) - (F[:, None] if u.ndim > F.ndim else F)
        touched = np.zeros(self.n, bool)
        touched[self.conditions[self.kept].indices] = True
        r[~touched] = 0.0
        return r

    def multipliers(self, r: FloatArray) -> FloatArray:
        """Split reactions between the conditions, ``r = C^T m``.

        Parameters
        ----------
        r : (n,) or (n, k) float64
            From `reactions`.

        Returns
        -------
        (n_conditions,) or (n_conditions, k) float64
            Zero for the redundant conditions.

        Cost
        ----
        Factorises a sparse matrix of size n_kept, diagonal where conditions fix one unknown each.
        """
        from scipy.sparse.linalg import splu

        result = np.zeros((self.conditions.shape[0], *r.shape[1:]))
        if len(self.kept):
            square = sp.csc_array(self.conditions[self.kept][:, self.pivots].T)
            result[self.kept] = splu(square).solve(r[self.pivots])
        return result


def reduce_conditions(C: sp.sparray, d: FloatArray | None = None, *, rtol: float = 1e-10) -> Reduction:
    """Eliminate equality conditions.

    Parameters
    ----------
    C : (m, n) sparse
        One condition per row.
    d : (m,) or (m, k) float64, optional
        Prescribed values, zero by default; k columns for k load cases.
    rtol : float
        Conditions disagree when they differ by more than rtol times the largest prescribed value.

    Returns
    -------
    Reduction

    Raises
    ------
    ContradictoryConditions
        With the rows that disagree.

    Notes
    -----
    1. A row with one unknown fixes it; its value goes into the other rows; repeated, since these may shrink to one
       unknown or to none (then redundant or contradictory).
    2. A row with an unknown found in no other row is solved for it; repeated on the rows left.
    3. The rest splits into groups that share unknowns; each is solved by a rank-revealing QR factorisation.

    Source
    ------
    Golub and Van Loan, Matrix Computations, chapter 5 (QR with column pivoting).

    Cost
    ----
    Proportional to the entries of C in steps 1 and 2; step 3 is dense in each group.
    """
    C = sp.csr_array(C, copy=True).astype(np.float64)
    C.sum_duplicates()
    m, n = C.shape
    values = np.zeros(m) if d is None else np.asarray(d, np.float64)
    work = Elimination(C, values if values.ndim == 2 else values[:, None], rtol)
    work.fix_single_unknowns()
    fixed = np.flatnonzero(work.fixed_by >= 0)
    work.solve_private_unknowns()
    work.solve_groups()
    kept, pivots = work.solved()
    tied = pivots[len(fixed) :]
    is_free = np.ones(n, bool)
    is_free[pivots] = False
    free = np.flatnonzero(is_free)
    relation, constant = work.resolve(tied, free)
    offset = work.values
    offset[tied] = constant
    return Reduction(
        n=n,
        free=free,
        fixed=fixed,
        tied=tied,
        relation=relation,
        offset=offset[:, 0] if values.ndim == 1 else offset,
        kept=kept,
        pivots=pivots,
        redundant=np.sort(work.dropped()),
        conditions=C,
    )
