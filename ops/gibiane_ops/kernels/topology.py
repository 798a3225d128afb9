"""Facets, boundary and edges of a mesh given as blocks of cells.

A mesh is a sequence of blocks ``(shape name, cells)`` with ``cells : (m, n_nodes) int64``. Cells are numbered through
the blocks in their order: the cells of the second block follow those of the first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.elements.quadratic import LINEAR
from gibiane_ops.kernels.elements.table import shape

Block = tuple[str, IntArray]


@dataclass(frozen=True, eq=False)
class Facets:
    """Facets of one shape.

    Attributes
    ----------
    name : str
        Shape name of the facets.
    nodes : (k, n) int64
        Their nodes, turning so that the normal leaves the cell that they come from.
    cell : (k,) int64
        Number of that cell, counted through the blocks.
    local : (k,) int64
        Which facet of the cell it is.
    """

    name: str
    nodes: IntArray
    cell: IntArray
    local: IntArray

    def take(self, rows: IntArray) -> Facets:
        """Return the facets of the given rows."""
        return Facets(self.name, self.nodes[rows], self.cell[rows], self.local[rows])


def faces_of(blocks: Sequence[Block]) -> dict[str, Facets]:
    """List every facet of every cell; a facet between two cells comes twice, once from each side.

    Parameters
    ----------
    blocks : sequence of (str, (m, n_nodes) int64)

    Returns
    -------
    dict of str to Facets
        By shape of facet, in the order of the cells then of their facets.
    """
    found: dict[str, list[Facets]] = {}
    start = 0
    for name, cells in blocks:
        faces = shape(name).faces
        numbers = np.arange(start, start + len(cells))
        start += len(cells)
        for face_name in dict.fromkeys(face for face, _ in faces):
            local = [(i, nodes) for i, (face, nodes) in enumerate(faces) if face == face_name]
            nodes = cells[:, np.array([list(each) for _, each in local])]
            found.setdefault(face_name, []).append(
                Facets(
                    face_name,
                    nodes.reshape(-1, nodes.shape[-1]),
                    np.repeat(numbers, len(local)),
                    np.tile(np.array([i for i, _ in local]), len(cells)),
                )
            )
    return {name: _joined(name, parts) for name, parts in found.items()}


def _joined(name: str, parts: list[Facets]) -> Facets:
    """Concatenate lists of facets of one shape."""
    return Facets(
        name,
        np.concatenate([part.nodes for part in parts]),
        np.concatenate([part.cell for part in parts]),
        np.concatenate([part.local for part in parts]),
    )


def group_by_nodes(nodes: IntArray) -> tuple[IntArray, IntArray]:
    """Give the same number to rows that hold the same nodes, in any order.

    Parameters
    ----------
    nodes : (k, n) int64

    Returns
    -------
    group : (k,) int64
        Number of the set of each row, 0 to n_groups - 1, in order of first appearance.
    first : (n_groups,) int64
        First row of each group, increasing.

    Cost
    ----
    One lexicographic sort of the rows.
    """
    if len(nodes) == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    keys = _packed(np.sort(nodes, axis=1))
    order = np.lexsort(keys)
    starts = np.r_[True, np.any([key[order[1:]] != key[order[:-1]] for key in keys], axis=0)]
    group = np.empty(len(nodes), np.int64)
    group[order] = np.cumsum(starts) - 1
    # lexsort is stable, so the first row of each run is its first appearance.
    first = order[starts]
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[group], np.sort(first)


def _packed(rows: IntArray) -> list[IntArray]:
    """Put the columns of rows into as few integers as hold them: fewer keys sort faster."""
    low = int(rows.min())
    bits = max(int(rows.max()) - low, 1).bit_length()
    keys: list[IntArray] = []
    room = 0
    for column in rows.T:
        if room < bits:
            keys.append(column - low)
            room = 63 - bits
        else:
            keys[-1] = (keys[-1] << bits) | (column - low)
            room -= bits
    return keys


def used_nodes(cells: Sequence[IntArray]) -> IntArray:
    """Return the distinct nodes of cells, increasing.

    Parameters
    ----------
    cells : sequence of (m, n_nodes) int64
        Nodes are not negative.
    """
    largest = max((int(block.max()) for block in cells if block.size), default=-1)
    used = np.zeros(largest + 1, bool)
    for block in cells:
        used[block] = True
    return np.flatnonzero(used)


def places_in(nodes: IntArray, cells: IntArray) -> IntArray:
    """Return where the nodes of cells stand in a list of nodes that holds all of them.

    Parameters
    ----------
    nodes : (k,) int64
        Distinct, not negative.
    cells : (m, n_nodes) int64

    Returns
    -------
    (m, n_nodes) int64
        ``nodes[result] == cells``.

    Cost
    ----
    One gather from a table as long as the largest node: a bisection (`searchsorted`) takes five times as long.
    """
    table = np.empty(int(nodes.max(initial=-1)) + 1, np.int64)
    table[nodes] = np.arange(len(nodes))
    return table[cells]


def boundary(blocks: Sequence[Block]) -> dict[str, Facets]:
    """Find the facets used by one cell only.

    Parameters
    ----------
    blocks : sequence of (str, (m, n_nodes) int64)

    Returns
    -------
    dict of str to Facets
        By shape of facet; normals leave the solid. Shapes without a boundary facet are absent. A linear cell and one of
        second degree share the facet that has the same corners.
    """
    result = {}
    every = faces_of(blocks)
    for family, group, _ in facet_families(every):
        alone = np.bincount(group)[group] == 1
        for name in family:
            here, alone = np.split(alone, [len(every[name].nodes)])
            if here.any():
                result[name] = every[name].take(np.flatnonzero(here))
    return result


def facet_families(every: Mapping[str, Facets]) -> Iterator[tuple[list[str], IntArray, IntArray]]:
    """Group facets of the same corners, whatever their degree.

    Parameters
    ----------
    every : mapping of str to Facets

    Yields
    ------
    family : list of str
        Shapes of the same corners, linear and of second degree, in order of first appearance.
    group, first : (k,) and (n_groups,) int64
        See `group_by_nodes`, of the facets of the family one shape after the other.
    """
    found: dict[str, list[str]] = {}
    for name in every:
        found.setdefault(LINEAR.get(name, name), []).append(name)
    for family in found.values():
        yield family, *group_by_nodes(np.vstack([every[name].nodes[:, : shape(name).n_corners] for name in family]))


def neighbours(blocks: Sequence[Block]) -> IntArray:
    """Find the pairs of cells that share a facet.

    Parameters
    ----------
    blocks : sequence of (str, (m, n_nodes) int64)

    Returns
    -------
    (k, 2) int64
        Numbers of the cells, the smaller first; one row per shared facet. Where more than two cells share a facet,
        consecutive ones are paired.
    """
    pairs = [np.zeros((0, 2), np.int64)]
    every = faces_of(blocks)
    for family, group, _ in facet_families(every):
        cell = np.concatenate([every[name].cell for name in family])
        order = np.lexsort((cell, group))
        same = np.flatnonzero(group[order[1:]] == group[order[:-1]])
        pairs.append(np.stack([cell[order[same]], cell[order[same + 1]]], axis=1))
    return np.concatenate(pairs)


def edges(blocks: Sequence[Block]) -> IntArray:
    """List the edges once each.

    Parameters
    ----------
    blocks : sequence of (str, (m, n_nodes) int64)

    Returns
    -------
    (k, 2) int64
        End nodes, the smaller first; rows sorted.
    """
    ends = [np.zeros((0, 2), np.int64)]
    for name, cells in blocks:
        local = np.array([edge[:2] for edge in shape(name).edges], np.int64).reshape(-1, 2)
        ends.append(np.sort(cells[:, local].reshape(-1, 2), axis=1))
    every = np.concatenate(ends)
    n = np.int64(every.max(initial=0) + 1)
    keys = np.sort(every[:, 0] * n + every[:, 1])
    keys = keys[np.r_[True, keys[1:] != keys[:-1]][: len(keys)]]
    return np.stack(np.divmod(keys, n), axis=1)


def corner_blocks(blocks: Sequence[Block]) -> list[Block]:
    """Keep the corners of the cells only: linear cells stay, those of second degree lose their mid-nodes.

    Parameters
    ----------
    blocks : sequence of (str, (m, n_nodes) int64)

    Returns
    -------
    list of (str, (m, n_corners) int64)
        The ids of the nodes do not change.
    """
    return [(LINEAR.get(name, name), cells[:, : shape(name).n_corners]) for name, cells in blocks]


def middles(blocks: Sequence[Block]) -> IntArray:
    """List the mid-nodes of cells of second degree with the ends of their edges.

    Parameters
    ----------
    blocks : sequence of (str, (m, n_nodes) int64)

    Returns
    -------
    (k, 3) int64
        The two ends, then the mid-node; once each, by increasing mid-node. A mid-node that is a corner of another
        cell (smaller elements beside larger ones) is absent.
    """
    local = [(cells, np.array(shape(name).edges)) for name, cells in blocks if shape(name).degree == 2]
    every = np.concatenate([np.zeros((0, 3), np.int64), *(cells[:, edges].reshape(-1, 3) for cells, edges in local)])
    _, first = np.unique(every[:, 2], return_index=True)
    corners = np.concatenate([np.zeros(0, np.int64), *(cells.ravel() for _, cells in corner_blocks(blocks))])
    return np.asarray(every[first][~np.isin(every[first, 2], corners)], np.int64)


def middles_on_linear(blocks: Sequence[Block]) -> IntArray:
    """Find the mid-nodes of quadratic cells whose edge is also that of a linear cell.

    Parameters
    ----------
    blocks : sequence of (str, (m, n_nodes) int64)

    Returns
    -------
    (k, 3) int64
        The two ends, then the mid-node, by increasing mid-node.
    """
    quadratic = middles(blocks)
    ends = edges([(name, cells) for name, cells in blocks if shape(name).degree == 1])
    if not len(quadratic) or not len(ends):
        return quadratic[:0]
    n = np.int64(max(quadratic.max(), ends.max()) + 1)
    pair = np.sort(quadratic[:, :2], axis=1)
    beside = np.isin(pair[:, 0] * n + pair[:, 1], ends[:, 0] * n + ends[:, 1])
    return np.asarray(quadratic[beside], np.int64)
