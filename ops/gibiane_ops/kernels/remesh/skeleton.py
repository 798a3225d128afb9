"""Geometry read off a mesh: regions of cells, smooth patches of their boundary, limiting curves and corners."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import BadValue

BoolArray = NDArray[np.bool_]

FLAT = 1e-9
"""A patch is plane, a chain straight, when it strays less than this share of the size of the mesh."""

CELL = {2: "TRI3", 3: "TET4"}
FACET = {2: "SEG2", 3: "TRI3"}


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Patches, chains and corners of a mesh of simplices.

    Attributes
    ----------
    points : (n, 3) float64, length
    dim : int
        Dimension of the cells, 2 or 3.
    triangles : (k, 3) int64
        Facets of the patches (the cells themselves when dim is 2).
    patch : (k,) int64
        Patch of each triangle.
    sides : (n_patches, 2) int64
        Regions on the two sides of each patch, -1 for none; in 2D the region of the patch, and -1.
    plane : (n_patches,) bool
    chains : list of (k,) int64
        Nodes of each curve from end to end; a closed curve ends where it begins.
    straight : (n_chains,) bool
    borders : list of list of int
        Chains that limit each patch.
    """

    points: FloatArray
    dim: int
    triangles: IntArray
    patch: IntArray
    sides: IntArray
    plane: BoolArray
    chains: list[IntArray]
    straight: BoolArray
    borders: list[list[int]]

    @property
    def polyhedral(self) -> bool:
        """Whether every patch is plane and every curve straight."""
        return bool(self.plane.all() and self.straight.all())


