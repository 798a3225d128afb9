"""Energy and balance of single cells as forms of the tractions on their sides."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.estimate.macro import contraction, macro_element, moments, turned
from gibiane_ops.kernels.estimate.simplices import Simplices, others


def jumps(mesh: Simplices, tau: FloatArray, stress: FloatArray, cells: IntArray | slice = slice(None)) -> FloatArray:
    """Subtract the tractions of the finite-element stress from the balanced ones, on each side of each cell.

    Parameters
    ----------
    mesh : Simplices
    tau : (n_sides, d, d) float64, force
    stress : (m, n_s) float64
    cells : (k,) int64, optional

    Returns
    -------
    (k, d + 1, d, d) float64, force
    """
    flux = np.einsum("mkis,ms->mki", contraction(mesh.outward[cells], mesh.dim), stress[cells])
    return np.asarray(mesh.sign[cells][..., None, None] * tau[mesh.side[cells]] - flux[:, :, None], np.float64)


def energy_matrices(mesh: Simplices, compliance: FloatArray, cells: IntArray) -> FloatArray:
    """Compute the energy of the stress of cells as a quadratic form of their tractions.

    Parameters
    ----------
    mesh : Simplices
    compliance : (m, n_s, n_s) float64
    cells : (k,) int64

    Returns
    -------
    (k, n_t, n_t) float64, symmetric
        In the order of `macro.MacroElement`, tractions leaving the cell.
    """
    dim = mesh.dim
    macro = macro_element(dim)
    F = mesh.map[cells]
    T = turned(F)
    det = mesh.volume[cells] * (2.0 if dim == 2 else 6.0)
    S = np.matmul(T.swapaxes(1, 2), np.matmul(compliance[cells], T)) / det[:, None, None]
    upper = np.triu_indices(S.shape[1])
    n_t = macro.n_tractions
    H = S[:, upper[0], upper[1]] @ macro.energies
    inverse = np.linalg.inv(F)
    H = np.matmul(H.reshape(len(cells), -1, dim), inverse).reshape(len(cells), n_t, n_t)
    # The other side, by symmetry of the form.
    H = np.matmul(H.swapaxes(1, 2).reshape(len(cells), -1, dim), inverse)
    return np.asarray(H.reshape(len(cells), n_t, n_t), np.float64)


def balance_rows(mesh: Simplices, cells: IntArray) -> FloatArray:
    """Compute resultant forces and moments (over the size of the cell) of tractions on cells.

    Parameters
    ----------
    mesh : Simplices
    cells : (k,) int64

    Returns
    -------
    (k, 6 or 3, n_t) float64
    """
    dim = mesh.dim
    X = mesh.points[mesh.cells[cells]]
    arm = np.matmul(moments(dim), (X - X.mean(axis=1, keepdims=True))[:, others(dim)])
    arm = arm / np.linalg.norm(arm, axis=-1).max(axis=(1, 2))[:, None, None, None] / dim
    turns = [(i, j) for i in range(dim) for j in range(i)]
    B = np.zeros((len(cells), dim + len(turns), dim + 1, dim, dim))
    B[:, range(dim), :, :, range(dim)] = 1.0 / dim
    for row, (i, j) in enumerate(turns, dim):
        B[:, row, :, :, i] = arm[..., j]
        B[:, row, :, :, j] = -arm[..., i]
    return B.reshape(len(cells), dim + len(turns), -1)
