"""Meshes of second degree from linear ones, and back."""

from __future__ import annotations

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels.elements.quadratic import QUADRATIC
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.values.maillage import Block, Maillage
from gibiane_ops.values.middles import middles_of

LINEAR = {high: low for low, high in QUADRATIC.items()}


def quadratic_mesh(ctx: Context, mesh: Maillage) -> Maillage:
    """Give linear elements mid-nodes, shared by all the meshes that share the edge; recorded sides follow."""
    middles = middles_of(ctx)
    blocks = []
    for block in mesh.blocks:
        name = QUADRATIC.get(block.shape)
        if name is None:
            blocks.append(block)
            continue
        ends = block.cells[:, np.array([edge[:2] for edge in shape(name).edges])]
        added = middles.of(ends.reshape(-1, 2)).reshape(len(block.cells), -1)
        blocks.append(Block(name, np.hstack([block.cells, added]), block.colours))
    return Maillage(mesh.store, blocks, {name: quadratic_mesh(ctx, side) for name, side in mesh.sides.items()})


def linear_mesh(ctx: Context, mesh: Maillage) -> Maillage:
    """Drop the mid-nodes of elements, and remember them: giving the elements mid-nodes again finds the same."""
    middles = middles_of(ctx)
    blocks = []
    for block in mesh.blocks:
        name = LINEAR.get(block.shape)
        if name is None:
            blocks.append(block)
            continue
        edges = np.array(shape(block.shape).edges)
        middles.record(block.cells[:, edges[:, :2]].reshape(-1, 2), block.cells[:, edges[:, 2]].ravel())
        blocks.append(Block(name, block.cells[:, : shape(name).n_nodes], block.colours))
    return Maillage(mesh.store, blocks, {name: linear_mesh(ctx, side) for name, side in mesh.sides.items()})
