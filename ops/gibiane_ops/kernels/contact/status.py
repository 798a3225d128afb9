"""The fixed point on statuses: friction forces imposed, normal contact solved, forces cut again.

This method reproduces published tables. It is not exact Coulomb friction: a pair below its bound keeps the tangential
force of the tied bodies and is not held, so that it may slide inside the cone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.cone import norms
from gibiane_ops.kernels.contact.history import History
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.report import OPEN, SLIP, STICK, ContactState, check_state
from gibiane_ops.kernels.errors import NotConverged, StatusCycle
from gibiane_ops.kernels.rigid import unseen

BoolArray = NDArray[np.bool_]


def solve_statuses(
    interface: Interface,
    mu: float | FloatArray | Friction,
    *,
    tolerance: float = 1e-4,
    closing_distance: float | None = None,
    sticking_distance: float | None = None,
    max_iter: int = 100,
) -> ContactState:
    """Solve contact with friction by the fixed point on statuses.

    Parameters
    ----------
    interface : Interface
    mu : float, (n,) float64 or Friction
        Friction coefficients, not negative, or Coulomb's law with cohesion.
    tolerance : float
        Largest relative change of the largest tangential force.
    closing_distance : float, optional
        Penetration from which an open pair closes, a length; 5 % of ``interface.length_scale`` when left out.
    sticking_distance : float, optional
        Second variant: pairs below their bound are held, and a sliding pair sticks again when its slip is below this
        length. When left out, no pair is held tangentially.
    max_iter : int
        Solutions of the normal contact problem.

    Returns
    -------
    ContactState
        ``history`` holds the relative change of the largest tangential force after each solution. ``report`` measures
        the distance to exact Coulomb friction, which is not small.

    Raises
    ------
    StatusCycle
        When the same statuses come back without convergence.
    NotConverged
        After ``max_iter`` solutions; ``best`` holds the last state.
    BadValue
        When a coefficient is negative.
    UnsupportedLaw
        For another law than Coulomb's, with cohesion or not.

    Notes
    -----
    Starts from the reaction r0 of tied bodies. Repeat: G = tangential part of r0 cut radially at ``mu abs(r_n)`` with
    the current r_n (always from r0); solve with G imposed and ``w_n = gap`` on closed pairs; a closed pair whose r_n is
    a tension opens, an open one whose penetration exceeds ``closing_distance`` closes. Bodies being held along the
    normals only, the tangential rigid motions take their smallest norm. The reaction of the result is (r_n, G), G being
    cut at the r_n of the iteration before. The variant with ``sticking_distance`` holds sticking pairs and imposes G on
    sliding ones only; it cycles where the distance is of the order of the slip. The criterion looks at the largest
    force only: where that one is not cut, smaller ones may stay beyond their bound, see ``report.excess_friction``.

    Source
    ------
    Becheur, Tahakourt and Coorevits 2008, Mechanics Research Communications 35; the update of sliding forces is read
    from its results.

    Cost
    ----
    One dense factorisation per set of closed pairs, one back substitution per iteration.
    """
    law = Friction.of(interface.n_pairs, mu)
    law.need_coulomb("the fixed point of statuses", cohesion=True)
    n, d = interface.n_pairs, interface.dim
    closing = 0.05 * interface.length_scale if closing_distance is None else closing_distance
    tied = np.where(interface.active, -interface.f.reshape(n, d), 0.0)
    closed = interface.active[:, 0] & (tied[:, 0] <= 0)
    holding = sticking_distance is not None
    G = _cut(tied, tied[:, 0], law, closed)
    stuck = closed & (norms(G) >= norms(tied[:, 1:])) & holding
    normal = _NormalContact(interface, closed, stuck)
    history = History()
    seen: list[IntArray] = []
    for _ in range(max_iter):
        w, r = normal.solve(G)
        opens = closed & (r[:, 0] > 0)
        closes = interface.active[:, 0] & ~closed & (w[:, 0] > interface.gap + closing)
        new_closed = (closed & ~opens) | closes
        new_G = _cut(tied, r[:, 0], law, new_closed)
        new_stuck = stuck
        if sticking_distance is not None:
            slips = stuck & (norms(r[:, 1:]) > law.bound(r[:, 0]))
            sticks = ~stuck & (norms(w[:, 1:]) < sticking_distance)
            new_stuck = new_closed & ((stuck & ~slips) | sticks)
        largest = float(norms(new_G).max(initial=0))
        change = abs(largest - float(norms(G).max(initial=0)))
        statuses = np.where(closed, np.where(stuck, STICK, SLIP), OPEN) if holding else _statuses(closed, tied, G)
        history.add(change / largest if largest else change, statuses)
        state = check_state(interface, w, r, statuses, law, history, None)
        if not ((new_closed != closed) | (new_stuck != stuck)).any():
            if change <= tolerance * largest:
                return state
        else:
            _raise_if_cycling(seen, new_closed, new_stuck, history, state)
            normal = _NormalContact(interface, new_closed, new_stuck)
        closed, stuck, G = new_closed, new_stuck, new_G
    raise NotConverged(history, state)


class _NormalContact:
    """Normal contact on given closed pairs, with given tangential forces on those that are not stuck."""

    def __init__(self, interface: Interface, closed: BoolArray, stuck: BoolArray) -> None:
        from scipy.linalg import cho_factor

        self.interface = interface
        self.known = np.zeros((interface.n_pairs, interface.dim), dtype=bool)
        self.known[:, 0] = closed
        self.known[:, 1:] = stuck[:, None]
        free = ~self.known.ravel()
        self.drift = self._drifts(free)
        A = interface.S[np.ix_(free, free)] + interface.kref * self.drift @ self.drift.T
        self.factor = cho_factor(A)

    def solve(self, G: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Give w, of least drift, and the reaction (r_n, G)."""
        from scipy.linalg import cho_solve

        S, f = self.interface.S, self.interface.f
        free = ~self.known.ravel()
        w = np.where(self.known[:, 0], self.interface.gap, 0.0)[:, None] * np.eye(self.interface.dim)[0]
        r = np.column_stack([np.zeros(len(w)), np.where(self.known[:, 1:], 0.0, G)])
        flat = w.ravel()
        right = (f + r.ravel())[free] - S[np.ix_(free, ~free)] @ flat[~free]
        # what the drifts cannot balance has no answer: the smallest motion leaves it out
        right -= self.drift @ (self.drift.T @ right)
        flat[free] = cho_solve(self.factor, right)
        w = flat.reshape(w.shape)
        r = np.where(self.known, (S @ flat - f).reshape(w.shape), r)
        return w, r

    def _drifts(self, free: BoolArray) -> FloatArray:
        """Find the rigid motions that keep closed pairs closed, as an orthonormal basis over the free components."""
        R = self.interface.rigid
        if R.shape[1] == 0:
            return R[free]
        return np.asarray(R[free] @ unseen(R[~free], 1e-9).T)


