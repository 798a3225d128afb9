"""Division of hexahedra in eight and of quadrangles in four, with hanging nodes, and its undoing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels import hanging
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue

BoolArray = NDArray[np.bool_]

DEEPEST = 18
"""Most divisions of one element: coordinates inside it are integers, and products of three of them must fit."""

NAMES = {4: "QUA4", 8: "CUB8"}


@dataclass(frozen=True, eq=False)
class Octree:
    """Elements of a first mesh, divided several times each.

    Attributes
    ----------
    points : (n, dim) float64, length
        Nodes of the first mesh, those at one place on the two sides of a contact counted once.
    cells : (m, 2^dim) int64
        Elements of the first mesh.
    root : (k,) int64
        Element of the first mesh that holds each element.
    level : (k,) int64
        How many times it has been divided.
    corner : (k, dim) int64
        Place of the first corner in it, in units of its side over 2^level.
    bound : tuple of (b,) int64
        Contacts: facets ``n_faces root + local`` of both sides, all divided alike, so that no node hangs on them.
    """

    points: FloatArray
    cells: IntArray
    root: IntArray
    level: IntArray
    corner: IntArray
    bound: tuple[IntArray, ...]

    @cached_property
    def corners(self) -> tuple[FloatArray, IntArray]:
        """Nodes of the mesh, (n, dim), and its elements, (k, 2^dim)."""
        offset = offsets(self.dim)
        keys, places = self.located(np.arange(len(self.root)), offset, 0)
        _, first, index = np.unique(keys.ravel(), return_index=True, return_inverse=True)
        # Nodes in the order of their first appearance: a mesh that is not divided keeps its own order of elements.
        order = np.argsort(first)
        rank = np.empty(len(order), np.int64)
        rank[order] = np.arange(len(order))
        return places.reshape(-1, self.dim)[first[order]], rank[index].reshape(keys.shape)

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return int(self.corner.shape[1])

    def located(self, rows: IntArray, at: IntArray, finer: int) -> tuple[IntArray, FloatArray]:
        """Return keys and coordinates of places inside elements.

        Parameters
        ----------
        rows : (r,) int64
        at : (p, dim) int64
            Places in units of the side over 2^finer.
        finer : int

        Returns
        -------
        keys : (r, p) int64
            The same for one place seen from several elements.
        places : (r, p, dim) float64, length

        Notes
        -----
        A place is a mean of nodes of the first mesh with integer weights; these, reduced by their common power of two,
        name it whatever the element that it is seen from. The key is a sum of random 64-bit numbers of the nodes times
        the weights.
        """
        dim = self.dim
        depth = self.level[rows] + finer
        x = (self.corner[rows][:, None, :] << finer) + at[None]
        whole = (np.int64(1) << depth)[:, None, None]
        both = np.stack([whole - x, x], axis=-1)
        weights = np.ones((*x.shape[:2], 2**dim), np.int64)
        for corner, offset in enumerate(offsets(dim)):
            for axis in range(dim):
                weights[..., corner] *= both[:, :, axis, offset[axis]]
        share = weights / (np.int64(1) << (dim * depth))[:, None, None]
        nodes = self.cells[self.root[rows]]
        places = np.einsum("rpc,rcd->rpd", share, self.points[nodes])
        low = np.bitwise_or.reduce(weights, axis=2)
        low &= -low
        reduced = (weights // low[..., None]).view(np.uint64)
        keys = (reduced * self._random[nodes][:, None, :]).sum(axis=2)
        return keys.view(np.int64), places

    @cached_property
    def _random(self) -> NDArray[np.uint64]:
        """One odd number of 64 bits per node of the first mesh, the same in every run."""
        numbers = np.random.default_rng(20061).integers(0, 2**63, len(self.points), dtype=np.uint64)
        return numbers * np.uint64(2) + np.uint64(1)

    def sides(self, rows: IntArray) -> IntArray:
        """Return the facets ``n_faces root + local`` of the first mesh on which facets of elements lie, -1 inside.

        Parameters
        ----------
        rows : (r,) int64

        Returns
        -------
        (r, n_faces) int64
        """
        axis, end = face_planes(self.dim)
        top = np.int64(1) << self.level[rows]
        x = self.corner[rows][:, axis]
        on = np.where(end[None, :] == 1, x + 1 == top[:, None], x == 0)
        number = self.root[rows][:, None] * len(axis) + np.arange(len(axis))
        return np.where(on, number, -1)

    def lines(self, edges: IntArray) -> IntArray:
        """Cut edges of the first mesh as the mesh does, (k, 2) to (l, 2), in the numbers of `corners`.

        Edges of the first mesh are those of `cells`.
        """
        of, offset = shape(NAMES[2**self.dim]), offsets(self.dim)
        local = np.array([edge[:2] for edge in of.edges])
        n = np.int64(len(self.points))
        own = np.sort(self.cells[:, local], axis=2)
        wanted = np.sort(edges, axis=1)
        on = np.isin(own[..., 0] * n + own[..., 1], wanted[:, 0] * n + wanted[:, 1])
        fixed = offset[local[:, 0]] == offset[local[:, 1]]
        top = (np.int64(1) << self.level)[:, None, None]
        reach = np.where(offset[local[:, 0]][None] == 1, self.corner[:, None] + 1 == top, self.corner[:, None] == 0)
        there = (reach | ~fixed[None]).all(axis=2) & on[self.root]
        row, edge = np.nonzero(there)
        points, cells = self.corners
        found = cells[row[:, None], local[edge]]
        line = self.cells[self.root[row][:, None], local[edge]]
        _, first = np.unique(np.sort(found, axis=1), axis=0, return_index=True)
        whole = np.delete(first, hanging.halved_edges(points, found[first])[0])
        found, line = found[whole], line[whole]
        # Turned as the given edges turn: the first mesh has their ends.
        forward = np.isin(line[:, 0] * n + line[:, 1], edges[:, 0] * n + edges[:, 1])
        return np.asarray(np.where(forward[:, None], found, found[:, ::-1]), np.int64)


def offsets(dim: int) -> IntArray:
    """Return the place of each corner of the reference element, (2^dim, dim), 0 or 1."""
    of = shape(NAMES[2**dim])
    return np.asarray(np.round((of.ref_nodes + 1) / 2), np.int64)


def face_planes(dim: int) -> tuple[IntArray, IntArray]:
    """Return the axis across each facet of the reference element and the end (0 or 1) where it lies."""
    of, offset = shape(NAMES[2**dim]), offsets(dim)
    axis, end = [], []
    for _, nodes in of.faces:
        flat = np.ptp(offset[list(nodes)], axis=0) == 0
        axis.append(int(np.flatnonzero(flat)[0]))
        end.append(int(offset[nodes[0], axis[-1]]))
    return np.array(axis), np.array(end)


def planted(points: FloatArray, cells: IntArray, bound: Sequence[IntArray] = ()) -> Octree:
    """Begin with a mesh of quadrangles or hexahedra.

    Parameters
    ----------
    points : (n, dim) float64, length
    cells : (m, 2^dim) int64
    bound : sequence of (b,) int64
        See `Octree`.

    Returns
    -------
    Octree
    """
    m, dim = len(cells), points.shape[1]
    start = np.zeros((m, dim), np.int64)
    return Octree(points, cells, np.arange(m), np.zeros(m, np.int64), start, tuple(bound))


def divided(mesh: Octree, marked: BoolArray) -> Octree:
    """Divide marked elements; their children stand in their place.

    Raises
    ------
    BadValue
        Below `DEEPEST` divisions of one element.
    """
    if not marked.any():
        return mesh
    if mesh.level[marked].max() >= DEEPEST:
        raise BadValue("divisions of one element", DEEPEST + 1, f"at most {DEEPEST}")
    offset = offsets(mesh.dim)
    times = np.where(marked, len(offset), 1)
    row = np.repeat(np.arange(len(marked)), times)
    child = np.arange(len(row)) - np.repeat(np.cumsum(times) - times, times)
    deeper = marked[row]
    corner = np.where(deeper[:, None], 2 * mesh.corner[row] + offset[child], mesh.corner[row])
    return replace(mesh, root=mesh.root[row], level=mesh.level[row] + deeper, corner=corner)


def balanced(mesh: Octree) -> tuple[Octree, int]:
    """Divide elements until neighbours differ by one level at most, and those of a contact not at all.

    Returns
    -------
    mesh : Octree
    rounds : int
        How many times elements had to be divided.

    Notes
    -----
    Neighbours across a facet or an edge. An element is too large when a node stands on a quarter of one of its edges or
    facets. A node of a contact must not hang: it would be no contact node.
    """
    quarters = _quarters(mesh.dim)
    rounds = 0
    while True:
        every = np.arange(len(mesh.root))
        known = np.unique(mesh.located(every, offsets(mesh.dim), 0)[0])
        marked = np.asarray(np.isin(mesh.located(every, quarters, 2)[0], known).any(axis=1), np.bool_)
        for facets in mesh.bound:
            touching = np.isin(mesh.sides(every), facets).any(axis=1)
            marked = np.asarray(marked | (touching & (mesh.level < mesh.level[touching].max())), np.bool_)
        if not marked.any():
            return mesh, rounds
        mesh = divided(mesh, marked)
        rounds += 1


def _quarters(dim: int) -> IntArray:
    """Return the quarter points of edges and facets, (p, dim), in units of a quarter of the side."""
    grid = np.array(list(product(range(5), repeat=dim)))
    outside = ((grid == 0) | (grid == 4)).any(axis=1)
    return np.asarray(grid[outside & (grid % 2 == 1).any(axis=1)], np.int64)


def merged_back(mesh: Octree, willing: BoolArray) -> tuple[Octree, IntArray]:
    """Put complete groups of children back together where all are willing.

    Parameters
    ----------
    mesh : Octree
    willing : (k,) bool

    Returns
    -------
    mesh : Octree
        Not balanced.
    place : (k,) int64
        The new element that holds each old one.
    """
    n = 2**mesh.dim
    row = np.flatnonzero(willing & (mesh.level > 0))
    half = mesh.corner[row] >> 1
    key = np.column_stack([mesh.root[row], mesh.level[row], half])
    _, first, group, count = np.unique(key, axis=0, return_index=True, return_inverse=True, return_counts=True)
    full = count[group.ravel()] == n
    head = np.arange(len(mesh.root))
    head[row[full]] = row[first[group.ravel()[full]]]
    heads = np.zeros(len(mesh.root), bool)
    heads[head[row[full]]] = True
    keep = head == np.arange(len(mesh.root))
    place = (np.cumsum(keep) - 1)[head]
    level = np.where(heads, mesh.level - 1, mesh.level)
    corner = np.where(heads[:, None], mesh.corner >> 1, mesh.corner)
    return replace(mesh, root=mesh.root[keep], level=level[keep], corner=corner[keep]), place
