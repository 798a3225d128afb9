"""LISSER: smoothed stresses."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, MCHAML, MMODEL
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.supports import moved
from gibiane_ops.values.champs import DIFFUS, ChamZone, ChPoint, MChaml
from gibiane_ops.values.material import STRESS, told_apart
from gibiane_ops.values.modele import Modele
from gibiane_ops.values.nodes import node_store
from gibiane_ops.values.smoothed import METHODS, smoothed

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
    "at a point of the surface where it peaks, 'MOYE' is often the better. Each solid is smoothed alone, never across "
    "two materials or across a contact. The result is an element field of sub-type CONTRAINTES at the nodes ('NOEU'), "
    "at the stress points ('STRE'), or a CHPOINT ('CHPO'), averaged where solids meet.",
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
    solids = smoothed(ctx, model, stress, "LUMP" if lump else method or "SPR", degree=ordre)
    if where == "CHPO":
        return _mean_of_solids(ctx, solids)
    zones = []
    for solid in solids:
        for zone in solid.zones:
            at_nodes = solid.nodal[np.searchsorted(solid.nodes, zone.cells)]
            values = at_nodes if where != "STRESSES" else moved(shape(zone.shape), at_nodes, "NOEUD", "STRESSES")
            zones.append(ChamZone(zone, zone.stresses, values))
    return MChaml(zones, STRESS, "STRESSES" if where == "STRESSES" else "NOEUD")


def _mean_of_solids(ctx: Context, solids: list[Any]) -> ChPoint:
    nodes = np.unique(np.concatenate([s.nodes for s in solids]))
    names = solids[0].zones[0].stresses
    total, count = np.zeros((len(nodes), len(names))), np.zeros((len(nodes), 1))
    for solid in solids:
        at = np.searchsorted(nodes, solid.nodes)
        total[at] += solid.nodal
        count[at] += 1
    return ChPoint.from_table(node_store(ctx), names, nodes, total / count, DIFFUS)
