"""PARDISO with its own Schur complement: one factorisation gives the stiffness of the pairs and tied solutions."""

from __future__ import annotations

import ctypes
import weakref
from typing import Any

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import SingularSystem

SINGULAR_SCHUR = -4
"""Return code that here says only that the Schur complement is singular: a body is free on its contact."""


class PardisoSchur:
    """Partial factorisation of ``[[A, B], [B^T, C]]``.

    Parameters
    ----------
    A : (n, n) csr_array, symmetric positive definite
    B : (n, m) csr_array
    C : (m, m) csr_array

    Attributes
    ----------
    S : (m, m) float64
        ``C - B^T A^-1 B``.

    Raises
    ------
    SingularSystem
        When the factorisation fails, or S is not finite.

    Notes
    -----
    pypardiso's public calls do not reach the phases of a partial solution: the function of the library that it has
    loaded is called by ctypes, with the matrix type of definite matrices (2), iparm(36) = 2 and the rows of C marked.

    Source
    ------
    Intel oneMKL reference: pardiso, iparm(36), phases 331 and 333.

    Cost
    ----
    As that of A alone while m is small.
    """

    def __init__(self, A: sp.csr_array, B: sp.csr_array, C: sp.csr_array) -> None:
        from pypardiso import PyPardisoSolver

        n, m = B.shape
        self._n = n
        whole = sp.csr_array(sp.block_array([[A, B], [B.T, C + sp.csr_array((m, m))]], format="csr"))
        # every diagonal entry must be stored, also where C has none
        upper = sp.csr_array(sp.triu(whole + sp.diags_array(np.zeros(n + m)), format="csr"))
        upper.sort_indices()
        self._a = upper.data.astype(np.float64)
        self._ia = (upper.indptr + 1).astype(np.int32)
        self._ja = (upper.indices + 1).astype(np.int32)
        marked: IntArray = np.zeros(n + m, np.int32)
        marked[n:] = 1
        self._perm = marked
        self._pt = np.zeros(64, np.int64)
        iparm = np.zeros(64, np.int32)
        iparm[0] = 1  # own values
        iparm[1] = 2  # nested dissection
        iparm[35] = 2  # Schur complement, with partial solutions
        self._iparm = iparm
        loaded = PyPardisoSolver()._mkl_pardiso
        # the same function without the argument types of pypardiso, which expect its own arrays
        address = ctypes.cast(loaded, ctypes.c_void_p).value or 0
        self._call = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 16)(address)
        self.S = np.zeros((m, m))
        self._run(11, np.zeros(1), np.zeros(1))
        self._run(22, np.zeros(1), self.S)
        weakref.finalize(self, _release, self._call, self._pt, self._iparm, n + m)
        if not np.isfinite(self.S).all():
            raise SingularSystem("pardiso: the Schur complement is not finite")
        self.S = (self.S + self.S.T) / 2

    def solve(self, b: FloatArray) -> FloatArray:
        """Solve ``A x = b`` for one or several right-hand sides."""
        columns = b.reshape(len(b), -1)
        x = np.empty(columns.shape)
        for i, column in enumerate(columns.T):
            right = np.concatenate([column, np.zeros(len(self.S))])
            middle = np.zeros_like(right)
            self._run(331, right, middle)
            middle[self._n :] = 0.0
            found = np.zeros_like(right)
            self._run(333, middle, found)
            x[:, i] = found[: self._n]
        return x.reshape(b.shape)

    def _run(self, phase: int, b: FloatArray, x: FloatArray) -> None:
        error = _pardiso(self._call, self._pt, phase, self._a, self._ia, self._ja, self._perm, self._iparm, b, x)
        if error not in (0, SINGULAR_SCHUR) or (error == SINGULAR_SCHUR and phase != 22):
            raise SingularSystem(f"pardiso: error {error} in phase {phase}")


def _pardiso(
    call: Any, pt: Any, phase: int, a: Any, ia: Any, ja: Any, perm: Any, iparm: Any, b: FloatArray, x: FloatArray
) -> int:
    """Call the library with one right-hand side and a definite matrix."""
    number = ctypes.c_int32
    error = number(0)

    def at(array: Any) -> Any:
        return array.ctypes.data_as(ctypes.c_void_p)

    call(
        at(pt), ctypes.byref(number(1)), ctypes.byref(number(1)), ctypes.byref(number(2)), ctypes.byref(number(phase)),
        ctypes.byref(number(len(ia) - 1)), at(a), at(ia), at(ja), at(perm), ctypes.byref(number(1)), at(iparm),
        ctypes.byref(number(0)), at(b), at(x), ctypes.byref(error),
    )  # fmt: skip
    return int(error.value)


def _release(call: Any, pt: Any, iparm: Any, size: int) -> None:
    nothing = np.zeros(1)
    empty = np.ones(size + 1, np.int32)
    _pardiso(call, pt, -1, nothing, empty, empty[:1], empty, iparm, nothing, nothing)
