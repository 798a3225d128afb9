"""Smoothed stresses of the solids of a model: what LISSER returns and ERREUR compares with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels import recovery
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import NotConverged
from gibiane_ops.kernels.recovery import StressBlock
from gibiane_ops.kernels.supports import moved
from gibiane_ops.kernels.topology import places_in, used_nodes
from gibiane_ops.values.champs import MChaml
from gibiane_ops.values.material import on_zone, solid_zones
from gibiane_ops.values.modele import Modele, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store

METHODS = ("SPR", "MOYE", "MOYC", "PROJ")


@dataclass(frozen=True, eq=False)
class Solid:
    """Zones that are smoothed together.

    Attributes
    ----------
    zones : list of ModelZone
    points : (k, dim) float64, length
        The nodes of these zones.
    nodes : (k,) int64
        Their ids in the session, sorted.
    blocks : list of StressBlock
        One per zone, nodes numbered in `points`, stresses at the stress points.
    nodal : (k, c) float64
        Smoothed stress.
    """

    zones: list[ModelZone]
    points: FloatArray
    nodes: IntArray
    blocks: list[StressBlock]
    nodal: FloatArray


@dataclass(frozen=True, eq=False)
class Balance:
    """What patches with equilibrium know of the loads.

    Attributes
    ----------
    body : (dim,) float64, force / length^dim
    zones : list of ModelZone
        All the zones, in the order in which `surface` counts cells.
    surface : recovery.Surface
    """

    body: FloatArray
    zones: list[ModelZone]
    surface: recovery.Surface

    def surface_of(self, zones: list[ModelZone]) -> recovery.Surface:
        """Return the facets of some zones, cells counted through these."""
        place, start = np.full(sum(len(z.cells) for z in self.zones), -1), 0
        for zone in zones:
            first = 0
            for other in self.zones:
                if other is zone:
                    place[first : first + len(zone.cells)] = np.arange(start, start + len(zone.cells))
                first += len(other.cells)
            start += len(zone.cells)
        s = self.surface
        here = np.flatnonzero(place[s.cell] >= 0)
        return recovery.Surface(place[s.cell[here]], s.place[here], s.normal[here], s.traction[here], s.known[here])


def solids_of(zones: list[ModelZone]) -> list[list[ModelZone]]:
    """Group zones into solids: each is one, but zones of different elements that share nodes belong together.

    MODE makes one zone per type of element of a mesh; two zones of one type come from two calls, hence two solids.
    """
    groups: list[list[ModelZone]] = []
    for zone in zones:
        home = next(
            (
                g
                for g in groups
                if zone.shape not in [z.shape for z in g] and any(len(np.intersect1d(zone.cells, z.cells)) for z in g)
            ),
            None,
        )
        if home is None:
            groups.append([zone])
        else:
            home.append(zone)
    return groups


def smoothed(
    ctx: Context,
    model: Modele,
    stress: MChaml,
    method: str,
    given: MChaml | None = None,
    degree: int | None = None,
    *,
    pairs: IntArray | None = None,
    balance: Balance | None = None,
) -> list[Solid]:
    """Smooth the stresses of every solid of a model, or take them from a field at the nodes that is `given`.

    `degree` bounds that of the patches. Patches that miss terms for want of elements are told in a note. With `pairs`
    of nodes, (k, 2), the solids that they link are smoothed together, as if they were bonded; with `balance` patches
    look at equilibrium.
    """
    store = node_store(ctx)
    solids = []
    if pairs is not None:
        return _together(ctx, model, stress, method, degree, pairs)
    fallbacks = flattened = 0
    if any(z.bars for z in model.zones):
        ctx.fail(251, "stresses of bars cannot be smoothed: a model of massive elements is wanted", at="model")
    for zones in solids_of(solid_zones(ctx, model)):
        nodes = used_nodes([z.cells for z in zones])
        points = store.coords[nodes][:, : zones[0].dim]
        blocks = []
        for zone in zones:
            of = shape(zone.shape)
            values = moved(of, on_zone(ctx, stress, zone, "stress").values, stress.support, "STRESSES")
            blocks.append(StressBlock(of, places_in(nodes, zone.cells), values))
        if given is None:
            try:
                if balance is None:
                    found = recovery.recover(points, blocks, method, degree)
                else:
                    known, axis = balance.surface_of(zones), zones[0].axisymmetric
                    found = recovery.enriched_recovery(points, blocks, balance.body, known, axisymmetric=axis)
            except NotConverged as failure:
                ctx.fail(
                    997,
                    "the projection does not converge: residual {residual} after {count} iterations",
                    residual=f"{failure.history[-1]:.3g}",
                    count=len(failure.history),
                )
            nodal = found.nodal
            fallbacks += found.fallbacks
            flattened += found.flattened
        else:
            nodal = _given(ctx, given, zones, nodes, blocks)
        solids.append(Solid(zones, points, nodes, blocks, nodal))
    if fallbacks:
        ctx.warn(
            "G411",
            "{count} patches have too few elements: their nodes take the mean of the elements around them",
            count=fallbacks,
            hint="a finer mesh, or LISSER 'MOYE'",
        )
    if flattened:
        ctx.warn(
            "G411",
            "{count} patches have too few elements to see every curvature: there the stress is taken straight",
            level=0,
            count=flattened,
            hint="two layers of elements or more, or LISSER 'MOYE'",
        )
    return solids


def _together(
    ctx: Context, model: Modele, stress: MChaml, method: str, degree: int | None, pairs: IntArray
) -> list[Solid]:
    """Smooth all the zones as one solid whose paired nodes are one."""
    zones = solid_zones(ctx, model)
    nodes = used_nodes([z.cells for z in zones])
    known = pairs[np.isin(pairs, nodes).all(axis=1)]
    name = np.arange(len(nodes))
    name[np.searchsorted(nodes, known[:, 0])] = np.searchsorted(nodes, known[:, 1])
    used, place = np.unique(name, return_inverse=True)
    points = node_store(ctx).coords[nodes[used]][:, : zones[0].dim]
    blocks = []
    for zone in zones:
        values = moved(shape(zone.shape), on_zone(ctx, stress, zone, "stress").values, stress.support, "STRESSES")
        blocks.append(StressBlock(shape(zone.shape), place[places_in(nodes, zone.cells)], values))
    found = recovery.recover(points, blocks, method, degree)
    return [Solid(zones, node_store(ctx).coords[nodes][:, : zones[0].dim], nodes, blocks, found.nodal[place])]


def _given(
    ctx: Context, field: MChaml, zones: list[ModelZone], nodes: IntArray, blocks: list[StressBlock]
) -> FloatArray:
    """Return the nodal values of a smoothed field given by the user (values of one node agree, or are averaged)."""
    values = [
        moved(block.shape, on_zone(ctx, field, zone, "smooth").values, field.support, "NOEUD")
        for zone, block in zip(zones, blocks, strict=True)
    ]
    return recovery.nodal_mean(len(nodes), [b.cells for b in blocks], values)
