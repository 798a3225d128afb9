"""Elements cut into simplices, with new points where that makes stresses in equilibrium sharper."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.quadratic import LINEAR
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.mesh.simplices import tetrahedra, triangles_of_quadrangles
from gibiane_ops.kernels.topology import Block, group_by_nodes

CORNERS, CENTRES, MIDDLES = 0, 1, 2
"""Points of the simplices: the corners of the elements; the centres too, of faces that are not triangles and of cells
that are not simplices; and the middles of the edges."""

Point = tuple[int, ...]
"""Corners of an element; the point is in the middle of them, in reference coordinates."""

Template = list[tuple[Point, ...]]


class Cutting:
    """Elements cut into simplices; neighbours fit, whatever their shapes and degrees.

    Parameters
    ----------
    nodes : (n, d) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)
        Elements in a plane or in space, of first or second degree.
    rank : (n,) int64
        Order of the nodes: where there are corners only, each quadrangular face is cut from its node of lowest rank.
    finest : {CORNERS, CENTRES, MIDDLES}

    Attributes
    ----------
    points : (k, d) float64, length
        Middle nodes of edges, where there are, are the middles; new points are centres of elements, faces and edges.
    node : (k,) int64
        Node that each point is; -1 for new ones.
    near : (k,) int64
        That node, or a corner beside.
    cells : (p, d + 1) int64
        Simplices, those of the first block first.
    at : (p, d + 1, d) float64
        Their corners in reference coordinates of their elements.
    owner : list of (p_b,) int64
        Element of each simplex of each block.

    Raises
    ------
    BadValue
        Another shape.

    Notes
    -----
    New points are known by the corners around: the middle of an edge is one for an element of first degree and its
    neighbour of second degree. With centres a cell is a cone over the simplices of its faces, from its
    centre; with middles so is a triangle of a plane (in six: a quadratic stress is followed better than by four of the
    shape of the whole, 1.10 times the error instead of 1.45). Triangular faces are cut in four, tetrahedra in eight,
    the octahedron inside by its shortest diagonal.

    Cost
    ----
    Sorts of the edges and faces.
    """

    def __init__(self, nodes: FloatArray, blocks: Sequence[Block], rank: IntArray, finest: int) -> None:
        self.rank, self.finest, self._nodes = rank, finest, nodes
        linear = [(LINEAR.get(name, name), cells[:, : shape(name).n_corners]) for name, cells in blocks]
        n = len(nodes)
        edges, faces = [np.zeros((0, 2), np.int64)], [np.zeros((0, 4), np.int64)]
        if finest == MIDDLES:
            edges += [cells[:, np.array(shape(name).edges)].reshape(-1, 2) for name, cells in linear]
        if finest > CORNERS:
            faces += [cells for name, cells in linear if name == "QUA4"]
            faces += [
                cells[:, list(corners)]
                for name, cells in linear
                if nodes.shape[1] == 3
                for kind, corners in shape(name).faces
                if kind == "QUA4"
            ]
        self._edges, self._faces = _distinct(np.concatenate(edges)), _distinct(np.concatenate(faces))
        self._middle = n + np.arange(len(self._edges))
        self._first_face = n + len(self._edges)
        first_cell = self._first_face + len(self._faces)
        if finest == MIDDLES:
            for name, cells in blocks:
                for a, b, *middle in shape(name).edges:
                    if middle:
                        self._middle[_found(self._edges, cells[:, [a, b]])] = cells[:, middle[0]]
        total = first_cell + sum(len(cells) for _, cells in blocks)
        points, near = np.zeros((total, nodes.shape[1])), np.zeros(total, np.int64)
        found, at, self.owner = [], [], []
        for (name, corners), (whole, cells) in zip(linear, blocks, strict=True):
            simplices, places, owner = self._cut(name, corners, first_cell + np.arange(len(cells)))
            first_cell += len(cells)
            kinds, which = np.unique(places.reshape(-1, places.shape[2]), axis=0, return_inverse=True)
            N, which = shape(whole).N(kinds), which.reshape(-1)
            for k, weights in enumerate(N):
                rows = np.flatnonzero(which == k)
                points[simplices.ravel()[rows]] = weights @ nodes[cells[owner[rows // simplices.shape[1]]]]
            near[simplices] = corners[owner, :1]
            found.append(simplices)
            at.append(places)
            self.owner.append(owner)
        points[:n], near[:n] = nodes, np.arange(n)
        every, self.at = np.concatenate(found), np.concatenate(at)
        used = np.unique(every)
        self._place = np.full(total, -1, np.int64)
        self._place[used] = np.arange(len(used))
        self.points, self.near = points[used], near[used]
        self.node = np.where(used < n, used, -1)
        self.cells = self._place[every]

    def places(self, nodes: IntArray) -> IntArray:
        """Return the points that nodes are, -1 for those that are no corner of a simplex."""
        return self._place[nodes]

    def facets(self, name: str, nodes: IntArray) -> tuple[IntArray, FloatArray, IntArray]:
        """Cut facets of elements as the elements are.

        Parameters
        ----------
        name : str
        nodes : (m, n_nodes) int64

        Returns
        -------
        points : (k, d) int64
            Sides of the simplices.
        at : (k, d, d - 1) float64
            Their corners in reference coordinates of the facets.
        owner : (k,) int64
            Facets, in the order in which they are given; those with corners of the same rank are cut alike.
        """
        sides, at, owner = self._cut(LINEAR.get(name, name), nodes[:, : shape(name).n_corners], np.zeros(0, np.int64))
        return self._place[sides], at, owner

    def _cut(self, name: str, cells: IntArray, centres: IntArray) -> tuple[IntArray, FloatArray, IntArray]:
        """Cut elements or facets of first degree; points by their numbers before those not used are left out."""
        ref = shape(name).ref_nodes
        if self.finest == CORNERS and name not in ("SEG2", "TRI3", "TET4"):
            places, owner = _by_rank(name, self.rank[cells])
            return np.take_along_axis(cells[owner], places, axis=1), ref[places], owner
        if self.finest < MIDDLES or name != "TET4":
            cases = [(np.arange(len(cells)), _template(name, self.finest, self._nodes.shape[1] == 2))]
        else:
            X = self._nodes[cells]
            lengths = [np.linalg.norm(X[:, list(a)].mean(1) - X[:, list(b)].mean(1), axis=1) for a, b in DIAGONALS]
            shortest = np.stack(lengths, axis=1).argmin(axis=1)
            cases = [(np.flatnonzero(shortest == k), _eight(*DIAGONALS[k])) for k in range(3)]
        found, at, owners = list[IntArray](), list[FloatArray](), list[IntArray]()
        for rows, template in cases:
            names = sorted({point for simplex in template for point in simplex})
            number = np.stack([self._number(cells[rows], point, centres) for point in names], axis=1)
            means = np.stack([ref[list(point)].mean(axis=0) for point in names])
            local = np.array([[names.index(point) for point in simplex] for simplex in template])
            if local.shape[1] == means.shape[1] + 1:
                turned = np.linalg.det(means[local[:, 1:]] - means[local[:, :1]]) < 0
                local[turned, :2] = local[turned][:, [1, 0]]
            found.append(number[:, local].reshape(-1, local.shape[1]))
            at.append(np.tile(means[local], (len(rows), 1, 1)))
            owners.append(np.repeat(rows, len(local)))
        order = np.argsort(np.concatenate(owners), kind="stable")
        return np.concatenate(found)[order], np.concatenate(at)[order], np.concatenate(owners)[order]

    def _number(self, cells: IntArray, point: Point, centres: IntArray) -> IntArray:
        corners = cells[:, list(point)]
        if len(point) == 1:
            return corners[:, 0]
        if len(point) == 2:
            return self._middle[_found(self._edges, corners)]
        if len(point) == 4:
            return self._first_face + _found(self._faces, corners)
        return centres


DIAGONALS: tuple[tuple[Point, Point], ...] = (((0, 1), (2, 3)), ((0, 2), (1, 3)), ((0, 3), (1, 2)))
"""Opposite edges of a tetrahedron: their middles are opposite corners of the octahedron inside."""


def _by_rank(name: str, local: IntArray) -> tuple[IntArray, IntArray]:
    """Cut by the ranks of corners alone: places of the corners of each simplex, and its element."""
    if name == "QUA4":
        pieces, owner = triangles_of_quadrangles(local), np.repeat(np.arange(len(local)), 2)
    else:
        pieces, owner = tetrahedra(name, local)
    return (local[owner][:, None, :] == pieces[:, :, None]).argmax(axis=2), owner


def _template(name: str, finest: int, plane: bool) -> Template:
    """Return the simplices of an element, the same for all of its kind."""
    middles = finest == MIDDLES
    if name == "SEG2":
        return [((0,), (0, 1)), ((0, 1), (1,))] if middles else [((0,), (1,))]
    if name == "TRI3" and plane and middles:
        halves = [((i,), _edge(i, j)) for i in range(3) for j in range(3) if j != i]
        return [(*half, (0, 1, 2)) for half in halves]
    if name == "TRI3":
        inner: Template = [((0, 1), (1, 2), (0, 2))]
        outer: Template = [((i,), _edge(i, (i + 1) % 3), _edge(i, (i + 2) % 3)) for i in range(3)]
        return outer + inner if middles else [((0,), (1,), (2,))]
    if name == "TET4" and not middles:
        return [((0,), (1,), (2,), (3,))]
    of = shape(name)
    faces: Sequence[tuple[str, tuple[int, ...]]] = of.faces
    if name not in ("QUA4", "PYR5", "PRI6", "CUB8"):
        raise BadValue("shape", name, "one whose stress is put in equilibrium")
    centre = tuple(range(of.n_corners))
    found: Template = []
    for kind, corners in faces:
        for side in _template(kind, finest, plane):
            found.append((*(tuple(sorted(corners[i] for i in point)) for point in side), centre))
    return found


def _eight(first: Point, second: Point) -> Template:
    """Return the eight parts of a tetrahedron, the middles of two opposite edges joined."""
    (p, q), (r, s) = [pair for pair in DIAGONALS if pair != (first, second)]
    outer = [((i,), *(_edge(i, j) for j in range(4) if j != i)) for i in range(4)]
    return outer + [(first, second, a, b) for a, b in ((p, r), (r, q), (q, s), (s, p))]


def _edge(a: int, b: int) -> Point:
    return (min(a, b), max(a, b))


def _distinct(rows: IntArray) -> IntArray:
    """Return each set of nodes once."""
    return rows[group_by_nodes(rows)[1]]


def _found(known: IntArray, asked: IntArray) -> IntArray:
    """Return the row of each set of nodes among the known ones."""
    group, first = group_by_nodes(np.concatenate([known, asked]))
    rows = first[group[len(known) :]]
    if len(rows) and rows.max() >= len(known):
        raise BadValue("facets", int((rows >= len(known)).sum()), "those of the elements")
    return rows
