"""The surface of a solved contact on the sides of simplices: what tractions in balance need at its points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane.registry import Context
from gibiane_ops.kernels.contact.frames import local_frames
from gibiane_ops.kernels.contact.node_pairs import all_partners
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.bodies import loose_motions
from gibiane_ops.kernels.estimate.contact import densities, with_following
from gibiane_ops.kernels.estimate.sides import Parts
from gibiane_ops.values.champs import MChaml
from gibiane_ops.values.contact import DISPLACEMENT, SolvedContact, nodal_property
from gibiane_ops.values.exterior import held_at, held_directions
from gibiane_ops.values.failures import worded
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store
from gibiane_ops.values.pieces import ROUND_OFF, Pieces
from gibiane_ops.values.rigidite import Rigidite

CLOSED = 1e-9
"""Largest opening of a closed pair, over the largest relative displacement."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Sides of simplices on the slave side of a contact zone, and the state at their corners.

    Attributes
    ----------
    quadratic : bool
        Whether a facet is of second degree.
    cells : (m, d) int64
        Points of the sides.
    owner : list of (m_b,) int64
        Facet of each side, for each block of facets.
    facing : (m, d) int64
        Points of the master before them; -1 where it has no such facet.
    points : (k,) int64
        Those of the sides, or those with a contact pair.
    partner : (k,) int64
        Points of the master before them; -1 where there are none.
    frames : (k, d, d) float64
    force : (k, d) float64, force
        On body 1, in these axes: that of the nodes, or ``int R N`` of their densities on quadratic facets.
    relative : (k, d) float64, length
    gap : (k,) float64, length
    mu : (k,) float64
    threshold : (k,) float64, force / length^(d - 1)
    sure : (k, d) bool
        Directions in which supports hold both sides.
    closed : (k,) bool
    motions : (q, k, d) float64
        Relative displacements in the rigid motions that supports leave to each body.
    """

    quadratic: bool
    cells: IntArray
    owner: list[IntArray]
    facing: IntArray
    points: IntArray
    partner: IntArray
    frames: FloatArray
    force: FloatArray
    relative: FloatArray
    gap: FloatArray
    mu: FloatArray
    threshold: FloatArray
    sure: NDArray[np.bool_]
    closed: NDArray[np.bool_]
    motions: FloatArray

    def opens_in_part(self, traction: FloatArray) -> bool:
        """Tell whether a side that carries a traction, (m, d, d), is not closed all over."""
        closed = np.zeros(int(max(self.cells.max(), self.points.max())) + 1, bool)
        closed[self.points[self.closed]] = True
        return bool((~closed[self.cells].all(axis=1) & (np.abs(traction).max(axis=(1, 2)) > 0)).any())


def surface_of(ctx: Context, state: SolvedContact, law: MChaml, pieces: Pieces, supports: Rigidite | None) -> Surface:
    """Carry the state of a contact zone over to the sides of simplices."""
    blocks, store, dim = state.zone.slave.kernel_blocks, node_store(ctx), state.frames.shape[1]
    count = sum(int((~np.isin(cells, pieces.nodes)).any(axis=1).sum()) for _, cells in blocks)
    if count:
        lost(ctx, count)
    cuts = [pieces.facets(name, cells) for name, cells in blocks]
    cells = np.concatenate([each for each, _, _ in cuts])
    slave, master = state.pairs.pairs.T
    facing = _facing(state, pieces, cuts)
    partner_of = np.full(len(pieces.cutting.points), -1)
    partner_of[cells[facing >= 0]] = facing[facing >= 0]
    values, friction = law.zone_of(state.zone), state.zone.law == "TRESCA"
    threshold = nodal_property(ctx, values, "SEUI", slave) if friction else None
    known = held_directions(store, supports, DISPLACEMENT[:dim], dim)
    # A support holds an axis of both nodes of a pair; an obstacle (-1) needs no balance of its own.
    sure = np.diagonal(held_at(*known, slave), axis1=1, axis2=2) > 1 - ROUND_OFF
    sure &= (np.diagonal(held_at(*known, master), axis1=1, axis2=2) > 1 - ROUND_OFF) | (master < 0)[:, None]
    quadratic = any(shape(name).degree > 1 for name, _ in blocks)
    forces = state.pair_force if quadratic else state.force
    shut = np.abs(state.relative[:, 0] - state.gap) <= CLOSED * np.abs(state.relative).max()
    shut &= forces[:, 0] < 0
    if quadratic:
        points, weights, spread = _interpolated(ctx, state, pieces, cuts)
        frames, _, _ = local_frames(weights @ state.pairs.normals, np.ones((len(points), dim), bool))
        force = np.einsum("nij,nj->ni", frames, spread)
    else:
        points, weights = pieces.places(slave), sp.eye_array(len(slave), format="csr")
        frames, force = state.frames, state.force
    displaced = np.einsum("nij,ni->nj", state.frames, state.relative)
    touched = sp.csr_array((weights != 0).astype(np.float64))
    motions = _motions(ctx, state, pieces, supports)
    return Surface(
        quadratic,
        cells,
        [owner for *_, owner in cuts],
        facing,
        points,
        partner_of[points],
        frames,
        force,
        np.einsum("nij,nj->ni", frames, weights @ displaced),
        weights @ state.gap,
        np.zeros(len(points)) if friction else weights @ state.mu,
        np.zeros(len(points)) if threshold is None else weights @ threshold,
        touched @ (~sure).astype(np.float64) == 0,
        touched @ (~shut).astype(np.float64) == 0,
        np.stack([weights @ each for each in motions]) if len(motions) else np.zeros((0, len(points), dim)),
    )


def lost(ctx: Context, count: int) -> NoReturn:
    """Fail because facets are not those of the solids."""
    ctx.fail(
        251,
        "{count} contact facets have no facet of a solid with the same nodes: tractions cannot be opposite there",
        at="mc",
        count=count,
        hint="mesh the contact surface once, copy it for the other solid, and cut both alike",
    )


Cut = tuple[IntArray, FloatArray, IntArray]


def _facing(state: SolvedContact, pieces: Pieces, cuts: list[Cut]) -> IntArray:
    """Return the points of the master before those of the sides, (m, d); -1 where it has no facet there."""
    blocks = state.zone.slave.kernel_blocks
    pairs = all_partners(state.pairs.pairs, blocks, [] if state.zone.rigid else state.zone.master.kernel_blocks)
    partner = np.full(int(max(pairs.max(initial=0), *(cells.max() for _, cells in blocks))) + 1, -1)
    partner[pairs[:, 0]] = pairs[:, 1]
    found = []
    for (name, cells), (sides, _, owner) in zip(blocks, cuts, strict=True):
        there = partner[cells]
        both = np.all(there >= 0, axis=1)
        each = np.full(sides.shape, -1)
        if both.any():
            each[both[owner]] = pieces.facets(name, there[both])[0]
        found.append(each)
    return np.concatenate(found)


def _interpolated(
    ctx: Context, state: SolvedContact, pieces: Pieces, cuts: list[Cut]
) -> tuple[IntArray, sp.csr_array, FloatArray]:
    """Return the points of the sides, their values from those of the pairs, and the forces of the densities there."""
    blocks, store, dim = state.zone.slave.kernel_blocks, node_store(ctx), state.frames.shape[1]
    slave = state.pairs.pairs[:, 0]
    every, follow = with_following(blocks, slave)
    order = np.argsort(every)
    with worded(ctx, at="rea"):
        force = np.einsum("nij,ni->nj", state.frames, state.force)
        density = densities(store.coords[:, :dim], blocks, slave, force)
    at_nodes = np.vstack([follow @ density, np.zeros((1, dim))])
    points, first, place = np.unique(
        np.concatenate([sides for sides, _, _ in cuts]).ravel(), return_index=True, return_inverse=True
    )
    row, column, share = [], [], []
    total, start = np.zeros((len(points), dim)), 0
    for (name, cells), (sides, at, owner) in zip(blocks, cuts, strict=True):
        of, nodes = shape(name), cells[owner]
        spot = np.minimum(np.searchsorted(every[order], nodes), len(every) - 1)
        local = np.where(every[order][spot] == nodes, order[spot], len(every))
        N = of.N(at.reshape(-1, dim - 1)).reshape(*at.shape[:2], -1)
        entry = start + np.arange(sides.size).reshape(sides.shape)
        row.append(np.broadcast_to(entry[:, :, None], N.shape).ravel())
        column.append(np.broadcast_to(local[:, None], N.shape).ravel())
        share.append(N.ravel())
        parts = Parts(of, store.coords[nodes][:, :, :dim], at, pieces.cutting.points[sides])
        np.add.at(total, place[entry], parts.moments(at_nodes[local]))
        start += sides.size
    every_row = sp.csr_array(
        (np.concatenate(share), (np.concatenate(row), np.concatenate(column))), shape=(start, len(every) + 1)
    )
    weights = sp.csr_array(every_row[first][:, : len(every)] @ follow)
    weights.data[np.abs(weights.data) < 1e-12] = 0.0
    weights.eliminate_zeros()
    return points, weights, total


def _motions(ctx: Context, state: SolvedContact, pieces: Pieces, supports: Rigidite | None) -> FloatArray:
    """Return the relative displacements of the pairs in the rigid motions that supports leave to each body."""
    dim = pieces.zones[0].dim
    points = node_store(ctx).coords[pieces.nodes][:, :dim]
    held = held_at(*held_directions(node_store(ctx), supports, DISPLACEMENT[:dim], dim), pieces.nodes)
    motions = loose_motions(points, pieces.cells, held)
    slave, master = state.pairs.pairs.T
    one, two = np.searchsorted(pieces.nodes, slave), np.searchsorted(pieces.nodes, np.maximum(master, 0))
    return motions[:, one] - np.where((master >= 0)[:, None], motions[:, two], 0.0)
