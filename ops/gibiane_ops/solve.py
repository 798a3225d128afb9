"""RESO and REAC: linear statics and frictional contact behind one operator."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, RIGIDITE, TABLE, Table
from gibiane_ops.kernels import errors as k_errors
from gibiane_ops.kernels.contact.condense import Condensation, condense
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.pairs import facets_of_body
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.contact.status import solve_statuses
from gibiane_ops.values.champs import DISCRET, ChPoint
from gibiane_ops.values.failures import worded
from gibiane_ops.values.linear import check_held, kept, reduced, solve_linear, tell_notes
from gibiane_ops.values.nodes import FloatArray, node_store
from gibiane_ops.values.rapport import fill_report
from gibiane_ops.values.rigidite import Rigidite
from gibiane_ops.values.system import System, build

RESO = operator(
    "RESO",
    topic="resolution",
    summary="solve a linear system with its conditions, and contact with friction",
    notice="`U = RESO K F`: K joins stiffness, conditions (BLOQ, SYMT, RELA) and contact conditions (RIGI of a contact "
    "model) by ET; F joins loads, imposed values (DEPI) and gaps. Several second members, and further calls with the "
    "same matrices, share one factorisation. A single solution of a large solid comes from conjugate gradients with "
    "algebraic multigrid, to the relative residual PREC (1.E-10), and so does every one that would not fit into the "
    "memory; OPTI 'RESO' 'DIRE' or 'ITER' chooses instead, OPTI 'ECHO' 1 tells. With contact the default is 'NEWT', the exact solution by a semi-smooth Newton method on the "
    "unknowns of the interface; 'STATUT' is the fixed point of statuses of Becheur, Tahakourt and Coorevits 2008, "
    "which holds no node inside the cone and keeps an error of its own. 'RAPP' T fills a table: CONVERGE, "
    "ITERATIONS, STATUTS (open, stick, slip), PENETRATION, CONE, PUISSANCE, HISTOIRE. 'DEPA' U starts from another "
    "solution. 'SOUC' turns a failure to converge into a warning and gives the best iterate. 'NOID' ignores the "
    "part of the load that the matrix does not know. LX holds the multipliers of the conditions, on nodes of their "
    "own.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROI 2 (0 0) (1 0)) TRAN 2 (0 1) ;\n"
    "MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.1E11 'NU' 0.3 ;\n"
    "CL = BLOQ 'DEPL' (S POIN 'DROI' (0 0) (1 0) 1.E-6) ;\n"
    "F = FORC (0 -1.E6) (S POIN 'DROI' (0 1) (1 1) 1.E-6) ;\n"
    "U = RESO ((RIGI MO MA) ET CL) F ; MESS ((MAXI (EXCO 'UY' U) 'ABS') > 0.) ;",
    see=["RIGIDITE", "BLOQUER", "REAC", "COFR"],
    source="semi-smooth Newton: Alart and Curnier 1991",
)

METHODS = ("NEWT", "STATUT")


@RESO.form(
    Arg("k", RIGIDITE, "stiffness and conditions"),
    Arg("f", CHPOINT, "second members", many=True),
    Arg("prec", FLOTTANT, "relative residual of iterations", optional=True),
    Key(METHODS, "contact method", name="method"),
    Key("RAPP", "report to fill", Arg("t", TABLE)),
    Key("DEPA", "start of the contact iterations", Arg("u", CHPOINT)),
    Key("TOLE", "tolerance of the contact iterations", Arg("x", FLOTTANT)),
    Key("SOUC", "unconverged contact is a warning"),
    Key("NOID", "ignore what the matrix does not know"),
    gives=["CHPOINT..."],
)
def _reso(
    ctx: Context,
    k: Rigidite,
    f: list[ChPoint],
    prec: float | None,
    method: str | None,
    rapp: Table | None,
    depa: ChPoint | None,
    tole: float | None,
    souc: bool,
    noid: bool,
) -> Any:
    system = build(ctx, k)
    loads = [system.load(ctx, field, lenient=noid) for field in f]
    _check_sense(ctx, system)
    if system.contacts:
        results = [
            _contact(ctx, k, system, field, load, method or "NEWT", rapp, tole, souc)
            for field, load in zip(f, loads, strict=True)
        ]
    else:
        results = solve_linear(ctx, k, system, loads, prec)
    return tuple(results)


def _check_sense(ctx: Context, system: System) -> None:
    for part in system.conditions:
        if part.sense != "=":
            ctx.fail(
                251,
                "{which}: conditions with MINI or MAXI are not available yet",
                at="k",
                which=part.origin,
                hint="contact between surfaces is: MODE G1 G2 'CONTACT'",
            )


def _contact(
    ctx: Context,
    k: Rigidite,
    system: System,
    field: ChPoint,
    load: tuple[FloatArray, FloatArray],
    method: str,
    report: Table | None,
    tolerance: float | None,
    lenient: bool,
) -> ChPoint:
    F, imposed = load
    _check_normals(ctx, k, system)
    pairs = system.pairs(system.gaps(field))
    if (pairs.gap < 0).any():
        worst = int(np.argmin(pairs.gap))
        where = " ".join(f"{x:g}" for x in pairs.points[worst])
        ctx.fail(
            "G403",
            "the solids penetrate each other at {count} nodes before any load, most at ({where}): {depth}",
            at="k",
            count=int((pairs.gap < 0).sum()),
            where=where,
            depth=f"{-pairs.gap[worst]:.3g}",
            hint="move one solid, or give the gap: MATE MC 'JEU' 0.",
        )
    reduction = reduced(ctx, system, imposed)

    def condensed() -> Condensation:
        check_held(ctx, system, _tied_rows(system, pairs.pairs))
        try:
            return condense(system.K, pairs, reduction)
        except k_errors.SingularSystem as failure:
            ctx.fail(49, "the system is singular: {reason}", at="k", reason=str(failure))

    with worded(ctx, at="k"):
        condensation: Condensation = kept(
            ctx, "contact", k, (pairs.pairs.tobytes(), pairs.normals.tobytes()), condensed
        )
        interface = _with_gap(condensation, pairs.gap).interface(F, reduction.offset)
    tell_notes(ctx, condensation.factor)
    options = {} if tolerance is None else {"tolerance": tolerance}
    mu = system.friction()
    state: ContactState
    converged = True
    try:
        state = (
            solve_statuses(interface, mu, **options) if method == "STATUT" else solve_coulomb(interface, mu, **options)
        )
    except (k_errors.NotConverged, k_errors.StatusCycle, k_errors.ContactUnbalanced) as failure:
        best = failure.best
        if not lenient or not isinstance(best, ContactState):
            _unconverged(ctx, failure, method, report)
        ctx.warn(1119, "contact has not converged: {reason}", reason=str(failure), at="k")
        state, converged = best, False
    if report is not None:
        fill_report(report, method, state, converged)
    u = interface.expand(state.w)
    forces = np.zeros_like(u).reshape(-1, system.dim)
    vector = interface.to_global(state.r)
    np.add.at(forces, pairs.pairs[:, 0], vector)
    np.add.at(forces, pairs.pairs[:, 1], -vector)
    m = reduction.multipliers(reduction.reactions(system.K, u, F + forces.ravel()))
    return _with_contact_forces(system, system.field(u, m), state, vector)


def _with_gap(condensation: Condensation, gap: FloatArray) -> Condensation:
    return replace(condensation, contact=replace(condensation.contact, gap=gap))


def _tied_rows(system: System, pairs: Any) -> Any:
    import scipy.sparse as sp

    n, d = len(pairs), system.dim
    row = np.repeat(np.arange(n * d), 2)
    slave = pairs[:, :1] * d + np.arange(d)
    master = pairs[:, 1:] * d + np.arange(d)
    column = np.stack([slave.ravel(), master.ravel()], axis=1).ravel()
    return sp.csr_array((np.tile([1.0, -1.0], n * d), (row, column)), shape=(n * d, system.K.shape[0]))


def _check_normals(ctx: Context, k: Rigidite, system: System) -> None:
    """Fail with G402 when the normals of a slave surface point into its own solid."""
    blocks = [b for part in k.matrices if part.mesh is not None for b in part.mesh.kernel_blocks]
    for part in system.contacts:
        for name, cells in part.zone.slave.kernel_blocks:
            try:
                turned = facets_of_body(blocks, [(name, cells)])[0][1]
            except k_errors.EmptyContact:
                continue
            X = system.store.coords[:, : system.dim]
            from gibiane_ops.kernels.elements.table import shape
            from gibiane_ops.kernels.geometry import facet_normals

            given, outward = (facet_normals(shape(name), X[c]) for c in (cells, turned))
            wrong = int((np.einsum("mi,mi->m", given, outward) < 0).sum())
            if wrong:
                ctx.fail(
                    "G402",
                    "the normals of {count} facets of the slave surface point into their solid",
                    at="k",
                    count=wrong,
                    hint="take the surface with FACE or ENVE, or turn it with ORIE or INVE",
                )


def _with_contact_forces(system: System, u: ChPoint, state: ContactState, vector: FloatArray) -> ChPoint:
    nodes = np.concatenate([part.multipliers for part in system.contacts])
    parts = dict(u.parts)
    own, values = parts.get("LX", (np.zeros(0, np.int64), np.zeros(0)))
    parts["LX"] = (np.concatenate([own, nodes]), np.concatenate([values, state.r[:, 0]]))
    for i, name in enumerate(("LFX", "LFY", "LFZ")[: system.dim]):
        parts[name] = (nodes, vector[:, i])
    return ChPoint(system.store, parts, u.nature)


def _unconverged(ctx: Context, failure: Any, method: str, report: Table | None) -> None:
    best = failure.best
    if report is not None and isinstance(best, ContactState):
        fill_report(report, method, best, converged=False)
    if isinstance(failure, k_errors.ContactUnbalanced):
        ctx.fail(
            "G405",
            "contact cannot balance the load: {reason}",
            at="k",
            reason=str(failure),
            hint="reduce the tangential load, raise MU, or hold the solid",
        )
    if isinstance(failure, k_errors.StatusCycle):
        ctx.fail(
            "G406",
            "the fixed point of statuses cycles: {reason}",
            at="k",
            reason=str(failure),
            hint="use the default method 'NEWT'",
        )
    ctx.fail(
        1119,
        "contact has not converged: {reason}",
        at="k",
        reason=str(failure),
        hint="'RAPP' T keeps the history; 'SOUC' gives the best iterate",
    )


REAC = operator(
    "REAC",
    topic="resolution",
    summary="forces that the conditions exert",
    notice="`REAC CL U`: the forces that the conditions of CL exert on the structure in the solution U, so "
    "that load, reactions and internal forces balance. With contact conditions: the nodal contact "
    "forces, on the slave and, opposite, on the master. Empty when CL has no condition.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROI 2 (0 0) (1 0)) TRAN 2 (0 1) ;\n"
    "MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.1E11 'NU' 0.3 ;\n"
    "CL = BLOQ 'DEPL' (S POIN 'DROI' (0 0) (1 0) 1.E-6) ;\n"
    "F = FORC (0 -1.E6) (S POIN 'DROI' (0 1) (1 1) 1.E-6) ;\n"
    "U = RESO ((RIGI MO MA) ET CL) F ; LIST 'RESU' (REAC CL U) ;",
    see=["RESO"],
)


@REAC.form(Arg("k", RIGIDITE, "conditions"), Arg("u", CHPOINT, "solution"), gives=[CHPOINT])
def _reac(ctx: Context, k: Rigidite, u: ChPoint) -> ChPoint:
    store = node_store(ctx)
    terms: dict[str, list[tuple[Any, Any]]] = {}
    for part in k.conditions:
        force = part.coefficients * u.at("LX", part.multipliers)[part.row]
        nodes = store.canonical(part.node)
        for name in np.unique(part.name):
            chosen = part.name == name
            terms.setdefault("F" + str(name)[1:], []).append((nodes[chosen], force[chosen]))
    for contact in k.contacts:
        slave, master = store.canonical(contact.pairs.pairs).T
        for axis in "XYZ"[: contact.pairs.normals.shape[1]]:
            force = u.at("LF" + axis, contact.multipliers)
            terms.setdefault("F" + axis, []).extend([(slave, force), (master, -force)])
    parts = {}
    for name, pieces in terms.items():
        nodes, inverse = np.unique(np.concatenate([n for n, _ in pieces]), return_inverse=True)
        parts[name] = (
            nodes,
            np.asarray(np.bincount(inverse, np.concatenate([f for _, f in pieces]), minlength=len(nodes)), np.float64),
        )
    return ChPoint(store, parts, DISCRET)
