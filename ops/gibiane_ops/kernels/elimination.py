"""Elimination of linear conditions one unknown each: the working part of `constraints`."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import ContradictoryConditions

# A coefficient below this share of the largest of its row is round-off, e.g. cos(90 degrees).
NEGLIGIBLE = 1e-12
# An unknown is solved for only if its coefficient is at least this share of the largest: it bounds error growth.
PIVOT = 0.1


def _with_data(R: sp.csr_array, data: FloatArray) -> sp.csr_array:
    """Return a matrix of the same pattern, zeros removed."""
    result = sp.csr_array((data, R.indices.copy(), R.indptr.copy()), shape=R.shape)
    result.eliminate_zeros()
    return result


class Elimination:
    """Working state of `constraints.reduce_conditions`; its three steps are methods, called once each, in order.

    Parameters
    ----------
    C : (m, n) csr_array
        Conditions, without duplicate entries.
    d : (m, k) float64
        Prescribed values.
    rtol : float
        Conditions disagree when they differ by more than rtol times the largest prescribed value.

    Attributes
    ----------
    values : (n, k) float64
        Values of the fixed unknowns, zero elsewhere.
    fixed_by : (n,) int64
        Condition that fixed each unknown, -1 for the others.
    R, rhs, rows
        Conditions still open: matrix, right-hand side, ids.
    """

    def __init__(self, C: sp.csr_array, d: FloatArray, rtol: float) -> None:
        m, self.n = C.shape
        self.C = C
        scale = np.ones(m)
        filled = np.flatnonzero(np.diff(C.indptr))
        if len(filled):
            scale[filled] = np.maximum.reduceat(np.abs(C.data), C.indptr[filled])
        scale[scale == 0] = 1.0
        data = C.data / np.repeat(scale, np.diff(C.indptr))
        self.R = _with_data(C, np.where(np.abs(data) < NEGLIGIBLE, 0.0, data))
        self.rhs = d / scale[:, None]
        self.rows = np.arange(m)
        self.tolerance = rtol * float(np.abs(self.rhs).max(initial=0.0))
        self.values = np.zeros((self.n, d.shape[1]))
        self.fixed_by = np.full(self.n, -1)
        self._redundant: list[IntArray] = []
        self._kept: list[IntArray] = []
        self._pivots: list[IntArray] = []
        # Solved relations u[slave] = coefficients . u + constant, block by block.
        self._coefficients: list[sp.csr_array] = []
        self._constants: list[FloatArray] = []

    def solved(self) -> tuple[IntArray, IntArray]:
        """Return the independent conditions and the unknown each was solved for, in the order of the elimination."""
        none = np.zeros(0, np.int64)
        return np.concatenate([none, *self._kept]), np.concatenate([none, *self._pivots])

    def dropped(self) -> IntArray:
        """Return the conditions that follow from the others."""
        return np.concatenate([np.zeros(0, np.int64), *self._redundant])

    def _keep_open(self, open_rows: IntArray) -> None:
        self.R, self.rhs, self.rows = self.R[open_rows], self.rhs[open_rows], self.rows[open_rows]

    def _contradiction(self, rows: IntArray, residual: float) -> ContradictoryConditions:
        """Build the error, adding the conditions that fixed unknowns of the given ones."""
        found = dict.fromkeys(int(row) for row in rows)
        queue = list(found)
        while queue:
            row = queue.pop()
            unknowns = self.C.indices[self.C.indptr[row] : self.C.indptr[row + 1]]
            fresh = [int(by) for by in self.fixed_by[unknowns] if by >= 0 and int(by) not in found]
            found.update(dict.fromkeys(fresh))
            queue.extend(fresh)
        return ContradictoryConditions(np.sort(np.array(list(found), np.int64)), residual)

    def fix_single_unknowns(self) -> None:
        """Fix the unknowns that stand alone in a condition and put their values into the others, until none is left."""
        while True:
            count = np.diff(self.R.indptr)
            self._drop_empty(np.flatnonzero(count == 0))
            single = np.flatnonzero(count == 1)
            if len(single) == 0:
                self._keep_open(np.flatnonzero(count > 0))
                return
            place = self.R.indptr[single]
            unknown = self.R.indices[place]
            value = self.rhs[single] / self.R.data[place][:, None]
            _, first, group = np.unique(unknown, return_index=True, return_inverse=True)
            gap = np.abs(value - value[first][group]).max(axis=1)
            if gap.max() > self.tolerance:
                worst = int(np.argmax(gap))
                rows = self.rows[single[[first[group[worst]], worst]]]
                raise self._contradiction(rows, float(gap[worst]))
            again = np.ones(len(single), bool)
            again[first] = False
            self._redundant.append(self.rows[single[again]])
            self._kept.append(self.rows[single[first]])
            self._pivots.append(unknown[first].astype(np.int64))
            self.values[unknown[first]] = value[first]
            self.fixed_by[unknown[first]] = self.rows[single[first]]
            self._keep_open(np.flatnonzero(count > 1))
            is_known = self.fixed_by[self.R.indices] >= 0
            self.rhs = self.rhs - _with_data(self.R, np.where(is_known, self.R.data, 0.0)) @ self.values
            self.R = _with_data(self.R, np.where(is_known, 0.0, self.R.data))

    def _drop_empty(self, empty: IntArray) -> None:
        residual = np.abs(self.rhs[empty]).max(axis=1, initial=0.0)
        if residual.max(initial=0.0) > self.tolerance:
            worst = int(np.argmax(residual))
            raise self._contradiction(self.rows[empty[[worst]]], float(residual[worst]))
        self._redundant.append(self.rows[empty])

    def solve_private_unknowns(self) -> None:
        """Solve each condition for an unknown that no other open condition holds, until none has one."""
        while self.R.shape[0]:
            row = np.repeat(np.arange(self.R.shape[0]), np.diff(self.R.indptr))
            size = np.abs(self.R.data)
            largest = np.maximum.reduceat(size, self.R.indptr[:-1])
            private = np.bincount(self.R.indices, minlength=self.n)[self.R.indices] == 1
            entries = np.flatnonzero(private & (size >= PIVOT * largest[row]))
            if len(entries) == 0:
                return
            entries = entries[np.lexsort((-size[entries], row[entries]))]
            solved, first = np.unique(row[entries], return_index=True)
            pivot = entries[first]
            divisor = self.R.data[pivot]
            data = self.R.data.copy()
            data[pivot] = 0.0
            others = _with_data(self.R, data)[solved]
            self._coefficients.append(sp.csr_array(sp.diags_array(-1.0 / divisor) @ others))
            self._constants.append(self.rhs[solved] / divisor[:, None])
            self._kept.append(self.rows[solved])
            self._pivots.append(self.R.indices[pivot].astype(np.int64))
            self._keep_open(np.setdiff1d(np.arange(self.R.shape[0]), solved))

    def solve_groups(self) -> None:
        """Solve the conditions left, group by group of those that share unknowns."""
        from scipy.sparse.csgraph import connected_components

        n_rows = self.R.shape[0]
        if n_rows == 0:
            return
        # Conditions and unknowns are the two sides of one graph.
        row = np.repeat(np.arange(n_rows), np.diff(self.R.indptr))
        links = (np.ones(len(row)), (row, self.R.indices + n_rows))
        _, label = connected_components(sp.csr_array(links, shape=(n_rows + self.n,) * 2), directed=False)
        _, label = np.unique(label[:n_rows], return_inverse=True)
        order = np.argsort(label, kind="stable")
        for rows in np.split(order, np.cumsum(np.bincount(label))[:-1]):
            self._solve_group(rows)

    def _solve_group(self, rows: IntArray) -> None:
        """Find the independent rows, check the others against them, and solve for the best conditioned unknowns."""
        from scipy.linalg import qr, solve_triangular

        part = self.R[rows]
        unknowns, column = np.unique(part.indices, return_inverse=True)
        A = np.zeros((len(rows), len(unknowns)))
        A[np.repeat(np.arange(len(rows)), np.diff(part.indptr)), column] = part.data
        _, upper, order = qr(A.T, mode="economic", pivoting=True)
        diagonal = np.abs(np.diag(upper))
        rank = int((diagonal > 1e-10 * diagonal[0]).sum())
        independent, dependent = rows[order[:rank]], rows[order[rank:]]
        weights = solve_triangular(upper[:rank, :rank], upper[:rank, rank:])
        residual = np.abs(self.rhs[dependent] - weights.T @ self.rhs[independent]).max(axis=1, initial=0.0)
        if residual.max(initial=0.0) > self.tolerance:
            worst = int(np.argmax(residual))
            involved = independent[np.abs(weights[:, worst]) > 1e-8]
            raise self._contradiction(self.rows[np.r_[involved, dependent[worst]]], float(residual[worst]))
        self._redundant.append(self.rows[dependent])
        Q, upper, order = qr(A[order[:rank]], mode="economic", pivoting=True)
        solved, others = unknowns[order[:rank]], unknowns[order[rank:]]
        block = solve_triangular(upper[:, :rank], np.hstack([-upper[:, rank:], Q.T @ self.rhs[independent]]))
        dense = sp.coo_array(block[:, : len(others)])
        place = (dense.row, others[dense.col])
        self._coefficients.append(sp.csr_array((dense.data, place), shape=(rank, self.n)))
        self._constants.append(block[:, len(others) :])
        self._kept.append(self.rows[independent])
        self._pivots.append(solved.astype(np.int64))

    def resolve(self, tied: IntArray, free: IntArray) -> tuple[sp.csr_array, FloatArray]:
        """Express the tied unknowns by the free ones only.

        Notes
        -----
        ``u_t = N u_t + A u_f + b`` where N is nilpotent, since an unknown solved in one pass is used by rows of
        earlier passes only. Hence ``u_t = (I + N)(I + N^2)(I + N^4) ... (A u_f + b)``.
        """
        if len(tied) == 0:
            return sp.csr_array((0, len(free))), np.zeros((0, self.values.shape[1]))
        every = sp.csc_array(sp.vstack(self._coefficients))
        relation, constant = sp.csr_array(every[:, free]), np.concatenate(self._constants)
        N = sp.csr_array(every[:, tied])
        while N.nnz:
            relation, constant = relation + N @ relation, constant + N @ constant
            N = sp.csr_array(N @ N)
        return relation, constant
