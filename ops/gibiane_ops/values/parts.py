"""Models and element fields on a part of their elements."""

from __future__ import annotations

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels import topology
from gibiane_ops.values.maillage import Block, Maillage
from gibiane_ops.values.modele import Modele, ModelZone


def model_part(ctx: Context, model: Modele, mesh: Maillage) -> Modele:
    """Return a model on the elements of a mesh; error 21 when one is no element of the model.

    Elements of one type that belong to several zones of the model stay apart.
    """
    zones = []
    for block in mesh.blocks:
        found = 0
        for zone in model.zones:
            if zone.shape != block.shape:
                continue
            group, _ = topology.group_by_nodes(np.vstack([zone.cells, block.cells]))
            inside = np.isin(group[len(zone.cells) :], group[: len(zone.cells)])
            if inside.any():
                part = Maillage(mesh.store, [Block(block.shape, block.cells[inside], block.colours[inside])])
                zones.append(ModelZone(part, zone.formulation, zone.law, zone.mode))
                found += int(inside.sum())
        if found < len(block.cells):
            ctx.fail(
                21,
                "{count} {shape} of the mesh are not elements of the model",
                at="mesh",
                count=len(block.cells) - found,
                shape=block.shape,
                hint="REDU wants elements of the model itself: ELEM chooses among them",
            )
    return Modele(zones)
