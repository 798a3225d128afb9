"""Relations that keep displacements continuous where small elements meet large ones, or quadratic ones linear ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.topology import Block, Facets

TOLERANCE = 1e-9
"""Distance of a hanging node to the middle of its edge or face, as a share of the edge."""


def hanging_nodes(points: FloatArray, blocks: Sequence[Block]) -> tuple[IntArray, IntArray]:
    """Find the nodes that stand in the middle of an edge or of a face of a larger or linear element.

    Parameters
    ----------
    points : (n, dim) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)

    Returns
    -------
    nodes : (k,) int64
        Increasing, once each.
    masters : (k, 4) int64
        The two ends of the edge, or the four corners of the face; -1 beyond.

    Notes
    -----
    A node of an edge (a, b) hangs when two edges of other elements lead from it to a and b, and it stands half-way:
    nodes at the same place in another solid share no edge with a and b. A node hangs in a face of four corners when
    edges lead from it to nodes in the middles of the four sides. A mid-node of a quadratic element hangs where its
    edge is also that of a linear element.
    """
    linear = [(name, cells) for name, cells in blocks if shape(name).degree == 1]
    ends = topology.edges(linear)
    beside = topology.middles_on_linear(blocks)
    found_nodes, found_masters = [beside[:, 2]], [_padded(beside[:, :2])]
    edge_of, middle = halved_edges(points, ends)
    found_nodes.append(middle)
    found_masters.append(_padded(ends[edge_of]))
    faces = topology.faces_of(linear).get("QUA4")
    if faces is not None and len(middle):
        nodes, face = _halved_faces(points, faces.nodes, ends[edge_of], middle, ends)
        found_nodes.append(nodes)
        found_masters.append(faces.nodes[face])
    node, first = np.unique(np.concatenate(found_nodes), return_index=True)
    return node, np.concatenate(found_masters)[first]


def pieces_of_facets(points: FloatArray, facets: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Find the facets that are a half or a quarter of another one: of small elements beside a large one.

    Parameters
    ----------
    points : (n, dim) float64, length
    facets : (m, 2) or (m, 4) int64
        Corners of the facets that belong to one element only: segments in a plane, quadrangles in space.

    Returns
    -------
    piece, whole : (k,) int64
        Numbers of the facets; a whole one comes for each of its pieces.
    weights : (k, c, c) float64
        Values at the corners of a piece from those at the corners of the whole.
    """
    c = facets.shape[1]
    ends = facets if c == 2 else topology.edges([("QUA4", facets)])
    halved, middle = halved_edges(points, ends)
    nodes, large = middle, halved
    if c == 4 and len(middle):
        nodes, large = _halved_faces(points, facets, ends[halved], middle, ends)
    if not len(middle) or not len(nodes):
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, c, c))
    of_node = np.full(len(points), -1, np.int64)
    of_node[nodes] = large
    found = of_node[facets].max(axis=1)
    # a facet that touches the middle of another one, but lies beside it, shares no corner with it
    shares_corner = (facets[:, :, None] == facets[found][:, None]).any(axis=(1, 2))
    piece = np.flatnonzero((found >= 0) & shares_corner & (found != np.arange(len(facets))))
    whole = found[piece]
    corners, own = facets[whole], facets[piece]
    weights = (own[:, :, None] == corners[:, None]).astype(np.float64)
    weights[of_node[own] == whole[:, None]] = 1 / c
    # the corners left are middles of sides: between the neighbours in the piece, a corner and the centre, of four
    left = weights.sum(axis=2) == 0
    row, place = np.nonzero(left)
    at = points[own[row, place]]
    middles = (points[corners] + points[np.roll(corners, -1, axis=1)]) / 2
    side = np.linalg.norm(middles[row] - at[:, None], axis=2).argmin(axis=1)
    weights[row, place, side] = weights[row, place, (side + 1) % c] = 0.5
    return piece, whole, weights


