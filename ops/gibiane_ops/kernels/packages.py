"""The packages that factorise, one function each: from a sparse matrix to a function that solves.

They check nothing: `solve.Factor` does, for all of them.
"""

from __future__ import annotations

import importlib.util
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import TooLarge
from gibiane_ops.kernels.memory import available_memory

Solve = Callable[[FloatArray], FloatArray]

DIRECT = ("rslab", "pardiso", "superlu")
MODULES = {"rslab": "rslab", "pardiso": "pypardiso", "superlu": "scipy"}

SUPERLU_LIMIT = 30_000
"""Number of unknowns above which SuperLU is some fifty times slower than a supernodal package."""


def is_installed(name: str) -> bool:
    """Tell whether the module of a package can be imported."""
    return importlib.util.find_spec(MODULES[name]) is not None


class Factored:
    """The solve of a package, and how many negative eigenvalues the factorisation met (None: not known)."""

    def __init__(self, run: Solve, negative: int | None) -> None:
        self._run = run
        self.negative = negative

    def __call__(self, b: FloatArray) -> FloatArray:
        """Solve for one or several right-hand sides, (n,) or (n, k)."""
        return np.asarray(self._run(b), np.float64).reshape(b.shape)


def rslab(A: sp.sparray, *, single: bool = False) -> Factored:
    """Factorise by rslab's supernodal LDL^T, of a definite or indefinite matrix, in double or single precision.

    Raises
    ------
    TooLarge
        When the analysis of the pattern predicts more memory than there is.
    """
    import rslab

    lower = sp.tril(A, format="csc")
    options = {"factor_dtype": "float32"} if single else {}
    analysis = rslab.analyze(lower, path="ldlt", **options)
    needed = float(analysis.memory_plan("float32" if single else "float64")["peak_bytes"])
    limit = available_memory()
    if needed > limit:
        raise TooLarge(f"the factorisation of {A.shape[0]} unknowns", needed, limit)
    factor = analysis.factor(lower, **options)

    def solve(b: FloatArray) -> FloatArray:
        return np.asarray(factor.solve(b) if b.ndim == 1 else factor.solve_many(np.ascontiguousarray(b)))

    return Factored(solve, int(factor.inertia[1]))


def pardiso(A: sp.sparray) -> Factored:
    """Factorise the upper triangle by MKL's PARDISO, as positive definite or, where that fails, as indefinite."""
    from pypardiso.pardiso_wrapper import PyPardisoError

    upper = sp.triu(A, format="csr")
    try:
        return _pardiso(upper, 2)
    except PyPardisoError:
        try:
            return _pardiso(upper, -2)
        except PyPardisoError as error:
            raise RuntimeError(str(error)) from error


def _pardiso(upper: sp.csr_array, kind: int) -> Factored:
    from pypardiso import PyPardisoSolver

    solver: Any = PyPardisoSolver(mtype=kind)
    try:
        solver.factorize(upper)
    except BaseException:
        solver.free_memory()
        raise
    found = Factored(lambda b: solver.solve(upper, np.asfortranarray(b)), int(solver.get_iparm(23)) if kind < 0 else 0)
    # MKL keeps the factor until it is told otherwise
    weakref.finalize(found, solver.free_memory)
    return found


def superlu(A: sp.sparray) -> Factored:
    """Factorise by SciPy's SuperLU, with pivoting where an entry of the diagonal is not positive."""
    from scipy.sparse.linalg import splu

    matrix = A.tocsc()
    if (matrix.diagonal() > 0).all():
        options = {"SymmetricMode": True}
        factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    else:
        factor = splu(matrix)
    return Factored(factor.solve, None)
