"""The report of a contact solution as a TABLE of the language."""

from __future__ import annotations

from gibiane.values import Table

from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.values.listes import ListEnti, ListReel


def fill_report(table: Table, method: str, state: ContactState, converged: bool) -> None:
    """Fill a table with how a contact solution went: iterations, counts of statuses, departures from the laws."""
    report = state.report
    history = Table()
    history.set("RESIDU", ListReel(state.history))
    for index, value in {
        "CONVERGE": converged,
        "METHODE": method,
        "ITERATIONS": state.iterations,
        "STATUTS": ListEnti([report.n_open, report.n_stick, report.n_slip]),
        "PENETRATION": float(report.penetration),
        "CONE": float(max(report.excess_friction, report.tension)),
        "PUISSANCE": float(max(report.adhesion_power, abs(report.friction_power))),
        "DISSIPATION": float(report.dissipation),
        "HISTOIRE": history,
        "MESSAGE": "converged" if converged else "not converged",
    }.items():
        table.set(index, value)
