"""Condition number of the matrix of a contact method."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.constraints import Reduction
from gibiane_ops.kernels.contact.condensation import Condensation
from gibiane_ops.kernels.contact.conditioning import condensed_condition, spring_condition
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.report import OPEN, ContactState
from gibiane_ops.values.contact_checks import held_rows
from gibiane_ops.values.methods import Method
from gibiane_ops.values.nodes import FloatArray
from gibiane_ops.values.system import System


def condition(
    system: System,
    condensation: Condensation,
    reduction: Reduction,
    interface: Interface,
    state: ContactState,
    method: Method,
    origin: FloatArray | None,
) -> float:
    """Measure the matrix of a method: that of the whole model for springs, that of the interface for the others."""
    r = 1.0 if method.r is None else method.r
    if method.matrix != "springs":
        return condensed_condition(interface, state, method.matrix, r, origin)
    contact = condensation.contact
    pairs = contact.pairs
    C = sp.block_diag(list(interface.frames[: len(pairs)])) @ held_rows(system, contact)[: pairs.shape[0] * system.dim]
    C = sp.csr_array(sp.vstack([C, *([system.stops] if system.stops.shape[0] else [])]))
    d = interface.dim
    kept = np.r_[np.arange(len(pairs) * d), len(pairs) * d + d * np.arange(system.stops.shape[0])]
    closed = ((state.status != OPEN)[:, None] & interface.active).ravel()[kept]
    springs = sp.diags_array(np.where(closed, r * interface.kref, 0.0))
    n = system.K.shape[0]
    nothing = np.zeros(n)
    free = np.ones(n)
    free[reduction.fixed] = 0.0

    def apply(u: FloatArray) -> FloatArray:
        v = free * np.ravel(u)
        return np.asarray(free * (system.K @ v + C.T @ (springs @ (C @ v))))

    return spring_condition(interface, state, r, apply, lambda F: condensation.interface(F, nothing), n)
