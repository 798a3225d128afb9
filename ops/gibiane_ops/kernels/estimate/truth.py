"""Error of a finite-element stress against one that is known at every point, singular ones included."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.quadratic import LINEAR
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.zz import SolidError
from gibiane_ops.kernels.recovery import StressBlock, extrapolate

ENOUGH = 5e-4
"""Changes of the squared error by smaller parts, over the whole, that are small enough."""

MARKED = 0.9
"""Share of these changes that the parts to be cut again hold."""

LEVELS = 24
"""Largest number of cuts."""

# Beside the parts at the corners, those in between: by the corners of the parent, in pairs whose middles they are.
BETWEEN: dict[str, list[list[tuple[int, int]]]] = {
    "TRI3": [[(0, 1), (1, 2), (2, 0)]],
    "QUA4": [],
    "TET4": [
        [(0, 1), (0, 2), (0, 3), (1, 3)],
        [(0, 1), (1, 2), (0, 2), (1, 3)],
        [(0, 2), (0, 3), (1, 3), (2, 3)],
        [(0, 2), (1, 2), (2, 3), (1, 3)],
    ],
    "CUB8": [],
    "PRI6": [
        [(0, 1), (1, 2), (2, 0), (0, 4), (1, 5), (2, 3)],
        [(0, 4), (1, 5), (2, 3), (3, 4), (4, 5), (5, 3)],
    ],
}


@dataclass(frozen=True, eq=False)
class _Parts:
    """Parts of cells: images of the reference shape of first degree in that of the cells.

    Attributes
    ----------
    cell : (k,) int64
    corners : (k, n_corners, d) float64
        Reference coordinates in the cell.
    level : (k,) int64
        Number of cuts.
    """

    cell: IntArray
    corners: FloatArray
    level: IntArray

    def cut(self, name: str) -> _Parts:
        """Cut each in 2^d, one after the other."""
        n = self.corners.shape[1]
        weights = [(np.eye(n) + np.eye(n)[k]) / 2 for k in range(n)]
        weights += [np.stack([(np.eye(n)[a] + np.eye(n)[b]) / 2 for a, b in part]) for part in BETWEEN[name]]
        corners = np.matmul(np.stack(weights), self.corners[:, None])
        count = len(weights)
        return _Parts(
            np.repeat(self.cell, count), corners.reshape(-1, n, corners.shape[-1]), np.repeat(self.level + 1, count)
        )

    def taken(self, some: IntArray) -> _Parts:
        """Return some of them."""
        return _Parts(self.cell[some], self.corners[some], self.level[some])


def exact_error(
    points: FloatArray,
    block: StressBlock,
    exact: Callable[[FloatArray], FloatArray],
    compliance: FloatArray,
    *,
    axisymmetric: bool = False,
) -> SolidError:
    """Compare the stresses of a block with an exact stress, cell by cell.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    block : StressBlock
    exact : callable
        ``exact(x)`` with x : (k, dim) gives the stress there, (k, c).
    compliance : (c, c) or (m, c, c) float64, length^2 / force
    axisymmetric : bool

    Returns
    -------
    SolidError

    Notes
    -----
    Parts of cells are cut into parts half as large where this changes the squared error most, until the changes are
    negligible: the four points in each cell that holds the corner of an L see 88 % of the squared error only, at the
    tip of a crack 90 %. A pyramid is not cut.

    Cost
    ----
    The exact stress at the points of the mass rule, in each cell and each half; some ten cuts around a singular point.
    """
    of = block.shape
    linear = shape(LINEAR.get(of.name, of.name))
    m, n_corners = len(block.cells), of.n_corners
    where = np.broadcast_to(of.ref_nodes[:n_corners], (m, n_corners, of.dim))
    parts = _Parts(np.arange(m), where, np.zeros(m, np.int64))
    nodal = extrapolate(of, block.stress)
    law = np.broadcast_to(compliance, (m, *compliance.shape[-2:]))

    def integrated(parts: _Parts) -> FloatArray:
        return _integrals(linear, points, block, nodal, exact, law, parts, axisymmetric)

    coarse = integrated(parts)
    total = np.zeros((m, 3))
    if linear.name not in BETWEEN:
        total = coarse
        parts = parts.taken(np.zeros(0, np.int64))
    while len(parts.cell):
        halves = parts.cut(linear.name)
        fine = integrated(halves)
        each = len(halves.cell) // len(parts.cell)
        change = np.abs(fine.reshape(-1, each, 3)[..., 0].sum(axis=1) - coarse[:, 0])
        whole = total[:, 0].sum() + fine[:, 0].sum()
        order = np.argsort(-change, kind="stable")
        count = int(np.searchsorted(np.cumsum(change[order]), MARKED * change.sum())) + 1
        again = np.zeros(len(change), bool)
        if change.sum() > ENOUGH * whole:
            again[order[:count]] = True
        more = np.repeat(again & (parts.level < LEVELS), each)
        np.add.at(total, halves.cell[~more], fine[~more])
        parts, coarse = halves.taken(np.flatnonzero(more)), fine[more]
    return SolidError(*(np.ascontiguousarray(column) for column in total.T))


def _integrals(
    linear: Shape,
    points: FloatArray,
    block: StressBlock,
    nodal: FloatArray,
    exact: Callable[[FloatArray], FloatArray],
    compliance: FloatArray,
    parts: _Parts,
    axisymmetric: bool,
) -> FloatArray:
    """Integrate the energies of the difference, of the stress, and of the sum over parts, (k, 3)."""
    of, rule, X = block.shape, block.shape.mass_rule, points[block.cells[parts.cell]]
    k, q, dim = len(parts.cell), len(rule.weights), of.dim
    xi = np.matmul(linear.N(rule.points), parts.corners).reshape(-1, dim)
    N = of.N(xi).reshape(k, q, -1)
    J = np.einsum("kqnj,kni->kqij", of.dN(xi).reshape(k, q, -1, dim), X, optimize=True)
    x = np.matmul(N, X)
    density = np.abs(np.linalg.det(J)) * rule.weights * (0.5 ** (dim * parts.level))[:, None]
    if axisymmetric:
        density = density * (2 * np.pi * x[:, :, 0])
    raw = np.matmul(N, nodal[parts.cell])
    true = exact(x.reshape(-1, dim)).reshape(k, q, -1)
    law = compliance[parts.cell]

    def energy(s: FloatArray) -> FloatArray:
        return np.asarray((density * (np.matmul(s, law) * s).sum(axis=2)).sum(axis=1), np.float64)

    return np.stack([energy(true - raw), energy(raw), energy(true + raw)], axis=1)
