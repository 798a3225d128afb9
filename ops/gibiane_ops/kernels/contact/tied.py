"""Solutions with the matrix of the tied bodies, by a factor or by iterations to any accuracy."""

from __future__ import annotations

import time

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.choice import factor_is_faster
from gibiane_ops.kernels.rigid import rigid_modes
from gibiane_ops.kernels.solve import ITERATIVE, Factor, factorize

PASS = 1e-4
"""Relative residual of one pass of iterations: the contact iterations need no more from most of them."""

PRECISION = 1e-10
"""Relative residual of a complete solution by iterations."""

SLOW = 40
"""Iterations of the trial solution from which multigrid does badly: uniform meshes take 8 to 15, flat ones hundreds."""

PASSES = 12
"""Passes after which iterations that do not reach ``PRECISION`` are given up."""


class TiedSolver:
    """The tied matrix and what solves with it.

    Attributes
    ----------
    A : (n, n) csr_array
    factor : Factor
    passes : int
        Solutions so far, a pass of iterations counting as one.
    seconds : float
        Duration of the fastest of them.
    """

    def __init__(self, A: sp.csr_array, factor: Factor, place: IntArray | None = None) -> None:
        self.A = A
        self.factor = factor
        self.passes = 0
        self.iterations = 0
        self.seconds = float("inf")
        self._place = place

    @property
    def direct(self) -> bool:
        """Whether a factor gives exact solutions."""
        return self.factor.name not in ITERATIVE

    @property
    def exact(self) -> bool:
        """Whether one solution leaves no more than round-off."""
        return self.direct and self.factor.name != "single"

    def once(self, b: FloatArray, tolerance: float | None = None) -> FloatArray:
        """Solve exactly with a factor, to the relative residual ``PASS`` by iterations.

        What iterates, a factor in single precision too, stops at the tolerance if one is given.
        """
        start = time.perf_counter()
        if self._place is None:
            x = self.factor.solve(b, tolerance)
        else:
            padded = np.zeros((self.factor.shape[0], *b.shape[1:]))
            padded[self._place] = b
            x = np.asarray(self.factor.solve(padded, tolerance)[self._place])
        self.seconds = min(self.seconds, time.perf_counter() - start)
        self.passes += 1
        self.iterations += self.factor.iterations
        return x

    def solve(self, b: FloatArray) -> FloatArray:
        """Solve ``A x = b`` for one or several right-hand sides, to ``PRECISION``.

        Parameters
        ----------
        b : (n,) or (n, k) float64

        Returns
        -------
        (n,) or (n, k) float64
        """
        x = self.once(b)
        if self.direct:
            return x
        size = np.linalg.norm(b, axis=0)
        for _ in range(PASSES):
            rest = b - self.A @ x
            if (np.linalg.norm(rest, axis=0) <= PRECISION * size).all():
                break
            x = x + self.once(rest)
        return x


def tied_solver(
    A: sp.csr_array, *, method: str = "auto", roots: IntArray | None = None, points: FloatArray | None = None
) -> TiedSolver:
    """Factorise the tied matrix, or prepare a multigrid preconditioner for it.

    Parameters
    ----------
    A : (n, n) csr_array, symmetric positive definite
    method : str
        See ``factorize``.
    roots : (n,) int64, optional
        Component c of node i, ``d i + c``, that each unknown is; for iterations.
    points : (n_nodes, d) float64, optional
        Coordinates of the nodes; for iterations.

    Returns
    -------
    TiedSolver

    Notes
    -----
    Multigrid wants whole nodes: unknowns that a node has not are added with an empty row and column, and its rigid
    modes vanish there. Where its trial solution takes many iterations, as with elements that are graded or flat, a
    factor takes its place if it fits.

    Cost
    ----
    See ``factorize``.
    """
    if method not in ITERATIVE or roots is None or points is None or (roots < 0).any():
        return TiedSolver(A, factorize(A, method="auto" if method in ITERATIVE else method))
    d = points.shape[1]
    nodes, inverse = np.unique(roots // d, return_inverse=True)
    place = inverse * d + roots % d
    size = len(nodes) * d
    missing = np.setdiff1d(np.arange(size), place)
    # rows of A in the order of the padded unknowns, then the columns renamed: no sort of the entries by value
    order = np.argsort(place)
    rows = sp.csr_array(A[order])
    lengths = np.zeros(size, np.int64)
    lengths[place[order]] = np.diff(rows.indptr)
    whole = sp.csr_array((rows.data, place[rows.indices], np.r_[0, np.cumsum(lengths)]), shape=(size, size))
    if len(missing):
        diagonal = np.zeros(size)
        diagonal[missing] = A.diagonal().mean()
        whole = sp.csr_array(whole + sp.diags_array(diagonal))
    blocks = whole.tobsr(blocksize=(d, d))
    del rows, whole  # of a million unknowns, two Gbyte that multigrid wants
    modes = rigid_modes(points[nodes], points[nodes].mean(axis=0))
    modes[missing] = 0.0
    trial = SLOW if method == "amg" and factor_is_faster(A.shape[0], A.nnz, d, SLOW) else 0
    factor = factorize(
        blocks, method=method, near_null=modes, block=d, tolerance=PASS, reserve=bool(trial), trial=trial
    )
    return TiedSolver(A, factor, place)
