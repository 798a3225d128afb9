"""ERREUR with loads and supports: constitutive relation error, which bounds the error, and explicit residuals."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.diagnostics import Text
from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend
from gibiane.values import CHPOINT, ENTIER, FLOTTANT, MCHAML, MMODEL
from gibiane_ops.kernels.contact.node_pairs import all_partners
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.contact import densities, with_following
from gibiane_ops.kernels.estimate.residual import FACETS, INTERIOR, residuals
from gibiane_ops.kernels.estimate.zz import SolidError, stress_energy
from gibiane_ops.kernels.recovery import StressBlock
from gibiane_ops.kernels.supports import moved
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.contact import zone_pairs
from gibiane_ops.values.equilibrated import check_balance, energy_bounds, equilibrated, guarantee_of, parts_of
from gibiane_ops.values.estimates import KIND, NORM, REFE, TABL, Guarantee, Parts, results, stresses_of
from gibiane_ops.values.exterior import LOADS, Side, add_tractions, exterior
from gibiane_ops.values.failures import worded
from gibiane_ops.values.following import carried
from gibiane_ops.values.listes import ListReel
from gibiane_ops.values.maillage import Point
from gibiane_ops.values.material import elastic_compliance, on_zone, solid_zones
from gibiane_ops.values.modele import FORCES, Modele, ModelZone
from gibiane_ops.values.nodes import node_store
from gibiane_ops.values.pieces import cut_sides, doubts_of, fields_of, pieces_of
from gibiane_ops.values.rigidite import Rigidite

ERRE = extend("ERREUR")
RESIDUALS = Guarantee(False, Text("explicit residuals follow the error up to a factor that depends on the mesh"))


@ERRE.form(
    Key("RDC", "constitutive relation error", required=True),
    Arg("model", MMODEL, "model in space or in a plane; other elements than linear simplices are cut"),
    Arg("sig", MCHAML, "stress"),
    Arg("mat", MCHAML, "material"),
    *LOADS,
    Key(
        "BALAYAGES",
        "improvements (2): from the second on with smaller cells where much is left",
        Arg("n", ENTIER),
        name="sweeps",
    ),
    KIND,
    NORM,
    TABL,
    REFE,
    gives=[FLOTTANT, MCHAML, "(FLOTTANT)"],
)
def _constitutive_relation(
    ctx: Context,
    rdc: bool,
    model: Modele,
    sig: MChaml,
    mat: MChaml,
    cl: Rigidite | None,
    pres: list[Any],
    fsur: list[Any],
    volu: Point | None,
    sweeps: int | None,
    kind: str | None,
    norm: str | None,
    tabl: bool,
    refe: Any,
) -> Any:
    stress, material, _ = stresses_of(ctx, sig, mat, None)
    zones = solid_zones(ctx, model)
    sides = exterior(ctx, zones, cl, pres, fsur)
    pieces = pieces_of(ctx, zones)
    check_balance(ctx, pieces, stress, sides, volu, cl)
    fields = fields_of(ctx, pieces, stress, material)
    boundary = cut_sides(ctx, pieces, sides, fields)
    found = equilibrated(ctx, pieces, stress, material, fields, boundary, volu, sweeps, cl)
    guarantee = guarantee_of(ctx, found, doubts_of(ctx, pieces, boundary.same, fields))
    more: dict[str, Any] = {"EQUILIBRE": found.residual, "HISTOIRE": ListReel(found.history)}
    more |= energy_bounds(found)
    return results(ctx, parts_of(pieces, found), kind, norm, tabl, guarantee, refe, more)


def _add_contact(ctx: Context, zones: list[ModelZone], sides: list[Side], contact: Modele, rea: ChPoint) -> None:
    """Put the densities of contact forces among the tractions, opposite on the two surfaces."""
    store, dim = node_store(ctx), zones[0].dim
    for zone in contact.contacts:
        pairs = zone_pairs(ctx, zone, "reaction")
        if not pairs.coincident:
            ctx.fail(
                251,
                "contact residuals need surfaces whose nodes coincide; these have different meshes",
                at="reaction",
                hint="without 'REAC' the contact surfaces count as free of load",
            )
        slave = carried(pairs, rea.nodes).pairs[:, 0]
        force = rea.table(FORCES[zones[0].family], slave)[:, :dim]
        blocks = zone.slave.kernel_blocks
        with worded(ctx, at="reaction"):
            density = densities(store.coords[:, :dim], blocks, slave, force, axisymmetric=zones[0].axisymmetric)
        every, follow = with_following(blocks, slave)
        at_node, partner = np.zeros((store.count, dim)), np.full(store.count, -1, np.int64)
        at_node[every] = follow @ density
        own, other = all_partners(pairs.pairs, blocks, zone.master.kernel_blocks).T
        partner[own] = other
        for name, cells in blocks:
            add_tractions(sides, name, cells, at_node[cells])
            both = (partner[cells] >= 0).all(axis=1)
            add_tractions(sides, name, partner[cells[both]], -at_node[cells[both]])


@ERRE.form(
    Key("RESI", "explicit residuals", required=True),
    Arg("model", MMODEL, "model"),
    Arg("sig", MCHAML, "stress"),
    Arg("mat", MCHAML, "material"),
    *LOADS,
    Key(
        "CONSTANTES",
        "constants of the residuals inside elements and across facets (1/24, 1/24)",
        Arg("inside", FLOTTANT),
        Arg("across", FLOTTANT),
        name="constants",
    ),
    Key(
        "REACTION",
        "contact model and contact forces (REAC): the residual of the tractions on the contact surfaces (Wriggers)",
        Arg("mc", MMODEL),
        Arg("rea", CHPOINT),
        name="reaction",
    ),
    KIND,
    TABL,
    REFE,
    gives=[FLOTTANT, MCHAML, "(FLOTTANT)"],
)
def _explicit_residuals(
    ctx: Context,
    resi: bool,
    model: Modele,
    sig: MChaml,
    mat: MChaml,
    cl: Rigidite | None,
    pres: list[Any],
    fsur: list[Any],
    volu: Point | None,
    constants: tuple[float, float] | None,
    reaction: tuple[Modele, ChPoint] | None,
    kind: str | None,
    tabl: bool,
    refe: Any,
) -> Any:
    stress, material, _ = stresses_of(ctx, sig, mat, None)
    zones = solid_zones(ctx, model)
    if any(zone.bars for zone in zones):
        ctx.fail(251, "explicit residuals are made on solids, not on bars", at="model")
    inside, across = constants or (INTERIOR, FACETS)
    sides = exterior(ctx, zones, cl, pres, fsur)
    if reaction is not None:
        _add_contact(ctx, zones, sides, *reaction)
    dim = zones[0].dim
    blocks, moduli, laws = [], [], []
    for zone in zones:
        values = moved(shape(zone.shape), on_zone(ctx, stress, zone, "sig").values, stress.support, "STRESSES")
        blocks.append(StressBlock(shape(zone.shape), zone.cells, values))
        laws.append(elastic_compliance(ctx, material, zone, "mat"))
        normal = np.trace(laws[-1][..., :3, :3], axis1=-2, axis2=-1)
        moduli.append(np.broadcast_to(np.asarray(3.0 / normal, np.float64), len(zone.cells)))
    points = node_store(ctx).coords[:, :dim]
    with worded(ctx, at="model"):
        found = residuals(
            points,
            blocks,
            moduli,
            np.zeros(dim) if volu is None else volu.coords[:dim],
            {side.facets.name: side.traction for side in sides},
            {side.facets.name: side.free for side in sides},
            interior=inside,
            facets=across,
            axisymmetric=zones[0].axisymmetric,
        )
        errors = []
        for block, law, error in zip(blocks, laws, found.total, strict=True):
            energy = stress_energy(points, block, law, axisymmetric=zones[0].axisymmetric)
            errors.append(SolidError(error, energy, 4 * energy + error))
    more = {
        "VOLUME": float(np.sqrt(sum(each.sum() for each in found.interior))),
        "SAUT": float(np.sqrt(sum(each.sum() for each in found.jumps))),
        "BORD": float(np.sqrt(sum(each.sum() for each in found.boundary))),
        "CONSTANTES": ListReel([inside, across]),
    }
    return results(ctx, Parts(zones, errors), kind, None, tabl, RESIDUALS, refe, more)
