"""Iterative solutions: conjugate gradients with several preconditioners, and MINRES for indefinite matrices."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels import packages
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.multigrid import Multigrid
from gibiane_ops.kernels.packages import Solve

MOST_ITERATIONS = {"amg": 1000, "cg": 20_000, "single": 12, "minres": 20_000}

FEW_ITERATIONS = 120
"""Iterations with multigrid after which a factorisation, where one fits, is the better way."""

COLUMNS = 16
"""Right-hand sides iterated together."""

ATTAINED = 1e-14
"""Residual, relative to the right-hand side, that a factor in single precision is corrected to."""

WEAKEST = 1e-8
"""Smallest eigenvalue, of the matrix scaled to a unit diagonal, that a factor in single precision is used for."""


class Iteration:
    """Preconditioned conjugate gradients, for blocks of columns.

    Parameters
    ----------
    A : (n, n) sparse, symmetric positive definite
    precondition : function from residuals (n, k) to corrections
    tolerance : float
        Euclidean norm of the residual over that of the right-hand side, column by column.
    most : int
        Largest number of iterations.

    Attributes
    ----------
    iterations : int
        Of the last solve, the largest over its columns.

    Notes
    -----
    The Polak-Ribiere form of beta allows for a preconditioner rounded to single precision.

    Source
    ------
    Golub and Ye, SIAM J. Sci. Comput. 21, 1999.
    """

    def __init__(self, A: sp.sparray, precondition: Solve, tolerance: float, most: int) -> None:
        self._A = A
        self._precondition = precondition
        self._tolerance = tolerance
        self._most = most
        self.iterations = 0

    def __call__(self, b: FloatArray, tolerance: float | None = None, most: int | None = None) -> FloatArray:
        """Solve for one or several right-hand sides, to another tolerance or in other iterations if they are given.

        Raises
        ------
        ArithmeticError
            When the iterations do not suffice, or a direction of no or negative energy shows that the matrix is not
            positive definite.
        """
        self.iterations = 0
        columns = b.reshape(len(b), -1)
        found = np.empty(columns.shape)
        for start in range(0, columns.shape[1], COLUMNS):
            part = slice(start, start + COLUMNS)
            wanted = self._tolerance if tolerance is None else tolerance
            found[:, part] = self._run(columns[:, part], wanted, self._most if most is None else most)
        return found.reshape(b.shape)

    def _run(self, b: FloatArray, tolerance: float, most: int) -> FloatArray:
        single = b.shape[1] == 1
        if single:
            b = b[:, 0]
        x = np.zeros(b.shape)
        r = b.copy()
        wanted = tolerance * np.linalg.norm(b, axis=0)
        active = np.linalg.norm(r, axis=0) > wanted
        z = self._precondition(r)
        p = z.copy()
        rz = (r * z).sum(axis=0)
        count = 0
        while active.any():
            if count == most:
                left = float((np.linalg.norm(r, axis=0)[active] / wanted[active]).max()) * tolerance
                raise ArithmeticError(f"{count} iterations leave a relative residual of {left:.1e}")
            q = self._A @ p
            curvature = (p * q).sum(axis=0)
            if not ((curvature > 0) & (rz > 0) | ~active).all():
                raise ArithmeticError("the matrix is not positive definite")
            step = np.divide(rz, curvature, out=np.zeros_like(rz), where=active)
            x += step * p
            old, r = r, r - step * q
            count += 1
            active = active & (np.linalg.norm(r, axis=0) > wanted)
            if not active.any():
                break
            z = self._precondition(r)
            new = (r * z).sum(axis=0)
            p = z + np.divide(new - (old * z).sum(axis=0), rz, out=np.zeros_like(rz), where=active) * p
            rz = new
        self.iterations = max(self.iterations, count)
        return x[:, None] if single else x


def amg(
    A: sp.sparray, near_null: FloatArray | None, block: int, tolerance: float, *, patient: bool = True
) -> Iteration:
    """Prepare conjugate gradients with a multigrid cycle; see `Multigrid`. Without patience they give up early."""
    most = MOST_ITERATIONS["amg"] if patient else FEW_ITERATIONS
    return Iteration(A, Multigrid(A, near_null, block), tolerance, most)


def cg(A: sp.sparray, block: int, tolerance: float) -> Iteration:
    """Prepare conjugate gradients with the inverses of the diagonal blocks as preconditioner (block Jacobi)."""
    A = A.tocsr()
    n = A.shape[0]
    diagonal = np.zeros((n // block, block, block))
    row = np.repeat(np.arange(n), np.diff(A.indptr))
    own = row // block == A.indices // block
    row, column = row[own], A.indices[own]
    diagonal[row // block, row % block, column % block] = A.data[own]
    inverse = sp.csr_array(
        sp.bsr_array((np.linalg.inv(diagonal), np.arange(n // block), np.arange(n // block + 1)), shape=(n, n))
    )
    return Iteration(A, lambda r: np.asarray(inverse @ r), tolerance, MOST_ITERATIONS["cg"])


def single(A: sp.sparray) -> Iteration:
    """Factorise in single precision, and correct by conjugate gradients in double: half the time and the memory.

    Raises
    ------
    ArithmeticError
        When the factor shows that the matrix is not positive definite, or too ill conditioned for single precision.
    """
    factor = packages.rslab(A, single=True)
    if factor.negative:
        raise ArithmeticError("negative pivots")
    # a motion without energy, or nearly so, appears in two inverse iterations: that is left to double precision
    weights = A.diagonal()
    x = np.random.default_rng(0).standard_normal(A.shape[0]) / np.sqrt(weights)
    for _ in range(2):
        x = factor(weights * x)
        x /= np.sqrt(weights @ x**2)
    if not float(x @ (A @ x)) > WEAKEST:
        raise ArithmeticError("ill conditioned")
    return Iteration(A, factor, ATTAINED, MOST_ITERATIONS["single"])


class Minres:
    """MINRES, which allows negative eigenvalues, on the matrix scaled by its diagonal.

    Parameters
    ----------
    A : (n, n) sparse, symmetric
    tolerance : float
        Euclidean norm of the residual of the scaled system over that of its right-hand side.

    Attributes
    ----------
    iterations : int
        Of the last solve, the largest over its columns.

    Source
    ------
    Paige and Saunders, SIAM J. Numer. Anal. 12, 1975.
    """

    def __init__(self, A: sp.sparray, tolerance: float) -> None:
        size = np.abs(A.diagonal())
        self._scale = 1 / np.sqrt(np.where(size > 0, size, size.mean() or 1.0))
        weights = sp.diags_array(self._scale, format="csr")
        self._A = sp.csr_array(weights @ sp.csr_array(A) @ weights)
        self._tolerance = tolerance
        self.iterations = 0

    def __call__(self, b: FloatArray) -> FloatArray:
        """Solve for one or several right-hand sides."""
        self.iterations = 0
        columns = [self._column(column) for column in b.reshape(len(b), -1).T]
        return np.stack(columns, axis=1).reshape(b.shape)

    def _column(self, b: FloatArray) -> FloatArray:
        from scipy.sparse.linalg import minres

        right = self._scale * b
        wanted = self._tolerance * float(np.linalg.norm(right))
        x, rest, count = np.zeros_like(right), right, 0

        def tick(_: FloatArray) -> None:
            nonlocal count
            count += 1

        # its own test compares with the norms of A and x: it starts again from the residual until this is small
        for _ in range(5):
            if np.linalg.norm(rest) <= wanted:
                break
            x = x + minres(self._A, rest, rtol=self._tolerance, maxiter=MOST_ITERATIONS["minres"], callback=tick)[0]
            rest = right - self._A @ x
        self.iterations = max(self.iterations, count)
        return np.asarray(self._scale * x, np.float64)
