"""From a solution that the user has to the start of another: slips of the load step before, first guesses."""

from __future__ import annotations

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels.contact.condensation import Condensation
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.kernels.contact.report import STICK, ContactState, check_state
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.nodes import FloatArray, IntArray
from gibiane_ops.values.system import System


def _relative(system: System, interface: Interface, pairs: ContactPairs, u: ChPoint) -> FloatArray:
    """Return u1 - u2 of the pairs and the values of the stops, in local axes."""
    table = u.table(system.names, system.nodes)
    moved = pairs.matrix(len(system.nodes)) @ table
    n = len(moved)
    w = np.zeros(interface.active.shape)
    w[:n] = np.einsum("nij,nj->ni", interface.frames[:n], moved)
    w[n:, 0] = system.stops @ table.ravel()
    return np.where(interface.active, w, 0.0)


def force_nodes(system: System) -> IntArray:
    """Return the nodes that carry the contact forces, one per pair and axis, (n_pairs, d)."""
    return np.concatenate([np.zeros((0, system.dim), np.int64), *(part.vectors for part in system.contacts)])


def _forces(system: System, interface: Interface, u: ChPoint) -> FloatArray | None:
    """Return the contact forces that a solution holds, in local axes; None when it is of other conditions."""
    nodes = force_nodes(system)
    if "LX" not in u.names or not np.isin(nodes, u.parts["LX"][0]).all():
        return None
    r = np.zeros(interface.active.shape)
    vector = u.at("LX", nodes.ravel()).reshape(nodes.shape)
    r[: len(nodes)] = np.einsum("nij,nj->ni", interface.frames[: len(nodes)], vector)
    r[len(nodes) :, 0] = system.stop_signs * u.at("LX", system.stop_multipliers)
    return r


def slip_origin_of(
    ctx: Context, system: System, interface: Interface, pairs: ContactPairs, law: Friction, before: ChPoint
) -> FloatArray:
    """Return the slips at the end of the load step before, without their elastic part."""
    w = _relative(system, interface, pairs, before)
    if not law.is_elastic:
        return w[:, 1:]
    r = _forces(system, interface, before)
    if r is None:
        ctx.fail(
            21,
            "the solution given by 'HIST' holds no forces of these contact conditions, which elastic slip needs",
            at="hist",
            hint="keep one result of RIGI MC MATC for all load steps",
        )
    return law.slip_of(w[:, 1:], r[:, 1:])


def start_of(
    system: System,
    bodies: Condensation,
    interface: Interface,
    pairs: ContactPairs,
    law: Friction,
    u: ChPoint,
    *,
    forces: bool = True,
) -> ContactState:
    """Make a first guess of a solution; forces that it does not hold, or must not give, are those of equilibrium."""
    w = _relative(system, interface, pairs, u)
    r = _forces(system, interface, u) if forces else None
    if r is None:
        force = bodies.force(w.ravel(), bodies.tied.solve(bodies.coupling(w.ravel()))) - interface.f
        r = np.where(interface.active, force.reshape(w.shape), 0.0)
    return check_state(interface, w, r, np.full(len(w), STICK), law, [], None)
