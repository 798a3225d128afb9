"""Algebraic multigrid by smoothed aggregation, for conjugate gradients on elastic solids.

Every level is scaled to a unit diagonal. The cycle runs in single precision: it only has to come near the inverse, and
reads half the memory; the iteration around it is in double precision.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray, IntArray

COARSEST = 400
"""Unknowns below which a level is solved by a dense inverse."""

DEGREE = 3
"""Degree of the Chebyshev polynomial that smooths before and after the correction of the coarser level."""

SMOOTHED = 20.0
"""The polynomial damps the eigenvalues between the largest one and the largest one over this number."""

DEPENDENT = 1e-7
"""A near-null vector is left out of an aggregate where the others give it to this accuracy."""

Single = np.ndarray[tuple[int, ...], np.dtype[np.float32]]


@dataclass(frozen=True, eq=False)
class Level:
    """One grid.

    Attributes
    ----------
    A : (n, n) csr_array, float32
        Matrix with a unit diagonal.
    P, R : (n, n_coarse) and (n_coarse, n) csr_array, float32
        Prolongation from the next level, and its transpose.
    radius : float
        Bound of the eigenvalues of A.
    """

    A: sp.csr_array
    P: sp.csr_array
    R: sp.csr_array
    radius: float


class Multigrid:
    """A V-cycle for a symmetric positive definite matrix.

    Parameters
    ----------
    A : (n, n) sparse, symmetric
    near_null : (n, k) float64 or None
        Vectors that A hardly sees before supports are imposed: the rigid-body modes. By default constants, one for
        each unknown of a node.
    block : int
        Unknowns per node; nodes are kept whole.

    Attributes
    ----------
    levels : list of Level
        Finest first.

    Notes
    -----
    Nodes are gathered with their neighbours; the near-null vectors of each aggregate, made orthonormal, interpolate,
    and one step of damped Jacobi smooths them: ``P = (I - 4/3 A / radius) T``.

    Source
    ------
    Vanek, Mandel and Brezina, Computing 56, 1996; Adams, Brezina, Hu and Tuminaro, J. Comput. Phys. 188, 2003
    (polynomial smoothing).

    Cost
    ----
    Linear in the entries of A, in time and memory: setting up takes as long as some 150 products by A, a cycle as 8.
    """

    def __init__(self, A: sp.sparray, near_null: FloatArray | None, block: int) -> None:
        n = A.shape[0]
        matrix = A.tobsr(blocksize=(block, block))
        modes = np.tile(np.eye(block), (n // block, 1)) if near_null is None else near_null
        self.levels: list[Level] = []
        matrix, self._scale = _scaled(matrix)
        modes = modes / np.where(self._scale > 0, self._scale, 1.0)[:, None]
        while matrix.shape[0] > COARSEST:
            label = aggregate(_node_graph(matrix))
            count = int(label.max(initial=-1)) + 1
            if count == 0 or count * modes.shape[1] > matrix.shape[0] // 2:
                break
            T, coarse_modes = _orthonormal(modes, label, count, matrix.blocksize[0])
            fine = sp.csr_array(_single(matrix).tocsr())
            radius = _radius(fine)
            P = T - (matrix @ T) * (4.0 / 3.0 / radius)
            coarse, scale = _scaled((P.T @ (matrix @ P)).tobsr(blocksize=(modes.shape[1],) * 2))
            weights = sp.diags_array(scale, format="csr")
            prolongation = sp.csr_array((P.tocsr() @ weights).astype(np.float32))
            self.levels.append(Level(fine, prolongation, sp.csr_array(prolongation.T), radius))
            modes = coarse_modes / np.where(scale > 0, scale, 1.0)[:, None]
            matrix = coarse
        # a motion that nothing holds leaves the last level singular; one that does not coarsen is as good as diagonal
        self._last: Single | sp.dia_array = (
            np.linalg.pinv(matrix.toarray(), rcond=1e-12, hermitian=True).astype(np.float32)
            if matrix.shape[0] <= 10 * COARSEST
            else sp.diags_array(np.ones(matrix.shape[0], np.float32))
        )
        self._columns = self._scale[:, None]

    def __call__(self, r: FloatArray) -> FloatArray:
        """Apply one cycle to residuals, (n,) or (n, k) float64, each of any size."""
        scale = self._scale if r.ndim == 1 else self._columns
        size = np.abs(r).max(axis=0)
        size = np.where(size > 0, size, 1.0)
        found = self._cycle(0, (scale * r / size).astype(np.float32))
        return np.asarray(scale * found * size, np.float64)

    def _cycle(self, depth: int, b: Single) -> Single:
        if depth == len(self.levels):
            return np.asarray(self._last @ b)
        level = self.levels[depth]
        x = _chebyshev(level, b, None)
        x += level.P @ self._cycle(depth + 1, level.R @ (b - level.A @ x))
        return _chebyshev(level, b, x)


def _chebyshev(level: Level, b: Single, x: Single | None) -> Single:
    """Improve x for the upper part of the spectrum (Saad, Iterative Methods, algorithm 12.1); None is zero."""
    single = np.float32
    middle = level.radius * (1 + 1 / SMOOTHED) / 2
    half = level.radius * (1 - 1 / SMOOTHED) / 2
    r = b if x is None else b - level.A @ x
    ratio = half / middle
    d = r * single(1 / middle)
    x = d.copy() if x is None else x + d
    for _ in range(DEGREE - 1):
        r = r - level.A @ d
        new = 1 / (2 * middle / half - ratio)
        d = d * single(new * ratio) + r * single(2 * new / half)
        ratio = new
        x += d
    return x


def aggregate(graph: sp.csr_array) -> IntArray:
    """Gather nodes with their neighbours.

    Parameters
    ----------
    graph : (n, n) csr_array
        Pattern of a symmetric matrix with its diagonal.

    Returns
    -------
    (n,) int64
        Aggregate of each node, from 0; -1 for a node without neighbour, which the smoother solves exactly.

    Notes
    -----
    A node none of whose neighbours is taken makes an aggregate of them; the nodes between aggregates join one
    beside them.
    """
    n = graph.shape[0]
    starts, indices = graph.indptr.tolist(), graph.indices
    label = np.full(n, -1)
    taken = bytearray(n)
    is_taken = np.frombuffer(taken, np.uint8)
    count = 0
    for i in range(n):
        if taken[i]:
            continue
        near = indices[starts[i] : starts[i + 1]]
        if len(near) > 1 and not is_taken[near].any():
            is_taken[near] = 1
            label[near] = count
            count += 1
    beside = np.maximum.reduceat(label[indices], graph.indptr[:-1]) if n else label
    label = np.where(label < 0, beside, label)
    for i in np.flatnonzero((label < 0) & (np.diff(graph.indptr) > 1)).tolist():
        if label[i] < 0:
            near = indices[starts[i] : starts[i + 1]]
            label[near[label[near] < 0]] = count
            count += 1
    return label


def _single(matrix: sp.bsr_array) -> sp.bsr_array:
    return sp.bsr_array((matrix.data.astype(np.float32), matrix.indices, matrix.indptr), shape=matrix.shape)


def _scaled(matrix: sp.bsr_array) -> tuple[sp.bsr_array, FloatArray]:
    """Scale rows and columns to a unit diagonal; give the matrix and the factors, 0 where the diagonal is 0."""
    diagonal = matrix.diagonal()
    # a combination of near-null vectors that an aggregate has not leaves an empty row
    known = diagonal > 1e-14 * diagonal.max(initial=0.0)
    scale = np.where(known, 1 / np.sqrt(np.where(known, diagonal, 1.0)), 0.0)
    d = scale.reshape(-1, matrix.blocksize[0])
    row = np.repeat(np.arange(len(d)), np.diff(matrix.indptr))
    data = matrix.data * d[row][:, :, None]
    data *= d[matrix.indices][:, None, :]
    return sp.bsr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape), scale


def _node_graph(matrix: sp.bsr_array) -> sp.csr_array:
    """Give the pattern of the blocks that are not zero, with the diagonal."""
    n = matrix.shape[0] // matrix.blocksize[0]
    row = np.repeat(np.arange(n), np.diff(matrix.indptr))
    filled = (matrix.data != 0).any(axis=(1, 2)) | (row == matrix.indices)
    indptr = np.r_[0, np.cumsum(np.bincount(row[filled], minlength=n))]
    return sp.csr_array((np.ones(int(filled.sum()), np.int8), matrix.indices[filled], indptr), shape=(n, n))


def _orthonormal(modes: FloatArray, label: IntArray, count: int, block: int) -> tuple[sp.bsr_array, FloatArray]:
    """Make the near-null vectors of each aggregate orthonormal: columns of T, and what gives the vectors back."""
    k = modes.shape[1]
    members = np.flatnonzero(label >= 0)
    members = members[np.argsort(label[members], kind="stable")]
    sizes = np.bincount(label[members], minlength=count)
    first = np.r_[0, np.cumsum(sizes)][:-1]
    by_node = modes.reshape(-1, block, k)
    values = np.zeros((len(label), block, k))
    coarse = np.zeros((count, k, k))
    # aggregates of about the same size are treated together, padded with zeros
    for power in np.unique(np.ceil(np.log2(np.maximum(sizes, 1))).astype(int)).tolist():
        chosen = np.flatnonzero((sizes <= 2**power) & (2 * sizes > 2**power))
        slot = np.arange(max(2**power, -(-k // block)))
        inside = slot < sizes[chosen][:, None]
        nodes = members[np.where(inside, first[chosen][:, None] + slot, 0)]
        stacked = np.where(inside[:, :, None, None], by_node[nodes], 0.0).reshape(len(chosen), -1, k)
        Q, upper = np.linalg.qr(stacked)
        pivot = np.abs(np.diagonal(upper, axis1=1, axis2=2))
        free = pivot > DEPENDENT * np.linalg.norm(stacked, axis=1).max(axis=1)[:, None]
        coarse[chosen] = np.where(free[:, :, None], upper, 0.0)
        Q = np.where(free[:, None, :], Q, 0.0).reshape(len(chosen), len(slot), block, k)
        values[nodes[inside]] = Q[inside]
    indptr = np.r_[0, np.cumsum(label >= 0)]
    T = sp.bsr_array((values[label >= 0], label[label >= 0], indptr), shape=(modes.shape[0], count * k))
    return T, coarse.reshape(count * k, k)


def _radius(A: sp.csr_array) -> float:
    """Bound the largest eigenvalue: that of ten steps of Lanczos (Golub and Van Loan, chapter 10), and a margin."""
    steps = min(10, A.shape[0])
    v = np.random.default_rng(0).standard_normal(A.shape[0])
    v /= np.linalg.norm(v)
    before, beta = np.zeros_like(v), 0.0
    diagonal, beside = [], []
    for _ in range(steps):
        w = A @ v.astype(np.float32) - beta * before
        diagonal.append(float(w @ v))
        w -= diagonal[-1] * v
        beta = float(np.linalg.norm(w))
        if beta < 1e-6:
            break
        beside.append(beta)
        before, v = v, w / beta
    k = len(diagonal)
    T = np.diag(diagonal) + np.diag(beside[: k - 1], 1) + np.diag(beside[: k - 1], -1)
    return 1.1 * float(np.linalg.eigvalsh(T)[-1])
