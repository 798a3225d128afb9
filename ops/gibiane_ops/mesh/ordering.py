"""Elements of meshes searched, sorted, and told apart: POSI, ORDO, UNIQ."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend
from gibiane.values import LISTENTI, MAILLAGE, POINT
from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.mesh import chains, neighbours, orientation
from gibiane_ops.kernels.topology import group_by_nodes
from gibiane_ops.mesh.building import DIMENSION, nodes_of
from gibiane_ops.values.listes import ListEnti
from gibiane_ops.values.maillage import Block, Maillage, Point

POSI = extend("POSITION")


def _points(ctx: Context, mesh: Maillage, at: str) -> IntArray:
    if mesh.shapes not in ([], ["POI1"]):
        ctx.fail(
            16,
            "a mesh of points is wanted, this one holds {shapes}",
            at=at,
            shapes=" ".join(mesh.shapes),
            hint="CHAN POI1 G is the mesh of its points",
        )
    return mesh.cells("POI1").reshape(-1)


@POSI.form(
    Arg("p", POINT, "point"),
    Key("DANS", "where", Arg("g", MAILLAGE, "mesh of points"), required=True),
    Key("TOUS", "all positions"),
    gives=["ENTIER|LISTENTI"],
)
def _where_point(ctx: Context, p: Point, dans: Maillage, tous: bool) -> Any:
    at = np.flatnonzero(_points(ctx, dans, "dans") == p.node) + 1
    if tous:
        return ListEnti(at)
    return int(at[0]) if len(at) else 0


@POSI.form(
    Arg("points", MAILLAGE, "mesh of points"),
    Key("DANS", "where", Arg("g", MAILLAGE, "mesh of points"), required=True),
    gives=[LISTENTI],
)
def _where_points(ctx: Context, points: Maillage, dans: Maillage) -> ListEnti:
    wanted, places = _points(ctx, points, "points"), _points(ctx, dans, "dans")
    known, first = np.unique(places, return_index=True)
    if not len(known):
        return ListEnti(np.zeros(len(wanted), np.int64))
    at = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
    return ListEnti(np.where(known[at] == wanted, first[at] + 1, 0))


@extend("ORDO").form(Arg("g", MAILLAGE, "mesh"), gives=[MAILLAGE])
def _ordered(ctx: Context, g: Maillage) -> Maillage:
    return Maillage(g.store, [_ordered_block(ctx, block) for block in g.blocks], g.sides)


def _ordered_block(ctx: Context, block: Block) -> Block:
    """Put points by distance from the first, segments end to end, other elements from neighbour to neighbour."""
    cells = block.cells
    if block.shape == "POI1":
        coords = nodes_of(ctx).coords[cells[:, 0]]
        rows = np.argsort(((coords - coords[0]) ** 2).sum(axis=1), kind="stable")
        return Block(block.shape, cells[rows], block.colours[rows])
    dimension = DIMENSION[block.shape]
    if dimension > 1:
        rows = neighbours.by_vicinity(cells, dimension)
        return Block(block.shape, cells[rows], block.colours[rows])
    rows, turned = chains.follow(cells[:, np.argsort(shape(block.shape).ref_nodes[:, 0])])
    found = cells[rows]
    found[turned] = orientation.reversed_cells(block.shape, found[turned])
    return Block(block.shape, found, block.colours[rows])


@extend("UNIQ").form(
    Arg("meshes", MAILLAGE, "meshes", many=True),
    Key("ORDO", "the nodes must stand in the same order too"),
    gives=["MAILLAGE..."],
)
def _distinct(ctx: Context, meshes: list[Maillage], ordo: bool) -> tuple[Maillage, ...]:
    return tuple(Maillage(g.store, [_distinct_block(b, ordo) for b in g.blocks], g.sides) for g in meshes)


def _distinct_block(block: Block, ordered: bool) -> Block:
    if ordered:
        _, first = np.unique(block.cells, axis=0, return_index=True)
    else:
        _, first = group_by_nodes(block.cells)
    rows = np.sort(first)
    return Block(block.shape, block.cells[rows], block.colours[rows])
