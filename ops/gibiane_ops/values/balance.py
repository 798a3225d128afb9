"""Balance of a finite-element stress with the loads given, node by node, and what it says of the tractions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels import elasticity, geometry, integrals, recovery
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.hanging import hanging_nodes
from gibiane_ops.kernels.supports import moved
from gibiane_ops.kernels.topology import Block, places_in, used_nodes
from gibiane_ops.values.champs import MChaml
from gibiane_ops.values.exterior import Side, held_at, held_directions
from gibiane_ops.values.maillage import Point
from gibiane_ops.values.material import on_zone
from gibiane_ops.values.modele import DISPLACEMENTS, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store
from gibiane_ops.values.rigidite import Rigidite
from gibiane_ops.values.smoothed import Balance

UNBALANCED = 1e-7
"""Largest force left at a node, over the largest nodal force of an element."""


def unbalanced(
    ctx: Context,
    zones: list[ModelZone],
    stress: MChaml,
    sides: list[Side],
    volu: Point | None,
    supports: Rigidite | None,
    contact: Sequence[tuple[IntArray, FloatArray]] = (),
) -> tuple[IntArray, FloatArray]:
    """Return the nodes that keep a force, the largest first, and these forces, (n, d).

    `contact` gives nodes and forces that act on them beside the loads; directions that are held keep no force.
    """
    store, dim, axis = node_store(ctx), zones[0].dim, zones[0].axisymmetric
    nodes = used_nodes([z.cells for z in zones])
    points = store.coords[nodes][:, :dim]
    force, scale = np.zeros((len(nodes), dim)), 0.0
    for zone in zones:
        of, cells = shape(zone.shape), places_in(nodes, zone.cells)
        values = moved(of, on_zone(ctx, stress, zone, "stress").values, stress.support, "STRESSES")
        inner = elasticity.internal_forces(of, points[cells], values, axisymmetric=axis)
        scale = max(scale, float(np.abs(inner).max(initial=0.0)))
        np.add.at(force, cells, -inner)
        if volu is not None:
            load = integrals.distributed_load(of, points[cells], volu.coords[:dim], axisymmetric=axis)
            np.add.at(force, cells, load)
    for side in sides:
        places = np.searchsorted(nodes, side.facets.nodes)
        np.add.at(force, places, side.forces(store.coords[:, :dim], axisymmetric=axis))
    for where, values in contact:
        np.add.at(force, np.searchsorted(nodes, where), values)
    _to_masters(points, [(z.shape, places_in(nodes, z.cells)) for z in zones], force)
    known, held = held_directions(store, supports, DISPLACEMENTS[zones[0].family], dim)
    force -= np.einsum("nij,nj->ni", held_at(known, held, nodes), force)
    size = np.linalg.norm(force, axis=1)
    wrong = np.flatnonzero(size > UNBALANCED * scale)
    worst = wrong[np.argsort(-size[wrong], kind="stable")]
    return nodes[worst], force[worst]


def _to_masters(points: FloatArray, blocks: Sequence[Block], force: FloatArray) -> None:
    """Move the forces of hanging nodes, and of middle nodes beside linear elements, to those that they follow."""
    hanging, masters = hanging_nodes(points, blocks)
    count = (masters >= 0).sum(axis=1)
    row, place = np.nonzero(masters >= 0)
    # a node may follow one that hangs itself
    while force[hanging].any():
        share = force[hanging] / count[:, None]
        force[hanging] = 0.0
        np.add.at(force, masters[row, place], share[row])


def known_tractions(
    ctx: Context,
    zones: list[ModelZone],
    stress: MChaml,
    sides: list[Side],
    volu: Point | None,
    supports: Rigidite | None,
) -> Balance:
    """Gather what patches with equilibrium need; a facet with a node that keeps a force has no known traction."""
    store, dim = node_store(ctx), zones[0].dim
    points = store.coords[:, :dim]
    left, _ = unbalanced(ctx, zones, stress, sides, volu, supports)
    parts = []
    for side in sides:
        of, X = shape(side.facets.name), points[side.facets.nodes]
        xi = recovery.surface_points(of)
        normal = geometry.normal_densities(of, X, xi)
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        known = np.eye(dim) - side.free
        known[np.isin(side.facets.nodes, left).any(axis=1)] = 0.0
        each = (geometry.positions(of, X, xi), normal, np.matmul(of.N(xi), side.traction))
        parts.append(
            (
                np.repeat(side.facets.cell, len(xi)),
                *(values.reshape(-1, dim) for values in each),
                np.repeat(known, len(xi), axis=0),
            )
        )
    surface = recovery.Surface(*(np.concatenate(each) for each in zip(*parts, strict=True)))
    if len(left):
        ctx.warn(
            "G411",
            "{count} nodes keep a force under the loads given: the tractions around them count as unknown",
            level=0,
            count=len(left),
            hint="that is right for contact and point loads; give the others by 'PRES', 'FSUR' or 'VOLU'",
        )
    return Balance(np.zeros(dim) if volu is None else volu.coords[:dim], zones, surface)
