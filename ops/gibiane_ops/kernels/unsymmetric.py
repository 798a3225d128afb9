"""Solve sparse systems without symmetry, with conditions whose reactions have directions of their own."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import NotConverged, SingularSystem
from gibiane_ops.kernels.packages import is_installed

RESIDUAL_LIMIT = 1e-9
"""Largest accepted norm of ``A x - b`` over that of ``b``."""
LARGE = 2000
"""Equations from which PARDISO is worth its start."""


class ConditionedFactor:
    """``K u = F + R^T m`` with ``C u = d``, factorised once: u and m for as many F and d as wanted.

    Parameters
    ----------
    K : (n, n) sparse
    C, R : (k, n) sparse
        Independent conditions, and where their multipliers act (C itself in the usual, symmetric case).

    Raises
    ------
    SingularSystem
        When a pivot vanishes.

    Notes
    -----
    One LU factorisation, with pivoting, of the whole system ``[K, -R^T; C, 0]``: the rows of C, scaled to the size of
    K, are indefinite for any method that keeps the diagonal.

    Source
    ------
    SuperLU: J. W. Demmel et al., A supernodal approach to sparse partial pivoting, 1999. PARDISO where it is installed
    and the system is large.
    """

    def __init__(self, K: sp.sparray, C: sp.sparray, R: sp.sparray) -> None:
        self.n, self.k = K.shape[0], C.shape[0]
        self.scale = float(np.abs(K.diagonal()).max(initial=0.0)) or 1.0
        blocks = [[K, -self.scale * R.T], [self.scale * C, None]] if self.k else [[K]]
        self.A = sp.csr_array(sp.block_array(blocks, format="csr"))
        self.package = "pardiso" if self.n > LARGE and is_installed("pardiso") else "superlu"
        self._solve = _pardiso(self.A) if self.package == "pardiso" else _superlu(self.A)

    def solve(self, F: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return u and m.

        Parameters
        ----------
        F : (n, s) float64
        d : (k, s) float64

        Returns
        -------
        u : (n, s) float64
        m : (k, s) float64

        Raises
        ------
        SingularSystem
            When the residual, refined once, stays above `RESIDUAL_LIMIT`.
        """
        b = np.concatenate([F, self.scale * d])
        if not b.shape[0]:
            return F.copy(), d.copy()
        x = np.asarray(self._solve(b), np.float64)
        x = x + np.asarray(self._solve(b - self.A @ x), np.float64)
        size = np.maximum(np.abs(b).max(axis=0), np.finfo(float).tiny)
        if not np.isfinite(x).all() or (np.abs(self.A @ x - b).max(axis=0) > RESIDUAL_LIMIT * size).any():
            raise SingularSystem("the residual is not small")
        return x[: self.n], self.scale * x[self.n :]


def _superlu(A: sp.csr_array) -> Any:
    from scipy.sparse.linalg import splu

    if not A.shape[0]:
        return np.copy
    try:
        return splu(sp.csc_array(A)).solve
    except RuntimeError as error:
        raise SingularSystem("a pivot vanishes") from error


def _pardiso(A: sp.csr_array) -> Any:
    from pypardiso import PyPardisoSolver
    from pypardiso.pardiso_wrapper import PyPardisoError

    solver, matrix = PyPardisoSolver(mtype=11), sp.csr_matrix(A)
    try:
        solver.factorize(matrix)
    except PyPardisoError as error:
        raise SingularSystem("a pivot vanishes") from error

    def solve(b: FloatArray) -> FloatArray:
        return np.asarray(solver.solve(matrix, np.asfortranarray(b))).reshape(b.shape)

    return solve


def complementary(M: FloatArray, q: FloatArray, max_pivots: int = 0) -> FloatArray:
    """Find ``z >= 0`` with ``w = M z + q >= 0`` and ``z . w = 0`` by Lemke's pivots.

    Parameters
    ----------
    M : (k, k) float64
        Finds a solution whenever there is one if M is positive semi-definite, symmetric or not, and always if all its
        principal minors are positive.
    q : (k,) float64
    max_pivots : int
        0: 50 and ten times k.

    Returns
    -------
    (k,) float64

    Raises
    ------
    NotConverged
        When the pivots end on a ray, or are too many.

    Source
    ------
    Cottle, Pang and Stone, The Linear Complementarity Problem, 1992, section 4.4.

    Cost
    ----
    A dense update of k x 2k a pivot, of which there are about as many as positive z.
    """
    k = len(q)
    if not k or (q >= 0).all():
        return np.zeros(k)
    # columns: w, z, the artificial unknown, right-hand side; w = M z + q + artificial
    table = np.column_stack([np.eye(k), -M, -np.ones(k), q])
    basis = np.arange(k)
    row, enters = int(np.argmin(q)), 2 * k
    for _ in range(max_pivots or 50 + 10 * k):
        table[row] /= table[row, enters]
        others = np.arange(k) != row
        table[others] -= np.outer(table[others, enters], table[row])
        leaves, basis[row] = int(basis[row]), enters
        if leaves == 2 * k:
            z = np.zeros(2 * k + 1)
            z[basis] = table[:, -1]
            return np.maximum(z[k : 2 * k], 0.0)
        enters = leaves + k if leaves < k else leaves - k
        column = table[:, enters]
        open_rows = np.flatnonzero(column > 1e-12 * np.abs(column).max(initial=0.0))
        if not len(open_rows):
            raise NotConverged([float(table[:, -1].max())], table[:, -1])
        ratio = table[open_rows, -1] / column[open_rows]
        best = open_rows[ratio <= ratio.min() * (1 + 1e-12) + 1e-300]
        artificial = best[basis[best] == 2 * k]
        row = int(artificial[0] if len(artificial) else best[0])
    raise NotConverged([float(np.abs(table[:, -1]).max())], table[:, -1])
