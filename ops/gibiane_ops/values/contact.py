"""Contact zones: their pairs, their laws of friction, and what they hold after a solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels import errors as k_errors
from gibiane_ops.kernels.contact.areas import nodal_areas
from gibiane_ops.kernels.contact.frames import local_frames
from gibiane_ops.kernels.contact.law import Friction, friction
from gibiane_ops.kernels.contact.obstacle import obstacle_pairs
from gibiane_ops.kernels.contact.pairs import ContactPairs, node_pairs
from gibiane_ops.values.champs import ChamZone, ChPoint, MChaml
from gibiane_ops.values.failures import worded
from gibiane_ops.values.modele import ContactZone, Modele
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store

DISPLACEMENT = ("UX", "UY", "UZ")
FORCE = ("FX", "FY", "FZ")

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
_REACH = 0.45
"""Largest gap that pairs of nodes may bridge, over the shortest edge of the slave surface."""

_OFFSET = 0.05
"""Largest distance along the surface of two nodes that make a pair, over the same edge."""


def zone_pairs(ctx: Context, zone: ContactZone, at: str) -> ContactPairs:
    """Return the pairs of a contact zone in nodes of the session (G401, G402 when there are none)."""
    points = node_store(ctx).coords[:, : int(ctx.option("DIME"))]
    slave, master = zone.slave.kernel_blocks, zone.master.kernel_blocks
    with worded(ctx, at=at):
        pairs = obstacle_pairs(points, slave, master) if zone.rigid else _node_pairs(points, zone)
    if len(pairs.not_facing):
        ctx.fail(
            "G402",
            "the surfaces do not face each other: their normals point the same way at {count} of {total} pairs",
            at=at,
            count=len(pairs.not_facing),
            total=len(pairs.pairs),
            hint="facets turn so that normals leave their solid: take them with FACE or ENVE, or turn one with ORIE",
        )
    return pairs


def warn_unpaired(ctx: Context, zone: ContactZone, pairs: ContactPairs, at: str) -> None:
    """Say how many nodes of the smaller surface have no partner (G401); past the border of an obstacle it is normal."""
    lost = min(len(pairs.unpaired_slave), len(pairs.unpaired_master))
    if lost and not zone.rigid:
        ctx.warn(
            "G401",
            "{count} nodes of the smaller surface have no partner and stay free of contact",
            at=at,
            count=lost,
        )


def _node_pairs(points: FloatArray, zone: ContactZone) -> ContactPairs:
    """Pair coincident nodes, and those left on both sides that face each other across less than half an edge."""
    slave, master = zone.slave.kernel_blocks, zone.master.kernel_blocks
    edges = [np.linalg.norm(points[c] - points[np.roll(c, 1, axis=1)], axis=2).min() for _, c in slave if len(c)]
    edge = float(min(edges, default=0.0))
    try:
        close = node_pairs(points, slave, master)
    except k_errors.EmptyContact:
        return node_pairs(points, slave, master, tolerance=_REACH * edge, offset=_OFFSET * edge)
    if len(close.unpaired_slave) and len(close.unpaired_master):
        return node_pairs(points, slave, master, tolerance=_REACH * edge, offset=_OFFSET * edge)
    return close


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


def zone_friction(ctx: Context, zone: ContactZone, values: ChamZone | None, nodes: IntArray) -> Friction:
    """Return the law of the pairs of a zone: stresses times the share of area of each node."""
    given: dict[str, FloatArray] = {}
    if values is not None:
        found = {name: nodal_property(ctx, values, name, nodes) for name in values.names}
        given = {name: column for name, column in found.items() if column is not None}
    if zone.law == "UNILATERAL":
        given.pop("MU", None)
    if "SEUI" in given:
        given["COHE"] = given.pop("SEUI")
    if given.keys() & {"COHE", "ADHE", "KT"}:
        points = node_store(ctx).coords[:, : int(ctx.option("DIME"))]
        area = nodal_areas(points, zone.slave.kernel_blocks, node_store(ctx).canonical(nodes))
        given |= {name: given[name] * area for name in ("COHE", "ADHE", "KT") if name in given}
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
        Nodal force on body 1 in these axes, negative normal in compression.
    relative : (n, d) float64, length
        u1 - u2 in these axes.
    gap : (n,) float64, length
        Initial gap.
    mu : (n,) float64
        Friction coefficient, 0 without friction.
    """

    zone: ContactZone
    pairs: ContactPairs
    frames: FloatArray
    force: FloatArray
    relative: FloatArray
    gap: FloatArray
    mu: FloatArray


def solved_contacts(
    ctx: Context, model: Modele, material: MChaml | None, u: ChPoint, reaction: ChPoint, at: str = "mc"
) -> list[SolvedContact]:
    """Gather the state of every contact zone of a model from a displacement and the contact forces (REAC)."""
    found = []
    if not model.contacts:
        ctx.fail(26, "this model has no contact zone", at=at, hint="MODE G1 G2 'CONTACT' ... makes one")
    for zone in model.contacts:
        dim = 3 if "UZ" in u.names else 2
        pairs = zone_pairs(ctx, zone, at)
        frames, _, _ = local_frames(pairs.normals, np.ones((len(pairs.pairs), dim), bool))
        values = material.zone_of(zone) if material is not None else None
        slave, master = pairs.pairs.T
        gap = nodal_property(ctx, values, "JEU", slave)
        mu = nodal_property(ctx, values, "MU", slave) if zone.law != "UNILATERAL" else None
        relative = u.table(DISPLACEMENT[:dim], slave)
        relative -= np.where(master[:, None] >= 0, u.table(DISPLACEMENT[:dim], master), 0.0)
        force = reaction.table(FORCE[:dim], slave)
        found.append(
            SolvedContact(
                zone,
                pairs,
                frames,
                np.einsum("nij,nj->ni", frames, force),
                np.einsum("nij,nj->ni", frames, relative),
                pairs.gap if gap is None else gap,
                np.zeros(len(slave)) if mu is None else mu,
            )
        )
    return found
