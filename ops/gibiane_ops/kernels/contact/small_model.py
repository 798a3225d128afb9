"""A small Galerkin model of tied bodies: exact near the contact, a coarse grid in each body farther away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.solve import Factor, factorize

BoolArray = NDArray[np.bool_]

RINGS = 3
"""Layers of nodes around the contact that are kept."""

CELLS = 512
"""Cells of the coarse grid of a body."""

NODES_PER_CELL = 8
"""Nodes of the mesh that a cell holds at least on average."""

SHIFT = 1e-13
"""Share of its diagonal added to the small matrix: on odd meshes some coarse functions depend on others."""

BLOCK = 32
"""Right-hand sides solved together: of 867 on 13 600 unknowns, 0.9 s by 32, 1.2 s by 64 or 16."""


@dataclass(frozen=True, eq=False)
class SmallModel:
    """Displacements ``P q`` of the tied bodies, and the Schur complement on w among them.

    Attributes
    ----------
    P : (n_v, n_q) csr_array
    factor : Factor
        Of ``P^T A P``, A the tied matrix.
    S : (n d, n d) float64
        ``Kww - Kwv P (P^T A P)^-1 P^T Kvw``, not below the exact one: as stiff or stiffer.
    """

    P: sp.csr_array
    factor: Factor
    S: FloatArray

    def solve(self, b: FloatArray) -> FloatArray:
        """Solve ``A x = b`` as well as the small model can."""
        return np.asarray(self.P @ self.factor.solve(np.asarray(self.P.T @ b)))


def small_model(A: sp.csr_array, Kvw: sp.csr_array, Kww: FloatArray, P: sp.csr_array, columns: IntArray) -> SmallModel:
    """Condense the small model on the pairs.

    Parameters
    ----------
    A : (n_v, n_v) csr_array
    Kvw : (n_v, n d) csr_array
    Kww : (n d, n d) float64
        Changed: becomes S.
    P : (n_v, n_q) csr_array
        From ``interpolation``.
    columns : (k,) int64
        Active components of w.

    Returns
    -------
    SmallModel

    Cost
    ----
    A factorisation and as many back substitutions as components of w, of a matrix some twenty times smaller than A.
    """
    Pt = P.T.tocsr()
    small = sp.csr_array(Pt @ (A @ P))
    small = sp.csr_array(small + sp.diags_array(SHIFT * small.diagonal()))
    factor = factorize(small)
    right = sp.csc_array(Pt @ Kvw)
    S = schur(factor, sp.csr_array(right), Kww, columns)
    return SmallModel(P, factor, S)


class Solver(Protocol):
    """Anything that solves with a matrix."""

    def solve(self, b: FloatArray) -> FloatArray:
        """Solve for one or several right-hand sides."""
        ...


def schur(factor: Solver, Kvw: sp.csr_array, S: FloatArray, columns: IntArray) -> FloatArray:
    """Subtract ``Kwv Kvv^-1 Kvw`` from S by blocks of columns; only the rows that Kvw touches are kept."""
    rows = np.flatnonzero(np.diff(Kvw.indptr))
    touched = Kvw[rows].T.tocsr()
    right = Kvw.tocsc()
    for start in range(0, len(columns), BLOCK):
        block = columns[start : start + BLOCK]
        X = factor.solve(right[:, block].toarray())
        S[:, block] -= touched @ X[rows]
    return np.asarray((S + S.T) / 2)


def interpolation(A: sp.csr_array, near: BoolArray, body: IntArray, points: FloatArray, axis: IntArray) -> sp.csr_array:
    """Interpolate the unknowns far from the contact on a coarse grid in each body, and keep the others.

    Parameters
    ----------
    A : (n, n) csr_array
        Tied matrix, whose entries tell which unknowns are neighbours.
    near : (n,) bool
        Unknowns on the contact.
    body : (n,) int64
        Body of each unknown: no coarse function straddles two, so that their relative motions stay free.
    points : (n, d) float64
        Coordinates of the node of each unknown.
    axis : (n,) int64
        Its component.

    Returns
    -------
    (n, n_q) csr_array
        Kept unknowns first.

    Notes
    -----
    Multilinear functions on the box around each body; they reproduce rigid motions. The unknowns within ``RINGS``
    layers of the contact are kept.
    """
    kept, front = near.copy(), near
    for _ in range(RINGS):
        reached = np.zeros(len(near), bool)
        reached[A[np.flatnonzero(front)].indices] = True
        front = reached & ~kept
        kept |= reached
    own = np.flatnonzero(kept)
    rows, columns, values = [own], [np.arange(len(own))], [np.ones(len(own))]
    start = len(own)
    for name in np.unique(body[~kept]):
        far = np.flatnonzero(~kept & (body == name))
        place, weight, n = _on_grid(points[far], points[body == name], len(far))
        rows.append(np.repeat(far, place.shape[1]))
        columns.append((start + place + n * axis[far][:, None]).ravel())
        values.append(weight.ravel())
        start += n * points.shape[1]
    row, column, value = np.concatenate(rows), np.concatenate(columns), np.concatenate(values)
    used = value > 1e-12
    _, column = np.unique(column[used], return_inverse=True)
    return sp.csr_array((value[used], (row[used], column)), shape=(len(near), int(column.max(initial=-1)) + 1))


def _on_grid(x: FloatArray, whole: FloatArray, n_unknowns: int) -> tuple[IntArray, FloatArray, int]:
    """Give the grid points around each x, their weights, and how many points the grid has."""
    d = x.shape[1]
    low, size = whole.min(axis=0), np.ptp(whole, axis=0)
    size = np.where(size > 1e-9 * size.max(initial=0.0), size, size.max(initial=0.0) or 1.0)
    cells = max(1, min(CELLS, n_unknowns // (d * NODES_PER_CELL)))
    count = np.maximum(1, np.round(size / (size.prod() / cells) ** (1 / d))).astype(np.int64)
    at = np.clip((x - low) / size, 0.0, 1.0) * count
    cell = np.minimum(at.astype(np.int64), count - 1)
    rest = at - cell
    places, weights = [], []
    for corner in np.ndindex(*([2] * d)):
        weights.append(np.where(corner, rest, 1 - rest).prod(axis=1))
        places.append(np.ravel_multi_index(tuple((cell + corner).T), tuple(count + 1)))
    return np.stack(places, axis=1).astype(np.int64), np.stack(weights, axis=1), int((count + 1).prod())
