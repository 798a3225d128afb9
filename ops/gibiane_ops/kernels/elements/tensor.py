"""Multilinear shape functions on [-1, 1]^dim, shared by the segment, the quadrangle and the hexahedron."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.shape import Basis


def multilinear(ref_nodes: FloatArray) -> tuple[Basis, Basis]:
    """Build the multilinear functions of the corners of [-1, 1]^dim.

    Parameters
    ----------
    ref_nodes : (2**dim, dim) float64
        Corners, coordinates -1 or 1.

    Returns
    -------
    N, dN : callable
        See `Shape`.

    Notes
    -----
    ``N_a = prod_i (1 + s_ai xi_i) / 2`` with s_a the corner.
    """
    dim = ref_nodes.shape[1]

    def factors(xi: FloatArray) -> FloatArray:
        return 0.5 * (1.0 + xi[:, None, :] * ref_nodes)

    def N(xi: FloatArray) -> FloatArray:
        return np.asarray(factors(xi).prod(axis=2), np.float64)

    def dN(xi: FloatArray) -> FloatArray:
        f = factors(xi)
        gradient = np.empty_like(f)
        for i in range(dim):
            others = [j for j in range(dim) if j != i]
            gradient[:, :, i] = 0.5 * ref_nodes[:, i] * f[:, :, others].prod(axis=2)
        return gradient

    return N, dN
