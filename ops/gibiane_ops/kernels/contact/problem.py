"""The equations of contact with friction in units of the interface, their derivative, and one Newton step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.cone import norms
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.report import OPEN, SLIP, STICK

BoolArray = NDArray[np.bool_]

REGULARISATION = 1e-8
"""Stiffness, relative to kref, given to free rigid motions in the Newton matrix only: the residual stays exact."""

UNREACHED = 1e6
"""Bound of friction, over the largest load, that stands for infinity."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Find w and r with ``S w = f + r`` and ``r = law(a)``, in units of kref and of the largest load.

    ``a = r - gamma (w - origin)`` for the exact law. With ``penalty``, ``a = multiplier - gamma (w - origin)``: gamma
    is then a stiffness of the interface, and the multiplier the force that an augmented Lagrangian has found so far.

    Attributes
    ----------
    S, S_newton : (n d, n d) float64
        The second holds the free rigid motions weakly.
    f : (n d,) float64
    origin : (n, d) float64
        Gap, then the tangential displacements from which slip is counted.
    law : Friction
    gamma : float
    holds, bonded : (n,) bool
        Pairs whose normal can carry a force; those that also withstand tension.
    penalty : bool
    multiplier : (n, d) float64
        Zero unless ``penalty``.
    """

    S: FloatArray
    S_newton: FloatArray
    f: FloatArray
    origin: FloatArray
    law: Friction
    gamma: float
    holds: BoolArray
    bonded: BoolArray
    force: float
    length: float
    penalty: bool
    multiplier: FloatArray

    @staticmethod
    def of(
        interface: Interface,
        law: Friction,
        gamma: float,
        slip_origin: FloatArray | None = None,
        *,
        penalty: bool = False,
        bonded: BoolArray | None = None,
    ) -> Problem:
        """Scale an interface, a law and earlier slips; gamma is given over kref."""
        n, d = interface.n_pairs, interface.dim
        force = interface.working_force(slip_origin) or 1.0
        length = force / interface.kref
        S = interface.S / interface.kref
        S_newton = S + REGULARISATION * interface.rigid @ interface.rigid.T
        slip = np.zeros((n, d - 1)) if slip_origin is None else np.asarray(slip_origin) / length
        return Problem(
            S, S_newton, interface.f / force, np.column_stack([interface.gap / length, slip]),
            law.scaled(force, length), gamma, interface.active[:, 0],
            np.zeros(n, dtype=bool) if bonded is None else bonded, force, length, penalty, np.zeros((n, d)),
        )  # fmt: skip

    def augmented(self, w: FloatArray, r: FloatArray) -> FloatArray:
        """Compute the force that the law cuts."""
        return (self.multiplier if self.penalty else r) - self.gamma * (w - self.origin)

    def project(self, a: FloatArray) -> tuple[FloatArray, IntArray]:
        """Apply the law: forces and statuses for the augmented values."""
        closed, normal, bound = self._normal(a)
        t = norms(a[:, 1:])
        s = self.law.length(t, bound, self.gamma)[0]
        ratio = np.divide(s, t, out=np.zeros_like(t), where=t > 0)
        return np.column_stack([normal, ratio[:, None] * a[:, 1:]]), self._status(closed, t, bound)

    def friction_bound(self, w: FloatArray, r: FloatArray) -> FloatArray:
        """Give the bounds of friction, at most ``UNREACHED``, for the normal forces that the law cuts.

        Round-off in the force of an open pair would keep its whole cohesion.
        """
        return np.minimum(self._normal(self.augmented(w, r))[2], UNREACHED)

    def with_bound(self, bound: FloatArray) -> Problem:
        """Freeze the bound of friction, on open pairs too: Tresca's problem, convex."""
        law = replace(self.law, mu=np.zeros_like(bound), cohesion=bound, when_open=True)
        return replace(self, law=law)

    def _normal(self, a: FloatArray) -> tuple[BoolArray, FloatArray, FloatArray]:
        """Give the closed pairs, their normal forces and the bounds of friction."""
        closed = self.holds & ((a[:, 0] < 0) | self.bonded)
        normal = np.where(closed, a[:, 0], 0.0)
        return closed, normal, self.law.bound(normal, self.bonded & closed)

    def _status(self, closed: BoolArray, t: FloatArray, bound: FloatArray) -> IntArray:
        holds = t <= bound * (1 + self.gamma / self.law.slip_stiffness)
        stick = closed & holds & self.law.rubs & (self.law.exponent == 0)
        return np.where(stick, STICK, np.where(closed, SLIP, OPEN))

    def derivative(self, a: FloatArray) -> FloatArray:
        """Differentiate the law by a, (n, d, d)."""
        n, d = a.shape
        closed, _, bound = self._normal(a)
        t = norms(a[:, 1:])
        s, by_t, by_bound = self.law.length(t, bound, self.gamma)
        e = np.divide(a[:, 1:], t[:, None], out=np.zeros((n, d - 1)), where=t[:, None] > 0)
        ratio = np.divide(s, t, out=by_t.copy(), where=t > 0)
        P = np.zeros((n, d, d))
        P[closed, 0, 0] = 1
        ratio, by_t = np.where(bound > 0, ratio, 0.0), np.where(bound > 0, by_t, 0.0)
        P[:, 1:, 1:] = ratio[:, None, None] * np.eye(d - 1) + (by_t - ratio)[:, None, None] * e[:, :, None] * e[:, None]
        slope = np.where(closed & (bound > 0) & (by_bound > 0), self.law.mu, 0.0)
        slope[~np.isfinite(slope)] = 0.0
        P[:, 1:, 0] = -(by_bound * slope)[:, None] * e
        return P

    def residuals(self, w: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute what is left of the law and of the equilibrium, both in force."""
        E1 = r - self.project(self.augmented(w, r))[0]
        E2 = (self.S @ w.ravel() - self.f).reshape(w.shape) - r
        return E1, E2

    def step(self, w: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Solve ``[(I - P) S + gamma P] dw = -E1 - (I - P) E2``, P without I for a penalty; ``dr = S dw + E2``."""
        n, d = w.shape
        a = self.augmented(w, r)
        P = self.derivative(a)
        E1, E2 = self.residuals(w, r)
        known = np.zeros((n, d), dtype=bool)
        if not self.penalty:
            # where P is a row of the identity, dw is known: normals of closed pairs, tangents of sticking ones
            status = self.project(a)[1]
            known[status != OPEN, 0] = True
            known[(status == STICK) & ~np.isfinite(self.law.slip_stiffness)] = True
        dw = np.where(known, -E1 / self.gamma, 0.0)
        if not known.all():
            I_P = np.broadcast_to(np.eye(d), (n, d, d)) if self.penalty else np.eye(d) - P
            right = (-E1 - np.einsum("nij,nj->ni", I_P, E2))[~known]
            nodes = np.flatnonzero(~known.all(axis=1))
            rows = self.S_newton.reshape(n, d, n * d)[nodes]
            A = np.matmul(I_P[nodes], rows).reshape(len(nodes), d, n, d)
            A[np.arange(len(nodes)), :, nodes] += self.gamma * P[nodes]
            A = A.reshape(len(nodes) * d, n * d)[~known[nodes].ravel()]
            flat = known.ravel()
            dw[~known] = np.linalg.solve(A[:, ~flat], right - A[:, flat] @ dw.ravel()[flat])
        return dw, (self.S @ dw.ravel()).reshape(n, d) + E2

    def merit(self, w: FloatArray, r: FloatArray) -> float:
        """Measure how far w and r are from a solution: largest residual, over the largest load."""
        E1, E2 = self.residuals(w, r)
        # with a small gamma E1 says little about w: count it as if gamma were at least kref
        return float(max(np.abs(E1).max(initial=0) * max(1.0, 1 / self.gamma), np.abs(E2).max(initial=0)))

    def tied(self) -> tuple[FloatArray, FloatArray]:
        """Give w and r of tied bodies."""
        shape = self.multiplier.shape
        return np.zeros(shape), -self.f.reshape(shape)
