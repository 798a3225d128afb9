"""Smoothings by means at the nodes and by projection."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels import assembly, integrals
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import NotConverged
from gibiane_ops.kernels.recovery.blocks import StressBlock, centre_values, extrapolate
from gibiane_ops.kernels.topology import used_nodes

CG_TOLERANCE = 1e-13
"""Relative residual of the conjugate gradients of the projection."""


def nodal_mean(n_points: int, cells: Sequence[IntArray], values: Sequence[FloatArray]) -> FloatArray:
    """Average element values at the nodes, every element counting once.

    Parameters
    ----------
    n_points : int
    cells : list of (m, n_nodes) int64
    values : list of (m, n_nodes, c) float64
        Values of each element at its own nodes.

    Returns
    -------
    (n_points, c) float64
        Zero where no element arrives.
    """
    total = assembly.assemble_vector(n_points, values[0].shape[2], list(zip(cells, values, strict=True)))
    count = np.bincount(np.concatenate([each.ravel() for each in cells]), minlength=n_points)
    return np.asarray(total.reshape(n_points, -1) / np.maximum(count, 1)[:, None], np.float64)


def mean_of_nodes(n_points: int, blocks: Sequence[StressBlock]) -> FloatArray:
    """Smooth by the nodal mean of extrapolated stresses (MOYE).

    Parameters
    ----------
    n_points : int
    blocks : list of StressBlock

    Returns
    -------
    (n_points, c) float64
    """
    values = [extrapolate(block.shape, block.stress) for block in blocks]
    return nodal_mean(n_points, [block.cells for block in blocks], values)


def mean_of_centres(n_points: int, blocks: Sequence[StressBlock]) -> FloatArray:
    """Smooth by the nodal mean of the stresses at the centres of the elements (MOYC).

    Parameters
    ----------
    n_points : int
    blocks : list of StressBlock

    Returns
    -------
    (n_points, c) float64
    """
    values = [
        np.repeat(centre_values(block.shape, block.stress)[:, None], block.shape.n_nodes, axis=1) for block in blocks
    ]
    return nodal_mean(n_points, [block.cells for block in blocks], values)


def project(points: FloatArray, blocks: Sequence[StressBlock], *, lumped: bool = False) -> FloatArray:
    """Smooth by projection on the continuous interpolation, in the L2 norm (PROJ, or LUMP).

    Parameters
    ----------
    points : (n_points, dim) float64, length
    blocks : list of StressBlock
    lumped : bool
        Replace the mass matrix by a diagonal one, see `integrals.lumped_mass`.

    Returns
    -------
    (n_points, c) float64

    Raises
    ------
    NotConverged
        When the conjugate gradients stall.

    Notes
    -----
    ``M s = int N^T sigma_h`` with the mass matrix of one scalar, each component in turn; sigma_h between its points is
    what `extrapolate` builds. Lumped, for elements of second degree, the diagonal stands on both sides: the mean of
    the extrapolated values weighted by the masses of the nodes.

    Source
    ------
    Zienkiewicz and Zhu 1987.

    Cost
    ----
    Some twenty products by M for each component.
    """
    n_points, c = len(points), blocks[0].stress.shape[2]
    masses = [(block.cells, _mass(block, points, lumped)) for block in blocks]
    # sigma_h is an interpolation of nodal values: the element mass matrix integrates N^T sigma_h as it is.
    loads = [
        (block.cells, np.matmul(mass, extrapolate(block.shape, block.stress)))
        for block, (_, mass) in zip(blocks, masses, strict=True)
    ]
    b = assembly.assemble_vector(n_points, c, loads).reshape(n_points, c)
    M = sp.csr_matrix(assembly.assemble(n_points, 1, masses))
    used = used_nodes([block.cells for block in blocks])
    nodal = np.zeros((n_points, c))
    if lumped:
        nodal[used] = b[used] / np.asarray(M.sum(axis=1)).reshape(n_points, 1)[used]
    else:
        nodal[used] = _conjugate_gradients(M[used][:, used], b[used])
    return nodal


def _mass(block: StressBlock, points: FloatArray, lumped: bool) -> FloatArray:
    """Return the matrices that weigh the stresses of the cells; the rows of linear shapes are summed up later."""
    X = points[block.cells]
    if lumped and block.shape.degree == 2:
        return integrals.lumped_mass(block.shape, X)[:, :, None] * np.eye(block.shape.n_nodes)
    return integrals.element_mass(block.shape, X)


def _conjugate_gradients(A: sp.csr_matrix, b: FloatArray) -> FloatArray:
    """Solve for several right-hand sides with a diagonal preconditioner; mass matrices need few iterations."""
    from scipy.sparse.linalg import cg

    inverse_diagonal = sp.diags(1.0 / A.diagonal())
    x = np.zeros_like(b)
    for k in range(b.shape[1]):
        x[:, k], failed = cg(A, b[:, k], rtol=CG_TOLERANCE, maxiter=1000, M=inverse_diagonal)
        if failed:
            residual = float(np.linalg.norm(A @ x[:, k] - b[:, k]) / np.linalg.norm(b[:, k]))
            raise NotConverged([residual], x)
    return x
