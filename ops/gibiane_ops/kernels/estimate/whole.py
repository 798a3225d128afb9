"""Best equilibrated tractions of a plane mesh: the energy of the error is minimised over all its sides at once."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.estimate.limits import Limits
from gibiane_ops.kernels.estimate.simplices import Simplices
from gibiane_ops.kernels.estimate.stars import balance_rows, energy_matrices, jumps
from gibiane_ops.kernels.solve import factorize

PENALTY = 1e8
"""Weight of the balance of each cell over the energy, in the augmented Lagrangian."""

UZAWA = 6
"""Largest number of solutions with the factor."""

STOP = 1e6
"""Stiffness against what leaves the law on contact facets, over that of a traction."""

SETS = 12
"""Largest number of sets of corners that are pushed back to the law of contact."""

LEFT = 1e-14
"""Imbalance that is round-off, over the largest traction force."""


def improve_whole(
    mesh: Simplices,
    stress: FloatArray,
    compliance: FloatArray,
    free: FloatArray,
    tau: FloatArray,
    pull: FloatArray | None = None,
    limits: Limits | None = None,
) -> None:
    """Replace the tractions, in place, by those of least energy of ``sigma_hat - sigma_h``.

    Parameters
    ----------
    mesh : Simplices
    stress : (m, n_s) float64, force / length^2
        Finite-element stress.
    compliance : (m, n_s, n_s) float64, length^2 / force
    free : (n_sides, d, d) float64
        Projector on the directions in which the traction of each side may change.
    tau : (n_sides, d, d) float64, force
        Balanced tractions, see `tractions.balanced_tractions`; still balanced afterwards.
    pull : (m, n_t) float64, optional
        What a stress that is not uniform in the cells adds, see `pieces.Aim`.
    limits : Limits, optional
        Sides on which tractions obey the law of contact and friction; they do to begin with, and go on to.

    Raises
    ------
    TooLarge
        When the factor needs more memory than there is.

    Notes
    -----
    In a plane the equilibrated stresses are those of a stress function, an unknown of fourth order: corrections that
    travel from star to star would need some (size / h)^4 sweeps (a plate with a hole: 1.79 times the error after 40
    sweeps of 576 triangles, 1.19 here), while one sparse factor of the plane costs less than a sweep. The rigid
    balances of the cells are constraints, by an augmented Lagrangian. Tractions that leave the law of contact are
    pushed back by stiff springs, as long as they push (semi-smooth Newton); what they leave is cut from the change.

    Source
    ------
    Fraeijs de Veubeke 1965 (dual analysis); Johnson and Mercier 1978; Hueber and Wohlmuth 2005 (active sets).

    Cost
    ----
    One sparse factor of 4 unknowns a side; with limits, one for each set of corners that are pushed back.
    """
    dim, m = mesh.dim, len(mesh.cells)
    block, n_t = dim * dim, dim * dim * (dim + 1)
    size = len(mesh.nodes) * block
    where = (mesh.side[:, :, None] * block + np.arange(block)).reshape(m, n_t)
    sign = np.repeat(mesh.sign, block, axis=1)
    corners = np.arange(size // dim + 1)
    P = sp.bsr_array((np.repeat(free, dim, axis=0), corners[:-1], corners), shape=(size, size)).tocsr()

    cells = np.arange(m)
    H, B = energy_matrices(mesh, compliance, cells), balance_rows(mesh, cells)
    stiff = STOP * float(np.einsum("mii->", H)) / (m * n_t)
    weight = np.repeat(PENALTY * np.trace(H, axis1=1, axis2=2) / (B**2).sum(axis=(1, 2)), B.shape[1])
    slope = np.einsum("mij,mj->mi", H, jumps(mesh, tau, stress).reshape(m, n_t))
    if pull is not None:
        slope -= pull
    descent = np.asarray(np.bincount(where.ravel(), (-sign * slope).ravel(), minlength=size), np.float64)
    if limits is not None:
        descent -= limits.slide.ravel()
    descent = P @ descent

    H *= sign[:, :, None] * sign[:, None]
    B *= sign[:, None]
    rows = np.arange(B.shape[0] * B.shape[1] + 1) * n_t
    balance = sp.csr_array((B.ravel(), np.repeat(where, B.shape[1], axis=0).ravel(), rows), shape=(len(weight), size))
    balance = balance @ P
    H = H + np.einsum("mr,mri,mrj->mij", weight.reshape(m, -1), B, B)
    entries = np.repeat(where, n_t, axis=1).ravel(), np.tile(where, (1, n_t)).ravel()
    energy = sp.coo_array((H.ravel(), entries), shape=(size, size)).tocsr()
    held = sp.eye_array(size) - P
    A = sp.csr_array(P @ energy @ P + held * float(np.median(energy.diagonal())))

    x, _ = _solved(A, P, descent, balance, weight, np.zeros(len(weight)), tau)
    if limits is not None:
        sides, pushing = np.arange(len(tau)), np.zeros((len(tau), 2, dim), bool)
        known = pushing.copy()
        for _ in range(SETS):
            row, corner, kind, n, over = limits.passed(tau + x.reshape(tau.shape), sides, pushing)
            active = np.zeros_like(known)
            active[row, kind, corner] = True
            if np.array_equal(known, active):
                break
            known = active
            place = (row * dim + corner)[:, None] * dim + np.arange(dim)
            start = np.arange(len(row) + 1) * dim
            N = sp.csr_array((n.ravel(), place.ravel(), start), shape=(len(row), size)) @ P
            springs, rows = np.full(len(row), stiff), sp.csr_array(sp.vstack([balance, N]))
            offset = np.concatenate([np.zeros(len(weight)), over - N @ x])
            x, push = _solved(
                sp.csr_array(A + stiff * (N.T @ N)), P, descent, rows, np.concatenate([weight, springs]), offset, tau
            )
            pushing = np.zeros_like(known)
            pushing[row, kind, corner] = push[len(weight) :] > 0
        x *= float(limits.step(tau, x.reshape(tau.shape), sides).min(initial=1.0))
    tau += x.reshape(tau.shape)


def _solved(
    A: sp.csr_array,
    P: sp.csr_array,
    descent: FloatArray,
    rows: sp.csr_array,
    weight: FloatArray,
    offset: FloatArray,
    tau: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Solve for the change x of the tractions with ``rows @ x + offset = 0`` to round-off; also the multipliers."""
    factor = factorize(A)
    x, push, scale = np.zeros(len(descent)), weight * offset, float(np.abs(tau).max(initial=0.0))
    force = np.zeros(len(weight))
    for _ in range(UZAWA):
        x = np.asarray(P @ factor.solve(descent - rows.T @ push), np.float64)
        gap = rows @ x + offset
        force = push + weight * (gap - offset)
        if np.abs(gap).max(initial=0.0) <= LEFT * (scale + np.abs(x).max(initial=0.0)):
            break
        push += weight * gap
    return x, force
