"""RESO and REAC: linear statics and frictional contact behind one operator."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, ENTIER, FLOTTANT, LISTCHPO, RIGIDITE, TABLE, Table
from gibiane_ops.values.champs import DISCRET, ChPoint
from gibiane_ops.values.conditions import family
from gibiane_ops.values.conforming import warn_torn
from gibiane_ops.values.contact_solution import Wishes, solve_contact
from gibiane_ops.values.linear import solve_linear
from gibiane_ops.values.methods import PLAIN, STATUSES, WITH_R, Method
from gibiane_ops.values.modele import FORCES, dual_of
from gibiane_ops.values.nodes import node_store
from gibiane_ops.values.rigidite import Rigidite
from gibiane_ops.values.suites import ListChpo
from gibiane_ops.values.system import build
from gibiane_ops.values.unsymmetric import solve_unsymmetric_system

RESO = operator(
    "RESO",
    topic="resolution",
    summary="solve a linear system with its conditions, and contact with friction",
    notice="`U = RESO K F`: K joins stiffness, conditions (BLOQ, SYMT, RELA) and contact conditions (RIGI of a contact "
    "model) by ET; F joins loads, imposed values (DEPI) and gaps. LX holds the multipliers of the conditions, on "
    "nodes of their own. Conditions with MINI or MAXI act like contact; 'NOUN' makes equalities of them, and ties "
    "contact surfaces. 'NOID' ignores the part of the load that the matrix does not know.\n"
    "Solvers. Several second members, a LISTCHPO of them, and further calls with the same matrices share one "
    "factorisation. A few solutions of a large solid come from conjugate gradients with algebraic multigrid, to "
    "the relative residual PREC (1.E-10), and so does every one that would not fit into the memory; OPTI 'RESO' "
    "'DIRE' or 'ITER' chooses instead, OPTI 'ECHO' 1 tells. A matrix with negative eigenvalues is solved too, by "
    "factorisation or MINRES.\n"
    "Contact. The interface is condensed once for all methods and for every MU, gap and load (large solids: on a "
    "small model around the contact, which 3 to 6 solutions of the tied solids correct to 1.E-9 of the largest "
    "force; PENA, PERT, STATUT, 'UNIQ' and 'NCON' take one solution per contact unknown instead), and r is a "
    "multiple of its stiffness, so that no result depends on units. Where multigrid iterates long on the tied "
    "solids (flat or graded elements) a factor that fits takes over.\n"
    "'NEWT' (default): exact, 1 to 10 dense factorisations; falls back on damped steps; above MU about 1 one of "
    "several solutions ('UNIQ' looks for others). 'KRYL': the same without condensation, whatever the size: "
    "conjugate gradients with multigrid on the tied solids correct a small model, as they do unasked for a large "
    "solid that a factor would not fit (OPTI 'ECHO' 1 tells the way chosen).\n"
    "'TRES': friction bound frozen, solved, updated; same solution, 4 to 20 times the cost; does not contract for "
    "large MU. 'MULT': multipliers and active set; same solution; no safeguard, statuses may cycle (G406). "
    "'PROJ': projected Gauss-Seidel; exact to 1E-8; tens to thousands of sweeps, no factorisation: an independent "
    "check. 'PCG': projected conjugate gradients, contact without friction only. 'BIPO' r: bipotential; exact to "
    "1E-8; 40 iterations at r = 1, in proportion more on both sides; Coulomb's law only.\n"
    "'PENA' r: springs; the error is about 1/r (r = 1E4 gives 4 digits, r < 1 is wrong with a good residual); a "
    "result more than 1 % away from the exact laws comes with a warning (G416) or, with 'RAPP', is measured "
    "there. 'PERT' r: perturbed Lagrangian, the same result. 'AUGM' r: augmented Lagrangian by Newton without "
    "safeguard; exact. 'UZAW' r: by updates of the multipliers; exact; 4 passes at r = 1000, 32 at r = 1, more "
    "than 400 at r = 0.01; each pass is a problem of PENA. PENA and UZAW go on by damped steps of limited length, "
    "PERT and AUGM have full steps only: with weak friction (MU below 0.1) on a contact that opens they may not "
    "converge, and say so (1119).\n"
    "'STATUT' (Sn (St (tol))): the fixed point of statuses of Becheur, Tahakourt and Coorevits 2008; it holds no "
    "node inside the cone and keeps an error of its own. Sn is the penetration from which a node closes; with St "
    "above 0 nodes inside the cone are held, and a sliding node sticks again when its slip is below St: this "
    "cycles when St is of the order of the slip.\n"
    "Options. 'TOLE' x and 'ITMA' n change the tolerance (relative residual) and the largest number of "
    "iterations. 'HIST' U0: slip counts from the solution U0 of the load step before. 'DEPA' U1: start of the "
    "iterations. 'SOUC' turns a failure to converge into a warning and gives the best iterate; with 'RAPP' the "
    "table says it (CONVERGE, MESSAGE) in place of the warning. 'ARRE' e, e the error of the mesh in energy norm "
    "(absolute, the third result of ERRE or 'ABSOLUE' of its TABLE), stops the corrections of a small model when "
    "SOLVEUR is below a tenth of it (CONVERGE is FAUX then, without failure; MESSAGE or a note says it): 5 "
    "iterations for 7 or 8, measured on a cube on a block of 2540 nodes; on a condensed interface, where an "
    "iteration costs a thousandth of the preparation, nothing would be saved and nothing changes. A result that "
    "breaks the exact laws by more than 1.E-5 (a hundred times TOLE if larger) is never called converged, but for "
    "PENA, PERT and STATUT, which obey laws of their own.\n"
    "'RAPP' T fills a table: CONVERGE, METHODE, ITERATIONS, STATUTS (open, stick, slip), PENETRATION and "
    "GLISSEMENT (slip of a node inside the cone), over the natural length of the interface, CONE (force outside "
    "the cone over the largest bound), PUISSANCE (friction that does not oppose slip, force on an open node, over "
    "the energy), EQUILIBRE, EXACT (VRAI when all of them are below 1.E-5), ECART for PENA, PERT and STATUT "
    "(differences of displacement and of force from 'NEWT', relative), SOLVEUR (estimate of what the iterations, "
    "or an approximate law, have left: the energy norm of the difference from the exact solution on this mesh, by "
    "Newton steps from the result, in the unit of 'ABSOLUE' of ERRE), in the units of the model DISSIPATION, "
    "PENEMAX (largest penetration), CONEMAX (force outside the cone), JEUMAX (opening), GLISMAX (slip), FORCEMAX "
    "(force of a pair), KREF, ZONES (STATUTS and RESULTANTE of each), UNIQUE and AUTRES (statuses of the other "
    "solutions) with 'UNIQ', CONDITION with 'NCON' (of the matrix of the method: whole model for PENA and UZAW, "
    "interface for the others), HISTOIRE (RESIDU, CHANGEMENTS of status), MESSAGE. `CONTRAPP T ;` writes the "
    "table in words.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROI 2 (0 0) (1 0)) TRAN 2 (0 1) ;\n"
    "MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.1E11 'NU' 0.3 ;\n"
    "CL = BLOQ 'DEPL' (S POIN 'DROI' (0 0) (1 0) 1.E-6) ;\n"
    "F = FORC (0 -1.E6) (S POIN 'DROI' (0 1) (1 1) 1.E-6) ;\n"
    "U = RESO ((RIGI MO MA) ET CL) F ; MESS ((MAXI (EXCO 'UY' U) 'ABS') > 0.) ;",
    see=["RIGIDITE", "BLOQUER", "REAC", "COFR"],
    source="semi-smooth Newton: Alart and Curnier 1991",
)


@RESO.form(
    Arg("k", RIGIDITE, "stiffness and conditions"),
    Arg("f", CHPOINT, "second members", many=True),
    Arg("prec", FLOTTANT, "relative residual of iterations", optional=True),
    Key(tuple(PLAIN), "contact method", name="method"),
    Key(
        tuple(WITH_R), "contact method with a parameter", Arg("r", FLOTTANT, "multiple of the stiffness"), name="with_r"
    ),
    Key(
        STATUSES,
        "fixed point of statuses",
        Arg("sn", FLOTTANT, "closing distance", optional=True),
        Arg("st", FLOTTANT, "sticking distance", optional=True),
        Arg("tol", FLOTTANT, "tolerance", optional=True),
        name="statuses",
    ),
    Key("RAPP", "report to fill", Arg("t", TABLE)),
    Key("HIST", "solution of the load step before", Arg("u0", CHPOINT)),
    Key("DEPA", "start of the contact iterations", Arg("u1", CHPOINT)),
    Key("TOLE", "tolerance of the contact iterations", Arg("x", FLOTTANT)),
    Key("ITMA", "largest number of contact iterations", Arg("n", ENTIER)),
    Key("ARRE", "error of the mesh, energy norm: corrections of a small model stop at a tenth", Arg("e", FLOTTANT)),
    Key("UNIQ", "look for other solutions"),
    Key("NCON", "condition number of the matrix of the method"),
    Key("SOUC", "unconverged contact is a warning"),
    Key("NOUN", "unilateral conditions are equalities"),
    Key("NOID", "ignore what the matrix does not know"),
    gives=["CHPOINT..."],
)
def _reso(
    ctx: Context,
    k: Rigidite,
    f: list[ChPoint],
    prec: float | None,
    method: str | None,
    with_r: tuple[str, float] | None,
    statuses: tuple[float | None, ...] | None,
    rapp: Table | None,
    hist: ChPoint | None,
    depa: ChPoint | None,
    tole: float | None,
    itma: int | None,
    arre: float | None,
    uniq: bool,
    ncon: bool,
    souc: bool,
    noun: bool,
    noid: bool,
) -> Any:
    chosen = _method(ctx, method, with_r, statuses, tole, itma)
    if arre is not None and not 0 < arre < np.inf:
        ctx.fail(
            41,
            "ARRE = {value}: the error of the mesh is positive",
            at="arre",
            value=float(arre),
            hint="'ABSOLUE' of the TABLE of ERRE is one; without ARRE the iterations go to the end",
        )
    wishes = Wishes(chosen, rapp, hist, depa, souc, noun, uniq, ncon, float(arre or 0.0))
    return tuple(_solutions(ctx, k, f, prec, noid, wishes))


@RESO.form(
    Arg("k", RIGIDITE, "stiffness and conditions"),
    Arg("fields", LISTCHPO, "second members"),
    Arg("prec", FLOTTANT, "relative residual of iterations", optional=True),
    Key("NOUN", "unilateral conditions are equalities"),
    Key("NOID", "ignore what the matrix does not know"),
    gives=[LISTCHPO],
)
def _reso_list(ctx: Context, k: Rigidite, fields: ListChpo, prec: float | None, noun: bool, noid: bool) -> ListChpo:
    wishes = Wishes(_method(ctx, None, None, None, None, None), None, None, None, False, noun, False, False)
    return ListChpo(_solutions(ctx, k, fields.objects, prec, noid, wishes) if len(fields) else [])


def _solutions(
    ctx: Context, k: Rigidite, fields: Sequence[ChPoint], prec: float | None, lenient: bool, wishes: Wishes
) -> list[ChPoint]:
    """Solve for every second member."""
    warn_torn(ctx, k)
    system = build(ctx, k, bilateral=wishes.bonded)
    loads = [system.load(ctx, field, lenient=lenient) for field in fields]
    if not system.symmetric:
        stops = np.column_stack([system.stop_values(field) for field in fields])
        return solve_unsymmetric_system(ctx, system, loads, stops)
    if system.contacts or system.stops.shape[0]:
        return [solve_contact(ctx, k, system, *pair, wishes) for pair in zip(fields, loads, strict=True)]
    return solve_linear(ctx, k, system, loads, prec)


def _method(
    ctx: Context,
    plain: str | None,
    with_r: tuple[str, float] | None,
    statuses: tuple[float | None, ...] | None,
    tolerance: float | None,
    max_iter: int | None,
) -> Method:
    """Gather the method and its numbers, within their ranges."""
    if sum(given is not None for given in (plain, with_r, statuses)) > 1:
        ctx.fail(26, "one contact method at a time", at="with_r" if with_r else "statuses")
    if tolerance is not None and not 0 < tolerance < 1:
        ctx.fail(41, "TOLE = {value}: the tolerance is between 0 and 1", at="tole", value=float(tolerance))
    if max_iter is not None and max_iter < 1:
        ctx.fail(41, "ITMA = {value}: at least one iteration", at="itma", value=max_iter)
    if with_r is not None:
        name, r = with_r[0], float(with_r[1])
        if not r > 0:
            ctx.fail(
                41,
                "{name} r = {value}: r is positive, a multiple of the stiffness of the interface",
                at="with_r",
                name=name,
                value=r,
                hint="1.E4 suits most models",
            )
        return Method(name, r=r, tolerance=tolerance, max_iter=max_iter)
    if statuses is not None:
        distances = [None if x is None else float(x) for x in statuses]
        if any(x is not None and not x >= 0 for x in distances):
            ctx.fail(41, "the thresholds of STATUT cannot be negative", at="statuses")
        closing, sticking, own = distances
        thresholds = (closing, sticking or None, own)
        return Method(STATUSES, thresholds=thresholds, tolerance=tolerance, max_iter=max_iter)
    return Method(plain or "NEWT", tolerance=tolerance, max_iter=max_iter)


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
        row, node, unknown, factor = part.reactions
        force = factor * u.at("LX", part.multipliers)[row]
        nodes = store.canonical(node)
        for name in np.unique(unknown):
            chosen = unknown == name
            terms.setdefault(dual_of(str(name)), []).append((nodes[chosen], force[chosen]))
    for contact in k.contacts:
        nodes = np.arange(store.count)
        names = FORCES[family(ctx)]
        # the solution holds no force of middles that follow their corners
        known = np.isin(contact.vectors[:, 0], u.parts["LX"][0] if "LX" in u.parts else [])
        known |= not known.any()
        pairs, vectors = (contact.pairs.only(np.flatnonzero(known)), contact.vectors[known])
        spread = pairs.matrix(store.count).T
        used = np.flatnonzero(np.diff(spread.tocsr().indptr))
        for i, name in enumerate(names[: contact.pairs.normals.shape[1]]):
            force = spread @ u.at("LX", vectors[:, i])
            terms.setdefault(name, []).append((store.canonical(nodes[used]), force[used]))
    parts = {}
    for name, pieces in terms.items():
        nodes, inverse = np.unique(np.concatenate([n for n, _ in pieces]), return_inverse=True)
        parts[name] = (
            nodes,
            np.asarray(np.bincount(inverse, np.concatenate([f for _, f in pieces]), minlength=len(nodes)), np.float64),
        )
    return ChPoint(store, parts, DISCRET)
