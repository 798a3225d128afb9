"""LISSER: smoothed stresses."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, MCHAML, MMODEL
from gibiane_ops.kernels.elements.table import shape
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
    "quadratic elements. 'MOYE': mean at the nodes of the stresses extrapolated from the integration points, what "
    "reproduces the classical indicator; 'MOYC': mean of the values at the centres, crude at the surface; 'PROJ': L2 "
    "projection, with 'LUMP' on the lumped mass. To estimate the error of quadratic elements take 'SPR': 'MOYE' and "
    "'PROJ' stay so near to their stresses that the error seems several times smaller than it is. To read the stress "
    "at a point of the surface where it peaks, 'MOYE' is often the better. 'SPRE': patches that also look at "
    "equilibrium with the loads given as to ERREUR 'RDC' (Wiberg 1994), linear elements; "
    "tractions that the stress does not balance (contact, forgotten loads) count as unknown. 'JOINT' MC: patches "
    "across a contact, which assume that all the components go through: for bonded solids of one material only. Each "
    "solid is smoothed alone, never across two materials or across a contact. The result is an element field of "
    "sub-type CONTRAINTES at the nodes ('NOEU'), at the stress points ('STRE'), or a CHPOINT ('CHPO'), averaged where"
    " solids meet.",
    example="""
    OPTI DIME 3 ELEM CUB8 ;
    S = (DROI 1 (0. 0. 0.) (1. 0. 0.)) TRAN 1 (0. 1. 0.) ; V = S VOLU 1 'TRAN' (0. 0. 1.) ;
    MO = MODE V 'MECANIQUE' 'ELASTIQUE' 'ISOTROPE' ; MA = MATE MO 'YOUN' 2.1E11 'NU' 0.3 ;
    U = NOMC 'UZ' (1.E-3 * (COOR 3 V)) ;
    SL = LISSER 'MOYE' MO (SIGM MO MA U) ; MESS (MAXI (EXCO 'SMZZ' SL)) ;
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
    pairs = None if joint is None else _pairs(ctx, joint)
    solids = smoothed(ctx, model, stress, "LUMP" if lump else method or "SPR", degree=ordre, pairs=pairs)
    return _field(ctx, solids, where)


@LISSER.form(
    Key("SPRE", "patches that also look at equilibrium and at the tractions given", required=True),
    Arg("model", MMODEL, "model of linear elements"),
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
    wrong = next((z for z in zones if shape(z.shape).degree > 1 or z.axisymmetric or z.bars), None)
    if wrong is not None:
        ctx.fail(
            251,
            "patches with equilibrium are made on linear elements in space or a plane, not on {shape} in mode {mode}",
            at="model",
            shape=wrong.shape,
            mode=wrong.mode,
            hint="LISSER 'SPR' takes every element",
        )
    known = known_tractions(ctx, zones, stress, exterior(ctx, zones, cl, pres, fsur), volu, cl)
    return _field(ctx, smoothed(ctx, model, stress, "SPR", balance=known), where)


def _pairs(ctx: Context, contact: Modele) -> IntArray:
    """Return the pairs of coincident nodes of a contact model."""
    found = [zone_pairs(ctx, zone, "joint") for zone in contact.contacts]
    if not found or not all(each.plain.all() for each in found):
        ctx.fail(
            21,
            "patches across a contact need a contact model between surfaces whose nodes coincide",
            at="joint",
            hint="mesh the contact surface once and copy it for the other solid",
        )
    pairs = np.concatenate([each.pairs for each in found])
    return np.asarray(pairs[(pairs >= 0).all(axis=1)], np.int64)


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
