"""RIGI: stiffness of solids, and contact conditions of contact zones."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg
from gibiane.registry import Context, extend, operator
from gibiane.values import MAILLAGE, MCHAML, MMODEL, RIGIDITE
from gibiane_ops.kernels import assembly
from gibiane_ops.kernels.topology import places_in
from gibiane_ops.values import mechanics
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.contact import NEEDS, warn_unpaired, zone_friction, zone_gap, zone_pairs
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.material import on_zone, solid_zones
from gibiane_ops.values.modele import DISPLACEMENTS, FORCES, Modele
from gibiane_ops.values.nodes import FloatArray, node_store
from gibiane_ops.values.parts import model_part
from gibiane_ops.values.rigidite import ConditionPart, ConditionTerms, ContactPart, MatrixPart, Rigidite

RIGI = operator(
    "RIGIDITE",
    topic="resolution",
    summary="stiffness of a model, or conditions of a contact zone",
    notice="Solid: the stiffness matrix. Contact: `RC JC = RIGI MC MATC` gives the contact and friction "
    "conditions and their second member (the initial gap), to be joined to the stiffness and to the "
    "load: RESO (K ET RC) (F ET JC).",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROI 2 (0 0) (1 0)) TRAN 2 (0 1) ;\n"
    "MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.1E11 'NU' 0.3 ;\n"
    "K = RIGI MO MA ; LIST 'RESU' K ;",
    see=["MODELISER", "MATERIAU", "RESO"],
)


@RIGI.form(
    Arg("model", MMODEL, "model"), Arg("material", MCHAML, "its material", optional=True), gives=[RIGIDITE, "(CHPOINT)"]
)
def _rigi(ctx: Context, model: Modele, material: MChaml | None) -> Any:
    if model.contacts and model.zones:
        ctx.fail(21, "the model mixes solids and contact: make their matrices one by one", at="model")
    if model.contacts:
        return _contact(ctx, model, material)
    if material is None:
        raise ctx.operands.missing(MCHAML, "the material")
    solid_zones(ctx, model)
    return _solid(ctx, model, material)


def _solid(ctx: Context, model: Modele, material: MChaml) -> Rigidite:
    store = node_store(ctx)
    zones = model.zones
    family, dim = zones[0].family, zones[0].dim
    mesh = Maillage(store, [b for zone in zones for b in zone.mesh.blocks])
    nodes = mesh.nodes
    blocks = [(places_in(nodes, zone.cells), mechanics.stiffness(ctx, zone, material)) for zone in zones]
    matrix = assembly.assemble(len(nodes), dim, blocks)
    part = MatrixPart(nodes, DISPLACEMENTS[family], FORCES[family], matrix, mesh)
    part.origin = model, material
    return Rigidite([part])


def _contact(ctx: Context, model: Modele, material: MChaml | None) -> Any:
    store = node_store(ctx)
    parts = []
    gaps: list[tuple[Any, FloatArray]] = []
    for zone in model.contacts:
        values = material.zone_of(zone) if material is not None else None
        if NEEDS[zone.law] and values is None:
            raise ctx.operands.missing(MCHAML, f"the material of the contact (MATE MC '{NEEDS[zone.law][0]}' ...)")
        pairs = zone_pairs(ctx, zone, at="model")
        warn_unpaired(ctx, zone, pairs, at="model")
        multipliers = store.add(pairs.points)
        d = pairs.normals.shape[1]
        vectors = store.add(np.repeat(pairs.points, d, axis=0)).reshape(-1, d)
        with worded(ctx, at="material"):
            parts.append(ContactPart(zone, pairs, zone_friction(ctx, zone, values, pairs), multipliers, vectors))
        gaps.append((multipliers, zone_gap(ctx, zone, values, pairs)))
    nodes = np.concatenate([n for n, _ in gaps])
    values_of_gaps = np.concatenate([g for _, g in gaps])
    return Rigidite(parts), ChPoint(store, {"FLX": (nodes, values_of_gaps)}, "DISCRET")


@extend("REDUIRE").form(Arg("k", RIGIDITE, "matrix"), Arg("mesh", MAILLAGE, "elements"), gives=[RIGIDITE])
def _redu(ctx: Context, k: Rigidite, mesh: Maillage) -> Rigidite:
    """Keep the elements of a mesh, and the conditions whose nodes all belong to it."""
    parts: list[Any] = []
    solid = Maillage(mesh.store, [b for b in mesh.blocks if b.shape != "POI1"])
    for part in k.matrices:
        if part.origin is None:
            ctx.fail(251, "only matrices of RIGI can be reduced to some elements", at="k")
        model = model_part(ctx, part.origin[0], solid)
        zones = [on_zone(ctx, part.origin[1], zone, "k") for zone in model.zones]
        material = MChaml(zones, part.origin[1].subtype, part.origin[1].support)
        parts += _solid(ctx, model, material).parts
    nodes = mesh.nodes
    for condition in k.conditions:
        reactions = condition.reactions
        outside = np.union1d(
            condition.row[~np.isin(condition.node, nodes)], reactions.row[~np.isin(reactions.node, nodes)]
        )
        rows = np.setdiff1d(np.arange(len(condition.multipliers)), outside)
        if len(rows):
            kept = np.isin(condition.row, rows)
            reduced = ConditionPart(
                np.searchsorted(rows, condition.row[kept]),
                condition.node[kept],
                condition.name[kept],
                condition.coefficients[kept],
                condition.multipliers[rows],
                condition.sense,
                condition.label,
                condition.line,
            )
            if condition.own_reactions is not None:
                kept = np.isin(reactions.row, rows)
                row = np.searchsorted(rows, reactions.row[kept])
                reduced.own_reactions = ConditionTerms(
                    row, reactions.node[kept], reactions.name[kept], reactions.coefficients[kept]
                )
            parts.append(reduced)
    return Rigidite(parts)


UNION = extend("ET")


@UNION.form(
    Arg("a", RIGIDITE, "matrix"),
    Arg("b", RIGIDITE, "matrix"),
    Arg("more", RIGIDITE, "matrices", many=True, optional=True),
    gives=[RIGIDITE],
)
def _et(ctx: Context, a: Rigidite, b: Rigidite, more: list[Rigidite]) -> Rigidite:
    return Rigidite([part for each in (a, b, *more) for part in each.parts])


@UNION.form(
    Arg("a", MMODEL, "model"),
    Arg("b", MMODEL, "model"),
    Arg("more", MMODEL, "models", many=True, optional=True),
    gives=[MMODEL],
)
def _et_models(ctx: Context, a: Modele, b: Modele, more: list[Modele]) -> Modele:
    every = (a, b, *more)
    zones, contacts = [z for m in every for z in m.zones], [c for m in every for c in m.contacts]
    return Modele(zones, contacts, [z for m in every for z in m.loads], [z for m in every for z in m.heated])
