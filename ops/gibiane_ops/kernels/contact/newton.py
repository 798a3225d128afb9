"""Exact Coulomb friction by a semi-smooth Newton method on the condensed problem."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.balance import raise_if_runaway, raise_if_unbalanced
from gibiane_ops.kernels.contact.cone import friction_bound, norms
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.report import OPEN, SLIP, STICK, ContactState, check_state, coefficients
from gibiane_ops.kernels.errors import NotConverged

REGULARISATION = 1e-8
"""Stiffness, relative to kref, given to free rigid motions in the Newton matrix only: the residual stays exact."""

ROUND_OFF = 1e-14
"""Residual, over the largest load, that no step improves."""

SOFT_GAMMA = 1e-3
"""Second value of gamma: pairs whose slip is small and turns back and forth settle with it."""

_STALL = 8
"""Full steps without a better residual after which another attempt is made."""

_MEMORY = 4
"""A damped step must improve on the worst of the last few residuals, not on the last one."""


def solve_coulomb(
    interface: Interface,
    mu: float | FloatArray,
    *,
    gamma: float = 1.0,
    tolerance: float = 1e-10,
    max_iter: int = 60,
    start: ContactState | None = None,
    slip_origin: FloatArray | None = None,
) -> ContactState:
    """Solve unilateral contact with Coulomb friction.

    Parameters
    ----------
    interface : Interface
    mu : float or (n,) float64
        Friction coefficients, not negative: 0 is frictionless, infinity contact without slip.
    gamma : float
        Parameter of the method over ``interface.kref``; it changes the path, not the solution.
    tolerance : float
        Largest residual, in force, over the largest condensed load.
    max_iter : int
        Newton steps of one attempt; full steps go on up to twice the number of pairs while they make progress.
    start : ContactState, optional
        First guess, for instance at another coefficient; the tied bodies when left out.
    slip_origin : (n, d - 1) float64, optional
        Tangential displacements at the start of the load step: slip is counted from there.

    Returns
    -------
    ContactState

    Raises
    ------
    ContactUnbalanced
        When no admissible contact force balances the load: the body slides, tips over or flies off.
    NotConverged
        When no solution was found although the load can be balanced; ``best`` holds the best state.
    BadValue
        When a coefficient is negative.

    Notes
    -----
    With ``a = r - gamma (w - gap n)``: open when ``a_n >= 0`` (r = 0), stick when ``abs(a_t) <= mu abs(a_n)`` (w_t = 0)
    and slip otherwise (``r_t = mu abs(r_n) a_t / abs(a_t)``). Coulomb solutions are unique for small coefficients only:
    for large ones this is one solution. When full steps fail, the load is first checked against the cone on the free
    motions; then come a softer gamma, damped steps, and growing coefficients.

    Source
    ------
    Alart and Curnier 1991, CMAME 92; Hueber, Stadler and Wohlmuth 2008, SIAM J. Sci. Comput. 30.

    Cost
    ----
    A step solves a dense system whose unknowns are the tangential components of slipping pairs and all components of
    open ones.
    """
    law = _Law.of(interface, mu, gamma, slip_origin)
    history: list[float] = []
    first = _first_guess(law, interface, start)
    best, last = _iterate(law, first, tolerance, max_iter, history, damped=False)
    if not best.converged:
        raise_if_unbalanced(interface, _state(law, interface, best, history, slip_origin))
        # slip may spread from pair to pair, one a step: go on as long as there is progress
        more, last = _iterate(law, (last.w, last.r), tolerance, 2 * interface.n_pairs, history, damped=False)
        best = _better(best, more)
    soft = replace(law, gamma=min(gamma, SOFT_GAMMA))
    for attempt, damped in ((soft, False), (law, True), (soft, True)):
        if not best.converged:
            best = _better(best, _iterate(attempt, first, tolerance, max_iter, history, damped=damped)[0])
    if not best.converged and law.mu.any():
        best = _better(best, _grow_friction(soft, first, tolerance, max_iter, history))
    state = _state(law, interface, best, history, slip_origin)
    if not best.converged:
        raise_if_runaway(interface, _state(law, interface, last, history, slip_origin), state)
        raise NotConverged(history, state)
    return state


def solve_tied(interface: Interface) -> ContactState:
    """Give the state of tied bodies: no relative displacement, whatever the sign of the reaction.

    Parameters
    ----------
    interface : Interface

    Returns
    -------
    ContactState
    """
    n, d = interface.n_pairs, interface.dim
    r = np.where(interface.active, -interface.f.reshape(n, d), 0.0)
    status = np.full(n, STICK)
    return check_state(interface, np.zeros((n, d)), r, status, np.full(n, np.inf), [], None)


@dataclass(frozen=True, eq=False)
class _Law:
    """The problem in units of kref and of the largest load, so that no result depends on units."""

    S: FloatArray
    S_newton: FloatArray
    f: FloatArray
    gap: FloatArray
    mu: FloatArray
    gamma: float
    origin: FloatArray
    holds: NDArray[np.bool_]
    force: float

    @staticmethod
    def of(interface: Interface, mu: float | FloatArray, gamma: float, slip_origin: FloatArray | None) -> _Law:
        n, d = interface.n_pairs, interface.dim
        force = interface.force_scale or 1.0
        length = force / interface.kref
        S = interface.S / interface.kref
        S_newton = S + REGULARISATION * interface.rigid @ interface.rigid.T
        origin = np.zeros((n, d - 1)) if slip_origin is None else np.asarray(slip_origin) / length
        return _Law(
            S, S_newton, interface.f / force, interface.gap / length, coefficients(interface, mu), gamma, origin,
            interface.active[:, 0], force,
        )  # fmt: skip

    def augmented(self, w: FloatArray, r: FloatArray) -> FloatArray:
        """Compute ``a = r - gamma (w - origin)``, gap and earlier slip being the origin."""
        return r - self.gamma * (w - np.column_stack([self.gap, self.origin]))

    def project(self, a: FloatArray) -> tuple[FloatArray, IntArray]:
        """Apply the law: forces and statuses for the augmented values."""
        closed = self.holds & (a[:, 0] < 0)
        normal = np.where(closed, a[:, 0], 0.0)
        bound = friction_bound(normal, self.mu)
        length = norms(a[:, 1:])
        stick = closed & (length <= bound) & (self.mu > 0)
        ratio = np.divide(bound, length, out=np.zeros_like(length), where=length > 0)
        ratio = np.where(stick, 1.0, np.where(closed, ratio, 0.0))
        status = np.where(stick, STICK, np.where(closed, SLIP, OPEN))
        return np.column_stack([normal, ratio[:, None] * a[:, 1:]]), status

    def derivative(self, a: FloatArray, status: IntArray) -> FloatArray:
        """Differentiate the law, (n, d, d)."""
        n, d = a.shape
        P = np.zeros((n, d, d))
        P[status != OPEN, 0, 0] = 1
        P[status == STICK, 1:, 1:] = np.eye(d - 1)
        slip = np.flatnonzero(status == SLIP)
        length = norms(a[slip, 1:])
        e = np.divide(a[slip, 1:], length[:, None], out=np.zeros((len(slip), d - 1)), where=length[:, None] > 0)
        bound = friction_bound(a[slip, 0], self.mu[slip])
        ratio = np.divide(bound, length, out=np.zeros_like(length), where=length > 0)
        P[slip, 1:, 1:] = ratio[:, None, None] * (np.eye(d - 1) - e[:, :, None] * e[:, None, :])
        P[slip, 1:, 0] = -self.mu[slip, None] * e
        return P

    def residuals(self, w: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute what is left of the law and of the equilibrium, both in force."""
        E1 = r - self.project(self.augmented(w, r))[0]
        E2 = (self.S @ w.ravel() - self.f).reshape(w.shape) - r
        return E1, E2

    def step(self, w: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Solve ``[(I - P) S + gamma P] dw = -E1 - (I - P) E2`` and give dw and ``dr = S dw + E2``."""
        n, d = w.shape
        a = self.augmented(w, r)
        status = self.project(a)[1]
        P = self.derivative(a, status)
        E1, E2 = self.residuals(w, r)
        # where P is a row of the identity, dw is known: normals of closed pairs, tangents of sticking ones
        known = np.zeros((n, d), dtype=bool)
        known[status != OPEN, 0] = True
        known[status == STICK] = True
        dw = np.where(known, -E1 / self.gamma, 0.0)
        if not known.all():
            I_P = np.eye(d) - P
            right = (-E1 - np.einsum("nij,nj->ni", I_P, E2))[~known]
            nodes = np.flatnonzero(~known.all(axis=1))
            rows = self.S_newton.reshape(n, d, n * d)[nodes]
            A = np.matmul(I_P[nodes], rows).reshape(len(nodes), d, n, d)
            A[np.arange(len(nodes)), :, nodes] += self.gamma * P[nodes]
            A = A.reshape(len(nodes) * d, n * d)[~known[nodes].ravel()]
            flat = known.ravel()
            dw[~known] = np.linalg.solve(A[:, ~flat], right - A[:, flat] @ dw.ravel()[flat])
        return dw, (self.S @ dw.ravel()).reshape(n, d) + E2


@dataclass(frozen=True, eq=False)
class _Iterate:
    w: FloatArray
    r: FloatArray
    status: IntArray
    residual: float
    converged: bool


def _first_guess(law: _Law, interface: Interface, start: ContactState | None) -> tuple[FloatArray, FloatArray]:
    shape = interface.n_pairs, interface.dim
    if start is None:
        return np.zeros(shape), np.where(interface.active, -law.f.reshape(shape), 0.0)
    return start.w * interface.kref / law.force, start.r / law.force


def _iterate(
    law: _Law,
    first: tuple[FloatArray, FloatArray],
    tolerance: float,
    max_iter: int,
    history: list[float],
    *,
    damped: bool,
) -> tuple[_Iterate, _Iterate]:
    """Run Newton steps from a first guess and give the best iterate met, and the last."""
    w, r = first
    E1, E2 = law.residuals(w, r)
    recent = [_merit(E1, E2)]
    best = now = _record(law, w, r, E1, E2, tolerance)
    stalled, polished = 0, False
    for _ in range(max_iter):
        # a last step after convergence costs little and leaves round-off only, even where friction is weak
        if best.residual <= ROUND_OFF or (best.converged and polished):
            break
        polished = best.converged
        try:
            dw, dr = law.step(w, r)
        except np.linalg.LinAlgError:
            break
        t = 1.0
        while True:
            E1, E2 = law.residuals(w + t * dw, r + t * dr)
            if not damped or _merit(E1, E2) <= (1 - 1e-4 * t) * max(recent) or t < 1e-3:
                break
            t /= 2
        w, r = w + t * dw, r + t * dr
        recent = [*recent[-_MEMORY + 1 :], _merit(E1, E2)]
        now = _record(law, w, r, E1, E2, tolerance)
        history.append(now.residual)
        best = _better(best, now)
        stalled = 0 if best is now else stalled + 1
        if not damped and stalled >= _STALL:
            break
    return best, now


def _grow_friction(
    law: _Law, first: tuple[FloatArray, FloatArray], tolerance: float, max_iter: int, history: list[float]
) -> _Iterate:
    """Follow the solution from small coefficients to the given ones."""
    guess = first
    for part in (0.1, 0.25, 0.5, 0.75, 0.9):
        milder = replace(law, mu=part * law.mu)
        found = _iterate(milder, guess, tolerance, max_iter, history, damped=True)[0]
        guess = found.w, found.r
    return _iterate(law, guess, tolerance, max_iter, history, damped=True)[0]


def _state(
    law: _Law, interface: Interface, found: _Iterate, history: list[float], slip_origin: FloatArray | None
) -> ContactState:
    """Go back to physical units and measure the result."""
    w = found.w * law.force / interface.kref
    if not law.mu.any():
        w = _without_drift(w, interface)
    return check_state(interface, w, found.r * law.force, found.status, law.mu, history, slip_origin)


def _merit(E1: FloatArray, E2: FloatArray) -> float:
    return float(np.sqrt((E1**2).sum() + (E2**2).sum()))


def _record(law: _Law, w: FloatArray, r: FloatArray, E1: FloatArray, E2: FloatArray, tolerance: float) -> _Iterate:
    # with a small gamma E1 says little about w: count it as if gamma were at least kref
    residual = float(max(np.abs(E1).max(initial=0) * max(1.0, 1 / law.gamma), np.abs(E2).max(initial=0)))
    status = law.project(law.augmented(w, r))[1]
    return _Iterate(w, r, status, residual, residual <= tolerance)


def _better(a: _Iterate, b: _Iterate) -> _Iterate:
    return b if b.residual < a.residual else a


def _without_drift(w: FloatArray, interface: Interface) -> FloatArray:
    """Remove the part of w that slides freely without friction: no force opposes it, so nothing fixes it."""
    R = interface.rigid
    if R.shape[1] == 0:
        return w
    # motions along the surface only: those that change a gap are settled by the normal forces
    _, values, Vt = np.linalg.svd(R[:: w.shape[1]], full_matrices=True)
    still = np.r_[values, np.zeros(len(Vt) - len(values))] <= 1e-9
    D = R @ Vt[still].T
    return np.asarray(w - (D @ (D.T @ w.ravel())).reshape(w.shape))
