"""What is said of a contact solution, good or failed, as sentences that know their languages."""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from gibiane.diagnostics import Text, joined
from gibiane.registry import Context
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.errors import ContactUnbalanced, NotConverged, StatusCycle
from gibiane_ops.values.methods import OWN_LAW, STATUSES, Method

Failure = NotConverged | StatusCycle | ContactUnbalanced


def success(method: Method, state: ContactState) -> Text:
    """Say what a converged method has converged to."""
    if method.name in OWN_LAW:
        return Text(
            "converged to the law of the penalty r = {r}, not to the exact one: {distance}",
            {"r": f"{method.r:g}", "distance": departures(state)},
        )
    if method.name == STATUSES:
        return Text("converged by its own criterion, not to the exact law: {distance}", {"distance": departures(state)})
    return Text("converged")


def stopped(left: float, enough: float) -> Text:
    """Say that the corrections of a contact solution stopped early because the user asked for it."""
    return Text(
        "stopped early by 'ARRE': the error left is about {left}, below {enough} (energy norm)",
        {"left": f"{left:.2g}", "enough": f"{enough:.2g}"},
    )


def departures(state: ContactState) -> Text:
    """Word the departures of a state from the exact laws."""
    report = state.report
    outside, power = max(report.excess_friction, report.tension), max(report.adhesion_power, abs(report.friction_power))
    parts = [
        (report.penetration, Text("penetration {value}", {"value": f"{report.penetration:.2g}"})),
        (report.inner_slip, Text("slip inside the cone {value}", {"value": f"{report.inner_slip:.2g}"})),
        (outside, Text("force outside the cone {value}", {"value": f"{outside:.2g}"})),
        (power, Text("power {value}", {"value": f"{power:.2g}"})),
    ]
    return joined([text for value, text in parts if value > 1e-3 * report.worst], ", ") or Text("none")


def counted(state: ContactState) -> Text:
    """Word the statuses of a state."""
    report = state.report
    return Text(
        "{open} open, {stick} stick, {slip} slip",
        {"open": report.n_open, "stick": report.n_stick, "slip": report.n_slip},
    )


def reason_of(failure: Failure, interface: Interface) -> Text:
    """Say why a method has failed, in terms of the model."""
    if isinstance(failure, ContactUnbalanced):
        return _unbalanced(failure, interface)
    if isinstance(failure, StatusCycle):
        return Text(
            "the statuses of {count} pairs come back every {period} iterations",
            {"count": len(failure.pairs), "period": failure.period},
        )
    fields = {"count": len(failure.history), "last": ", ".join(f"{x:.2g}" for x in failure.history[-3:])}
    if failure.reason:
        return Text("{count} iterations, last residuals {last}, {why}", {**fields, "why": _why(failure)})
    return Text("{count} iterations, last residuals {last}", fields)


def _why(failure: NotConverged) -> Text:
    """Word what stopped the iterations before their number did."""
    if failure.reason == "wavering":
        return Text("{count} pairs change status back and forth", failure.fields)
    if failure.reason == "inner":
        return Text("the penalty problem of pass {number} is not solved in {steps} steps", failure.fields)
    return Text("the laws are broken by {size}", failure.fields)


def _unbalanced(failure: ContactUnbalanced, interface: Interface) -> Text:
    share = f"{failure.share:.2%}"
    if failure.kind == "tipping":
        return Text("{share} of the load on the free motions is not balanced, tipping", {"share": share})
    # a slide of the polar cone comes with an opening, which is no physical one
    along_surface = np.r_[0.0, np.ones(interface.dim - 1)]
    motion = failure.motion * along_surface if failure.kind == "sliding" else failure.motion
    mean = interface.to_global(motion).mean(axis=0)
    size = float(np.abs(mean).max())
    along = " ".join(f"{x:.2g}" for x in np.round(mean / size, 3) + 0.0) if size > 0 else "0"
    fields = {"share": share, "along": along}
    if failure.kind == "sliding":
        return Text("{share} of the load on the free motions is not balanced, sliding towards ({along})", fields)
    return Text("{share} of the load on the free motions is not balanced, separation towards ({along})", fields)


def fail_contact(ctx: Context, failure: Failure, reason: Text, method: Method) -> NoReturn:
    """Stop with the diagnostic of a failure: what happened, and what to try."""
    if isinstance(failure, ContactUnbalanced):
        if failure.kind == "separation":
            ctx.fail(
                "G404",
                "a solid is held only by contact that opens: {reason}",
                at="k",
                reason=reason,
                hint="hold the solid, or reverse the load that lifts it",
            )
        ctx.fail(
            "G405",
            "contact cannot balance the load: {reason}",
            at="k",
            reason=reason,
            hint="reduce the tangential load, raise MU, or hold the solid",
        )
    if isinstance(failure, StatusCycle):
        ctx.fail(
            "G406",
            "method '{method}' cycles: {reason}",
            at="k",
            method=method.title,
            reason=reason,
            hint="use the default method 'NEWT'",
        )
    ctx.fail(
        1119,
        "contact has not converged by '{method}': {reason}",
        at="k",
        method=method.title,
        reason=reason,
        hint="'RAPP' T keeps the history, 'SOUC' gives the best iterate"
        if method.is_newton
        else "the default method 'NEWT' needs no parameter; 'RAPP' T keeps the history, "
        "'ITMA' n allows more iterations",
    )
