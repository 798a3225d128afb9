"""The report of a contact solution as a TABLE of the language."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane.values import Table
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.report import OPEN, SLIP, STICK, ContactState
from gibiane_ops.values.listes import ListEnti, ListReel
from gibiane_ops.values.methods import OWN_LAW, Method


def fill_report(
    table: Table,
    method: Method,
    interface: Interface,
    state: ContactState,
    converged: bool,
    message: str,
    zones: Sequence[int],
) -> None:
    """Fill a table with how a contact solution went: iterations, counts of statuses, departures from the laws.

    `zones` holds the number of pairs of each zone, in order; stops come after them.
    """
    report = state.report
    history = Table()
    history.set("RESIDU", ListReel(state.history))
    for index, value in {
        "CONVERGE": converged,
        "METHODE": method.name,
        "ITERATIONS": state.iterations,
        "STATUTS": ListEnti([report.n_open, report.n_stick, report.n_slip]),
        "PENETRATION": float(report.penetration),
        "CONE": float(max(report.excess_friction, report.tension)),
        "PUISSANCE": float(max(report.adhesion_power, abs(report.friction_power))),
        "EQUILIBRE": float(report.balance),
        "DISSIPATION": float(report.dissipation),
        "KREF": float(interface.kref),
        "ZONES": _zones(interface, state, zones),
        "HISTOIRE": history,
        "MESSAGE": message,
    }.items():
        table.set(index, value)


def success(method: Method, state: ContactState) -> str:
    """Say what a converged method has converged to."""
    if method.name in OWN_LAW:
        return (
            f"converged to the law of the penalty r = {method.r:g}, not to the exact one: "
            f"penetration {state.report.penetration:.2g} of the natural length of the interface"
        )
    if method.name == "STATUT":
        return (
            f"converged by its own criterion; departure from Coulomb's law {state.report.worst:.2g} "
            "(nodes inside the cone are not held)"
        )
    return "converged"


def _zones(interface: Interface, state: ContactState, counts: Sequence[int]) -> Table:
    """Gather the statuses and the resultant of each zone, force on its slave surface in global axes."""
    zones = Table()
    force = interface.to_global(state.r)
    start = 0
    for number, count in enumerate(counts, 1):
        here = slice(start, start + count)
        status = state.status[here]
        zone = Table()
        zone.set("STATUTS", ListEnti([int((status == kind).sum()) for kind in (OPEN, STICK, SLIP)]))
        zone.set("RESULTANTE", ListReel(np.asarray(force[here].sum(axis=0)).tolist()))
        zones.set(number, zone)
        start += count
    return zones
