"""Best equilibrated tractions of some cells: the energy of the error is minimised over all the sides between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.estimate.forms import balance_rows, energy_matrices, jumps
from gibiane_ops.kernels.estimate.limits import Limits
from gibiane_ops.kernels.estimate.target import Target
from gibiane_ops.kernels.solve import factorize

PENALTY = 1e8
"""Weight of the balance of each cell over the energy, in the augmented Lagrangian."""

UZAWA = 6
"""Largest number of solutions with the factor."""

STOP = 1e6
"""Stiffness against what leaves the law on contact facets, over that of a traction."""

SETS = 20
"""Largest number of sets of corners that are pushed back to the law of contact."""

LEFT = 1e-14
"""Imbalance that is round-off, over the largest traction force."""

MET = 1e-12
"""Imbalance of a change that keeps the balance, over the largest traction force."""


@dataclass(frozen=True, eq=False)
class _System:
    """Quadratic form of the changes of the sides that may move, and its linear constraints.

    Attributes
    ----------
    A : (N, N) csr, length / force
        Energy and weighted balance.
    descent : (N,) float64, length
    rows : (k, N) csr
        Constraints.
    weight, offset : (k,) float64
        Their weights in `A`, and their values before any change.
    free : (n, d, d) float64
        Projectors of the sides.
    scale : float, force
    """

    A: sp.csr_array
    descent: FloatArray
    rows: sp.csr_array
    weight: FloatArray
    offset: FloatArray
    free: FloatArray
    scale: float

    def solved(self) -> tuple[FloatArray, FloatArray]:
        """Solve for the change x with ``rows @ x + offset = 0`` to round-off; also the multipliers."""
        factor = factorize(self.A)
        x, push = np.zeros(len(self.descent)), self.weight * self.offset
        force = np.zeros(len(self.weight))
        for _ in range(UZAWA):
            x = self.projected(factor.solve(self.descent - self.rows.T @ push))
            gap = self.rows @ x + self.offset
            force = push + self.weight * (gap - self.offset)
            if np.abs(gap).max(initial=0.0) <= LEFT * (self.scale + np.abs(x).max(initial=0.0)):
                break
            push += self.weight * gap
        return x, force

    def projected(self, x: FloatArray) -> FloatArray:
        """Keep the directions that are free."""
        n, dim = self.free.shape[:2]
        return np.asarray(np.einsum("sij,saj->sai", self.free, x.reshape(n, -1, dim)).ravel(), np.float64)


def improve(target: Target, tau: FloatArray, cells: IntArray) -> None:
    """Replace the tractions between some cells, in place, by those of least energy of ``sigma_hat - sigma_h``.

    Parameters
    ----------
    target : Target
    tau : (n_sides, d, d) float64, force
        Balanced tractions, see `tractions.balanced_tractions`; still balanced afterwards, within the law of contact.
    cells : (k,) int64
        The sides between two of them, and those on the boundary that displacements hold, change.

    Raises
    ------
    TooLarge
        When the factor needs more memory than there is.

    Notes
    -----
    The equilibrated stresses of a mesh are those of stress functions, an unknown of fourth order: corrections that
    travel from star to star need some (size / h)^4 sweeps (a plate with a hole: 1.5 times the least estimate after 40
    sweeps of 576 triangles, a block with a crack: 1.22 times after ten of 384 tetrahedra), while one sparse factor
    costs less than a sweep of some thousand tetrahedra. The rigid balances of the cells are constraints,
    by an augmented Lagrangian. Tractions that leave the law of contact are pushed back by stiff springs, as long as
    they push (semi-smooth Newton); where friction is at its bound g the multiplier p of ``|R_t| <= g`` also resists
    turning, with p / g. What they leave is cut from
    the last change that keeps the balance.

    Source
    ------
    Fraeijs de Veubeke 1965 (dual analysis); Johnson and Mercier 1978; Hueber and Wohlmuth 2005 (active sets).

    Cost
    ----
    One sparse factor of 4 unknowns a side in a plane, 9 in space; with limits, one for each set of corners that are
    pushed back.
    """
    mesh = target.mesh
    count = np.bincount(mesh.side[cells].ravel(), minlength=len(mesh.nodes))
    inner = (count == 2) | ((count == 1) & (mesh.cell[:, 1] < 0))
    moved = np.flatnonzero(inner & target.free.any(axis=(1, 2)))
    if not len(moved):
        return
    system, stiff = _assembled(target, tau, cells, moved)
    x, _ = system.solved()
    if target.limits is not None and (np.abs(target.limits.normal[moved]) > 0).any():
        x = _within(system, x, tau[moved], target.limits, moved, stiff)
    tau[moved] += x.reshape(len(moved), *tau.shape[1:])


def _assembled(target: Target, tau: FloatArray, cells: IntArray, moved: IntArray) -> tuple[_System, float]:
    """Assemble the form of the sides `moved`, and the stiffness that keeps them within the law."""
    mesh, dim, m = target.mesh, target.mesh.dim, len(cells)
    n, block, size = dim + 1, dim * dim, len(moved) * dim * dim
    number = np.full(len(mesh.nodes), -1)
    number[moved] = np.arange(len(moved))
    place = number[mesh.side[cells]]
    known = place >= 0
    sign = np.repeat(mesh.sign[cells], block, axis=1)

    H, B = energy_matrices(mesh, target.compliance, cells), balance_rows(mesh, cells)
    trace = np.trace(H, axis1=1, axis2=2)
    stiff = STOP * float(trace.sum()) / (m * n * block)
    weight = PENALTY * trace / (B**2).sum(axis=(1, 2))
    jump = jumps(mesh, tau, target.aim.mean, cells).reshape(m, -1)
    slope = np.einsum("mij,mj->mi", H, jump) - target.aim.pull[cells]
    H += weight[:, None, None] * np.matmul(B.swapaxes(1, 2), B)
    H *= sign[:, :, None] * sign[:, None]
    B *= sign[:, None]
    where = (np.where(known, place, 0)[:, :, None] * block + np.arange(block)).reshape(m, -1)
    mine = np.repeat(known, block, axis=1)
    descent = np.bincount(where[mine], (-sign * slope)[mine], minlength=size).astype(np.float64)
    if target.limits is not None:
        descent -= target.limits.slide[moved].ravel()

    free = target.free[moved]
    partly = np.abs(free - np.eye(dim)).max(axis=(1, 2)) > 0
    H, B = H.reshape(m, n, block, n, block), B.reshape(m, -1, n, block)
    rows, side = np.nonzero(known & partly[place])
    for k in range(n):
        some = rows[side == k]
        P = np.kron(np.eye(dim), free[place[some, k]])
        H[some, k] = np.einsum("qij,qjkl->qikl", P, H[some, k], optimize=True)
        H[some, :, :, k] = np.einsum("qkij,qjl->qkil", H[some, :, :, k], P, optimize=True)
        B[some, :, k] = np.matmul(B[some, :, k], P)
    entry = np.flatnonzero(np.repeat(mine[:, None], B.shape[1], axis=1).ravel())
    column = np.repeat(where[:, None], B.shape[1], axis=1).ravel()[entry]
    start = np.concatenate([[0], np.cumsum(np.repeat(mine.sum(axis=1), B.shape[1]))])
    balance = sp.csr_array((B.ravel()[entry], column, start), shape=(m * B.shape[1], size))
    A = _blocks(H, place, len(moved))
    if partly.any():
        held = (np.eye(dim) - free[partly]) * float(np.median(A.diagonal()))
        at = (np.flatnonzero(partly)[:, None] * dim + np.arange(dim)).ravel()
        A = sp.csr_array(A + _diagonal(np.repeat(held, dim, axis=0), at, size))
    weights = np.repeat(weight, B.shape[1])
    system = _System(A, descent, balance, weights, np.zeros(len(weights)), free, float(np.abs(tau).max(initial=0.0)))
    return replace(system, descent=system.projected(descent)), stiff


def _blocks(H: FloatArray, place: IntArray, size: int) -> sp.csr_array:
    """Sum the blocks of cells, (m, n, b, n, b), on those of sides."""
    m, n, block = H.shape[:3]
    row, column = np.repeat(place, n, axis=1), np.tile(place, (1, n))
    lower = (column >= 0) & (row >= column)
    key = row[lower] * np.int64(size) + column[lower]
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    values = H.transpose(0, 1, 3, 2, 4).reshape(m, n * n, block, block)[lower][order]
    row, column = np.divmod(key[first], size)
    start = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=size))])
    total = np.add.reduceat(values, first, axis=0)
    A = sp.tril(sp.bsr_array((total, column, start), shape=(size * block, size * block)), format="csr")
    return sp.csr_array(A + sp.tril(A, -1).T)


def _diagonal(blocks: FloatArray, at: IntArray, size: int) -> sp.csr_array:
    """Build a matrix of blocks (k, d, d) at the rows of corners `at`, (k,), zero elsewhere."""
    d = blocks.shape[1]
    index = at[:, None] * d + np.arange(d)
    rows, columns = np.repeat(index, d, axis=1).ravel(), np.tile(index, (1, d)).ravel()
    return sp.coo_array((blocks.ravel(), (rows, columns)), shape=(size, size)).tocsr()


def _within(
    system: _System, x: FloatArray, tau: FloatArray, limits: Limits, sides: IntArray, stiff: float
) -> FloatArray:
    """Solve again with the corners that leave the law pushed back, until their set no longer changes."""
    n, dim = tau.shape[:2]
    k, size = len(system.weight), len(x)
    pushing, before = np.zeros((n, 2, dim), bool), np.zeros((n, 2, dim), bool)
    force = np.zeros((n, 2, dim))
    balanced = x
    for turn in range(SETS):
        ahead = tau + x.reshape(tau.shape)
        found = limits.passed(ahead, sides, pushing)
        reach = np.einsum("sij,si,sj->s", system.free[found[0]], found[3], found[3])
        row, corner, kind, direction, over = (each[reach > 0.5] for each in found)
        active = np.zeros_like(before)
        active[row, kind, corner] = True
        if np.array_equal(before, active) and limits.step(tau, x.reshape(tau.shape), sides).min() >= 1.0:
            break
        before, at = active, row * dim + corner
        push = force[row, kind, corner]
        slip = np.maximum(-np.einsum("si,si->s", direction, limits.slide[sides][row, corner]), 0.0)
        push = np.where(kind == 0, 0.0, push if turn else slip)
        along = np.einsum("si,si->s", direction, ahead[row, corner])
        bend = push / np.maximum(along, np.finfo(float).tiny)
        normal = limits.normal[sides[row]]
        across = np.eye(dim) - direction[:, :, None] * direction[:, None, :] - normal[:, :, None] * normal[:, None, :]
        turning = _diagonal(bend[:, None, None] * across, at, size)
        place = at[:, None] * dim + np.arange(dim)
        N = sp.csr_array((direction.ravel(), place.ravel(), np.arange(len(row) + 1) * dim), shape=(len(row), size))
        held = replace(
            system,
            A=sp.csr_array(system.A + stiff * (N.T @ N) + turning),
            descent=system.descent + turning @ x,
            rows=sp.csr_array(sp.vstack([system.rows, N])),
            weight=np.concatenate([system.weight, np.full(len(row), stiff)]),
            offset=np.concatenate([system.offset, over - N @ x]),
        )
        x, multipliers = held.solved()
        force = np.zeros_like(force)
        force[row, kind, corner] = multipliers[k:]
        pushing = force > 0
        # corners that cycle may be more than the balance leaves free
        if np.abs(system.rows @ x + system.offset).max(initial=0.0) <= MET * system.scale:
            balanced = x
    return balanced * float(limits.step(tau, balanced.reshape(tau.shape), sides).min(initial=1.0))
