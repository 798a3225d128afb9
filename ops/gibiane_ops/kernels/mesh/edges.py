"""Edges of surfaces: contours, and the sharp edges of envelopes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.geometry import facet_normals
from gibiane_ops.kernels.topology import Block


def contour(blocks: Sequence[Block], which: str) -> IntArray:
    """Find the edges of a surface by the number of elements that use them.

    Parameters
    ----------
    blocks : sequence of (str, (m, n_nodes) int64)
        Surfaces.
    which : str
        EXTE (one element), INTE (three or more) or TOUT (any number but two).

    Returns
    -------
    (k, 2) int64
        Each edge once, directed as the first element that has it turns.
    """
    facets = topology.faces_of(blocks).get("SEG2")
    if facets is None:
        return np.zeros((0, 2), np.int64)
    group, first = topology.group_by_nodes(facets.nodes)
    count = np.bincount(group)
    wanted = {"EXTE": count == 1, "INTE": count > 2, "TOUT": count != 2}[which]
    return np.asarray(facets.nodes[first[wanted]], np.int64)


def sharp(points: FloatArray, blocks: Sequence[Block], angle: float) -> IntArray:
    """Find the edges where a surface ends, branches or folds.

    Parameters
    ----------
    points : (n_points, 3) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)
        Surfaces; neighbours turn alike.
    angle : float, degrees
        Facets whose normals differ by more make a sharp edge.

    Returns
    -------
    (k, 2) int64
        Each edge once.
    """
    facets = topology.faces_of(blocks).get("SEG2")
    if facets is None:
        return np.zeros((0, 2), np.int64)
    normals = np.concatenate([facet_normals(shape(name), points[cells]) for name, cells in blocks])
    group, first = topology.group_by_nodes(facets.nodes)
    count = np.bincount(group)
    order = np.argsort(group, kind="stable")
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    one = facets.cell[order[start]]
    other = facets.cell[order[np.minimum(start + 1, len(order) - 1)]]
    cosine = (normals[one] * normals[other]).sum(axis=1)
    fold = (count == 2) & (cosine < np.cos(np.radians(angle)))
    return np.asarray(facets.nodes[first[fold | (count != 2)]], np.int64)
