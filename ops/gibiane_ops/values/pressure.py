"""Surfaces under pressure: the zones of a model, and the nodal forces of a field on them."""

from __future__ import annotations

from gibiane.registry import Context
from gibiane_ops.kernels import assembly, integrals, topology
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.supports import moved
from gibiane_ops.values.champs import DISCRET, ChPoint, MChaml
from gibiane_ops.values.failures import worded
from gibiane_ops.values.modele import FORCES, Modele, ModelZone
from gibiane_ops.values.nodes import node_store

COMPONENT, SUBTYPE = "PRES", "PRESSION"


def pressed(ctx: Context, model: Modele) -> list[ModelZone]:
    """Return the surfaces under pressure of a model; error 26 without any."""
    if not model.loads:
        ctx.fail(
            26,
            "this model holds no surface under pressure",
            at="model",
            hint="MODE G 'CHARGEMENT' 'PRESSION' makes one; PRES 'MASS' loads a solid",
        )
    return model.loads


def pressure_forces(ctx: Context, model: Modele, field: MChaml) -> ChPoint:
    """Return the nodal forces of pressures on the surfaces of a model; they act against the normals of the facets."""
    store, blocks = node_store(ctx), []
    zones = pressed(ctx, model)
    for zone in zones:
        values = field.zone_of(zone)
        if values is None:
            continue
        of = shape(zone.shape)
        nodal = moved(of, values.values, field.support, "NOEUD")[..., 0]
        x = store.coords[zone.cells][..., : zone.dim]
        with worded(ctx, at="model"):
            blocks.append((zone.cells, integrals.pressure_load(of, x, nodal, axisymmetric=zone.axisymmetric)))
    nodes = topology.used_nodes([cells for cells, _ in blocks])
    local = [(topology.places_in(nodes, cells), forces) for cells, forces in blocks]
    dim = zones[0].dim
    total = assembly.assemble_vector(len(nodes), dim, local).reshape(-1, dim)
    return ChPoint.from_table(store, FORCES[zones[0].family], nodes, total, DISCRET)
