"""The report of a contact solution as a TABLE of the language."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from gibiane.values import Table
from gibiane_ops.kernels.contact.correction import Corrected
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.outcome import DEPARTURE
from gibiane_ops.kernels.contact.report import OPEN, SLIP, STICK, ContactState
from gibiane_ops.kernels.contact.solver_error import solver_error
from gibiane_ops.kernels.errors import ContactUnbalanced, NotConverged
from gibiane_ops.values.listes import ListEnti, ListReel
from gibiane_ops.values.methods import Method
from gibiane_ops.values.nodes import FloatArray

TOLD = 1e-2
"""Departure from the exact laws, relative, from which an approximate result comes with a warning."""


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
    for index in ("ECART", "SOLVEUR", "UNIQUE", "AUTRES", "CONDITION"):
        if table.has(index):
            table.remove(index)
    history = Table()
    history.set("RESIDU", ListReel(state.history))
    history.set("CHANGEMENTS", ListEnti(state.changes))
    for index, value in {
        "CONVERGE": converged,
        "METHODE": method.name,
        "ITERATIONS": state.iterations,
        "STATUTS": ListEnti([report.n_open, report.n_stick, report.n_slip]),
        "PENETRATION": float(report.penetration),
        "CONE": float(max(report.excess_friction, report.tension)),
        "GLISSEMENT": float(report.inner_slip),
        "PUISSANCE": float(max(report.adhesion_power, abs(report.friction_power))),
        "EQUILIBRE": float(report.balance),
        "EXACT": bool(converged and report.worst <= max(DEPARTURE, 100 * (method.tolerance or 0.0))),
        "DISSIPATION": float(report.dissipation),
        "PENEMAX": float(report.deepest),
        "CONEMAX": float(report.outside),
        "JEUMAX": float(report.opening),
        "GLISMAX": float(report.slip),
        "FORCEMAX": float(report.force),
        "KREF": float(interface.kref),
        "ZONES": _zones(interface, state, zones),
        "HISTOIRE": history,
        "MESSAGE": message,
    }.items():
        table.set(index, value)


def tell_others(table: Table, others: Sequence[ContactState]) -> None:
    """Put the statuses of other solutions into a report, as AUTRES, numbered from 1."""
    found = Table()
    for number, state in enumerate(others, 1):
        report = state.report
        found.set(number, ListEnti([report.n_open, report.n_stick, report.n_slip]))
    table.set("AUTRES", found)


def tell_solver_error(table: Table, found: Corrected, slip_origin: FloatArray | None) -> None:
    """Put the energy norm of what the iterations have left into a report, as SOLVEUR; absent when it is unknown."""
    # the tied bodies are the solution itself, and no stiffness was needed to know it
    error = 0.0 if sp.issparse(found.interface.S) else solver_error(found.interface, found.state, slip_origin)
    if error is not None:
        table.set("SOLVEUR", error)


def tell_distance(
    table: Table, method: Method, interface: Interface, state: ContactState, slip_origin: FloatArray | None
) -> None:
    """Put the distance of an approximate result from the exact solution into its report.

    ECART holds the largest differences of relative displacement, over the largest or over the natural length of the
    interface, and of contact force, over the largest; it is absent when the exact method finds no solution.
    """
    try:
        exact = method.solve_exact(interface, state.law, slip_origin)
    except (NotConverged, ContactUnbalanced):
        return
    length = max(float(np.abs(exact.w).max(initial=0)), interface.length_scale) or 1.0
    force = float(np.abs(exact.r).max(initial=0)) or interface.force_scale or 1.0
    far = (
        float(np.abs(state.w - exact.w).max(initial=0)) / length,
        float(np.abs(state.r - exact.r).max(initial=0)) / force,
    )
    table.set("ECART", ListReel(list(far)))


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
