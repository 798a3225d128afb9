"""Why a contact problem has no solution: tell whether any admissible contact force can balance the load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.cone import norms
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.errors import ContactUnbalanced

RUNAWAY = 1e5
"""Free motion, over the natural length of the interface, that no static solution shows."""

UNBALANCED = 1e-5
"""Part of the load that may stay unbalanced before the problem is said to have no solution."""


def unbalanced_load(interface: Interface, law: Friction, *, max_iter: int = 5000) -> tuple[float, FloatArray]:
    """Measure the part of the load on free rigid motions that no force of the friction law can balance.

    Parameters
    ----------
    interface : Interface
    law : Friction
    max_iter : int
        Steps of the projected gradient method.

    Returns
    -------
    share : float
        Unbalanced part over the load on the free motions; 0 when the load can be balanced.
    motion : (n, d) float64
        Relative rigid motion that the unbalanced part drives, largest entry 1, zero when there is none.

    Notes
    -----
    Minimises ``abs(R^T (f + r))`` over all r in the cone of ``Friction.nearest_possible``, R the free
    motions. A positive minimum proves that there is no static solution; a zero one does not prove that there is one.

    Cost
    ----
    Each step costs a few operations per pair.
    """
    R, load = interface.rigid, interface.rigid.T @ interface.f
    size = float(np.linalg.norm(load))
    shape = interface.n_pairs, interface.dim
    if size == 0:
        return 0.0, np.zeros(shape)
    r = ahead = np.zeros(shape)
    left, t = load, 1.0
    for _ in range(max_iter):
        step = ahead - (R @ (load + R.T @ ahead.ravel())).reshape(shape)
        new = law.nearest_possible(np.where(interface.active, step, 0.0))
        new[~interface.active[:, 0]] = 0.0
        # Nesterov's acceleration, restarted when it turns back
        if ((ahead - new) * (new - r)).sum() > 0:
            t = 1.0
        t_new = (1 + np.sqrt(1 + 4 * t * t)) / 2
        ahead = new + (t - 1) / t_new * (new - r)
        r, t = new, t_new
        left = load + R.T @ r.ravel()
        if np.linalg.norm(left) <= 0.1 * UNBALANCED * size:
            break
    share = float(np.linalg.norm(left)) / size
    motion = (R @ left).reshape(shape)
    return share, motion / (np.abs(motion).max() or 1.0)


def raise_if_unbalanced(interface: Interface, state: ContactState) -> None:
    """Raise the error that names the motion which starts, when no contact force can balance the load.

    Parameters
    ----------
    interface : Interface
    state : ContactState
        Best state reached, kept in the error.

    Raises
    ------
    ContactUnbalanced
        ``kind`` is ``sliding``, ``tipping`` or ``separation``.
    """
    share, motion = unbalanced_load(interface, state.law)
    if share > UNBALANCED:
        raise ContactUnbalanced(kind_of_motion(motion, state.law.mu), share, motion, state.history, state)


def raise_if_runaway(interface: Interface, last: ContactState, best: ContactState) -> None:
    """Raise the error that names the motion which starts, when the iterations ran away along a free motion.

    Needed where supports fix the normal forces: the cone alone then allows any pressure, and proves nothing.

    Parameters
    ----------
    interface : Interface
    last : ContactState
        Last state of the full Newton steps.
    best : ContactState
        Best state reached, kept in the error.

    Raises
    ------
    ContactUnbalanced
        When the free motion exceeds ``RUNAWAY`` times the natural length of the interface, and the last forces, cut at
        the bound of friction, leave a part of the load.
    """
    R = interface.rigid
    motion = (R @ (R.T @ last.w.ravel())).reshape(last.w.shape)
    size = float(np.abs(motion).max(initial=0))
    if size > RUNAWAY * interface.length_scale > 0:
        law, length = last.law, norms(last.r[:, 1:])
        # a pair that the runaway has opened might have kept its cohesion in a solution that was not found
        bound = np.where(law.exponent > 0, np.inf, replace(law, when_open=True).bound(last.r[:, 0]))
        cut = np.divide(bound, length, out=np.ones_like(length), where=length > bound)
        r = np.column_stack([np.minimum(last.r[:, 0], 0.0), cut[:, None] * last.r[:, 1:]])
        load = float(np.linalg.norm(R.T @ interface.f)) or interface.force_scale
        share = float(np.linalg.norm(R.T @ (interface.f + r.ravel()))) / load
        motion = motion / size
        if share > UNBALANCED:
            raise ContactUnbalanced(kind_of_motion(motion, law.mu), share, motion, best.history, best)


def kind_of_motion(motion: FloatArray, mu: FloatArray) -> str:
    """Name a relative rigid motion that the contact does not prevent.

    Parameters
    ----------
    motion : (n, d) float64
        Local components; opening is negative along the normal.
    mu : (n,) float64

    Returns
    -------
    str
        ``sliding``, ``tipping`` or ``separation``.

    Notes
    -----
    The motion belongs to the polar cone, so that a pure slide comes with an opening ``mu abs(w_t)``, which is no
    physical opening and is set aside.
    """
    opening = -motion[:, 0] - mu * norms(motion[:, 1:])
    size = float(np.sqrt((motion**2).sum(axis=1)).max())
    if opening.max() <= 0.05 * size:
        return "sliding"
    return "separation" if np.ptp(motion[:, 0]) <= 0.05 * size else "tipping"