def regions(cells: IntArray, member: FloatArray) -> IntArray:
    """Split the cells in regions: cells joined through facets that belong to the same groups.

    Parameters
    ----------
    cells : (m, dim + 1) int64
    member : (m, n_groups)
        1 where the cell belongs to the group.

    Returns
    -------
    (m,) int64
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    _, label = np.unique(member, axis=0, return_inverse=True)
    label = label.ravel()
    pairs = topology.neighbours([(CELL[cells.shape[1] - 1], cells)])
    pairs = pairs[label[pairs[:, 0]] == label[pairs[:, 1]]]
    links = coo_array((np.ones(len(pairs), np.int8), pairs.T), shape=(len(cells),) * 2)
    return np.asarray(connected_components(links, directed=False)[1], np.int64)


def membership(rows: IntArray, groups: Mapping[str, IntArray]) -> FloatArray:
    """Tell which sets of nodes belong to which groups.

    Parameters
    ----------
    rows : (m, k) int64
        Node sets, all different.
    groups : dict of str to (n, k) int64
        Node sets of each group, each one of `rows`.

    Returns
    -------
    (m, n_groups) float64
        0 or 1.

    Raises
    ------
    BadValue
        When a group is empty or holds a set that is not among the rows.
    """
    member = np.zeros((len(rows), len(groups)))
    for k, (name, group) in enumerate(groups.items()):
        number, first = topology.group_by_nodes(np.vstack([rows, group]))
        if len(group) == 0 or len(first) > len(rows):
            limit = "some cells of the mesh, facets of its boundary or of the limit of regions, or lines on sharp edges"
            raise BadValue(f"group {name}", f"{len(first) - len(rows)} unknown elements of {len(group)}", limit)
        member[np.isin(number[: len(rows)], number[len(rows) :]), k] = 1.0
    return member


def build_skeleton(
    points: FloatArray,
    cells: IntArray,
    region: IntArray,
    facet_groups: Mapping[str, IntArray],
    edge_groups: Mapping[str, IntArray],
    corner_nodes: IntArray,
    angle: float,
) -> Skeleton:
    """Split the limits of the regions into patches, curves and corners.

    Parameters
    ----------
    points : (n, 3) float64, length
    cells : (m, dim + 1) int64
        Solids in contact share the nodes of the contact.
    region : (m,) int64
    facet_groups : dict of str to (k, dim) int64
        Named boundary parts: their limits become curves (in 2D their ends become corners).
    edge_groups : dict of str to (k, 2) int64
        In 3D, named lines.
    corner_nodes : (k,) int64
        Nodes to keep where they are on curves.
    angle : float, degrees
        Facets, and segments of a curve, that turn by less than this are one smooth piece.

    Returns
    -------
    Skeleton

    Raises
    ------
    BadValue
        A named facet inside a region, or a named line that is not on a limit of patches.
    """
    dim = cells.shape[1] - 1
    faces = topology.faces_of([(CELL[dim], cells)])[FACET[dim]]
    number, first = topology.group_by_nodes(faces.nodes)
    sides = _sides(region[faces.cell], number)
    kept = np.flatnonzero(sides[:, 0] != sides[:, 1])
    limits, sides = faces.nodes[first[kept]], sides[kept]
    member = membership(limits, facet_groups)
    if dim == 3:
        _, label = np.unique(np.hstack([sides, member]), axis=0, return_inverse=True)
        triangles = limits
        patch, whole = _smooth_patches(points, triangles, label.ravel(), angle)
        first_facet = np.unique(patch, return_index=True)[1]
        patch_sides, whole = sides[first_facet], whole[first_facet]
        edges, edge_patches = _patch_limits(triangles, patch)
        # A cut made only to open a closed surface may zigzag: its bends are no corners.
        around = np.where(edge_patches >= 0, whole[edge_patches], whole[edge_patches[:, :1]])
        soft = (around == around[:, :1]).all(axis=1) & (edge_patches[:, 1] >= 0)
        member = membership(edges, edge_groups)
    else:
        triangles, patch = cells, region
        count = int(region.max()) + 1
        patch_sides = np.stack([np.arange(count), np.full(count, -1)], axis=1)
        edges, edge_patches = limits, sides
        soft = np.zeros(len(edges), bool)
    _, label = np.unique(np.hstack([edge_patches, member]), axis=0, return_inverse=True)
    chains, chain_label = _chains(points, edges, label.ravel(), soft, corner_nodes, angle)
    size = float(np.ptp(points[np.unique(cells)], axis=0).max())
    first_edge = np.unique(label.ravel(), return_index=True)[1]
    borders: list[list[int]] = [[] for _ in patch_sides]
    for k, each in enumerate(chain_label):
        for p in {int(p) for p in edge_patches[first_edge[each]] if p >= 0}:
            borders[p].append(k)
    return Skeleton(
        points,
        dim,
        triangles,
        patch,
        patch_sides,
        np.array([_is_flat(points[np.unique(triangles[patch == p])], 2, size) for p in range(len(patch_sides))]),
        chains,
        np.array([_is_flat(points[chain], 1, size) for chain in chains]),
        borders,
    )


def _sides(region: IntArray, number: IntArray) -> IntArray:
    """Give the two regions of each numbered facet, the larger number first, -1 for the outside."""
    n = int(number.max()) + 1
    low = np.full(n, np.iinfo(np.int64).max)
    high = np.full(n, -1)
    np.minimum.at(low, number, region)
    np.maximum.at(high, number, region)
    low[np.bincount(number, minlength=n) == 1] = -1
    return np.stack([high, low], axis=1)


def _unit_normals(points: FloatArray, triangles: IntArray) -> FloatArray:
    normal = np.cross(
        points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]]
    )
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True), np.float64)


def _smooth_patches(
    points: FloatArray, triangles: IntArray, label: IntArray, angle: float
) -> tuple[IntArray, IntArray]:
    """Join facets of one label across edges where they are the only two of that label and turn little.

    A closed surface, which has no single map to the plane, is cut in octants about its centre. Returns the patch of
    each facet, and the smooth surface of which the patch is a part.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edge, _ = topology.group_by_nodes(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2))
    key = edge * (int(label.max()) + 1) + np.repeat(label, 3)
    order = np.argsort(key, kind="stable")
    starts = np.flatnonzero(np.r_[True, key[order][1:] != key[order][:-1]])
    two = starts[np.diff(np.r_[starts, len(key)]) == 2]
    pairs = np.stack([order[two], order[two + 1]], axis=1) // 3
    normal = _unit_normals(points, triangles)
    # Facets of one label leave the same region, but the sense in which they are listed may differ.
    cosine = np.abs((normal[pairs[:, 0]] * normal[pairs[:, 1]]).sum(axis=1))
    folded = _folded(points, triangles, pairs)
    pairs = pairs[(cosine >= np.cos(np.radians(angle))) & ~folded]

    def joined(pairs: IntArray) -> IntArray:
        links = coo_array((np.ones(len(pairs), np.int8), pairs.T), shape=(len(triangles),) * 2)
        return np.asarray(connected_components(links, directed=False)[1], np.int64)

    whole = joined(pairs)
    # Three joined edges for every two facets: no edge is left for a border.
    facets, inner = np.bincount(whole), np.bincount(whole[pairs[:, 0]], minlength=int(whole.max()) + 1)
    closed = (2 * inner == 3 * facets)[whole]
    middle = points[triangles].mean(axis=1)
    centre = np.stack([np.bincount(whole, x) / facets for x in middle.T], axis=1)
    octant = ((middle > centre[whole]) @ np.array([1, 2, 4])) * closed
    return joined(pairs[octant[pairs[:, 0]] == octant[pairs[:, 1]]]), whole


