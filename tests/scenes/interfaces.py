"""Interfaces made from a matrix and a load, without bodies, for the tests."""

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.interface import FREE_LIMIT, Interface


def bare_interface(S: FloatArray, f: FloatArray, dim: int, gap: FloatArray | None = None) -> Interface:
    """Build an interface from its matrix and load alone, in axes (n, t1 (, t2)).

    Parameters
    ----------
    S : (n dim, n dim) float64, symmetric positive semidefinite
    f : (n dim,) float64
    dim : int
        Components of a pair, normal first: 2 or 3.
    gap : (n,) float64, optional
        Initial gaps, zero when left out.

    Returns
    -------
    Interface

    Cost
    ----
    One dense eigenvalue decomposition, for the free motions.
    """
    n = len(f) // dim
    kref = float(np.mean(np.diag(S)))
    values, vectors = np.linalg.eigh(S)
    frames = np.broadcast_to(np.eye(dim), (n, dim, dim))
    gap = np.zeros(n) if gap is None else np.asarray(gap, dtype=np.float64)
    active = np.ones((n, dim), dtype=bool)
    return Interface(S, f, gap, frames, active, vectors[:, values < FREE_LIMIT * kref], kref)
