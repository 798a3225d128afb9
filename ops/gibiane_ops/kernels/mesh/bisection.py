"""Bisection of simplices with its history: local refinement without hanging nodes, and its undoing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape

BoolArray = NDArray[np.bool_]

NAMES = {3: "TRI3", 4: "TET4"}


@dataclass(frozen=True, eq=False)
class Bisection:
    """A mesh of simplices and the halvings that led to it.

    Attributes
    ----------
    points : (n, dim) float64, length
    cells : (m, dim + 1) int64
        Every simplex of the history; those of the first mesh come first, in its order.
    parent : (m,) int64
        The simplex that each is a half of, -1 for those of the first mesh.
    split : (m,) int64
        Node in the middle of the edge along which a simplex has been halved, -1 when it is whole.
    root : (m,) int64
        The simplex of the first mesh that holds it.
    facet : (m, dim + 1) int64
        Facet ``(dim + 1) root + local`` of the first mesh on which the facet opposite to each node lies, local counted
        as in the faces of the shape; -1 for those inside a simplex of the first mesh.
    ends : (n, 2) int64
        Ends of the edge that each node halves, -1 for the nodes of the first mesh.
    """

    points: FloatArray
    cells: IntArray
    parent: IntArray
    split: IntArray
    root: IntArray
    facet: IntArray
    ends: IntArray

    @property
    def leaves(self) -> IntArray:
        """Rows of the simplices that are whole: the mesh."""
        return np.flatnonzero(self.split < 0)

    @property
    def leaf_cells(self) -> IntArray:
        """The mesh, (k, dim + 1) int64."""
        return self.cells[self.leaves]

    def sides(self) -> IntArray:
        """Return the facets of the first mesh on which those of the mesh lie, (k, dim + 1), faces as in the shape."""
        return self.facet[self.leaves][:, opposite_nodes(self.cells.shape[1] - 1)]

    def lines(self, edges: IntArray) -> IntArray:
        """Cut edges of the first mesh as the mesh does, (k, 2) to (l, 2)."""
        n = np.int64(len(self.points))
        made = np.flatnonzero(self.ends[:, 0] >= 0)
        pair = np.sort(self.ends[made], axis=1)
        keys = pair[:, 0] * n + pair[:, 1]
        order = np.argsort(keys)
        keys, made = keys[order], made[order]
        while len(keys):
            own = np.sort(edges, axis=1)
            own = own[:, 0] * n + own[:, 1]
            at = np.minimum(np.searchsorted(keys, own), len(keys) - 1)
            cut = keys[at] == own
            if not cut.any():
                break
            m = made[at[cut]]
            a, b = edges[cut].T
            edges = np.concatenate([edges[~cut], np.stack([a, m], axis=1), np.stack([m, b], axis=1)])
        return edges


def opposite_nodes(dim: int) -> IntArray:
    """Return the node opposite to each face of the reference simplex."""
    every = set(range(dim + 1))
    return np.array([(every - set(nodes)).pop() for _, nodes in shape(NAMES[dim + 1]).faces])


def started(points: FloatArray, cells: IntArray) -> Bisection:
    """Begin a history with a mesh.

    Parameters
    ----------
    points : (n, dim) float64, length
    cells : (m, dim + 1) int64

    Returns
    -------
    Bisection
    """
    m, corners = cells.shape
    none = np.full(m, -1, np.int64)
    facet = np.empty((m, corners), np.int64)
    facet[:, opposite_nodes(corners - 1)] = np.arange(m * corners).reshape(m, corners)
    ends = np.full((len(points), 2), -1, np.int64)
    return Bisection(points, cells, none, none.copy(), np.arange(m), facet, ends)


def _edge_keys(cells: IntArray, n: int) -> tuple[IntArray, IntArray]:
    """Return the keys of the edges of cells, (k, e), and their local ends, (e, 2)."""
    local = np.array(list(combinations(range(cells.shape[1]), 2)))
    ends = np.sort(cells[:, local], axis=2)
    return ends[..., 0] * np.int64(n) + ends[..., 1], local


def refined(mesh: Bisection, marked: BoolArray) -> Bisection:
    """Halve marked simplices, and those that must follow so that no node hangs.

    Parameters
    ----------
    mesh : Bisection
    marked : (n_leaves,) bool
        Through `Bisection.leaves`.

    Returns
    -------
    Bisection

    Notes
    -----
    A marked simplex marks its longest edge; a simplex with a marked edge marks its longest one; repeated until none is
    added. Each simplex is then cut along its marked edges, the longest first. Edges are ordered by length, then by
    their ends, so that the two sides of a facet cut it in the same way.

    Source
    ------
    Rivara 1984 (longest edges); Plaza and Carey 2000 (skeleton first).
    """
    leaves = mesh.leaves
    if not marked.any():
        return mesh
    cells = mesh.cells[leaves]
    keys, _ = _edge_keys(cells, len(mesh.points))
    edges, index = np.unique(keys, return_inverse=True)
    index = index.reshape(keys.shape)
    n = len(mesh.points)
    first, second = np.divmod(edges, n)
    length = np.linalg.norm(mesh.points[first] - mesh.points[second], axis=1)
    # Lengths equal but for round-off are equal, so that the ends decide alike on both sides of a contact.
    rounded = np.round(np.log2(length) * 2.0**30)
    rank = np.empty(len(edges), np.int64)
    rank[np.lexsort((second, first, rounded))] = np.arange(len(edges))
    longest = index[np.arange(len(cells)), np.argmax(rank[index], axis=1)]
    cut = np.zeros(len(edges), bool)
    cut[longest[marked]] = True
    while True:
        follow = longest[cut[index].any(axis=1)]
        if cut[follow].all():
            break
        cut[follow] = True
    split = np.flatnonzero(cut)
    middle = np.full(len(edges), -1, np.int64)
    middle[split] = n + np.arange(len(split))
    points = np.vstack([mesh.points, (mesh.points[first[split]] + mesh.points[second[split]]) / 2])
    ends = np.vstack([mesh.ends, np.stack([first[split], second[split]], axis=1)])
    grown = replace(mesh, points=points, ends=ends)
    active = leaves[cut[index].any(axis=1)]
    while len(active):
        grown, active = _halved(grown, active, edges, middle, rank, n)
    return grown


def _halved(
    mesh: Bisection, rows: IntArray, edges: IntArray, middle: IntArray, rank: IntArray, n: int
) -> tuple[Bisection, IntArray]:
    """Cut simplices along their longest marked edge; return the halves that still have one."""
    cells = mesh.cells[rows]
    keys, local = _edge_keys(cells, n)
    # Keys of edges that end at a new node are no keys of old edges: such an edge is not marked.
    old = (cells[:, local] < n).all(axis=2)
    at = np.where(old, np.searchsorted(edges, keys), 0)
    at[at == len(edges)] = 0
    order = np.where(old & (edges[at] == keys) & (middle[at] >= 0), rank[at], -1)
    which = np.argmax(order, axis=1)
    each = np.arange(len(rows))
    has = order[each, which] >= 0
    rows, cells, which, at, each = rows[has], cells[has], which[has], at[has], np.arange(int(has.sum()))
    if len(rows) == 0:
        return mesh, rows
    m = middle[at[each, which]]
    a, b = local[which].T
    one, two = cells.copy(), cells.copy()
    one[each, b] = m
    two[each, a] = m
    on_one, on_two = mesh.facet[rows], mesh.facet[rows]
    on_one[each, a] = -1
    on_two[each, b] = -1
    split = mesh.split.copy()
    split[rows] = m
    start = len(mesh.cells)
    grown = Bisection(
        points=mesh.points,
        cells=np.vstack([mesh.cells, one, two]),
        parent=np.concatenate([mesh.parent, rows, rows]),
        split=np.concatenate([split, np.full(2 * len(rows), -1)]),
        root=np.concatenate([mesh.root, mesh.root[rows], mesh.root[rows]]),
        facet=np.vstack([mesh.facet, on_one, on_two]),
        ends=mesh.ends,
    )
    return grown, np.arange(start, start + 2 * len(rows))


def coarsened(mesh: Bisection, willing: BoolArray) -> tuple[Bisection, IntArray]:
    """Undo halvings around nodes all of whose simplices are willing.

    Parameters
    ----------
    mesh : Bisection
    willing : (n_leaves,) bool
        Simplices that may become larger.

    Returns
    -------
    mesh : Bisection
    kept : (n_new,) int64
        The old node that each node was.

    Notes
    -----
    A node goes when every simplex around it is a half made with this very node: their wholes come back together, and
    no node hangs.
    """
    leaves = mesh.leaves
    cells, parent = mesh.cells[leaves], mesh.parent[leaves]
    made = np.where(parent >= 0, mesh.split[parent], -1)
    n = len(mesh.points)
    around = np.bincount(cells.ravel(), minlength=n)
    mine = np.bincount(made[(made >= 0) & willing], minlength=n)
    gone = (around > 0) & (mine == around)
    back = np.unique(parent[(made >= 0) & gone[made]])
    if len(back) == 0:
        return mesh, np.arange(n)
    split = mesh.split.copy()
    split[back] = -1
    keep = np.ones(len(mesh.cells), bool)
    keep[leaves[(made >= 0) & gone[made]]] = False
    place = np.cumsum(keep) - 1
    number = np.cumsum(~gone) - 1
    parent = mesh.parent[keep]
    ends, kept_split = mesh.ends[~gone], split[keep]
    undone = Bisection(
        points=mesh.points[~gone],
        cells=number[mesh.cells[keep]],
        parent=np.where(parent >= 0, place[parent], -1),
        split=np.where(kept_split >= 0, number[kept_split], -1),
        root=mesh.root[keep],
        facet=mesh.facet[keep],
        ends=np.where(ends >= 0, number[ends], -1),
    )
    return undone, np.flatnonzero(~gone)
