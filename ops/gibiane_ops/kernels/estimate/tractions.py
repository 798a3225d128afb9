"""Tractions on the sides of a mesh of simplices that balance every cell, close to those of a finite-element stress."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import NotEquilibrated
from gibiane_ops.kernels.estimate.macro import contraction
from gibiane_ops.kernels.estimate.simplices import Simplices, others

BALANCE_LIMIT = 1e-8
"""Largest imbalance of a star, over the largest nodal force of the stress, that is taken for round-off."""


@dataclass(frozen=True, eq=False)
class Exterior:
    """What is known on the boundary.

    Attributes
    ----------
    traction : (k, d, d) float64, force / length^(d - 1)
        Tractions at the corners (increasing) of the sides ``mesh.boundary``: side, corner, component.
    free : (k, d, d) float64
        Projector on the directions in which displacements are prescribed and tractions unknown: the identity where
        clamped, zero where loaded or free of load.
    body : (m, d) float64, force / length^d
        Body force, uniform in each cell.
    """

    traction: FloatArray
    free: FloatArray
    body: FloatArray


def balanced_tractions(mesh: Simplices, stress: FloatArray, exterior: Exterior) -> FloatArray:
    """Find tractions that balance each cell, star by star.

    Parameters
    ----------
    mesh : Simplices
    stress : (m, n_s) float64, force / length^2
        Finite-element stress, uniform in each cell, components of `macro.STATIC`.
    exterior : Exterior

    Returns
    -------
    (n_sides, d, d) float64, force
        Traction times measure at each corner of each side, on its first cell (opposite on the second).

    Raises
    ------
    NotEquilibrated
        The stress does not balance the loads at some node: it comes from other loads or other supports.

    Notes
    -----
    For each corner i of a cell E, ``sum_F +- b_Fi = int_E (sigma_h grad N_i - f N_i)`` over the sides F of E through
    i, with ``b_Fi = int_F t N_i``; b is the nearest, in least squares, to the mean of the tractions of sigma_h. The
    corner tractions come from b by the inverse of the mass matrix of the side, ``d (d + 1) (I - J / (d + 1))``.

    Source
    ------
    Ladeveze and Leguillon 1983; Ladeveze and Rougeot 1997.

    Cost
    ----
    One dense system of 3 unknowns a cell for each star.
    """
    dim = mesh.dim
    n_sides = len(mesh.nodes)
    free = np.broadcast_to(np.eye(dim), (n_sides, dim, dim)).copy()
    free[mesh.boundary] = exterior.free
    guess = np.zeros((n_sides, dim))
    flux = np.einsum("mkis,ms->mki", contraction(mesh.outward, dim), stress)
    np.add.at(guess, mesh.side, flux * mesh.sign[..., None])
    guess[mesh.cell[:, 1] >= 0] /= 2
    b = np.repeat(guess[:, None] / dim, dim, axis=1)
    area = np.linalg.norm(mesh.outward[mesh.cell[:, 0], mesh.local[:, 0]], axis=1)[mesh.boundary]
    known = np.einsum("ab,kbi->kai", (np.eye(dim) + 1.0) / (dim * (dim + 1)), exterior.traction)
    b[mesh.boundary] = np.einsum("kij,kaj->kai", exterior.free, b[mesh.boundary]) + np.einsum(
        "kij,kaj->kai", np.eye(dim) - exterior.free, known * area[:, None, None]
    )

    # What each corner of each cell lacks: -flux_k / dim is the volume times sigma grad N_k.
    need = -flux / dim - (exterior.body * mesh.volume[:, None] / (dim + 1))[:, None]
    lack = need.copy()
    corner = others(dim)
    for k in range(dim + 1):
        lack[:, corner[k]] -= mesh.sign[:, k, None, None] * b[mesh.side[:, k]]
    scale = float(np.abs(flux).max(initial=0.0)) + float(np.abs(b).max(initial=0.0))
    y = _potentials(mesh, lack, free, scale)
    for k in range(dim + 1):
        push = mesh.sign[:, k, None, None] * y[:, corner[k]]
        np.add.at(b, mesh.side[:, k], np.einsum("mij,maj->mai", free[mesh.side[:, k]], push))
    mass_inverse = dim * (dim + 1) * (np.eye(dim) - 1.0 / (dim + 1))
    tau: FloatArray = np.einsum("ab,fbi->fai", mass_inverse, b)
    # What is imposed stays as it was given, to the last digit.
    tau[mesh.boundary] = np.einsum("kij,kaj->kai", exterior.free, tau[mesh.boundary]) + np.einsum(
        "kij,kaj->kai", np.eye(dim) - exterior.free, exterior.traction * area[:, None, None]
    )
    return tau


def _potentials(mesh: Simplices, lack: FloatArray, free: FloatArray, scale: float) -> FloatArray:
    """Solve ``A P A^T y = lack`` in each star, (m, d + 1, d), A the incidence of its corners and sides."""
    dim, (m, n) = mesh.dim, mesh.cells.shape
    star = mesh.star.ravel()
    count = np.bincount(star, minlength=mesh.n_stars)
    order = np.argsort(star, kind="stable")
    place = np.empty(m * n, np.int64)
    place[order] = np.arange(m * n) - np.repeat(np.cumsum(count) - count, count)

    own = free[mesh.side]
    diagonal = own.sum(axis=1, keepdims=True) - own
    held = np.zeros((mesh.n_stars, dim, dim))
    edge = mesh.boundary
    ends = mesh.star[mesh.cell[edge, 0][:, None], others(dim)[mesh.local[edge, 0]]]
    np.add.at(held, ends, np.repeat(free[edge][:, None], dim, axis=1))
    # In the directions that no side of the star leaves free, potentials are known up to a constant.
    values, vectors = np.linalg.eigh(held)
    kernel = np.where(values < 1e-9, 1.0, 0.0)
    loose = np.einsum("sik,sk,sjk->sij", vectors, kernel, vectors)
    resultant = np.stack([np.bincount(star, lack[..., i].ravel(), minlength=mesh.n_stars) for i in range(dim)], axis=1)
    unbalanced = np.einsum("sij,sj->si", loose, resultant)
    size = np.linalg.norm(unbalanced, axis=1)
    if (size > BALANCE_LIMIT * scale).any():
        wrong = np.flatnonzero(size > BALANCE_LIMIT * scale)
        node = np.empty(mesh.n_stars, np.int64)
        node[star] = mesh.cells.ravel()
        worst = wrong[np.argsort(-size[wrong])]
        raise NotEquilibrated(node[worst], unbalanced[worst], float(size.max() / scale))

    inner = np.flatnonzero(mesh.cell[:, 1] >= 0)
    pairs = mesh.cell[inner][:, :, None] * n + others(dim)[mesh.local[inner]]
    first, second = pairs[:, 0].ravel(), pairs[:, 1].ravel()
    y = np.zeros((m * n, dim))
    flat, blocks = lack.reshape(-1, dim), diagonal.reshape(-1, dim, dim)
    row = np.zeros(mesh.n_stars, np.int64)
    for size_of in np.unique(count):
        stars = np.flatnonzero(count == size_of)
        row[stars] = np.arange(len(stars))
        L = np.zeros((len(stars), size_of, size_of, dim, dim))
        L += loose[stars][:, None, None] / size_of
        mine = order[count[star[order]] == size_of]
        L[row[star[mine]], place[mine], place[mine]] += blocks[mine]
        here = count[star[first]] == size_of
        a, b = first[here], second[here]
        L[row[star[a]], place[a], place[b]] -= np.eye(dim)
        L[row[star[a]], place[b], place[a]] -= np.eye(dim)
        matrix = L.transpose(0, 1, 3, 2, 4).reshape(len(stars), size_of * dim, -1)
        rhs = flat[mine].reshape(len(stars), size_of * dim, 1)
        y[mine] = np.linalg.solve(matrix, rhs).reshape(-1, dim)
    return y.reshape(m, n, dim)
