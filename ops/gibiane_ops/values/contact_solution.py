"""A contact problem of RESO: from the system to the interface, through a method, to the field and its report."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane.diagnostics import Text
from gibiane.registry import Context
from gibiane.values import Table
from gibiane_ops.kernels import errors as k_errors
from gibiane_ops.kernels.constraints import Reduction, reduce_conditions
from gibiane_ops.kernels.contact.condense import Condensation, TiedSolution, condense
from gibiane_ops.kernels.contact.conditioning import condensed_condition, spring_condition
from gibiane_ops.kernels.contact.correction import Corrected, solve_stuck
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.pairs import ContactPairs, facets_of_body
from gibiane_ops.kernels.contact.report import OPEN, STICK, ContactState, check_state
from gibiane_ops.kernels.contact.strategy import as_found
from gibiane_ops.kernels.contact.uniqueness import compare_starts
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.geometry import facet_normals
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.contact_run import Prepared, run_on_bodies, way_of
from gibiane_ops.values.contact_words import counted, departures, fail_contact, listed, reason_of, stopped, success
from gibiane_ops.values.failures import worded
from gibiane_ops.values.linear import solver_wish
from gibiane_ops.values.methods import Method
from gibiane_ops.values.nodes import FloatArray, IntArray
from gibiane_ops.values.rapport import TOLD, fill_report, tell_distance, tell_others, tell_solver_error
from gibiane_ops.values.rigidite import Rigidite
from gibiane_ops.values.solving import ELASTIC, check_held, kept, tell_notes
from gibiane_ops.values.system import System

FAR = 0.5
"""Slip over the size of the facets above which the pairs of the start are doubtful."""

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
    _check_normals(ctx, k, system)
    pairs = system.pairs(ctx, system.gaps(field))
    deep = _overlapping(system, pairs)
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
        check_held(ctx, system, _held_rows(system, pairs))
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
        prepared: Prepared = kept(ctx, "contact", k, key, prepare)
        bodies = prepared.bodies
        tied = bodies.load(F, reduction.offset)
        gap = bodies.gaps(tied, system.stop_values(field), pairs.gap)
    _refuse_held(ctx, pairs, bodies.active, reduction.fixed, len(system.nodes))
    tell_notes(ctx, bodies.factor)
    law = system.friction()
    frame = bodies.interface_of(tied, bodies.unloaded_stiffness(), gap)
    origin = None if wishes.history is None else _slip_origin(ctx, system, frame, pairs, law, wishes.history)
    start = None
    if wishes.start is not None:
        start = _start(system, bodies, frame, pairs, law, wishes.start)
    elif wishes.history is not None:
        # a step starts from surfaces that keep their places: of several equilibria this is the one that is continued
        start = _start(system, bodies, frame, pairs, law, wishes.history, forces=False)
    found = _run(ctx, system, prepared, tied, gap, pairs, law, wishes, exact, start, origin)
    state, interface, u = found.state, found.interface, found.displacement
    if wishes.conditioning and wishes.report is not None:
        wishes.report.set("CONDITION", _condition(system, bodies, reduction, interface, state, wishes.method, origin))
    n = len(pairs.pairs)
    vector = interface.to_global(state.r)[:n]
    on_stops = state.r[n:, 0]
    forces = pairs.matrix(len(system.nodes)).T @ vector
    total = F + forces.ravel() + system.stops.T @ on_stops
    m = reduction.multipliers(reduction.reactions(system.K, u, total))
    return _with_contact_forces(system, system.field(u, m), state, vector, on_stops)


def _overlapping(system: System, pairs: ContactPairs) -> NDArray[np.bool_]:
    """Find the pairs that penetrate: by their surfaces, or by a gap that the user gave."""
    whole = np.concatenate([np.zeros(0), *(part.pairs.gap for part in system.contacts)])
    given = pairs.gap != whole
    given[pairs.penetrating] = True
    return np.asarray(given & (pairs.gap < 0))


def _refuse_held(ctx: Context, pairs: ContactPairs, active: NDArray[np.bool_], fixed: IntArray, n_nodes: int) -> None:
    """Fail when conditions were left out: slave nodes are held, and too few master nodes can move for them."""
    d = active.shape[1]
    movable = np.ones((n_nodes, d), dtype=bool)
    movable.reshape(-1)[fixed] = False
    moves = np.abs(pairs.matrix(n_nodes)) @ movable.astype(float) > 0
    lost = ~pairs.plain & ~active[: len(pairs.pairs), 0] & moves.all(axis=1)
    if lost.any():
        ctx.fail(
            "G407",
            "nodes of the slave surface are held, or lie in a corner that leans, and the master cannot follow them "
            "all: {count} would be left without contact, the first at ({where})",
            at="k",
            count=int(lost.sum()),
            where=" ".join(f"{x:g}" for x in pairs.points[np.flatnonzero(lost)[0]]),
            hint="take the held surface as the master",
        )


def _warn_far(ctx: Context, system: System, pairs: ContactPairs, state: ContactState) -> None:
    """Say when slips are so large that nodes face other facets than those of the start."""
    rigid = np.concatenate(
        [np.zeros(0, bool), *(np.full(len(part.multipliers), part.zone.rigid) for part in system.contacts)]
    )
    slip = np.linalg.norm(state.w[: len(rigid), 1:], axis=1)
    far = ~rigid & (slip > FAR * pairs.size)
    if far.any():
        worst = int(np.argmax(np.where(far, slip / pairs.size, 0.0)))
        ctx.warn(
            "G417",
            "{count} contact nodes slip by more than half a facet, most by {slip} at ({where})",
            at="k",
            count=int(far.sum()),
            slip=f"{slip[worst]:.3g}",
            where=" ".join(f"{x:g}" for x in pairs.points[worst]),
            hint="nodes keep the facets that they face at the start: the result holds for small slips",
        )


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
        _warn_far(ctx, system, pairs, state)
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
                others=listed([counted(other) for other in others.others], " / "),
                share=f"{others.difference:.2g}",
                hint="large friction coefficients allow several equilibria; the one returned is that of the method",
            )
    return found


def _report(
    table: Table, system: System, method: Method, interface: Interface, state: ContactState, converged: bool, text: str
) -> None:
    counts = [len(part.multipliers) for part in system.contacts]
    fill_report(table, method, interface, state, converged, text, counts)


def _condition(
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
    C = sp.block_diag(list(interface.frames[: len(pairs)])) @ _held_rows(system, contact)[: pairs.shape[0] * system.dim]
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


def _relative(system: System, interface: Interface, pairs: ContactPairs, u: ChPoint) -> FloatArray:
    """Return u1 - u2 of the pairs and the values of the stops, in local axes."""
    table = u.table(system.names, system.nodes)
    moved = pairs.matrix(len(system.nodes)) @ table
    n = len(moved)
    w = np.zeros(interface.active.shape)
    w[:n] = np.einsum("nij,nj->ni", interface.frames[:n], moved)
    w[n:, 0] = system.stops @ table.ravel()
    return np.where(interface.active, w, 0.0)


def _force_nodes(system: System) -> IntArray:
    """Return the nodes that carry the contact forces, one per pair and axis, (n_pairs, d)."""
    return np.concatenate([np.zeros((0, system.dim), np.int64), *(part.vectors for part in system.contacts)])


def _forces(system: System, interface: Interface, u: ChPoint) -> FloatArray | None:
    """Return the contact forces that a solution holds, in local axes; None when it is of other conditions."""
    nodes = _force_nodes(system)
    if "LX" not in u.names or not np.isin(nodes, u.parts["LX"][0]).all():
        return None
    r = np.zeros(interface.active.shape)
    vector = u.at("LX", nodes.ravel()).reshape(nodes.shape)
    r[: len(nodes)] = np.einsum("nij,nj->ni", interface.frames[: len(nodes)], vector)
    r[len(nodes) :, 0] = system.stop_signs * u.at("LX", system.stop_multipliers)
    return r


def _slip_origin(
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


def _start(
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


def _held_rows(system: System, pairs: ContactPairs) -> sp.csr_array:
    """Write the relative displacements of the pairs and the stops as rows."""
    tied = sp.kron(pairs.matrix(len(system.nodes)), sp.eye_array(system.dim), format="csr")
    return sp.csr_array(sp.vstack([tied, system.stops], format="csr"))


def _check_normals(ctx: Context, k: Rigidite, system: System) -> None:
    """Fail with G402 when the normals of a slave surface point into its own solid."""
    blocks = [b for part in k.matrices if part.mesh is not None for b in part.mesh.kernel_blocks]
    points = system.store.coords[:, : system.dim]
    for part in system.contacts:
        for name, cells in part.zone.slave.kernel_blocks:
            try:
                turned = facets_of_body(blocks, [(name, cells)])[0][1]
            except k_errors.EmptyContact:
                continue
            given, outward = (facet_normals(shape(name), points[c]) for c in (cells, turned))
            wrong = int((np.einsum("mi,mi->m", given, outward) < 0).sum())
            if wrong:
                ctx.fail(
                    "G402",
                    "the normals of {count} facets of the slave surface point into their solid",
                    at="k",
                    count=wrong,
                    hint="take the surface with FACE or ENVE, or turn it with ORIE or INVE",
                )


def _with_contact_forces(
    system: System, u: ChPoint, state: ContactState, vector: FloatArray, on_stops: FloatArray
) -> ChPoint:
    normal = np.concatenate([np.zeros(0, np.int64), *(part.multipliers for part in system.contacts)])
    parts = dict(u.parts)
    own, values = parts.get("LX", (np.zeros(0, np.int64), np.zeros(0)))
    parts["LX"] = (
        np.concatenate([own, normal, _force_nodes(system).ravel(), system.stop_multipliers]),
        np.concatenate([values, state.r[: len(normal), 0], vector.ravel(), system.stop_signs * on_stops]),
    )
    return ChPoint(system.store, parts, u.nature)
