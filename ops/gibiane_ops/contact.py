"""COFR: pressure, traction, gap, slip and status on contact surfaces."""

from __future__ import annotations

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, MCHAML, MMODEL
from gibiane_ops.kernels.estimate.contact import densities, with_following
from gibiane_ops.values.champs import DIFFUS, ChPoint, MChaml
from gibiane_ops.values.conditions import family
from gibiane_ops.values.contact import solved_contacts
from gibiane_ops.values.modele import Modele
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store

COFR = operator(
    "COFR",
    topic="contact",
    summary="pressure, friction traction, gap, slip and status on contact surfaces",
    notice="On the nodes of the slave surface: PN normal pressure (positive in compression), PT1 PT2 friction "
    "traction, GN gap, GT1 GT2 slip, ETAT status (0 open, 1 stick, 2 slip). REA holds the contact "
    "forces, REAC RC U. Pressure and traction are nodal forces divided by the mass matrix of the "
    "facets, or by its row sums with 'LUMP'; between different meshes by mortar ('MORT'), by the area of the node.",
    example="OPTI DIME 2 ELEM QUA4 MODE PLAN DEFO ;\n"
    "V1 = (DROI 2 (0 -1) (1 -1)) TRAN 2 (0 1) ; V2 = (DROI 2 (0 0) (1 0)) TRAN 2 (0 1) ;\n"
    "G1 = CONT V1 ELEM 'APPU' 'STRI' (V1 POIN 'DROI' (0 0) (1 0) 1.E-6) ;\n"
    "G2 = CONT V2 ELEM 'APPU' 'STRI' (V2 POIN 'DROI' (0 0) (1 0) 1.E-6) ;\n"
    "MO = MODE (V1 ET V2) 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 1000. 'NU' 0.3 ;\n"
    "MC = MODE G1 G2 'CONTACT' 'FROTTANT' 'COULOMB' ; MATC = MATE MC 'MU' 0.2 ; RC JC = RIGI MC MATC ;\n"
    "CL = BLOQ 'DEPL' (V1 POIN 'DROI' (0 -1) (1 -1) 1.E-6) ;\n"
    "F = FORC (0 -1) (V2 POIN 'DROI' (0 1) (1 1) 1.E-6) ;\n"
    "U = RESO ((RIGI MO MA) ET CL ET RC) (F ET JC) ; CF = COFR MC MATC U (REAC RC U) ;\n"
    "MESS 'largest pressure: ' (MAXI (EXCO 'PN' CF)) ;",
    see=["RESO", "REAC", "ERREUR"],
)


@COFR.form(
    Arg("mc", MMODEL, "contact model"),
    Arg("u", CHPOINT, "solution"),
    Arg("rea", CHPOINT, "contact forces"),
    Arg("matc", MCHAML, "material of the contact", optional=True),
    Key("LUMP", "lumped mass of the facets"),
    gives=[CHPOINT],
)
def _cofr(ctx: Context, mc: Modele, u: ChPoint, rea: ChPoint, matc: MChaml | None, lump: bool) -> ChPoint:
    store, axis = node_store(ctx), family(ctx) == "AXIS"
    columns: dict[str, list[tuple[IntArray, FloatArray]]] = {}
    for zone in solved_contacts(ctx, mc, matc, u, rea):
        nodes = zone.pairs.pairs[:, 0]
        dim = zone.frames.shape[1]
        in_space = np.einsum("nij,ni->nj", zone.frames, zone.force)
        if zone.is_mortar:
            local = zone.pair_force / zone.pairs.area[:, None]
        else:
            surface = zone.zone.slave.kernel_blocks
            R = densities(store.coords[:, :dim], surface, nodes, in_space, lumped=lump, axisymmetric=axis)
            local = np.einsum("nij,nj->ni", zone.frames, R)
        scale = np.abs(zone.pair_force).max(initial=0.0)
        slip = np.linalg.norm(zone.pair_relative[:, 1:], axis=1)
        closed = -zone.pair_force[:, 0] > 1e-9 * scale
        # what the surfaces move together measures the round-off of what they slip
        moving = slip > 1e-9 * max(np.abs(zone.pair_relative).max(initial=0.0), zone.motion)
        status = np.where(closed, np.where(moving, 2.0, 1.0), 0.0)
        values = {
            "PN": -local[:, 0],
            "PT1": local[:, 1],
            "GN": zone.gap - zone.relative[:, 0],
            "GT1": zone.relative[:, 1],
            "ETAT": status,
        }
        if dim == 3:
            values |= {"PT2": local[:, 2], "GT2": zone.relative[:, 2]}
        every, follow = with_following(zone.zone.slave.kernel_blocks, nodes)
        for name, value in values.items():
            at = follow @ value
            if name == "ETAT":  # the first and the last entry of a row: its node, or two corners
                at = np.maximum(value[follow.indices[follow.indptr[:-1]]], value[follow.indices[follow.indptr[1:] - 1]])
            columns.setdefault(name, []).append((every, at))
    parts = {
        name: (np.concatenate([n for n, _ in pieces]), np.concatenate([v for _, v in pieces]))
        for name, pieces in columns.items()
    }
    return ChPoint(store, parts, DIFFUS)
