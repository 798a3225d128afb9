"""Meshes of second degree from linear ones, and back: operators work on corners, and give mid-nodes at the end."""

from __future__ import annotations

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.elements.quadratic import QUADRATIC
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.values.maillage import Block, Maillage
from gibiane_ops.values.middles import middles_of
from gibiane_ops.values.nodes import node_store

LINEAR = {high: low for low, high in QUADRATIC.items()}


def is_quadratic(*meshes: Maillage) -> bool:
    """Say whether one of several meshes has elements of second degree."""
    return any(name in LINEAR for mesh in meshes for name in mesh.shapes)


def wants_quadratic(ctx: Context, *given: Maillage) -> bool:
    """Say whether what is made now has mid-nodes: OPTI ELEM asks for them, or what it is made from has them."""
    return ctx.option("ELEM") in LINEAR or is_quadratic(*given)


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
    if not is_quadratic(mesh, *mesh.sides.values()):
        return mesh
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


def finished(ctx: Context, mesh: Maillage, quadratic: bool) -> Maillage:
    """Return what was made of corners, with mid-nodes if they are wanted."""
    return quadratic_mesh(ctx, mesh) if quadratic else mesh


def checked_degree(ctx: Context, degree: int) -> int:
    """Return a degree of elements that a script gives: 1 or 2 (error 42)."""
    if degree not in (1, 2):
        ctx.fail(42, "elements are of degree 1 or 2, not {degree}", at="ordre", degree=degree)
    return degree


def every_node(ctx: Context, nodes: IntArray) -> IntArray:
    """Put the mid-nodes between the corners of a line, (m + 1,) to (2 m + 1,)."""
    result = np.empty(2 * len(nodes) - 1, np.int64)
    result[::2] = nodes
    result[1::2] = middles_of(ctx).of(np.stack([nodes[:-1], nodes[1:]], axis=1))
    return result


def bend_diagonals(ctx: Context, quadrangles: IntArray, triangles: IntArray) -> None:
    """Give the diagonals of quadrangles cut in two mid-nodes that follow the curve of their sides.

    Parameters
    ----------
    ctx : Context
    quadrangles : (m, 4) int64
        Their sides have mid-nodes.
    triangles : (2 m, 3) int64
        The halves, two by two.

    Notes
    -----
    The middle of the diagonal moves by half the sum of what the mid-nodes of the sides are off their chords: on a
    patch that is ruled from curve to curve it comes to lie on the surface. Diagonals that have a mid-node keep it.
    """
    middles = middles_of(ctx)
    one, two = triangles[::2], triangles[1::2]
    ends = one[(one[:, :, None] == two[:, None, :]).any(axis=2)].reshape(-1, 2)
    new = np.flatnonzero(~middles.known(ends))
    _, first = np.unique(np.sort(ends[new], axis=1), axis=0, return_index=True)
    new = new[first]
    sides = np.stack([quadrangles[new], np.roll(quadrangles[new], -1, axis=1)], axis=2)
    on = middles.of(sides.reshape(-1, 2)).reshape(-1, 4)
    x = node_store(ctx).coords
    bulge = (x[on] - x[sides].mean(axis=2)).sum(axis=1) / 2
    middles.add(ends[new], x[ends[new]].mean(axis=1) + bulge)
