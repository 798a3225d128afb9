"""Elements of a model cut into simplices, with their boundary: what a stress in equilibrium is built on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.pieces import cut
from gibiane_ops.kernels.topology import Facets
from gibiane_ops.values.exterior import Side
from gibiane_ops.values.modele import ModelZone
from gibiane_ops.values.nodes import IntArray, node_store

ROUND_OFF = 1e-9
SIMPLICES = ("TRI3", "TET4")


@dataclass(frozen=True, eq=False)
class Pieces:
    """The simplices that the elements of a model are, or are cut into.

    Attributes
    ----------
    zones : list of ModelZone
    nodes : (n,) int64
        Nodes of the session, sorted.
    cells : list of (m, n_nodes) int64
        Elements of each zone, nodes numbered in `nodes`.
    rank : (n,) int64
        Order of the nodes: facets with four nodes are cut from the lowest.
    corners : list of (k, d + 1) int64
        Corners of its element that each simplex takes.
    owner : list of (k,) int64
        Element of each simplex.
    """

    zones: list[ModelZone]
    nodes: IntArray
    cells: list[IntArray]
    rank: IntArray
    corners: list[IntArray]
    owner: list[IntArray]

    @property
    def whole(self) -> bool:
        """Whether no element was cut."""
        return all(z.shape in SIMPLICES for z in self.zones)

    def facets(self, nodes: IntArray) -> tuple[IntArray, IntArray]:
        """Cut facets of nodes of the session into simplices: places of their nodes, (k, d), and the facet of each."""
        if nodes.shape[1] < 4:
            return np.tile(np.arange(nodes.shape[1]), (len(nodes), 1)), np.arange(len(nodes))
        return cut("QUA4", nodes, _ranks(self.nodes, self.rank, nodes))


def _ranks(nodes: IntArray, rank: IntArray, used: IntArray) -> IntArray:
    """Return the rank of each node of the session, up to the largest that is used."""
    full = np.zeros(int(max(nodes.max(initial=0), used.max(initial=0))) + 1, np.int64)
    full[nodes] = rank
    return full


def pieces_of(ctx: Context, zones: list[ModelZone], pairs: IntArray | None = None) -> Pieces:
    """Cut the elements of a model into simplices; facets of `pairs` of nodes, (k, 2), are cut alike on both sides."""
    dim = zones[0].dim
    wanted = ("TRI3", "QUA4") if dim == 2 else ("TET4", "PYR5", "PRI6", "CUB8")
    wrong = next((z for z in zones if z.shape not in wanted or z.axisymmetric), None)
    if wrong is not None:
        ctx.fail(
            251,
            "an equilibrated stress is built on {wanted} only, not on {shape} in mode {mode}",
            at="model",
            wanted=" ".join(wanted),
            shape=wrong.shape,
            mode=wrong.mode,
            hint="solve on linear elements before the estimate",
        )
    nodes, flat = np.unique(np.concatenate([z.cells.ravel() for z in zones]), return_inverse=True)
    cells = [
        part.reshape(z.cells.shape)
        for part, z in zip(np.split(flat, np.cumsum([z.cells.size for z in zones])[:-1]), zones, strict=True)
    ]
    lead = nodes.copy()
    if pairs is not None and len(pairs):
        known = pairs[np.isin(pairs, nodes).all(axis=1)]
        lead[np.searchsorted(nodes, known[:, 1])] = known[:, 0]
    rank = np.empty(len(nodes), np.int64)
    rank[np.lexsort((nodes, lead))] = np.arange(len(nodes))
    cuts = [cut(z.shape, c, rank) for z, c in zip(zones, cells, strict=True)]
    return Pieces(zones, nodes, cells, rank, [c for c, _ in cuts], [o for _, o in cuts])


def cut_sides(ctx: Context, pieces: Pieces, sides: list[Side]) -> Side:
    """Return the boundary as one set of simplicial facets, loads and supports carried over."""
    dim = pieces.zones[0].dim
    parts = []
    for side in sides:
        places, owner = pieces.facets(side.facets.nodes)
        rows = np.arange(len(owner))[:, None]
        parts.append(
            (
                side.facets.nodes[owner][rows, places],
                side.facets.cell[owner],
                side.traction[owner][rows, places],
                side.free[owner],
            )
        )
    nodes, cell, traction, free = (np.concatenate(each) for each in zip(*parts, strict=True))
    name = "SEG2" if dim == 2 else "TRI3"
    return Side(Facets(name, nodes, cell, np.zeros(len(nodes), np.int64)), traction, free)


def exact_pieces(ctx: Context, pieces: Pieces, sides: list[Side]) -> str:
    """Say why the pieces of elements are not exactly the elements and their loads; nothing when they are."""
    points = node_store(ctx).coords[pieces.nodes][:, : pieces.zones[0].dim]
    for zone, cells in zip(pieces.zones, pieces.cells, strict=True):
        of, X = shape(zone.shape), points[cells]
        if zone.shape in SIMPLICES:
            continue
        J = geometry.jacobians(of, X, of.gauss[0])
        if zone.shape not in ("QUA4", "CUB8") or np.abs(J - J[:, :1]).max() > ROUND_OFF * np.abs(J).max():
            return "the elements are not parallelepipeds: their stress on the simplices is not exact"
    for side in sides:
        if side.traction.shape[1] == 4:
            twist = side.traction[:, 0] - side.traction[:, 1] + side.traction[:, 2] - side.traction[:, 3]
            if np.abs(twist).max(initial=0.0) > ROUND_OFF * np.abs(side.traction).max(initial=0.0):
                return "a load varies more than linearly over a facet"
    return ""
