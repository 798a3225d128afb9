"""De Saxce's bipotential: contact and friction as one projection on Coulomb's cone, in Uzawa iterations."""

from __future__ import annotations

from itertools import islice

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.balance import raise_if_unbalanced
from gibiane_ops.kernels.contact.history import History
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.newton_steps import first_guess
from gibiane_ops.kernels.contact.outcome import PATIENCE, finished, physical_state
from gibiane_ops.kernels.contact.penalty import check_stiffness
from gibiane_ops.kernels.contact.problem import Problem
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.contact.splitting import splitting_steps


def solve_bipotential(
    interface: Interface,
    mu: float | FloatArray | Friction,
    rho: float,
    *,
    tolerance: float = 1e-8,
    max_iter: int = 20000,
    start: ContactState | None = None,
    slip_origin: FloatArray | None = None,
) -> ContactState:
    """Solve contact with Coulomb friction by Uzawa iterations on the bipotential.

    Parameters
    ----------
    interface : Interface
    mu : float, (n,) float64 or Friction
        Finite coefficients of Coulomb's law.
    rho : float
        Parameter of the iterations over ``interface.kref``.
    tolerance : float
        Largest residual over the largest condensed load.
    max_iter : int
    start : ContactState, optional
    slip_origin : (n, d - 1) float64, optional

    Returns
    -------
    ContactState

    Raises
    ------
    ContactUnbalanced, NotConverged
    UnsupportedLaw
        For another law than Coulomb's.
    BadValue
        When rho is not positive.

    Notes
    -----
    A state obeys the laws when ``r = proj(r - rho (w - gap n - mu abs(w_t) n))``, the projection on the cone being the
    orthogonal one. Each iteration solves ``(S + rho) w = f + r + rho z``, z being the displacement that the law allowed
    last, and projects once. The shift of S holds bodies that only contact holds, for which the displacements of
    Uzawa's plain iteration do not exist. Convergence is linear, best for rho near 1 and slower in proportion on both
    sides; it has a proof without friction only, and the term ``mu abs(w_t)`` makes large coefficients oscillate.

    Source
    ------
    De Saxce and Feng 1998, Mathematical and Computer Modelling 28; Glowinski and Le Tallec 1989 (splitting).

    Cost
    ----
    One dense factorisation in all, a back substitution and a vectorised projection an iteration; tens to thousands of
    iterations.
    """
    law = Friction.of(interface.n_pairs, mu)
    law.need_coulomb("the bipotential method")
    check_stiffness(rho)
    problem = Problem.of(interface, law, 1.0, slip_origin)
    history = History()
    converged = False
    w, r = first = first_guess(problem, start)

    def state() -> ContactState:
        status = problem.project(problem.augmented(w, r))[1]
        return physical_state(interface, law, problem, w, r, status, history, slip_origin)

    for number, (w, r) in enumerate(islice(splitting_steps(problem, first, rho), max_iter)):
        history.add(problem.merit(w, r), problem.project(problem.augmented(w, r))[1])
        if history[-1] <= tolerance:
            converged = True
            break
        if number == PATIENCE:
            raise_if_unbalanced(interface, state())
    return finished(interface, state(), converged)
