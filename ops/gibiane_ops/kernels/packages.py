"""The packages that factorise or iterate, one function each: from a sparse matrix to a function that solves.

They check nothing: `solve.Factor` does, for all of them.
"""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray

Solve = Callable[[FloatArray], FloatArray]

DIRECT = ("rslab", "pardiso", "superlu")
MODULES = {"rslab": "rslab", "pardiso": "pypardiso", "superlu": "scipy", "amg": "pyamg", "cg": "scipy"}
# Nodes of the coarsest level of the multigrid hierarchy, which is solved by a dense pseudo-inverse.
COARSEST = 40
MOST_ITERATIONS = {"amg": 300, "cg": 20_000}


def is_installed(name: str) -> bool:
    """Tell whether the module of a package can be imported."""
    return importlib.util.find_spec(MODULES[name]) is not None


def rslab(A: sp.csr_array) -> Solve:
    """Factorise by rslab's supernodal LDL^T."""
    import rslab

    factor = rslab.ldlt(A.tocsc())

    def solve(b: FloatArray) -> FloatArray:
        return np.asarray(factor.solve(b) if b.ndim == 1 else factor.solve_many(np.ascontiguousarray(b)))

    return solve


def pardiso(A: sp.csr_array) -> Solve:
    """Factorise by MKL's PARDISO: symmetric positive definite, upper triangle."""
    from pypardiso import PyPardisoSolver
    from pypardiso.pardiso_wrapper import PyPardisoError

    solver = PyPardisoSolver(mtype=2)
    upper = sp.triu(A, format="csr")
    try:
        solver.factorize(upper)
    except PyPardisoError as error:
        raise RuntimeError(str(error)) from error
    return lambda b: np.asarray(solver.solve(upper, np.asfortranarray(b))).reshape(b.shape)


def superlu(A: sp.csr_array) -> Solve:
    """Factorise by SciPy's SuperLU, rows and columns ordered alike."""
    from scipy.sparse.linalg import splu

    options = {"SymmetricMode": True}
    factor = splu(A.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    return lambda b: np.asarray(factor.solve(b))


class Iteration:
    """Conjugate gradients with a preconditioner, column by column.

    Attributes
    ----------
    iterations : int
        Of the last solve, the largest over its columns.
    """

    def __init__(self, run: Callable[[FloatArray, list[float]], FloatArray]) -> None:
        self._run = run
        self.iterations = 0

    def __call__(self, b: FloatArray) -> FloatArray:
        """Solve for one or several right-hand sides."""
        self.iterations = 0
        found = []
        for column in b.reshape(len(b), -1).T:
            residuals: list[float] = []
            # a singular matrix breaks the iteration down: the residual check of the caller finds that out
            with warnings.catch_warnings(record=True), np.errstate(all="ignore"):
                found.append(self._run(np.ascontiguousarray(column), residuals))
            self.iterations = max(self.iterations, len(residuals) - 1)
        return np.stack(found, axis=1).reshape(b.shape)


def amg(A: sp.csr_array, near_null: FloatArray | None, block: int, tolerance: float) -> Solve:
    """Make a smoothed-aggregation hierarchy for conjugate gradients (pyamg).

    Parameters
    ----------
    A : (n, n) csr_array
    near_null : (n, k) float64 or None
        Modes of zero energy of the matrix without its supports: the rigid-body modes.
    block : int
        Unknowns per node; nodes are aggregated whole.
    tolerance : float
        Relative residual, Euclidean norm.
    """
    import pyamg

    whole = A.tobsr(blocksize=(block, block)) if block > 1 else A
    smoother = ("block_gauss_seidel" if block > 1 else "gauss_seidel", {"sweep": "symmetric"})
    hierarchy: Any = pyamg.smoothed_aggregation_solver(
        whole, B=near_null, symmetry="symmetric", strength=("symmetric", {"theta": 0.0}),
        presmoother=smoother, postsmoother=smoother, max_coarse=COARSEST,
    )  # fmt: skip

    def run(b: FloatArray, residuals: list[float]) -> FloatArray:
        most = MOST_ITERATIONS["amg"]
        return np.asarray(hierarchy.solve(b, tol=tolerance, accel="cg", maxiter=most, residuals=residuals))

    return Iteration(run)


def cg(A: sp.csr_array, block: int, tolerance: float) -> Solve:
    """Prepare conjugate gradients with the inverses of the diagonal blocks as preconditioner (block Jacobi)."""
    from scipy.sparse.linalg import LinearOperator, cg

    n = A.shape[0]
    diagonal = np.zeros((n // block, block, block))
    entries = A.tocoo()
    own = entries.row // block == entries.col // block
    row, column = entries.row[own], entries.col[own]
    diagonal[row // block, row % block, column % block] = entries.data[own]
    inverse = np.linalg.inv(diagonal)

    def precondition(r: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("nij,nj->ni", inverse, r.reshape(-1, block)).ravel())

    M = LinearOperator((n, n), matvec=precondition)

    def run(b: FloatArray, residuals: list[float]) -> FloatArray:
        residuals.append(float(np.linalg.norm(b)))

        def count(x: FloatArray) -> None:
            residuals.append(0.0)

        return np.asarray(cg(A, b, rtol=tolerance, atol=0.0, maxiter=MOST_ITERATIONS["cg"], M=M, callback=count)[0])

    return Iteration(run)