def _folded(points: FloatArray, triangles: IntArray, pairs: IntArray) -> BoolArray:
    """Tell the pairs of triangles that lie on the same side of their common edge, like a shut book."""
    a, b = triangles[pairs[:, 0]], triangles[pairs[:, 1]]
    shared = (a[:, :, None] == b[:, None, :]).any(axis=2)
    middle = (points[a] * shared[:, :, None]).sum(axis=1) / 2
    # A long triangle may lean far along the edge: only what stands across it tells the side.
    edge = 2 * (middle - points[a][np.arange(len(a)), shared.argmax(axis=1)])
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)

    def across(triangle: IntArray) -> FloatArray:
        toward = points[triangle].mean(axis=1) - middle
        return np.asarray(toward - (toward * edge).sum(axis=1, keepdims=True) * edge, np.float64)

    return np.asarray((across(a) * across(b)).sum(axis=1) > 0, np.bool_)


def _patch_limits(triangles: IntArray, patch: IntArray) -> tuple[IntArray, IntArray]:
    """Find the edges that are not inside one patch, with the patches around each, padded by -1."""
    ends = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edge, first = topology.group_by_nodes(ends)
    owner = np.repeat(patch, 3)
    order = np.lexsort((owner, edge))
    starts = np.r_[0, np.cumsum(np.bincount(edge))]
    count = np.diff(starts)
    around = np.full((len(count), int(count.max())), -1, np.int64)
    around[edge[order], np.arange(len(order)) - starts[edge[order]]] = owner[order]
    inside = (count == 2) & (around[:, 0] == around[:, 1])
    return ends[first[~inside]], around[~inside]


def _chains(
    points: FloatArray, edges: IntArray, label: IntArray, soft: BoolArray, corner_nodes: IntArray, angle: float
) -> tuple[list[IntArray], list[int]]:
    """Follow edges of one label from corner to corner; curves are few, so that a loop over them is cheap."""
    around: dict[int, list[int]] = {}
    for k, ends in enumerate(edges.tolist()):
        for node in ends:
            around.setdefault(node, []).append(k)
    fixed = set(corner_nodes.tolist())
    limit = np.cos(np.radians(angle))

    def is_corner(node: int) -> bool:
        at = around[node]
        if len(at) != 2 or node in fixed or label[at[0]] != label[at[1]]:
            return True
        if soft[at].all():
            return False
        arms = points[edges[at].sum(axis=1) - node] - points[node]
        arms /= np.linalg.norm(arms, axis=1, keepdims=True)
        return bool(-(arms[0] @ arms[1]) < limit)

    corner = {node for node in around if is_corner(node)}
    done = np.zeros(len(edges), bool)
    chains, labels = [], []
    # Corners first; what remains are closed curves without corner, opened at their first node.
    for start in [*sorted(corner), *sorted(set(around) - corner)]:
        for k in around[start]:
            chain, edge = [start], k
            while not done[edge]:
                done[edge] = True
                node = int(edges[edge].sum()) - chain[-1]
                chain.append(node)
                if node in corner or node == start:
                    break
                first, second = around[node]
                edge = second if first == edge else first
            if len(chain) > 1:
                chains.append(np.array(chain, np.int64))
                labels.append(int(label[k]))
    return chains, labels


def _is_flat(points: FloatArray, dim: int, size: float) -> bool:
    """Tell whether points lie in a space of the given dimension."""
    centred = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    return bool(np.abs(centred @ axes[dim:].T).max(initial=0.0) <= FLAT * size)
