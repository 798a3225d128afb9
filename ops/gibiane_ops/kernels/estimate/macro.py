"""Symmetric stresses on triangles and tetrahedra cut by their centroid, from the tractions on their sides."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations
from math import factorial

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray

# In-plane components of a stress vector ``xx yy zz xy (xz yz)``: the only ones that tractions see.
STATIC = {2: (0, 1, 3), 3: (0, 1, 2, 3, 4, 5)}
PAIRS = {2: ((0, 0), (1, 1), (0, 1)), 3: ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))}


def contraction(vector: FloatArray, dim: int) -> FloatArray:
    """Build the matrix that applies a stress to a vector, ``sigma . v = A s``.

    Parameters
    ----------
    vector : (..., dim) float64
    dim : int

    Returns
    -------
    (..., dim, n_s) float64
        For the components s of `STATIC`.
    """
    A = np.zeros((*vector.shape, len(PAIRS[dim])))
    for k, (i, j) in enumerate(PAIRS[dim]):
        A[..., i, k] += vector[..., j]
        if i != j:
            A[..., j, k] += vector[..., i]
    return A


def turned(F: FloatArray) -> FloatArray:
    """Build the matrix of ``s -> F s F^T`` on stress components.

    Parameters
    ----------
    F : (..., dim, dim) float64

    Returns
    -------
    (..., n_s, n_s) float64
    """
    pairs = PAIRS[F.shape[-1]]
    T = np.empty((*F.shape[:-2], len(pairs), len(pairs)))
    for row, (i, j) in enumerate(pairs):
        for column, (p, q) in enumerate(pairs):
            term = F[..., i, p] * F[..., j, q]
            T[..., row, column] = term if p == q else term + F[..., i, q] * F[..., j, p]
    return T


def moments(dim: int) -> FloatArray:
    """Return ``int N_i N_j / measure`` of a side with `dim` corners."""
    return (np.eye(dim) + 1.0) / (dim * (dim + 1))


@dataclass(frozen=True, eq=False)
class MacroElement:
    """The reference element: barycentric cut in dim + 1 parts, a linear symmetric stress in each.

    Attributes
    ----------
    dim : int
    stress : (dim + 1, dim + 1, n_s, n_t) float64
        Stress at each corner of each part, from the tractions. Part k holds side k, the one that faces corner k; its
        corners are those of the element, corner k replaced by the centroid.

    Notes
    -----
    The n_t tractions are ordered by side, corner of the side (increasing), component; each is multiplied by the
    measure of its side, so that ``tau_ref = F^-1 tau`` for the affine map of matrix F (Piola:
    ``sigma = F sigma_ref F^T / |det F|``). They must have no resultant moment; their resultant force is balanced by a
    uniform body force. Tractions are continuous between the parts and the mean stress is what the tractions impose, so
    that the divergence is uniform in the element.

    Source
    ------
    Johnson and Mercier 1978; Krizek 1982; Gopalakrishnan, Guzman and Lee 2024.
    """

    dim: int
    stress: FloatArray

    @property
    def n_tractions(self) -> int:
        """Number of tractions, ``dim^2 (dim + 1)``."""
        return self.dim * self.dim * (self.dim + 1)

    @cached_property
    def energies(self) -> FloatArray:
        """Matrices of ``int s_a s_b``, (n_s (n_s + 1) / 2, n_t^2): upper triangle of a compliance, by rows."""
        n, n_s = self.dim + 1, len(PAIRS[self.dim])
        weight = (np.eye(n) + 1.0) / (n * (n + 1)) / (factorial(self.dim) * n)
        R = self.stress
        gram = np.einsum("pq,kpax,kqby->abxy", weight, R, R, optimize=True)
        rows = [gram[a, b] + (gram[b, a] if a != b else 0.0) for a in range(n_s) for b in range(a, n_s)]
        return np.stack(rows).reshape(len(rows), -1)

    @cached_property
    def divergence(self) -> FloatArray:
        """Divergence of the stress in each part, (dim + 1, dim, n_t)."""
        n, dim = self.dim + 1, self.dim
        corners = np.vstack([np.zeros(dim), np.eye(dim)])
        A = np.stack([contraction(_gradients(_part(corners, k)), dim) for k in range(n)])
        return np.asarray(np.einsum("kpis,kpst->kit", A, self.stress), np.float64)


def _part(X: FloatArray, k: int) -> FloatArray:
    """Return the corners of part k of a simplex."""
    part = X.copy()
    part[k] = X.mean(axis=0)
    return part


def _gradients(X: FloatArray) -> FloatArray:
    """Return the gradients of the barycentric coordinates of one simplex, (dim + 1, dim)."""
    return np.asarray(np.linalg.inv(np.hstack([np.ones((len(X), 1)), X]))[1:].T, np.float64)


@lru_cache
def macro_element(dim: int) -> MacroElement:
    """Build the reference element of a dimension.

    Parameters
    ----------
    dim : {2, 3}

    Returns
    -------
    MacroElement

    Notes
    -----
    (dim + 1)^2 n_s stress values (27 or 96), as many equations: tractions given on the sides, continuous on the inner
    sides, and mean stress ``sym(int tau (x - x_c))``.

    Cost
    ----
    One dense solution of that size, once a session.
    """
    n, n_s, pairs = dim + 1, len(PAIRS[dim]), PAIRS[dim]
    X = np.vstack([np.zeros(dim), np.eye(dim)])
    slope = _gradients(X)
    volume = 1.0 / factorial(dim)
    n_t = n * dim * dim
    equations: list[FloatArray] = []
    right: list[FloatArray] = []

    def row() -> FloatArray:
        return np.zeros((dim, n, n, n_s))

    for k in range(n):
        for a, corner in enumerate(c for c in range(n) if c != k):
            left = row()
            left[:, k, corner] = contraction(-dim * volume * slope[k], dim)
            given = np.zeros((dim, n, dim, dim))
            given[:, k, a] = np.eye(dim)
            equations.append(left.reshape(dim, -1))
            right.append(given.reshape(dim, -1))
    for k, m in combinations(range(n), 2):
        across = contraction(slope[k] - slope[m], dim)
        shared = [(c, c) for c in range(n) if c not in (k, m)] + [(k, m)]
        for mine, theirs in shared:
            left = row()
            left[:, k, mine] = across
            left[:, m, theirs] -= across
            equations.append(left.reshape(dim, -1))
            right.append(np.zeros((dim, n_t)))
    for s, (i, j) in enumerate(pairs):
        left = np.zeros((n, n, n_s))
        left[:, :, s] = volume / (n * n)
        given = np.zeros((n, dim, dim))
        for k in range(n):
            lever = moments(dim) @ (np.delete(X, k, axis=0) - X.mean(axis=0))
            given[k, :, i] += lever[:, j] / 2
            given[k, :, j] += lever[:, i] / 2
        equations.append(left.reshape(1, -1))
        right.append(given.reshape(1, -1))
    solved = np.linalg.solve(np.vstack(equations), np.vstack(right))
    return MacroElement(dim, solved.reshape(n, n, n_s, n_t))
