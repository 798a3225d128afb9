"""Stresses in equilibrium with given loads, on the zones of a model: what RDC needs, with contact or without."""

from __future__ import annotations

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import NotEquilibrated
from gibiane_ops.kernels.estimate.admissible import SWEEPS, Admissible, admissible_stress
from gibiane_ops.kernels.estimate.simplices import simplices
from gibiane_ops.kernels.estimate.tractions import Exterior
from gibiane_ops.kernels.estimate.zz import SolidError
from gibiane_ops.kernels.supports import moved
from gibiane_ops.kernels.topology import group_by_nodes
from gibiane_ops.values.champs import MChaml
from gibiane_ops.values.estimates import Guarantee, Parts
from gibiane_ops.values.exterior import Side
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import Point
from gibiane_ops.values.material import elastic_law, on_zone
from gibiane_ops.values.modele import ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store

GUARANTEED = Guarantee(True, "a stress in exact equilibrium with the loads: the error is not above this value")
ROUND_OFF = 1e-9


def guarantee_of(ctx: Context, found: Admissible) -> Guarantee:
    """Say whether the equilibrium was found to hold to round-off; if not, warn."""
    if found.residual <= ROUND_OFF:
        return GUARANTEED
    ctx.warn(
        "G411",
        "the equilibrium of the stress is violated by {share} of its tractions: the estimate is not a bound",
        level=1,
        share=f"{found.residual:.1e}",
    )
    return Guarantee(False, f"the equilibrium is violated by {found.residual:.1e} of the tractions")


def parts_of(zones: list[ModelZone], found: Admissible) -> Parts:
    """Return the errors zone by zone."""
    cuts = np.cumsum([len(z.cells) for z in zones])[:-1]
    columns = [np.split(each, cuts) for each in (found.error, found.energy, found.sum_energy)]
    return Parts(zones, [SolidError(*each) for each in zip(*columns, strict=True)])


def equilibrated(
    ctx: Context,
    zones: list[ModelZone],
    stress: MChaml,
    material: MChaml,
    sides: list[Side],
    volu: Point | None,
    sweeps: int | None,
) -> Admissible:
    """Build the stress in equilibrium over all the zones together: they exchange tractions where they share nodes."""
    dim, of = zones[0].dim, shape(zones[0].shape)
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
    body = np.zeros(dim) if volu is None else volu.coords[:dim]
    count = SWEEPS if sweeps is None else sweeps
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
            return admissible_stress(points, cells, sigma, law, loads, sweeps=count, mesh=mesh)
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
