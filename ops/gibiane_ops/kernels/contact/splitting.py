"""Alternate between equilibrium and the cone of Coulomb: De Saxce's projection, split from the elastic problem."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.cone import norms, orthogonal_projection
from gibiane_ops.kernels.contact.problem import Problem


def splitting_steps(
    problem: Problem, first: tuple[FloatArray, FloatArray], rho: float
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield w and r after each alternation, without end.

    Parameters
    ----------
    problem : Problem
        Of Coulomb's law alone.
    first : tuple of (n, d) float64
        w and r in the units of the problem.
    rho : float
        Parameter of the iterations, in units of ``kref``.

    Yields
    ------
    w, r : (n, d) float64

    Notes
    -----
    Each step solves ``(S + rho) w = f + r + rho z``, z being the displacement that the law allowed last, and projects
    ``r - rho (w - gap n - mu abs(w_t) n)`` on the cone, orthogonally.

    Source
    ------
    De Saxce and Feng 1998, Mathematical and Computer Modelling 28; Glowinski and Le Tallec 1989 (splitting).

    Cost
    ----
    One dense factorisation in all, a back substitution and a projection a step.
    """
    from scipy.linalg import cho_factor, cho_solve

    coefficient = np.minimum(problem.law.mu, 1e6)

    def cone(a: FloatArray) -> FloatArray:
        # a pair whose normal is held elsewhere carries nothing
        return np.where(problem.holds[:, None], orthogonal_projection(a, coefficient), 0.0)

    factor = cho_factor(problem.S + rho * np.eye(len(problem.f)))
    load = problem.f - problem.S @ problem.origin.ravel()
    z, r = first[0] - problem.origin, cone(first[1])
    while True:
        v = cho_solve(factor, load + (r + rho * z).ravel()).reshape(r.shape)
        shifted = v.copy()
        shifted[:, 0] -= coefficient * norms(v[:, 1:])
        new = cone(r - rho * shifted)
        z, r = v + (new - r) / rho, new
        yield v + problem.origin, r
