"""A mesh refined in place: its first mesh, its divisions, its groups and contacts at every stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gibiane_ops.kernels import connectivity, geometry, topology
from gibiane_ops.kernels.adapt import halvings, octree
from gibiane_ops.kernels.adapt.octree import Octree
from gibiane_ops.kernels.adapt.resized import resized
from gibiane_ops.kernels.adapt.sizes import element_sizes, predicted_count
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.mesh import bisection, pairing
from gibiane_ops.kernels.mesh.bisection import Bisection

TRIALS = 6
"""Factors on the sizes that are tried to come near the number of elements asked."""

NEAR = 0.9
"""Share of the number of elements asked that is near enough."""


@dataclass(frozen=True, eq=False)
class LocalMesh:
    """The mesh of a stage.

    Attributes
    ----------
    points : (n, dim) float64, length
    cells : (m, n_nodes) int64
    groups : dict of str to (k, c) int64
        The groups of the first mesh; facets turn as they did.
    pairs : list of (k, 2) int64
        Nodes of the first and of the second face of each contact, at the very same places.
    """

    points: FloatArray
    cells: IntArray
    groups: dict[str, IntArray]
    pairs: list[IntArray]


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """A first mesh with its groups, and how it is divided now.

    Attributes
    ----------
    name : str
        TRI3, TET4, QUA4 or CUB8.
    cells : (m, n_nodes) int64
        Of the first mesh.
    merged, solid : (n,) int64
        Number of each node of the first mesh once the contacts are closed; its solid.
    groups : dict of str to (k, c) int64
    pairs : list of (str, str)
    tree : Bisection or Octree
        On merged nodes.
    """

    name: str
    cells: IntArray
    merged: IntArray
    solid: IntArray
    groups: dict[str, IntArray]
    pairs: list[tuple[str, str]]
    tree: Bisection | Octree

    def _stage(self) -> tuple[FloatArray, IntArray, IntArray, IntArray]:
        """Return merged points, cells, first cell of each and first facet of each face."""
        if isinstance(self.tree, Bisection):
            leaves = self.tree.leaves
            return self.tree.points, self.tree.cells[leaves], self.tree.root[leaves], self.tree.sides()
        points, cells = self.tree.corners
        return points, cells, self.tree.root, self.tree.sides(np.arange(len(cells)))

    def mesh(self) -> LocalMesh:
        """Open the contacts and find the groups."""
        points, cells, root, sides = self._stage()
        n_solids = int(self.solid.max()) + 1
        keys = cells * n_solids + self.solid[self.cells[root, 0]][:, None]
        known, opened = np.unique(keys, return_inverse=True)
        opened = opened.reshape(cells.shape)
        groups = {}
        for name, group in self.groups.items():
            groups[name] = self._group(group, opened, root, sides, known, n_solids)
        pairs = []
        for first, second in self.pairs:
            a, b = np.unique(groups[first]), np.unique(groups[second])
            a, b = (each[np.argsort(known[each] // n_solids)] for each in (a, b))
            pairs.append(np.stack([a, b], axis=1))
        return LocalMesh(points[known // n_solids], opened, groups, pairs)

    def _group(
        self, group: IntArray, cells: IntArray, root: IntArray, sides: IntArray, known: IntArray, n_solids: int
    ) -> IntArray:
        """Find a group of the first mesh among the elements, facets, edges or nodes of this one."""
        of = shape(self.name)
        if group.shape[1] == of.n_nodes:
            return np.asarray(cells[_rows_among(self.cells, group)[root]], np.int64)
        facet = faces_in_order(self.name, self.cells)
        if group.shape[1] == facet.shape[2]:
            flat = facet.reshape(-1, facet.shape[2])
            number = _match(flat, group)
            sign = np.zeros(len(flat), np.int64)
            sign[number] = np.where(_same_turn(flat[number], group), 1, -1)
            row, face = np.nonzero((sides >= 0) & (sign[np.maximum(sides, 0)] != 0))
            local = np.array([nodes for _, nodes in of.faces])
            found = cells[row[:, None], local[face]]
            turned = (sign[sides[row, face]] > 0)[:, None]
            return np.asarray(np.where(turned, found, found[:, ::-1]), np.int64)
        solid = self.solid[group[:, :1]]
        corners = self._now(self.merged[group])
        if group.shape[1] == 1:
            return np.searchsorted(known, corners * n_solids + solid)
        each = [
            np.searchsorted(known, self.tree.lines(self.merged[group[solid[:, 0] == k]]) * n_solids + k)
            for k in np.unique(solid)
        ]
        return np.concatenate(each)

    def _now(self, nodes: IntArray) -> IntArray:
        """Give nodes of the first mesh their numbers in this stage."""
        if isinstance(self.tree, Bisection):
            return nodes
        cells = self.tree.corners[1]
        number = np.full(len(self.merged), -1, np.int64)
        offset = octree.offsets(self.tree.dim)
        top = (np.int64(1) << self.tree.level)[:, None, None]
        place = self.tree.corner[:, None, :] + offset[None]
        at = ((place == 0) | (place == top)).all(axis=2)
        row, corner = np.nonzero(at)
        which = (place[row, corner] > 0).astype(np.int64)
        local = np.array([int(np.flatnonzero((offset == w).all(axis=1))[0]) for w in which])
        number[self.tree.cells[self.tree.root[row], local]] = cells[row, corner]
        return number[nodes]


def _match(facets: IntArray, group: IntArray) -> IntArray:
    """Return the first row of the facets that has the nodes of each row of a group."""
    index, first = topology.group_by_nodes(np.concatenate([facets, group]))
    found = first[index[len(facets) :]]
    if len(found) and found.max() >= len(facets):
        raise BadValue("group", "facets", "made of facets of the mesh")
    return found


def _rows_among(cells: IntArray, group: IntArray) -> np.ndarray:
    """Mark the rows that a group holds."""
    marked = np.zeros(len(cells), bool)
    marked[_match(cells, group)] = True
    return marked


def _same_turn(one: IntArray, two: IntArray) -> np.ndarray:
    """Tell whether facets of the same nodes turn the same way."""
    if one.shape[1] == 2:
        return np.asarray((one == two).all(axis=1))
    at = np.argmax(two == one[:, :1], axis=1)
    after = two[np.arange(len(two)), (at + 1) % two.shape[1]]
    return np.asarray(after == one[:, 1])


def faces_in_order(name: str, cells: IntArray) -> IntArray:
    """Return the nodes of the facets of each cell, (m, n_faces, n)."""
    return cells[:, np.array([nodes for _, nodes in shape(name).faces])]


def founded(
    name: str,
    points: FloatArray,
    cells: IntArray,
    groups: Mapping[str, IntArray] | None = None,
    pairs: Sequence[tuple[str, str]] = (),
) -> Hierarchy:
    """Begin the history of a mesh.

    Parameters
    ----------
    name : str
        TRI3, TET4, QUA4 or CUB8.
    points : (n, dim) float64, length
    cells : (m, n_nodes) int64
    groups : dict of str to (k, c) int64, optional
        Parts of the mesh: elements, facets, edges or nodes.
    pairs : sequence of (str, str)
        Contacts: two groups of facets whose nodes lie at the same places; they are divided alike (quadrangles and
        hexahedra: all the elements of a contact).

    Returns
    -------
    Hierarchy

    Raises
    ------
    BadValue
        A group that is no part of the mesh, a pair that does not match.
    """
    named = {key: np.asarray(group, np.int64) for key, group in (groups or {}).items()}
    solid = connectivity.solids([(name, cells)], len(points))[1]
    merged, _ = pairing.merged_nodes(points, solid, named, pairs)
    tree: Bisection | Octree
    if name in ("TRI3", "TET4"):
        tree = bisection.started(points, merged[cells])
    else:
        facets = faces_in_order(name, merged[cells]).reshape(-1, 2 ** (points.shape[1] - 1))
        bound = [np.flatnonzero(_rows_of(facets, merged[named[second]])) for _, second in pairs]
        tree = octree.planted(points, merged[cells], bound)
    state = Hierarchy(name, cells, merged, np.maximum(solid, 0), named, list(pairs), tree)
    state.mesh()  # refuses groups that are no part of the mesh
    return state


def _rows_of(facets: IntArray, group: IntArray) -> np.ndarray:
    """Mark every row, from both sides, whose nodes are those of a row of a group."""
    index, _ = topology.group_by_nodes(np.concatenate([facets, group]))
    wanted = np.zeros(int(index.max()) + 1, bool)
    wanted[index[len(facets) :]] = True
    return wanted[index[: len(facets)]]


def adapted(state: Hierarchy, sizes: FloatArray, *, counted: bool = True) -> tuple[Hierarchy, list[int]]:
    """Divide and put together elements until they have the sizes asked for.

    Parameters
    ----------
    state : Hierarchy
    sizes : (n,) float64, length
        Edge wanted at the nodes of ``state.mesh()``.
    counted : bool
        Multiply all sizes by one factor, found by trial, so that the mesh has at most the number of elements that the
        sizes ask for, and about `NEAR` of it unless divisions jump over it; else take the sizes as they are.

    Returns
    -------
    state : Hierarchy
    counts : list of int
        Elements of each trial.

    Raises
    ------
    BadValue
        Sizes that are not positive and finite; divisions beyond `octree.DEEPEST`.
    """
    now = state.mesh()
    if not (np.isfinite(sizes).all() and (sizes > 0).all()):
        bad = sizes[~(np.isfinite(sizes) & (sizes > 0))]
        raise BadValue("size", float(bad[0]), "finite and positive")
    points, cells, root, _ = state._stage()
    common = np.zeros(len(points))
    number = np.zeros(len(points))
    np.add.at(common, cells, np.log(sizes[now.cells]))
    np.add.at(number, cells, 1.0)
    asked = np.exp(common / np.maximum(number, 1.0))
    # Nothing becomes larger than in the first mesh: sizes above would ask for fewer elements than there can be.
    of = shape(state.name)
    whole = np.asarray(np.bincount(root, np.abs(geometry.measures(of, points[cells]))), np.float64)
    widest = np.zeros(len(points))
    np.maximum.at(widest, cells, element_sizes(of, whole)[root][:, None])
    asked = np.minimum(asked, widest)
    if not counted:
        tree = _resized(state.tree, asked)
        return replace(state, tree=tree), [_count(tree)]
    wanted = predicted_count(points, [(state.name, cells)], asked)
    dim = points.shape[1]
    factor, counts = 1.0, []
    best: Bisection | Octree | None = None
    best_count = 0
    low, high = 0.0, np.inf
    for _ in range(TRIALS):
        tree = _resized(state.tree, factor * asked)
        got = _count(tree)
        counts.append(got)
        if best is None or (got <= wanted and (got > best_count or best_count > wanted)) or (got < best_count > wanted):
            best, best_count = tree, got
        if NEAR * wanted <= got <= wanted:
            break
        low, high = (max(low, factor), high) if got > wanted else (low, min(high, factor))
        step = factor * (got / (0.97 * wanted)) ** (1 / dim)
        factor = step if low < step < high else float(np.sqrt(low * high)) if np.isfinite(high) and low > 0 else step
    assert best is not None
    return replace(state, tree=best), counts


def _count(tree: Bisection | Octree) -> int:
    return len(tree.leaves) if isinstance(tree, Bisection) else len(tree.root)


def _resized(tree: Bisection | Octree, sizes: FloatArray) -> Bisection | Octree:
    return halvings.adapted(tree, sizes) if isinstance(tree, Bisection) else resized(tree, sizes)[0]
