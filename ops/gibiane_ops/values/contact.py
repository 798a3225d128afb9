"""What contact zones hold after a solution: pairs, frames, forces and relative displacements, zone by zone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gibiane.registry import Context

from gibiane_ops.kernels.contact.frames import local_frames
from gibiane_ops.kernels.contact.pairs import ContactPairs, node_pairs
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.failures import worded
from gibiane_ops.values.modele import ContactZone, Modele
from gibiane_ops.values.nodes import FloatArray, node_store

DISPLACEMENT = ("UX", "UY", "UZ")
FORCE = ("FX", "FY", "FZ")


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
    store = node_store(ctx)
    found = []
    if not model.contacts:
        ctx.fail(26, "this model has no contact zone", at=at, hint="MODE G1 G2 'CONTACT' ... makes one")
    for zone in model.contacts:
        dim = 3 if "UZ" in u.names else 2
        with worded(ctx, at=at):
            pairs = node_pairs(store.coords[:, :dim], zone.slave.kernel_blocks, zone.master.kernel_blocks)
        n = len(pairs.pairs)
        frames, _, _ = local_frames(pairs.normals, np.ones((n, dim), bool))
        values = material.zone_of(zone) if material is not None else None
        gap, mu = pairs.gap, np.zeros(n)
        if values is not None and "JEU" in values.names:
            gap = np.full(n, values.component("JEU")[0, 0])
        if values is not None and "MU" in values.names and zone.law == "COULOMB":
            mu = np.full(n, values.component("MU")[0, 0])
        slave, master = pairs.pairs.T
        relative = u.table(DISPLACEMENT[:dim], slave) - u.table(DISPLACEMENT[:dim], master)
        force = reaction.table(FORCE[:dim], slave)
        found.append(
            SolvedContact(
                zone,
                pairs,
                frames,
                np.einsum("nij,nj->ni", frames, force),
                np.einsum("nij,nj->ni", frames, relative),
                gap,
                mu,
            )
        )
    return found
