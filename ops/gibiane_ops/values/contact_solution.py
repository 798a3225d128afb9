"""A contact problem of RESO: from the system to the interface, through a method, to the field and its report."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gibiane.diagnostics import Text, joined
from gibiane.registry import Context
from gibiane.values import Table
from gibiane_ops.kernels import errors as k_errors
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.contact.condensation import TiedSolution
from gibiane_ops.kernels.contact.condense import condense
from gibiane_ops.kernels.contact.correction import Corrected, solve_stuck
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.contact.strategy import as_found
from gibiane_ops.kernels.contact.uniqueness import compare_starts
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.contact_checks import check_normals, held_rows, overlapping, refuse_held, warn_far
from gibiane_ops.values.contact_condition import condition
from gibiane_ops.values.contact_run import Prepared, run_on_bodies, serves, way_of
from gibiane_ops.values.contact_start import force_nodes, slip_origin_of, start_of
from gibiane_ops.values.contact_words import counted, departures, fail_contact, reason_of, stopped, success
from gibiane_ops.values.failures import worded
from gibiane_ops.values.linear import solver_wish
from gibiane_ops.values.methods import Method
from gibiane_ops.values.nodes import FloatArray
from gibiane_ops.values.rapport import TOLD, fill_report, tell_distance, tell_others, tell_solver_error
from gibiane_ops.values.rigidite import Rigidite
from gibiane_ops.values.solving import ELASTIC, check_held, kept, tell_notes
from gibiane_ops.values.system import System

ENOUGH = 0.1
"""Share of the error of the mesh at which the solver may stop."""


@dataclass(frozen=True, eq=False)
class Wishes:
    """What the user asked of a contact solution.

    Attributes
    ----------
    method : Method
    report : Table or None
    history : ChPoint or None
        Solution of the load step before.
    start : ChPoint or None
    lenient : bool
        A failure to converge is a warning.
    bonded : bool
        Contact surfaces are tied.
    compare : bool
        Look for other solutions.
    conditioning : bool
        Measure the matrix of the method.
    mesh_error : float
        Energy norm of the error of the mesh, beside which that of the solver need not be seen; 0 when not given.
    """

    method: Method
    report: Table | None
    history: ChPoint | None
    start: ChPoint | None
    lenient: bool
    bonded: bool
    compare: bool
    conditioning: bool
    mesh_error: float = 0.0


def solve_contact(
    ctx: Context,
    k: Rigidite,
    system: System,
    field: ChPoint,
    load: tuple[FloatArray, FloatArray],
    wishes: Wishes,
) -> ChPoint:
    """Solve a system with contact conditions or stops; the field holds their forces beside the displacement."""
    F, imposed = load
    check_normals(ctx, k, system)
    pairs = system.pairs(ctx, system.gaps(field))
    deep = overlapping(system, pairs)
    if deep.any():
        worst = int(np.argmin(np.where(deep, pairs.gap, np.inf)))
        where = " ".join(f"{x:g}" for x in pairs.points[worst])
        ctx.fail(
            "G403",
            "the solids penetrate each other at {count} nodes before any load, most at ({where}): {depth}",
            at="k",
            count=int(deep.sum()),
            where=where,
            depth=f"{-pairs.gap[worst]:.3g}",
            hint="move one solid, or give the gap: MATE MC 'JEU' 0.",
        )
    with worded(ctx, at="k"):
        reduction = reduce_conditions(system.C, imposed)

    exact = wishes.compare or wishes.conditioning or wishes.method.approximate

    def prepare() -> Prepared:
        check_held(ctx, system, held_rows(system, pairs))
        try:
            way = way_of(ctx, system, pairs, reduction, exact, wishes.method.krylov)
            points = system.points if system.names in ELASTIC else None
            bodies = condense(system.K, pairs, reduction, stops=system.stops, points=points, method=way.method)
            return Prepared(bodies, way)
        except k_errors.SingularSystem as failure:
            ctx.fail(49, "the system is singular: {reason}", at="k", reason=str(failure))
        except k_errors.ContradictoryConditions:
            if not len(system.stop_signs):
                ctx.fail(
                    "G407",
                    "the conditions hold a relative displacement of contact nodes along a line that is no axis",
                    at="k",
                    hint="a plane of symmetry that crosses a contact surface goes along axes: turn the model",
                )
            ctx.fail(
                "G407",
                "a condition with MINI or MAXI acts on what another condition already holds",
                at="k",
                hint="leave blocked nodes out of it; an unknown has one of MINI and MAXI",
            )

    with worded(ctx, at="k"):
        geometry = (pairs.pairs, pairs.normals, pairs.row, pairs.node, pairs.coefficient)
        key = solver_wish(ctx), wishes.method.krylov, *(each.tobytes() for each in geometry)
        krylov = wishes.method.krylov

        def suits(found: Prepared) -> bool:
            return serves(ctx, system, pairs, reduction, exact, krylov, found)

        prepared: Prepared = kept(ctx, "contact", k, key, prepare, suits)
        bodies = prepared.bodies
        tied = bodies.load(F, reduction.offset)
        gap = bodies.gaps(tied, system.stop_values(field), pairs.gap)
    refuse_held(ctx, pairs, bodies.active, reduction.fixed, len(system.nodes))
    tell_notes(ctx, bodies.factor)
    law = system.friction()
    frame = bodies.interface_of(tied, bodies.unloaded_stiffness(), gap)
    origin = None if wishes.history is None else slip_origin_of(ctx, system, frame, pairs, law, wishes.history)
    start = None
    if wishes.start is not None:
        start = start_of(system, bodies, frame, pairs, law, wishes.start)
    elif wishes.history is not None:
        # a step starts from surfaces that keep their places: of several equilibria this is the one that is continued
        start = start_of(system, bodies, frame, pairs, law, wishes.history, forces=False)
    found = _run(ctx, system, prepared, tied, gap, pairs, law, wishes, exact, start, origin)
    state, interface, u = found.state, found.interface, found.displacement
    if wishes.conditioning and wishes.report is not None:
        wishes.report.set("CONDITION", condition(system, bodies, reduction, interface, state, wishes.method, origin))
    n = len(pairs.pairs)
    vector = interface.to_global(state.r)[:n]
    on_stops = state.r[n:, 0]
    forces = pairs.matrix(len(system.nodes)).T @ vector
    total = F + forces.ravel() + system.stops.T @ on_stops
    m = reduction.multipliers(reduction.reactions(system.K, u, total))
    return _with_contact_forces(system, system.field(u, m), state, vector, on_stops)


def _run(
    ctx: Context,
    system: System,
    prepared: Prepared,
    tied: TiedSolution,
    gap: FloatArray,
    pairs: ContactPairs,
    law: Friction,
    wishes: Wishes,
    exact: bool,
    start: ContactState | None,
    origin: FloatArray | None,
) -> Corrected:
    """Run the method, look for other solutions if asked, and fill the report."""
    method, converged, message = wishes.method, True, Text("")
    try:
        if wishes.bonded:
            found = solve_stuck(prepared.bodies, tied, gap)
        else:
            with worded(ctx, at="k"):
                found = run_on_bodies(
                    ctx, prepared, tied, gap, law, method, exact=exact,
                    enough=ENOUGH * wishes.mesh_error, start=start, slip_origin=origin,
                )  # fmt: skip
        message = success(method, found.state)
        if found.left:
            converged, message = False, stopped(found.left, ENOUGH * wishes.mesh_error)
            if wishes.report is None:
                ctx.warn("G418", "contact {reason}", level=0, reason=message)
    except (k_errors.NotConverged, k_errors.StatusCycle, k_errors.ContactUnbalanced) as failure:
        best = failure.best
        if not isinstance(best, ContactState):
            raise
        found, converged = as_found(prepared.bodies, tied, gap, best), False
        message = reason_of(failure, found.interface)
        if not wishes.lenient:
            if wishes.report is not None:
                _report(
                    wishes.report, system, method, found.interface, best, converged, message.render(ctx.session.lang)
                )
            fail_contact(ctx, failure, message, method)
        if wishes.report is None:
            ctx.warn(
                1119,
                "contact has not converged by '{method}', the best iterate is returned: {reason}",
                at="k",
                method=method.title,
                reason=message,
                hint="it obeys no law to the tolerance; 'RAPP' T keeps the history",
            )
    interface, state = found.interface, found.state
    if wishes.report is not None:
        _report(wishes.report, system, method, interface, state, converged, message.render(ctx.session.lang))
        if not wishes.bonded:
            tell_solver_error(wishes.report, found, origin)
        if method.approximate and not wishes.bonded:
            tell_distance(wishes.report, method, interface, state, origin)
    elif converged and method.approximate and state.report.worst > TOLD:
        ctx.warn(
            "G416",
            "the result obeys the law of method '{method}', not the exact one: {reason}",
            at="k",
            method=method.title,
            reason=departures(state),
            hint="'RAPP' T gives the distance; 'NEWT' is exact, a penalty is nearer with a larger r",
        )
    if (converged or found.left) and not method.approximate:
        warn_far(ctx, system, pairs, state)
    if wishes.compare and converged:
        # an approximate method may be far from every solution: the exact one is what is unique or not
        first = method.solve_exact(interface, law, origin) if method.approximate else state
        others = compare_starts(interface, law, first, slip_origin=origin)
        if wishes.report is not None:
            wishes.report.set("UNIQUE", others.unique)
            tell_others(wishes.report, others.others)
        if not others.unique:
            ctx.warn(
                "G413",
                "several solutions exist: the one returned has {here}; other starts of the iterations lead to "
                "{others}, with forces that differ by {share} of the largest",
                at="k",
                here=counted(state),
                others=joined([counted(other) for other in others.others], " / "),
                share=f"{others.difference:.2g}",
                hint="large friction coefficients allow several equilibria; the one returned is that of the method",
            )
    return found


def _report(
    table: Table, system: System, method: Method, interface: Interface, state: ContactState, converged: bool, text: str
) -> None:
    counts = [len(part.multipliers) for part in system.contacts]
    fill_report(table, method, interface, state, converged, text, counts)


def _with_contact_forces(
    system: System, u: ChPoint, state: ContactState, vector: FloatArray, on_stops: FloatArray
) -> ChPoint:
    normal = np.concatenate([np.zeros(0, np.int64), *(part.multipliers for part in system.contacts)])
    parts = dict(u.parts)
    own, values = parts.get("LX", (np.zeros(0, np.int64), np.zeros(0)))
    parts["LX"] = (
        np.concatenate([own, normal, force_nodes(system).ravel(), system.stop_multipliers]),
        np.concatenate([values, state.r[: len(normal), 0], vector.ravel(), system.stop_signs * on_stops]),
    )
    return ChPoint(system.store, parts, u.nature)
