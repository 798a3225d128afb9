"""Condition number of the matrix that a contact method factorises."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.problem import Problem
from gibiane_ops.kernels.contact.report import OPEN, ContactState

_FEW = 40
"""Unknowns up to which all eigenvalues are computed."""


def spring_condition(
    interface: Interface,
    state: ContactState,
    r: float,
    apply: Callable[[FloatArray], FloatArray],
    condensed: Callable[[FloatArray], Interface],
    n_unknowns: int,
) -> float:
    """Estimate the condition number of ``K + g C^T C``, the matrix of the penalty before any condensation.

    Parameters
    ----------
    interface : Interface
        Condensed under the load.
    state : ContactState
        Whose closed pairs carry springs.
    r : float
        Of the springs, over ``interface.kref``.
    apply : callable
        Product by K and by the springs of stiffness ``r kref`` on the closed pairs, (n_unknowns,) to (n_unknowns,),
        zero on prescribed unknowns.
    condensed : callable
        Interface under another load, nothing being prescribed and no gap.
    n_unknowns : int

    Returns
    -------
    float
        Largest over smallest eigenvalue, within some percent.

    Notes
    -----
    Lanczos iterations on the matrix, then on its inverse: a system of the penalty is that of the tied bodies and ``(S +
    g P) w = f``. Without springs on enough pairs a body is free, and the number is that of round-off.

    Cost
    ----
    Some tens of products by K and of solutions with the tied matrix.
    """
    from scipy.linalg import lu_factor, lu_solve
    from scipy.sparse.linalg import LinearOperator, eigsh

    closed = (state.status != OPEN)[:, None] & interface.active
    springs = np.where(closed, r * interface.kref, 0.0).ravel()
    factor = lu_factor(interface.S + np.diag(springs))

    def solve(F: FloatArray) -> FloatArray:
        loaded = condensed(np.ravel(F))
        w: FloatArray = lu_solve(factor, loaded.f)
        return loaded.expand(w)

    shape = (n_unknowns, n_unknowns)
    start = np.random.default_rng(1).normal(size=n_unknowns)
    largest = []
    # the inverse is dear and its largest values stand apart: few vectors do
    for product, vectors in ((apply, 20), (solve, 6)):
        if n_unknowns <= _FEW:
            whole = np.column_stack([product(column) for column in np.eye(n_unknowns)])
            largest.append(float(np.linalg.eigvalsh(whole)[-1]))
            continue
        operator = LinearOperator(shape, matvec=product, dtype=np.float64)
        found = eigsh(operator, 1, v0=product(start), ncv=vectors, tol=1e-2, return_eigenvectors=False)
        largest.append(float(found[0]))
    return largest[0] * largest[1]


def condensed_condition(
    interface: Interface, state: ContactState, method: str, r: float, slip_origin: FloatArray | None = None
) -> float:
    """Compute the condition number of the matrix on the interface that a method factorises last.

    Parameters
    ----------
    interface : Interface
    state : ContactState
        Result of the method, at which its matrix is formed.
    method : str
        ``newton``: ``(I - P) S + r P``; ``saddle``: ``[S -I; P I - P]``; ``perturbed``: ``[S -I; r P I]``; ``shifted``:
        ``S + r I``. P is the derivative of the law.
    r : float
        Parameter of the method over ``interface.kref``; 1 when it has none.
    slip_origin : (n, d - 1) float64, optional

    Returns
    -------
    float
        In the 2-norm, in units of ``kref``; infinity when the matrix is singular.

    Cost
    ----
    One singular value decomposition of the dense matrix.
    """
    problem = Problem.of(interface, state.law, r, slip_origin, penalty=method == "perturbed")
    w, forces = state.w / problem.length, state.r / problem.force
    n, d = w.shape
    size = n * d
    blocks = np.zeros((n, d, n, d))
    blocks[np.arange(n), :, np.arange(n)] = problem.derivative(problem.augmented(w, forces))
    P = blocks.reshape(size, size)
    S, unit = problem.S_newton, np.eye(size)
    if method == "newton":
        A = (unit - P) @ S + r * P
    elif method == "shifted":
        A = problem.S + r * unit
    else:
        corner = unit if method == "perturbed" else unit - P
        A = np.block([[S, -unit], [r * P, corner]])
    return float(np.linalg.cond(A)) if size else 1.0
