"""ERREUR with loads and supports: constitutive relation error, which bounds the error, and explicit residuals."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend
from gibiane.values import ENTIER, FLOTTANT, MCHAML, MMODEL
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import NotEquilibrated
from gibiane_ops.kernels.estimate.admissible import SWEEPS, Admissible, admissible_stress
from gibiane_ops.kernels.estimate.residual import FACETS, INTERIOR, residuals
from gibiane_ops.kernels.estimate.simplices import simplices
from gibiane_ops.kernels.estimate.tractions import Exterior
from gibiane_ops.kernels.estimate.zz import SolidError, stress_energy
from gibiane_ops.kernels.recovery import StressBlock
from gibiane_ops.kernels.supports import moved
from gibiane_ops.kernels.topology import group_by_nodes
from gibiane_ops.values.champs import MChaml
from gibiane_ops.values.estimates import KIND, NORM, REFE, TABL, Guarantee, Parts, results, stresses_of
from gibiane_ops.values.exterior import LOADS, Side, exterior
from gibiane_ops.values.failures import worded
from gibiane_ops.values.listes import ListReel
from gibiane_ops.values.maillage import Point
from gibiane_ops.values.material import elastic_compliance, elastic_law, on_zone, solid_zones
from gibiane_ops.values.modele import Modele, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store
from gibiane_ops.values.rigidite import Rigidite

ERRE = extend("ERREUR")
GUARANTEED = Guarantee(True, "a stress in exact equilibrium with the loads: the error is not above this value")
RESIDUALS = Guarantee(False, "explicit residuals follow the error up to a factor that depends on the mesh")
ROUND_OFF = 1e-9


@ERRE.form(
    Key("RDC", "constitutive relation error", required=True),
    Arg("model", MMODEL, "model (TET4, or TRI3 in a plane)"),
    Arg("sig", MCHAML, "stress"),
    Arg("mat", MCHAML, "material"),
    *LOADS,
    Key("BALAYAGES", "improvements around each node (2)", Arg("n", ENTIER), name="sweeps"),
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
    dim = zones[0].dim
    wanted = "TET4" if dim == 3 else "TRI3"
    wrong = next((z for z in zones if z.shape != wanted or z.axisymmetric), None)
    if wrong is not None:
        ctx.fail(
            251,
            "an equilibrated stress is built on {wanted} only, not on {shape} in mode {mode}",
            at="model",
            wanted=wanted,
            shape=wrong.shape,
            mode=wrong.mode,
            hint="CHAN '{wanted}' cuts a mesh; solve on it before the estimate",
        )
    if sweeps is not None and sweeps < 0:
        ctx.fail(41, "the number of sweeps {count} is negative", at="sweeps", count=sweeps)
    sides = exterior(ctx, zones, cl, pres, fsur)
    body = np.zeros(dim) if volu is None else volu.coords[:dim]
    found = _admissible(ctx, zones, stress, material, sides, body, SWEEPS if sweeps is None else sweeps)
    cuts = np.cumsum([len(z.cells) for z in zones])[:-1]
    columns = [np.split(each, cuts) for each in (found.error, found.energy, found.sum_energy)]
    parts = Parts(zones, [SolidError(*each) for each in zip(*columns, strict=True)])
    guarantee = GUARANTEED
    if found.residual > ROUND_OFF:
        guarantee = Guarantee(False, f"the equilibrium is violated by {found.residual:.1e} of the tractions")
        ctx.warn(
            "G411",
            "the equilibrium of the stress is violated by {share} of its tractions: the estimate is not a bound",
            level=1,
            share=f"{found.residual:.1e}",
        )
    more = {"EQUILIBRE": found.residual, "HISTOIRE": ListReel(found.history)}
    return results(ctx, parts, kind, norm, tabl, guarantee, refe, more)


def _admissible(
    ctx: Context,
    zones: list[ModelZone],
    stress: MChaml,
    material: MChaml,
    sides: list[Side],
    body: FloatArray,
    sweeps: int,
) -> Admissible:
    """Build the stress in equilibrium over all the zones together: they exchange tractions where they share nodes."""
    dim, of = zones[0].dim, shape(zones[0].shape)
    nodes, flat = np.unique(np.concatenate([z.cells for z in zones]), return_inverse=True)
    cells = flat.reshape(-1, dim + 1)
    points = node_store(ctx).coords[nodes][:, :dim]
    given = [moved(of, on_zone(ctx, stress, z, "sig").values, stress.support, "STRESSES") for z in zones]
    sigma = np.concatenate([each[:, 0] for each in given])
    law = np.concatenate(
        [np.broadcast_to(elastic_law(ctx, material, z, "mat"), (len(z.cells), *2 * sigma.shape[1:])) for z in zones]
    )
    with worded(ctx, at="model"):
        mesh = simplices(points, cells)
        traction, free = _on_boundary(sides, nodes, mesh.nodes[mesh.boundary])
        loads = Exterior(traction, free, np.tile(body, (len(cells), 1)))
        try:
            return admissible_stress(points, cells, sigma, law, loads, sweeps=sweeps, mesh=mesh)
        except NotEquilibrated as failure:
            node = int(nodes[failure.nodes[0]])
            where = " ".join(f"{x:g}" for x in node_store(ctx).coords[node][:dim])
            left = failure.forces[0]
            force = " ".join(f"{x:.4g}" for x in np.where(np.abs(left) > 1e-9 * np.abs(left).max(), left, 0.0))
            ctx.fail(
                21,
                "the stress does not balance the loads given: {count} nodes keep a force, first node {node} at "
                "({where}), force ({force})",
                at="sig",
                count=len(failure.nodes),
                node=node + 1,
                where=where,
                force=force,
                hint="give every load by 'PRES', 'FSUR' or 'VOLU' and the supports; forces and supports at single "
                "points or lines, and contact, are not balanced by tractions",
            )


def _on_boundary(sides: list[Side], nodes: IntArray, boundary: IntArray) -> tuple[FloatArray, FloatArray]:
    """Put what is imposed on the sides in the order of the boundary of a mesh of simplices."""
    (side,) = sides
    given = np.searchsorted(nodes, side.facets.nodes)
    order = np.argsort(given, axis=1)
    group, _ = group_by_nodes(np.vstack([boundary, given]))
    place = np.empty(len(boundary), np.int64)
    place[group[: len(boundary)]] = np.arange(len(boundary))
    traction, free = np.empty_like(side.traction), np.empty_like(side.free)
    rows = place[group[len(boundary) :]]
    traction[rows] = np.take_along_axis(side.traction, order[:, :, None], axis=1)
    free[rows] = side.free
    return traction, free


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
    kind: str | None,
    tabl: bool,
    refe: Any,
) -> Any:
    stress, material, _ = stresses_of(ctx, sig, mat, None)
    zones = solid_zones(ctx, model)
    wrong = next((z for z in zones if shape(z.shape).degree > 1 or z.axisymmetric or z.bars), None)
    if wrong is not None:
        ctx.fail(
            251,
            "explicit residuals are made on linear elements in space or in a plane, not on {shape} in mode {mode}",
            at="model",
            shape=wrong.shape,
            mode=wrong.mode,
        )
    inside, across = constants or (INTERIOR, FACETS)
    sides = exterior(ctx, zones, cl, pres, fsur)
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
        )
        errors = []
        for block, law, error in zip(blocks, laws, found.total, strict=True):
            energy = stress_energy(points, block, law)
            errors.append(SolidError(error, energy, 4 * energy + error))
    more = {
        "VOLUME": float(np.sqrt(sum(each.sum() for each in found.interior))),
        "SAUT": float(np.sqrt(sum(each.sum() for each in found.jumps))),
        "BORD": float(np.sqrt(sum(each.sum() for each in found.boundary))),
        "CONSTANTES": ListReel([inside, across]),
    }
    return results(ctx, Parts(zones, errors), kind, None, tabl, RESIDUALS, refe, more)
