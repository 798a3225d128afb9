"""Loads and supports on the boundary of a model, as estimates that look at equilibrium need them: densities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context
from gibiane.values import CHPOINT, FLOTTANT, MAILLAGE, POINT, RIGIDITE
from gibiane_ops.kernels import geometry, hanging, integrals, topology
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.topology import Facets
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.modele import DISPLACEMENTS, FORCES, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray, NodeStore, node_store
from gibiane_ops.values.rigidite import Rigidite

LOADS = (
    Arg("cl", RIGIDITE, "supports (BLOQ, SYMT)", optional=True),
    Key(
        "PRES",
        "a pressure and its facets, as PRES 'MASS'",
        Arg("p", (FLOTTANT, CHPOINT)),
        Arg("g", MAILLAGE),
        name="pres",
        repeat=True,
    ),
    Key(
        "FSUR",
        "a surface traction and its facets, as FSUR 'MASS'",
        Arg("v", (POINT, CHPOINT)),
        Arg("g", MAILLAGE),
        name="fsur",
        repeat=True,
    ),
    Key("VOLU", "a uniform force per unit of volume", Arg("f", POINT), name="volu"),
)


@dataclass(frozen=True, eq=False)
class Side:
    """Boundary facets of one shape.

    Attributes
    ----------
    facets : Facets
        Nodes of the session; cells counted through the zones.
    traction : (k, n, d) float64, force / length^(d - 1)
        Imposed traction at the nodes of each facet.
    free : (k, d, d) float64
        Projector on the directions held at all the nodes of a facet, where the traction is a reaction.
    pressure : (k, n) float64, force / length^(d - 1), optional
        The pressures at the nodes, whose tractions are a part of `traction`.
    """

    facets: Facets
    traction: FloatArray
    free: FloatArray
    pressure: FloatArray | None = None

    def forces(self, points: FloatArray, *, axisymmetric: bool = False) -> FloatArray:
        """Return the nodal forces that the tractions stand for, (k, n, d): a pressure follows the bends of its facets.

        Tractions of a pressure are exact at the nodes of a bent facet; between them, normals are no polynomials.
        """
        of, X = shape(self.facets.name), points[self.facets.nodes]
        traction, given = self.traction, np.zeros_like(self.traction)
        if self.pressure is not None:
            traction = traction + self.pressure[..., None] * nodal_normals(of, X)
            given = integrals.pressure_load(of, X, self.pressure, axisymmetric=axisymmetric)
        M = integrals.element_mass(of, X, axisymmetric=axisymmetric)
        return np.asarray(given + np.matmul(M, traction), np.float64)


def exterior(
    ctx: Context,
    zones: list[ModelZone],
    supports: Rigidite | None,
    pressures: Sequence[tuple[float | ChPoint, Maillage]],
    tractions: Sequence[tuple[Point | ChPoint, Maillage]],
) -> list[Side]:
    """Gather what is imposed on the boundary of the zones.

    A facet is held where conditions on single nodes (BLOQ, SYMT) hold all of its nodes in a direction. Facets that are
    not on the boundary of the model are refused.
    """
    store, dim = node_store(ctx), zones[0].dim
    points = store.coords[:, :dim]
    sides = []
    with worded(ctx, at="model"):
        boundary = hanging.outer_boundary(points, [(z.shape, z.cells) for z in zones])
    known, held = held_directions(store, supports, DISPLACEMENTS[zones[0].family], dim)
    for name, facets in boundary.items():
        normal = nodal_normals(shape(name), points[facets.nodes])
        value = np.zeros((len(facets.nodes), shape(name).n_nodes, dim))
        pressure = np.zeros(value.shape[:2])
        for p, surface in pressures:
            here = _rows(facets, surface, name)
            nodes = facets.nodes[here]
            at = p.at(p.names[0], nodes.ravel()).reshape(nodes.shape) if isinstance(p, ChPoint) else p
            pressure[here] += np.broadcast_to(at, nodes.shape)
        for v, surface in tractions:
            here = _rows(facets, surface, name)
            nodes = facets.nodes[here]
            if isinstance(v, ChPoint):
                value[here] += v.table(FORCES[zones[0].family], nodes.ravel()).reshape(*nodes.shape, dim)
            else:
                value[here] += v.coords[:dim]
        value -= pressure[..., None] * normal
        sides.append(Side(facets, value, _common(known, held, facets.nodes), pressure))
    for where, surface in [("pres", g) for _, g in pressures] + [("fsur", g) for _, g in tractions]:
        found = sum(len(_rows(side.facets, surface, side.facets.name)) for side in sides)
        if found < surface.n_cells:
            ctx.fail(
                21,
                "{count} of the {total} loaded facets are not on the boundary of the model",
                at=where,
                count=surface.n_cells - found,
                total=surface.n_cells,
                hint="take them from the same mesh as the model: FACE, ENVE, ELEM 'APPU'",
            )
    return sides


def nodal_normals(of: Shape, X: FloatArray) -> FloatArray:
    """Return unit normals at the nodes of facets, (k, n, d): of linear ones that of the middle, everywhere."""
    if of.degree == 1:
        return np.repeat(geometry.facet_normals(of, X)[:, None], of.n_nodes, axis=1)
    geometry.check_cells(of, X, of.ref_nodes)
    normal = geometry.normal_densities(of, X, of.ref_nodes)
    return np.asarray(normal / np.linalg.norm(normal, axis=2, keepdims=True), np.float64)


def add_tractions(sides: Sequence[Side], name: str, nodes: IntArray, values: FloatArray) -> int:
    """Add tractions, (k, n, d), at the nodes of facets of one shape, (k, n); return how many are on the boundary."""
    found = 0
    for side in sides:
        if side.facets.name != name:
            continue
        group, _ = topology.group_by_nodes(np.vstack([side.facets.nodes, nodes]))
        row = np.full(int(group.max(initial=0)) + 1, -1, np.int64)
        row[group[: len(side.facets.nodes)]] = np.arange(len(side.facets.nodes))
        target = row[group[len(side.facets.nodes) :]]
        known = np.flatnonzero(target >= 0)
        order = (nodes[known][:, None] == side.facets.nodes[target[known]][:, :, None]).argmax(axis=2)
        side.traction[target[known]] += np.take_along_axis(values[known], order[:, :, None], axis=1)
        found += len(known)
    return found


def _rows(facets: Facets, surface: Maillage, name: str) -> IntArray:
    """Return which boundary facets belong to a surface."""
    given = [block.cells for block in surface.blocks if block.shape == name]
    if not given:
        return np.zeros(0, np.int64)
    group, _ = topology.group_by_nodes(np.vstack([facets.nodes, *given]))
    return np.flatnonzero(np.isin(group[: len(facets.nodes)], group[len(facets.nodes) :]))


def held_directions(
    store: NodeStore, supports: Rigidite | None, names: Sequence[str], dim: int
) -> tuple[IntArray, FloatArray]:
    """Return the nodes that equality conditions of their own hold, sorted, and the projectors on the directions held.

    A last projector, of zeros, serves the other nodes.
    """
    nodes, matrices = [np.zeros(0, np.int64)], [np.zeros((0, dim, dim))]
    place = {name: i for i, name in enumerate(names)}
    for part in supports.conditions if supports is not None else []:
        row, node, unknown, factor = part.reactions
        if part.sense != "=" or not len(row):
            continue
        count, node = len(part.multipliers), store.canonical(node)
        column = np.array([place.get(str(name), -1) for name in unknown])
        low, high = np.full(count, store.count), np.full(count, -1)
        np.minimum.at(low, row, np.where(column >= 0, node, -1))
        np.maximum.at(high, row, node)
        vector = np.zeros((count, dim))
        np.add.at(vector, (row, column), np.where(column >= 0, factor, 0.0))
        length = (vector**2).sum(axis=1)
        own = (low == high) & (length > 0)
        nodes.append(low[own])
        matrices.append(vector[own][:, :, None] * vector[own][:, None, :] / length[own][:, None, None])
    known, inverse = np.unique(np.concatenate(nodes), return_inverse=True)
    total = np.zeros((len(known) + 1, dim, dim))
    np.add.at(total, inverse, np.concatenate(matrices))
    return known, projectors(total)


def projectors(matrices: FloatArray) -> FloatArray:
    """Return the projectors on the ranges of symmetric matrices without negative values, (k, d, d)."""
    values, vectors = np.linalg.eigh(matrices)
    kept = np.where(values > 1e-9, 1.0, 0.0)
    return np.asarray(np.einsum("kiv,kv,kjv->kij", vectors, kept, vectors), np.float64)


def held_at(known: IntArray, held: FloatArray, nodes: IntArray) -> FloatArray:
    """Return the projectors on the directions held at given nodes, (..., d, d), see `held_directions`."""
    padded = np.append(known, -1)
    place = np.searchsorted(known, nodes)
    found = np.where(padded[place] == nodes, place, len(known))
    return np.asarray(held[found], np.float64)


def _common(known: IntArray, held: FloatArray, nodes: IntArray) -> FloatArray:
    """Return the projectors on the directions held at all the nodes of each facet, (k, d, d)."""
    left = (np.eye(held.shape[1]) - held_at(known, held, nodes)).sum(axis=1)
    return np.asarray(np.eye(left.shape[1]) - projectors(left), np.float64)
