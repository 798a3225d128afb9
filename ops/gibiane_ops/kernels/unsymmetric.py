"""Solve sparse systems without symmetry."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import SingularSystem

RESIDUAL_LIMIT = 1e-9
"""Largest accepted norm of ``A x - b`` over that of ``b``."""


def solve_unsymmetric(A: sp.csr_array, b: FloatArray) -> FloatArray:
    """Solve ``A x = b`` by LU factorisation with partial pivoting.

    Parameters
    ----------
    A : (n, n) csr_array
    b : (n, k) float64

    Returns
    -------
    (n, k) float64

    Raises
    ------
    SingularSystem
        When a pivot vanishes or the residual, refined once, stays above `RESIDUAL_LIMIT`.

    Source
    ------
    SuperLU: J. W. Demmel et al., A supernodal approach to sparse partial pivoting, 1999.
    """
    from scipy.sparse.linalg import splu

    if not A.shape[0]:
        return np.zeros_like(b)
    try:
        factor = splu(sp.csc_array(A))
    except RuntimeError as error:
        raise SingularSystem("a pivot vanishes") from error
    x = np.asarray(factor.solve(b), np.float64)
    x = np.asarray(x + factor.solve(b - A @ x), np.float64)
    size = np.maximum(np.abs(b).max(axis=0), np.finfo(float).tiny)
    if not np.isfinite(x).all() or (np.abs(A @ x - b).max(axis=0) > RESIDUAL_LIMIT * size).any():
        raise SingularSystem("the residual is not small")
    return x
