"""The state of a contact interface, and how far it is from the laws it should obey."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.cone import norms
from gibiane_ops.kernels.contact.history import History
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import BoolArray, Friction

OPEN, STICK, SLIP = 0, 1, 2

ROUND_OFF = 1e-9
"""Force of a pair, over the largest, that iterations leave on an open one."""

APART = 1e-5
"""Opening, over the largest displacement, beyond which a pair has no cohesion whatever its force."""


@dataclass(frozen=True, eq=False)
class ContactReport:
    """Departures of a state from equilibrium and from the laws, relative, and its largest values, in the model's units.

    Attributes
    ----------
    penetration : float
        Largest ``w_n - gap`` over the natural length of the interface.
    tension : float
        Largest tensile normal force over the largest force.
    excess_friction : float
        Largest ``abs(r_t) - mu abs(r_n)`` over the largest ``mu abs(r_n)``, at least a millionth of the largest force.
    inner_slip : float
        Largest ``abs(w_t) (1 - abs(r_t) / bound)`` over the natural length: a pair that slides inside the cone.
    adhesion_power : float
        ``sum abs(r_n (w_n - gap))`` over ``scale``: a pair that is open and loaded.
    friction_power : float
        ``sum mu abs(r_n) abs(w_t) + r_t . w_t`` over ``scale``: slip that is not opposed by its friction force.
    balance : float
        Largest residual of ``S w = f + r`` over the largest force.
    dissipation : float, energy
        ``sum -r_t . w_t``.
    deepest, outside : float, length and force
        Penetration and excess of friction again, not divided.
    opening, slip, force : float, length, length and force
        Largest of the pairs.
    n_open, n_stick, n_slip : int
    """

    penetration: float
    tension: float
    excess_friction: float
    inner_slip: float
    adhesion_power: float
    friction_power: float
    balance: float
    dissipation: float
    deepest: float
    outside: float
    opening: float
    slip: float
    force: float
    n_open: int
    n_stick: int
    n_slip: int

    @property
    def worst(self) -> float:
        """Largest departure from a law or from equilibrium."""
        return max(
            self.penetration, self.tension, self.excess_friction, self.inner_slip, self.adhesion_power,
            abs(self.friction_power), self.balance,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class ContactState:
    """Relative displacements and forces of the pairs, in local components (normal first).

    Attributes
    ----------
    w : (n, d) float64, length
    r : (n, d) float64, force on body 1
    status : (n,) int64
        0 open, 1 stick, 2 slip.
    law : Friction
    history : list of float
        Residual after each step, relative.
    report : ContactReport
    changes : list of int
        Statuses that each step has changed; empty when they were not followed.
    """

    w: FloatArray
    r: FloatArray
    status: IntArray
    law: Friction
    history: list[float]
    report: ContactReport
    changes: list[int] = field(default_factory=list)

    @property
    def iterations(self) -> int:
        """Number of steps."""
        return len(self.history)


def check_state(
    interface: Interface,
    w: FloatArray,
    r: FloatArray,
    status: IntArray,
    law: Friction,
    history: list[float],
    slip_origin: FloatArray | None,
    *,
    bonded: BoolArray | None = None,
) -> ContactState:
    """Measure a state against the laws, from the forces and displacements alone.

    Parameters
    ----------
    interface : Interface
    w, r : (n, d) float64
    status : (n,) int64
    law : Friction
    history : list of float
    slip_origin : (n, d - 1) float64 or None
        Tangential displacements from which slip is counted.
    bonded : (n,) bool, optional
        Pairs that adhesion holds: no gap, and a tension up to the adhesion.

    Returns
    -------
    ContactState
    """
    force = max(float(np.abs(r).max(initial=0)), interface.working_force(slip_origin)) or 1.0
    length = max(float(np.abs(w).max(initial=0)), force / interface.kref)
    bonded = np.zeros(len(w), dtype=bool) if bonded is None else bonded
    slip = law.slip_of(w[:, 1:] - (0.0 if slip_origin is None else slip_origin), r[:, 1:])
    opening = interface.gap - w[:, 0]
    # cohesion holds pairs in contact only: a pair without any force is open, whatever the sign of its round-off
    idle = ~bonded & (norms(r) <= ROUND_OFF * force)
    held = replace(law, cohesion=np.where(~bonded & (opening > APART * length), 0.0, law.cohesion))
    bound = _reachable(held, np.where(idle, 0.0, r[:, 0]), slip, bonded)
    finite = np.where(np.isfinite(bound), bound, 0.0)
    apart = np.where(bonded, -np.abs(opening), opening)
    allowed = np.where(bonded, law.adhesion, 0.0)
    power = np.einsum("ni,ni->n", r[:, 1:], slip)
    limited = np.isfinite(bound)
    equilibrium = (interface.S @ w.ravel() - interface.f).reshape(w.shape) - r
    # without compression, or nearly without friction, the bound itself is round-off
    friction = max(float(finite.max(initial=0)), 1e-6 * force)
    holds = interface.active[:, 0]
    spare = np.where(limited, finite - norms(r[:, 1:]), np.inf)
    spare = np.clip(spare / np.maximum(finite, 1e-6 * force), 0.0, 1.0)
    deepest = float((-apart[holds]).max(initial=0)) + 0.0
    outside = float((norms(r[:, 1:]) - bound)[limited].max(initial=0))
    report = ContactReport(
        penetration=deepest / length,
        tension=float((r[:, 0] - allowed).max(initial=0)) / force,
        excess_friction=outside / friction,
        inner_slip=float((spare * norms(slip))[holds & law.rubs & (law.exponent == 0)].max(initial=0)) / length,
        adhesion_power=float(np.abs(r[holds, 0] * opening[holds]).sum()) / (force * length),
        friction_power=float((finite * norms(slip) + power)[limited].sum()) / (force * length),
        balance=float(np.abs(equilibrium).max(initial=0)) / force,
        dissipation=float(-power.sum()),
        deepest=deepest,
        outside=max(outside, float((r[:, 0] - allowed).max(initial=0))),
        opening=float(opening[holds & ~bonded].max(initial=0)),
        slip=float(norms(slip)[status != OPEN].max(initial=0)),
        force=float(norms(r).max(initial=0)),
        n_open=int((status == OPEN).sum()),
        n_stick=int((status == STICK).sum()),
        n_slip=int((status == SLIP).sum()),
    )
    changes = list(history.changes) if isinstance(history, History) else []
    return ContactState(w, r, status, law, list(history), report, changes)


def _reachable(law: Friction, normal: FloatArray, slip: FloatArray, bonded: BoolArray) -> FloatArray:
    """Give the largest friction force: the bound, or what Norton-Hoff allows at the present slip."""
    bound = law.bound(normal, bonded)
    power = np.where(law.exponent > 0, norms(slip) / law.slip_scale, 1.0)
    return np.where(law.exponent > 0, bound * power ** np.where(law.exponent > 0, law.exponent, 1.0), bound)