def _cut(tied: FloatArray, normal: FloatArray, law: Friction, closed: BoolArray) -> FloatArray:
    """Cut the tangential reaction of tied bodies at the current bound; nothing on open pairs."""
    bound = law.bound(np.where(closed, normal, 0.0))
    size = norms(tied[:, 1:])
    ratio = np.divide(bound, size, out=np.ones_like(size), where=size > bound)
    return np.asarray(ratio[:, None] * tied[:, 1:])


def _statuses(closed: BoolArray, tied: FloatArray, G: FloatArray) -> IntArray:
    cut = norms(G) < norms(tied[:, 1:])
    return np.where(closed, np.where(cut, SLIP, STICK), OPEN)


def _raise_if_cycling(
    seen: list[IntArray], closed: BoolArray, stuck: BoolArray, history: list[float], state: ContactState
) -> None:
    """Compare the statuses with all earlier ones; twice may be a detour, three times is a cycle."""
    now = closed.astype(np.int64) + stuck
    before = [i for i, old in enumerate(seen) if np.array_equal(old, now)]
    seen.append(now)
    if len(before) >= 2:
        loop = np.stack(seen[before[-1] :])
        raise StatusCycle(len(seen) - 1 - before[-1], np.flatnonzero(np.ptp(loop, axis=0)), history, state)
