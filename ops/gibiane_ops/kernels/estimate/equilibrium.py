"""The stress that tractions impose: its values, its energy, and a check of its equilibrium."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.estimate.forms import jumps
from gibiane_ops.kernels.estimate.macro import contraction, macro_element, turned
from gibiane_ops.kernels.estimate.simplices import Simplices, others
from gibiane_ops.kernels.estimate.tractions import Exterior

CHUNK = 4096


def stress_at_corners(mesh: Simplices, tractions: FloatArray, cells: IntArray | slice = slice(None)) -> FloatArray:
    """Evaluate the stress that tractions impose, at the corners of the parts of each cell.

    Parameters
    ----------
    mesh : Simplices
    tractions : (k, d + 1, d, d) float64, force
        Leaving the cell, times the measure of the side.
    cells : (k,) int64, optional

    Returns
    -------
    (k, d + 1, d + 1, n_s) float64, force / length^2
        By part and corner, see `macro.MacroElement`.
    """
    F = mesh.map[cells]
    det = mesh.volume[cells] * (2.0 if mesh.dim == 2 else 6.0)
    pulled = np.matmul(tractions, np.linalg.inv(F).swapaxes(1, 2)[:, None])
    reference = macro_element(mesh.dim).stress
    n = mesh.dim + 1
    local = (pulled.reshape(len(F), -1) @ reference.reshape(n * n * reference.shape[2], -1).T).reshape(
        len(F), n * n, -1
    )
    return np.asarray(np.matmul(local, turned(F).swapaxes(1, 2) / det[:, None, None]).reshape(len(F), n, n, -1))


def errors(mesh: Simplices, tau: FloatArray, sigma: FloatArray, compliance: FloatArray) -> FloatArray:
    """Integrate the energy of ``sigma_hat - sigma_h`` over each cell, (m,).

    Notes
    -----
    The macro-element reproduces uniform stresses, so that the difference comes from the jumps of tractions alone: no
    cancellation, and an exact finite-element stress has no error to round-off.
    """
    n = mesh.dim + 1
    found = np.empty(len(mesh.cells))
    mass = (np.eye(n) + 1.0) / (n * (n + 1))
    for start in range(0, len(found), CHUNK):
        part = np.arange(start, min(start + CHUNK, len(found)))
        s = stress_at_corners(mesh, jumps(mesh, tau, sigma, part), part)
        strain = np.matmul(np.matmul(mass, s), compliance[part][:, None])
        found[part] = mesh.volume[part] / n * (strain * s).sum(axis=(1, 2, 3))
    return np.maximum(found, 0.0)


def equilibrium_residual(mesh: Simplices, tau: FloatArray, exterior: Exterior) -> float:
    """Check the stress itself: divergence in every part of every cell, and tractions on every side from both cells.

    Parameters
    ----------
    mesh : Simplices
    tau : (n_sides, d, d) float64, force
    exterior : Exterior

    Returns
    -------
    float
        Largest residual force over the largest traction force: round-off when the equilibrium holds.
    """
    dim = mesh.dim
    n, scale = dim + 1, float(np.abs(tau).max(initial=0.0))
    if scale == 0.0:
        return float(np.abs(exterior.body).max(initial=0.0) > 0)
    worst = 0.0
    macro = macro_element(dim)
    for start in range(0, len(mesh.cells), CHUNK):
        part = np.arange(start, min(start + CHUNK, len(mesh.cells)))
        out = mesh.sign[part][..., None, None] * tau[mesh.side[part]]
        F = mesh.map[part]
        pulled = np.matmul(out, np.linalg.inv(F).swapaxes(1, 2)[:, None]).reshape(len(part), -1)
        # Piola: div sigma = F div_ref sigma_ref / |det F|.
        reference = (pulled @ macro.divergence.reshape(n * dim, -1).T).reshape(len(part), n, dim)
        force = np.matmul(reference, F.swapaxes(1, 2)) / (2.0 if dim == 2 else 6.0)
        force = force + (exterior.body[part] * mesh.volume[part][:, None])[:, None]
        worst = max(worst, float(np.abs(force).max()))
        s = stress_at_corners(mesh, out, part)
        worst = max(worst, _traction_gap(mesh, s, out, part))
    edge = mesh.boundary
    area = np.linalg.norm(mesh.outward[mesh.cell[edge, 0], mesh.local[edge, 0]], axis=1)
    gap = tau[edge] - exterior.traction * area[:, None, None]
    imposed = np.einsum("kij,kaj->kai", np.eye(dim) - exterior.free, gap)
    return max(worst, float(np.abs(imposed).max(initial=0.0))) / scale


def _traction_gap(mesh: Simplices, stress: FloatArray, out: FloatArray, cells: IntArray) -> float:
    """Return the largest difference between tractions and those of the stress evaluated on the sides of cells."""
    found = 0.0
    for k, corners in enumerate(others(mesh.dim)):
        applied = np.einsum("mis,mas->mai", contraction(mesh.outward[cells, k], mesh.dim), stress[:, k, corners])
        found = max(found, float(np.abs(applied - out[:, k]).max(initial=0.0)))
    return found
