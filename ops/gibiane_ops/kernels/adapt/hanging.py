"""Relations that keep displacements continuous where small elements meet large ones, or quadratic ones linear ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.topology import Block

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
        nodes, masters = _halved_faces(points, faces.nodes, ends[edge_of], middle, ends)
        found_nodes.append(nodes)
        found_masters.append(masters)
    node, first = np.unique(np.concatenate(found_nodes), return_index=True)
    return node, np.concatenate(found_masters)[first]


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
    """Return the nodes in the middle of faces whose four sides are halved, and the corners of these faces."""
    n = np.int64(len(points))
    key = np.sort(halved, axis=1)
    key = key[:, 0] * n + key[:, 1]
    order = np.argsort(key)
    key, middle = key[order], middle[order]
    side = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
    side_key = side[..., 0] * n + side[..., 1]
    at = np.searchsorted(key, side_key)
    at[at == len(key)] = 0
    whole = (key[at] == side_key).all(axis=1)
    faces, around = faces[whole], middle[at[whole]]
    if len(faces) == 0:
        return np.zeros(0, np.int64), np.zeros((0, 4), np.int64)
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
    return centre[good], faces[face[good]]