def outer_boundary(points: FloatArray, blocks: Sequence[Block]) -> dict[str, Facets]:
    """Find the facets of one cell only that are no part of another cell's: `topology.boundary` less hanging ones.

    Parameters
    ----------
    points : (n, dim) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)

    Returns
    -------
    dict of str to Facets
    """
    found = topology.boundary(blocks)
    for name, c in (("SEG2", 2), ("QUA4", 4)):
        if name in found and found[name].nodes.shape[1] == c:
            piece, whole, _ = pieces_of_facets(points, found[name].nodes)
            found[name] = found[name].take(np.setdiff1d(np.arange(len(found[name].nodes)), np.r_[piece, whole]))
    return {name: facets for name, facets in found.items() if len(facets.nodes)}


def _padded(masters: IntArray) -> IntArray:
    return np.pad(masters, ((0, 0), (0, 4 - masters.shape[1])), constant_values=-1)


def _among(keys: IntArray, known: IntArray) -> np.ndarray:
    """Tell which keys are in a sorted list."""
    if len(known) == 0:
        return np.zeros(len(keys), bool)
    at = np.searchsorted(known, keys)
    at[at == len(known)] = 0
    return np.asarray(known[at] == keys)


def halved_edges(points: FloatArray, ends: IntArray) -> tuple[IntArray, IntArray]:
    """Return the edges made of two others, and the node between these."""
    length = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    # Both ways: from each node, its edges.
    start = np.concatenate([ends[:, 0], ends[:, 1]])
    stop = np.concatenate([ends[:, 1], ends[:, 0]])
    size = np.concatenate([length, length])
    order = np.lexsort((stop, start))
    start, stop, size = start[order], stop[order], size[order]
    n = np.int64(len(points))
    keys = start * n + stop
    # A half of edge (a, b) leaves a, is half as long and ends half-way: candidates are the edges from a.
    first = np.searchsorted(start, ends[:, 0])
    count = np.searchsorted(start, ends[:, 0], side="right") - first
    edge = np.repeat(np.arange(len(ends)), count)
    at = np.repeat(first, count) + np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    near = np.abs(2 * size[at] - length[edge]) <= TOLERANCE * length[edge]
    edge, at = edge[near], at[near]
    middle = stop[at]
    a, b = ends[edge].T
    off = np.linalg.norm(points[middle] - (points[a] + points[b]) / 2, axis=1) <= TOLERANCE * length[edge]
    joined = _among(middle * n + b, keys)
    good = off & joined
    return edge[good], middle[good]


def _halved_faces(
    points: FloatArray, faces: IntArray, halved: IntArray, middle: IntArray, ends: IntArray
) -> tuple[IntArray, IntArray]:
    """Return the nodes in the middle of faces whose four sides are halved, and the numbers of these faces."""
    n = np.int64(len(points))
    key = np.sort(halved, axis=1)
    key = key[:, 0] * n + key[:, 1]
    order = np.argsort(key)
    key, middle = key[order], middle[order]
    side = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
    side_key = side[..., 0] * n + side[..., 1]
    at = np.searchsorted(key, side_key)
    at[at == len(key)] = 0
    whole = np.flatnonzero((key[at] == side_key).all(axis=1))
    faces, around = faces[whole], middle[at[whole]]
    if len(faces) == 0:
        return np.zeros(0, np.int64), whole
    start = np.concatenate([ends[:, 0], ends[:, 1]])
    stop = np.concatenate([ends[:, 1], ends[:, 0]])
    order = np.lexsort((stop, start))
    start, stop = start[order], stop[order]
    keys = start * n + stop
    first = np.searchsorted(start, around[:, 0])
    count = np.searchsorted(start, around[:, 0], side="right") - first
    face = np.repeat(np.arange(len(faces)), count)
    centre = stop[np.repeat(first, count) + np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)]
    size = np.linalg.norm(points[faces[:, 0]] - points[faces[:, 2]], axis=1)
    good = np.linalg.norm(points[centre] - points[faces[face]].mean(axis=1), axis=1) <= TOLERANCE * size[face]
    for k in range(1, 4):
        good &= _among(around[face, k] * n + centre, keys)
    return centre[good], whole[face[good]]
