"""Pairs of the nodes of a surface with a rigid obstacle, which has no unknowns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.outward import nodal_normals
from gibiane_ops.kernels.contact.pairs import FACING, ROUND_OFF, ContactPairs
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import EmptyContact
from gibiane_ops.kernels.topology import Block, middles_on_linear

INSIDE = 1e-6
"""How far outside a facet, over its size, a projection still belongs to it."""

CATCH_UP = 0.05
"""The same where a node projects on no facet: between the facets of a convex edge, or just past the border."""


def obstacle_pairs(points: FloatArray, slave: Sequence[Block], obstacle: Sequence[Block]) -> ContactPairs:
    """Pair each node of a surface with the facet of a rigid obstacle below it.

    Parameters
    ----------
    points : (n_points, d) float64, length
    slave : sequence of (shape name, (m, n_nodes) int64)
        Facets of the surface of the solid, normals out of it.
    obstacle : sequence of (shape name, (m, n_nodes) int64)
        Facets of the obstacle, normals towards the solid. Quadrangles count as two triangles.

    Returns
    -------
    ContactPairs
        Masters are -1. The normal is that of the facet, reversed, so that a plane is exact whatever the mesh of the
        solid; the gap is the distance to its plane.

    Raises
    ------
    EmptyContact
        When no node projects on a facet.

    Notes
    -----
    Among the facets on which a node projects, the nearest counts. Nodes that project on none stay free of contact, and
    so do those whose surface looks away from the obstacle when others face it. A middle of a quadratic facet on the
    side of a linear one follows its corners: it makes no pair, and is not left alone.

    Cost
    ----
    A k-d tree of the facets.
    """
    nodes, own_normals = nodal_normals(points, slave)
    own = ~np.isin(nodes, middles_on_linear(slave)[:, 2])
    nodes, own_normals = nodes[own], own_normals[own]
    corners = _simplices(points, obstacle)
    if not len(nodes) or not len(corners):
        raise EmptyContact("a surface without facets")
    d = points.shape[1]
    normal = _simplex_normals(corners)
    node, facet = _candidates(points[nodes], corners)
    x = points[nodes[node]]
    height = np.einsum("ki,ki->k", x - corners[facet, 0], normal[facet])
    outside = _outside(x - height[:, None] * normal[facet], corners[facet], normal[facet])
    within = outside <= CATCH_UP
    node, facet, height, outside = node[within], facet[within], height[within], outside[within]
    # facets that hold the projection come first, then the nearest
    order = np.lexsort((np.abs(height), outside > INSIDE, node))
    first = order[np.unique(node[order], return_index=True)[1]]
    node, facet, height = node[first], facet[first], height[first]
    if not len(node):
        raise EmptyContact("no node of the surface has a facet of the obstacle in front of it")
    away = np.einsum("ki,ki->k", own_normals[node], normal[facet]) > FACING
    if not away.all():
        node, facet, height, away = node[~away], facet[~away], height[~away], away[~away]
    size = float(np.ptp(points[nodes], axis=0).max())
    gap = np.where(np.abs(height) <= ROUND_OFF * size, 0.0, height)
    n = len(node)
    pairs = np.column_stack([nodes[node], np.full(n, -1)])
    none = np.zeros(0, np.int64)
    return ContactPairs(
        pairs, -normal[facet], gap, points[nodes[node]].reshape(n, d), np.zeros(n, np.int64),
        np.setdiff1d(nodes, nodes[node]), none, np.flatnonzero(away), np.flatnonzero(gap < 0),
    )  # fmt: skip


def _simplices(points: FloatArray, facets: Sequence[Block]) -> FloatArray:
    """Cut facets into segments or triangles by their corners, (m, d, d)."""
    found = []
    for name, cells in facets:
        corners = cells[:, : shape(name).n_corners]
        found.append(corners[:, :3] if corners.shape[1] > 2 else corners)
        if corners.shape[1] == 4:
            found.append(corners[:, [0, 2, 3]])
    d = points.shape[1]
    return points[np.concatenate(found)] if found else np.zeros((0, d, d))


def _simplex_normals(corners: FloatArray) -> FloatArray:
    """Give unit normals: to the right of a segment, right-handed for a triangle."""
    along = corners[:, 1] - corners[:, 0]
    if corners.shape[2] == 2:
        normal = np.column_stack([along[:, 1], -along[:, 0]])
    else:
        normal = np.cross(along, corners[:, 2] - corners[:, 0])
    return np.asarray(normal / np.linalg.norm(normal, axis=1)[:, None])


def _candidates(x: FloatArray, corners: FloatArray) -> tuple[IntArray, IntArray]:
    """List the facets that may be nearest to each point: (point, facet) pairs."""
    from scipy.spatial import cKDTree

    centres = corners.mean(axis=1)
    radius = float(np.linalg.norm(corners - centres[:, None], axis=2).max())
    tree = cKDTree(centres)
    # no facet whose centre is farther than this can be nearer than the one with the nearest centre
    reach = tree.query(x)[0] + 2 * radius
    found = tree.query_ball_point(x, reach)
    counts = np.array([len(each) for each in found])
    return np.repeat(np.arange(len(x)), counts), np.concatenate([np.asarray(each, np.int64) for each in found])


def _outside(x: FloatArray, corners: FloatArray, normal: FloatArray) -> FloatArray:
    """Measure how far points of the planes of facets are outside them: the most negative barycentric coordinate."""
    k = corners.shape[1]
    if k == 2:
        along = corners[:, 1] - corners[:, 0]
        s = np.einsum("ki,ki->k", x - corners[:, 0], along) / np.einsum("ki,ki->k", along, along)
        coordinates = np.stack([1 - s, s])
    else:
        areas = [
            np.einsum("ki,ki->k", np.cross(corners[:, (i + 1) % 3] - x, corners[:, (i + 2) % 3] - x), normal)
            for i in range(3)
        ]
        coordinates = np.stack(areas) / np.sum(areas, axis=0)
    return np.asarray(-coordinates.min(axis=0))
