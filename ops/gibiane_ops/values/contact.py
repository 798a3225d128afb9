"""Contact zones: their pairs, their laws of friction, and what they hold after a solution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import scipy.sparse as sp

from gibiane.registry import Context
from gibiane_ops.kernels import errors as k_errors
from gibiane_ops.kernels.contact.frames import local_frames
from gibiane_ops.kernels.contact.law import Friction, friction
from gibiane_ops.kernels.contact.mortar import mortar_pairs
from gibiane_ops.kernels.contact.node_facet import are_inside, node_facet_pairs
from gibiane_ops.kernels.contact.node_pairs import node_pairs, with_surface
from gibiane_ops.kernels.contact.obstacle import obstacle_pairs
from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.kernels.contact.sharing import forces_by_zone
from gibiane_ops.values.champs import ChamZone, ChPoint, MChaml
from gibiane_ops.values.conditions import family
from gibiane_ops.values.failures import worded
from gibiane_ops.values.following import carried
from gibiane_ops.values.modele import DISPLACEMENTS, FORCES, ContactZone, Modele
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store

DISPLACEMENT = ("UX", "UY", "UZ")

# Properties of MATE that each law needs, those that it may have, and their ranges: low, low excluded, high.
NEEDS: dict[str, tuple[str, ...]] = {
    "UNILATERAL": (),
    "COULOMB": ("MU",),
    "TRESCA": ("SEUI",),
    "REGULARISE": ("MU", "KT"),
    "NORTON": ("MU", "EXPO", "VREF"),
}
MAY_HAVE: dict[str, tuple[str, ...]] = {
    "UNILATERAL": ("MU", "ADHE", "JEU"),
    "COULOMB": ("COHE", "ADHE", "JEU"),
    "TRESCA": ("ADHE", "JEU"),
    "REGULARISE": ("COHE", "JEU"),
    "NORTON": ("COHE", "JEU"),
}
RANGES = {
    "MU": (0.0, False, np.inf),
    "COHE": (0.0, False, np.inf),
    "SEUI": (0.0, False, np.inf),
    "ADHE": (0.0, False, np.inf),
    "KT": (0.0, True, np.inf),
    "EXPO": (0.0, True, 1.0),
    "VREF": (0.0, True, np.inf),
    "JEU": (-np.inf, False, np.inf),
}
LOCKING = ("SYME", "FAIB")
"""Kinematics whose conditions are not independent on meshes that differ."""

_REACH = 0.45
"""Largest gap that pairs of nodes may bridge, over the shortest edge of the slave surface."""

_OFFSET = 0.05
"""Largest distance along the surface of two nodes that make a pair, over the same edge."""


def zone_pairs(ctx: Context, zone: ContactZone, at: str) -> ContactPairs:
    """Return the pairs of a contact zone in nodes of the session (G401, G402 when there are none)."""
    points = node_store(ctx).coords[:, : int(ctx.option("DIME"))]
    axis = family(ctx) == "AXIS"
    # RIGI, COFR and ERREUR ask in turn: the pairs are kept until the nodes move
    used = np.concatenate([zone.slave.nodes, zone.master.nodes])
    key = (axis, used.tobytes(), points[used].tobytes())
    cache: dict[int, Any] = ctx.state.setdefault("contact pairs", {})
    known = cache.get(id(zone))
    if known is not None and known[:2] == (zone, key):
        return cast(ContactPairs, known[2])
    with worded(ctx, at=at):
        try:
            pairs = _pairs(ctx, points, zone, axis, at)
        except k_errors.EmptyContact:
            if zone.rigid:
                raise
            pairs = _looking_away(points, zone)
    if len(pairs.not_facing):
        ctx.fail(
            "G402",
            "the surfaces do not face each other: their normals point the same way at {count} of {total} pairs",
            at=at,
            count=len(pairs.not_facing),
            total=len(pairs.pairs),
            hint="facets turn so that normals leave their solid: take them with FACE or ENVE, or turn one with ORIE",
        )
    cache[id(zone)] = zone, key, pairs
    return pairs


def warn_unpaired(ctx: Context, zone: ContactZone, pairs: ContactPairs, at: str) -> None:
    """Say how many nodes of the smaller surface have no partner (G401); past the border of an obstacle it is normal."""
    lost = min(len(pairs.unpaired_slave), len(pairs.unpaired_master))
    if lost and not zone.rigid and zone.kinematics == "NOEU":
        ctx.warn(
            "G401",
            "{count} nodes of the smaller surface have no partner and stay free of contact",
            at=at,
            count=lost,
        )


def _pairs(ctx: Context, points: FloatArray, zone: ContactZone, axis: bool, at: str) -> ContactPairs:
    """Pair coincident nodes where the surfaces have them, else interpolate as the kinematics of the zone say."""
    slave, master = zone.slave.kernel_blocks, zone.master.kernel_blocks
    if zone.rigid:
        if zone.kinematics == "MORT":
            return mortar_pairs(points, slave, master, rigid=True, axisymmetric=axis)
        return with_surface(obstacle_pairs(points, slave, master), points, slave, axis)
    pairs = _node_pairs(points, zone, axis)
    if pairs is not None:
        return pairs
    if zone.kinematics in LOCKING:
        ctx.fail(
            251,
            "'{word}' goes with coincident nodes only: between different meshes its conditions outnumber the motions "
            "of the surfaces, which lock",
            at=at,
            word=zone.kinematics,
            hint="'MORT' holds the mean gap about each node, and is exact for a uniform pressure",
        )
    if zone.kinematics == "MORT":
        return mortar_pairs(points, slave, master, axisymmetric=axis)
    return node_facet_pairs(points, slave, master, axisymmetric=axis)


def _looking_away(points: FloatArray, zone: ContactZone) -> ContactPairs:
    """Find the pairs of surfaces that look the same way, to tell that from surfaces that are elsewhere."""
    found = node_facet_pairs(points, zone.slave.kernel_blocks, zone.master.kernel_blocks, facing=False)
    near = np.abs(found.gap) <= found.size
    if not near[found.not_facing].any():
        raise k_errors.EmptyContact("no part of one surface lies in front of the other")
    return found


def _node_pairs(points: FloatArray, zone: ContactZone, axis: bool) -> ContactPairs | None:
    """Pair coincident nodes, and those left on both sides that face each other across less than half an edge.

    None when nodes of both surfaces stay alone, or nodes of one before facets of the other, unless pairs are asked for.
    """
    slave, master = zone.slave.kernel_blocks, zone.master.kernel_blocks
    edges = [np.linalg.norm(points[c] - points[np.roll(c, 1, axis=1)], axis=2).min() for _, c in slave if len(c)]
    edge = float(min(edges, default=0.0))
    found = None
    for limits in ({}, {"tolerance": _REACH * edge, "offset": _OFFSET * edge}):
        try:
            found = node_pairs(points, slave, master, axisymmetric=axis, **limits)
        except k_errors.EmptyContact:
            if limits and zone.kinematics == "NOEU":
                raise
            continue
        whole = not len(found.unpaired_slave) or not len(found.unpaired_master)
        # nodes past the border of the smaller surface are ignored, those of a finer mesh before it are not
        if whole and (
            zone.kinematics == "NOEU"
            or not (
                are_inside(points, found.unpaired_slave, slave, master)
                or are_inside(points, found.unpaired_master, master, slave)
            )
        ):
            return found
    return found if zone.kinematics == "NOEU" else None


def nodal_property(ctx: Context, values: ChamZone | None, name: str, nodes: IntArray) -> FloatArray | None:
    """Return a property of a contact material at nodes of its slave surface, None when it was not given."""
    if values is None or name not in values.names:
        return None
    column = values.component(name)[0]
    if len(column) == 1:
        return np.full(len(nodes), column[0])
    zone = values.zone
    own = zone.slave.nodes if isinstance(zone, ContactZone) else np.zeros(0, np.int64)
    if len(own) != len(column):
        ctx.fail(21, "the nodes of the slave surface have changed since MATE: make the material again")
    return np.asarray(column[np.searchsorted(own, node_store(ctx).canonical(nodes))])


def zone_gap(ctx: Context, zone: ContactZone, values: ChamZone | None, pairs: ContactPairs) -> FloatArray:
    """Return the initial gaps of the pairs of a zone: those of MATE 'JEU', else of the geometry."""
    nodal = nodal_property(ctx, values, "JEU", pairs.pairs[:, 0])
    if nodal is None:
        return pairs.gap
    # the changed basis of quadratic facets lowers a bent gap at the middles: a gap that is not negative is no overlap
    moved = pairs.on_pairs(nodal)
    return np.where(nodal >= 0, np.maximum(moved, 0.0), moved)


def zone_friction(ctx: Context, zone: ContactZone, values: ChamZone | None, pairs: ContactPairs) -> Friction:
    """Return the law of the pairs of a zone: stresses times the share of area of each node."""
    nodes = pairs.pairs[:, 0]
    given: dict[str, FloatArray] = {}
    if values is not None:
        found = {name: nodal_property(ctx, values, name, nodes) for name in values.names}
        given = {name: column for name, column in found.items() if column is not None}
    if zone.law == "UNILATERAL":
        given.pop("MU", None)
    if "SEUI" in given:
        given["COHE"] = given.pop("SEUI")
    given |= {name: given[name] * pairs.area for name in ("COHE", "ADHE", "KT") if name in given}
    return friction(
        len(nodes),
        mu=given.get("MU", 0.0),
        cohesion=given.get("COHE", 0.0),
        slip_stiffness=given.get("KT", np.inf),
        exponent=given.get("EXPO", 0.0),
        slip_scale=given.get("VREF", 1.0),
        adhesion=given.get("ADHE", 0.0),
    )


@dataclass(frozen=True, eq=False)
class SolvedContact:
    """One contact zone of a solution.

    Attributes
    ----------
    zone : ContactZone
    pairs : ContactPairs
        Nodes of the session.
    frames : (n, d, d) float64
        Rows: outward normal of body 1 (the slave), then the tangents.
    force : (n, d) float64, force
        Nodal force on body 1 in these axes, negative normal in compression (at linear facets).
    relative : (n, d) float64, length
        Relative displacement at the slave nodes in these axes.
    gap : (n,) float64, length
        Initial gap at the slave nodes.
    pair_force, pair_relative : as above
        The same on the changed basis of quadratic facets, on which the law of contact holds.
    mu : (n,) float64
        Friction coefficient, 0 without friction.
    motion : float, length
        Largest displacement of the slave nodes.
    """

    zone: ContactZone
    pairs: ContactPairs
    frames: FloatArray
    force: FloatArray
    relative: FloatArray
    gap: FloatArray
    pair_force: FloatArray
    pair_relative: FloatArray
    mu: FloatArray
    motion: float

    @property
    def is_mortar(self) -> bool:
        """Whether forces are those of dual multipliers: over the area of a node they are tractions."""
        return self.zone.kinematics == "MORT" and (self.zone.rigid or len(self.pairs.row) > 0)


def solved_contacts(
    ctx: Context, model: Modele, material: MChaml | None, u: ChPoint, reaction: ChPoint
) -> list[SolvedContact]:
    """Gather the state of every contact zone of a model from a displacement and the contact forces (REAC)."""
    found, kind, store = [], family(ctx), node_store(ctx)
    if not model.contacts:
        ctx.fail(26, "this model has no contact zone", at="mc", hint="MODE G1 G2 'CONTACT' ... makes one")
    every = []
    for zone in model.contacts:
        pairs = carried(zone_pairs(ctx, zone, "mc"), reaction.nodes)
        # forces of a node on a sharp edge are known together: it counts for the side that comes first
        first = np.unique(pairs.pairs[:, 0], return_index=True)[1]
        every.append(pairs.only(np.sort(first)) if len(first) < len(pairs.pairs) else pairs)
    forces = forces_by_zone(every, lambda nodes: reaction.table(FORCES[kind], nodes))
    for zone, pairs, force in zip(model.contacts, every, forces, strict=True):
        frames, _, _ = local_frames(pairs.normals, np.ones(pairs.normals.shape, bool))
        values = material.zone_of(zone) if material is not None else None
        slave = pairs.pairs[:, 0]
        gap = zone_gap(ctx, zone, values, pairs)
        mu = nodal_property(ctx, values, "MU", slave) if zone.law != "UNILATERAL" else None
        nodes, rows = _columns(pairs.matrix(store.count))
        relative = rows @ u.table(DISPLACEMENTS[kind], nodes)
        vectors = force, relative, pairs.forces_on_pairs(force), pairs.at_nodes(relative)
        local_force, pair_relative, pair_force, at_nodes = (np.einsum("nij,nj->ni", frames, v) for v in vectors)
        found.append(
            SolvedContact(
                zone,
                pairs,
                frames,
                local_force,
                at_nodes,
                pairs.at_nodes(gap),
                pair_force,
                pair_relative,
                np.zeros(len(slave)) if mu is None else mu,
                float(np.abs(u.table(DISPLACEMENTS[kind], slave)).max(initial=0.0)),
            )
        )
    return found


def _columns(matrix: sp.csr_array) -> tuple[IntArray, sp.csr_array]:
    """Keep the columns of a sparse matrix that are not empty."""
    used = np.unique(matrix.indices).astype(np.int64)
    return used, sp.csr_array(sp.csc_array(matrix)[:, used])
