"""LISSER: smoothed stresses."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, MCHAML, MMODEL
from gibiane_ops.kernels.contact.node_pairs import all_partners
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.recovery.patches import TENSOR
from gibiane_ops.kernels.supports import moved
from gibiane_ops.kernels.topology import places_in
from gibiane_ops.values.balance import known_tractions
from gibiane_ops.values.champs import DIFFUS, ChamZone, ChPoint, MChaml
from gibiane_ops.values.contact import zone_pairs
from gibiane_ops.values.exterior import LOADS, exterior
from gibiane_ops.values.maillage import Point
from gibiane_ops.values.material import STRESS, solid_zones, told_apart
from gibiane_ops.values.modele import Modele
from gibiane_ops.values.nodes import IntArray, node_store
from gibiane_ops.values.rigidite import Rigidite
from gibiane_ops.values.smoothed import METHODS, Solid, smoothed

LISSER = operator(
    "LISSER",
    topic="estimation",
    whole=True,
    summary="smooth a stress field: continuous values at the nodes of each solid",
    notice="'SPR' (the default): superconvergent patches (Zienkiewicz-Zhu 1992), polynomials of the degree of the "
    "elements about the corners inside the solid, prolonged to its surface; 'ORDRE' 1 asks for linear ones in "
    "quadratic elements, 'PLEIN' for the functions of QUA4 and CUB8 themselves, with products of coordinates (full "
    "basis: on bricks it sees 10 to 15 % less of the error than the linear one). 'MOYE': mean at the nodes of the "
    "stresses extrapolated from the integration points, what "
    "reproduces the classical indicator; 'MOYC': mean of the values at the centres, crude at the surface; 'PROJ': L2 "
    "projection, with 'LUMP' on the lumped mass. To estimate the error of quadratic elements take 'SPR': 'MOYE' and "
    "'PROJ' stay so near to their stresses that the error seems several times smaller than it is. To read the stress "
    "at a point of the surface where it peaks, 'MOYE' is often the better. 'SPRE': patches that also look at "
    "equilibrium with the loads given as to ERREUR 'RDC' (Wiberg 1994); "
    "tractions that the stress does not balance (contact, forgotten loads) count as unknown. 'JOINT' MC: patches "
    "across a contact, which assume that all the components go through: for bonded solids of one material only. Each "
    "solid is smoothed alone, never across two materials or across a contact. The result is an element field of "
    "sub-type CONTRAINTES at the nodes ('NOEU'), at the stress points ('STRE'), or a CHPOINT ('CHPO'), averaged where"
    " solids meet.",
    example="""
    OPTI DIME 2 ELEM QUA4 MODE PLAN DEFO ;
    S = (DROI 8 (0. 0.) (4. 0.)) TRAN 2 (0. 1.) ;
    MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.E5 'NU' 0.3 ;
    CL = BLOQ 'DEPL' (COTE 4 S) ; F = 0. -1. ; G = COTE 2 S ;
    U = RESO ((RIGI MO MA) ET CL) (FSUR 'MASS' MO F G) ; SIG = SIGM MO MA U ;
    SL = LISSER 'SPR' MO SIG ; MESS (MAXI (EXCO 'SMXX' SL)) ;
    SM = LISSER 'MOYE' MO SIG 'CHPO' ; MESS (MAXI (EXCO 'SMXX' SM)) ;
    SE = LISSER 'SPRE' MO SIG CL 'FSUR' F G ; MESS (MAXI (EXCO 'SMXX' SE)) ;
    """,
    see=["ERREUR", "SIGMA"],
)


@LISSER.form(
    Key(METHODS, "how", name="method"),
    Key("LUMP", "lumped mass (with 'PROJ')"),
    Arg("model", MMODEL, "model"),
    Arg("stress", MCHAML, "stress"),
    Arg("material", MCHAML, "material: solids of different materials are told apart", optional=True),
    Key(("NOEUD", "STRESSES", "CHPO"), "where the result stands", name="where"),
    Key("ORDRE", "highest degree of the patches, at most that of the elements", Arg("degree", ENTIER)),
    Key("PLEIN", "full basis of QUA4 and CUB8: products of the coordinates too (with 'SPR')", name="full"),
    Key(
        "JOINT",
        "a contact model: patches go across it, as if the solids were bonded (Rieger-Wriggers)",
        Arg("mc", MMODEL),
        name="joint",
    ),
    gives=["MCHAML|CHPOINT"],
)
def _lisser(
    ctx: Context,
    method: str | None,
    lump: bool,
    model: Modele,
    stress: MChaml,
    material: MChaml | None,
    where: str | None,
    ordre: int | None,
    full: bool,
    joint: Modele | None,
) -> Any:
    (stress,) = told_apart(ctx, [("stress", stress), ("material", material)], STRESS)
    if ordre is not None:
        highest = max((shape(z.shape).degree for z in model.zones), default=1)
        if not 1 <= ordre <= highest:
            ctx.fail(
                41,
                "the degree of the patches is {degree}: it is at least 1, and at most {highest} with these elements",
                at="ordre",
                degree=ordre,
                highest=highest,
            )
    if lump and method not in (None, "PROJ", "LUMP"):
        ctx.fail(19, "'LUMP' goes with 'PROJ', not with '{method}'", at="lump", method=method)
    if full:
        _check_full(ctx, model, method)
    pairs = None if joint is None else _pairs(ctx, joint)
    how = "LUMP" if lump else "FULL" if full else method or "SPR"
    solids = smoothed(ctx, model, stress, how, degree=ordre, pairs=pairs)
    return _field(ctx, solids, where)


@LISSER.form(
    Key("SPRE", "patches that also look at equilibrium and at the tractions given", required=True),
    Arg("model", MMODEL, "model"),
    Arg("stress", MCHAML, "stress"),
    Arg("material", MCHAML, "material: solids of different materials are told apart", optional=True),
    *LOADS,
    Key(("NOEUD", "STRESSES", "CHPO"), "where the result stands", name="where"),
    gives=["MCHAML|CHPOINT"],
)
def _with_equilibrium(
    ctx: Context,
    spre: bool,
    model: Modele,
    stress: MChaml,
    material: MChaml | None,
    cl: Rigidite | None,
    pres: list[Any],
    fsur: list[Any],
    volu: Point | None,
    where: str | None,
) -> Any:
    (stress,) = told_apart(ctx, [("stress", stress), ("material", material)], STRESS)
    zones = solid_zones(ctx, model)
    if any(z.bars for z in zones):
        ctx.fail(251, "stresses of bars cannot be smoothed: a model of massive elements is wanted", at="model")
    known = known_tractions(ctx, zones, stress, exterior(ctx, zones, cl, pres, fsur), volu, cl)
    return _field(ctx, smoothed(ctx, model, stress, "SPR", balance=known), where)


def _check_full(ctx: Context, model: Modele, method: str | None) -> None:
    """Refuse the full basis where it is none, or another method."""
    if method not in (None, "SPR"):
        ctx.fail(19, "'PLEIN' goes with 'SPR', not with '{method}'", at="full", method=method)
    if not any(zone.shape in TENSOR for zone in model.zones):
        ctx.fail(
            19,
            "'PLEIN' is for QUA4 and CUB8, not for {shape}",
            at="full",
            shape=model.zones[0].shape,
            hint="the linear basis is the full one of linear simplices",
        )


def _pairs(ctx: Context, contact: Modele) -> IntArray:
    """Return the pairs of coincident nodes of a contact model."""
    zones = [(zone, zone_pairs(ctx, zone, "joint")) for zone in contact.contacts]
    if not zones or not all(pairs.coincident for _, pairs in zones):
        ctx.fail(
            21,
            "patches across a contact need a contact model between surfaces whose nodes coincide",
            at="joint",
            hint="mesh the contact surface once and copy it for the other solid",
        )
    found = [all_partners(p.pairs, z.slave.kernel_blocks, z.master.kernel_blocks) for z, p in zones]
    return np.concatenate(found)


def _field(ctx: Context, solids: list[Solid], where: str | None) -> MChaml | ChPoint:
    """Return smoothed stresses where they are wanted."""
    if where == "CHPO":
        return _mean_of_solids(ctx, solids)
    zones = []
    for solid in solids:
        for zone in solid.zones:
            at_nodes = solid.nodal[places_in(solid.nodes, zone.cells)]
            values = at_nodes if where != "STRESSES" else moved(shape(zone.shape), at_nodes, "NOEUD", "STRESSES")
            zones.append(ChamZone(zone, zone.stresses, values))
    return MChaml(zones, STRESS, "STRESSES" if where == "STRESSES" else "NOEUD")


def _mean_of_solids(ctx: Context, solids: list[Solid]) -> ChPoint:
    nodes = np.unique(np.concatenate([s.nodes for s in solids]))
    names = solids[0].zones[0].stresses
    total, count = np.zeros((len(nodes), len(names))), np.zeros((len(nodes), 1))
    for solid in solids:
        at = np.searchsorted(nodes, solid.nodes)
        total[at] += solid.nodal
        count[at] += 1
    return ChPoint.from_table(node_store(ctx), names, nodes, total / count, DIFFUS)
