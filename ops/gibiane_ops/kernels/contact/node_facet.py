"""Slave nodes against the facets of another mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.facets import integrals, middles_of, surface_of
from gibiane_ops.kernels.contact.pairs import DEEP, FACING, ROUND_OFF, ContactPairs
from gibiane_ops.kernels.contact.search import candidates, reach, spheres
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import EmptyContact
from gibiane_ops.kernels.topology import Block

INSIDE = 1e-6
"""How far outside a facet, in its reference coordinates, a projection still belongs to it."""

CATCH_UP = 0.05
"""The same where a node projects on no facet; it is then moved to the border."""


def node_facet_pairs(
    points: FloatArray,
    slave: Sequence[Block],
    master: Sequence[Block],
    *,
    facing: bool = True,
    axisymmetric: bool = False,
) -> ContactPairs:
    """Tie each slave node to the point of the master in front of it, along its normal.

    Parameters
    ----------
    points : (n_points, d) float64, length
    slave, master : sequence of (shape name, (m, n_nodes) int64)
        Facets, normals out of their bodies.
    facing : bool
        Only facets that look towards the node count; False finds those that look away, to tell why there is no contact.
    axisymmetric : bool
        Areas go once round the axis.

    Returns
    -------
    ContactPairs
        ``w_p = u1_p - sum_j N_j(xi_p) u2_j``; the gap is the distance along the normal, negative inside the master.

    Raises
    ------
    EmptyContact
        When no node has a facet in front of it.

    Notes
    -----
    Facets farther than half the extent of the slave surface do not count; among the others the nearest does. Forces
    balance exactly; a uniform pressure does not pass (the patch test fails), the more so the coarser the slave. Nodes
    without a facet stay free of contact.

    Cost
    ----
    A k-d tree, and a few 3 x 3 systems for each facet near a node.
    """
    surface = surface_of(points, slave)
    master = [(name, cells) for name, cells in master if len(cells)]
    if not master:
        raise EmptyContact("a surface without facets")
    among = spheres(points, master)
    x = points[surface.nodes]
    far = reach(x)
    node, facet = candidates(x, 0.0, among, far)
    cosine = np.einsum("ki,ki->k", surface.normals[node], among.normal[facet])
    looks = (cosine < FACING) if facing else np.abs(cosine) > -FACING
    node, facet = node[looks], facet[looks]
    dim = points.shape[1] - 1
    xi, height = np.zeros((len(node), dim)), np.full(len(node), np.inf)
    outside = np.full(len(node), np.inf)
    for number, (name, cells) in enumerate(master):
        mine = np.flatnonzero(among.block[facet] == number)
        X = points[cells[among.facet[facet[mine]]]]
        xi[mine], height[mine] = _project(shape(name), X, x[node[mine]], surface.normals[node[mine]])
        outside[mine] = _outside(shape(name), xi[mine])
    within = (outside <= CATCH_UP) & (np.abs(height) <= far)
    node, facet, xi, height, outside = (each[within] for each in (node, facet, xi, height, outside))
    order = np.lexsort((np.abs(height), outside > INSIDE, node))
    first = order[np.unique(node[order], return_index=True)[1]]
    middles = middles_of(surface.facets)
    has = np.zeros(len(surface.nodes), dtype=bool)
    has[node[first]] = True
    has[middles[~has[middles[:, 1:]].all(axis=1), 0]] = False
    first = first[has[node[first]]]
    if not len(first):
        raise EmptyContact(f"no node of the slave surface has a facet of the master in front of it within {far:g}")
    node, facet, xi, gap = node[first], facet[first], xi[first], height[first]
    entries = _entries(master, among.block[facet], among.facet[facet], xi)
    position = np.full(len(surface.nodes), -1, np.int64)
    position[node] = np.arange(len(node))
    middles = position[middles[has[middles[:, 0]]]]
    extent = float(np.ptp(points[surface.nodes], axis=0).max())
    gap[np.abs(gap) <= ROUND_OFF * extent] = 0.0
    size = surface.size[node]
    masters = np.unique(np.concatenate([cells.ravel() for _, cells in master]))
    away = np.einsum("ki,ki->k", surface.normals[node], among.normal[facet]) > FACING
    found = ContactPairs.interpolated(
        points,
        surface.nodes[node],
        entries,
        middles,
        normals=surface.normals[node],
        gap=gap,
        area=integrals(points, surface, axisymmetric)[node],
        size=size,
        unpaired_slave=np.setdiff1d(surface.nodes, surface.nodes[node]),
        unpaired_master=np.setdiff1d(masters, entries[1]),
        penetrating=np.flatnonzero(gap < -DEEP * size),
        not_facing=np.flatnonzero(away),
    )
    return found.on_changed_basis()


def are_inside(points: FloatArray, nodes: IntArray, own: Sequence[Block], other: Sequence[Block]) -> bool:
    """Tell whether some nodes of a surface lie in front of facets of another, rather than beside it.

    Parameters
    ----------
    points : (n_points, d) float64, length
    nodes : (k,) int64
        Nodes of `own`.
    own, other : sequence of (shape name, (m, n_nodes) int64)

    Returns
    -------
    bool
    """
    if not len(nodes):
        return False
    try:
        found = node_facet_pairs(points, own, other)
    except EmptyContact:
        return False
    foot = -(found.matrix(len(points)) @ points - found.on_pairs(points[found.pairs[:, 0]]))
    here = found.on_pairs(points[found.pairs[:, 0]] + found.at_nodes(found.gap)[:, None] * found.normals)
    caught_up = np.linalg.norm(foot - here, axis=1) > 1e-3 * found.size
    return bool(np.isin(nodes, found.pairs[~caught_up, 0]).any())


def _entries(
    master: Sequence[Block], block: IntArray, facet: IntArray, xi: FloatArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Write minus the master's displacement at each point: (pair, node, coefficient)."""
    row, node, value = [], [], []
    for number, (name, cells) in enumerate(master):
        mine = np.flatnonzero(block == number)
        nodes = cells[facet[mine]]
        N = shape(name).N(_clamped(shape(name), xi[mine]))
        row.append(np.repeat(mine, nodes.shape[1]))
        node.append(nodes.ravel())
        value.append(-N.ravel())
    return np.concatenate(row), np.concatenate(node), np.concatenate(value)


def _project(of: Shape, X: FloatArray, x: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Find where the line from x along a normal meets facets: reference coordinates and distance, inf when nowhere."""
    k, dim = len(X), of.dim
    xi = np.broadcast_to(of.ref_nodes[: of.n_corners].mean(axis=0), (k, dim)).copy()
    s = np.zeros(k)
    step = np.full((k, dim + 1), np.inf)
    for _ in range(20):
        residual = x + s[:, None] * normal - np.einsum("ka,kai->ki", of.N(xi), X)
        J = np.concatenate([np.einsum("kaj,kai->kij", of.dN(xi), X), -normal[:, :, None]], axis=2)
        flat = np.abs(np.linalg.det(J)) <= 1e-12 * np.linalg.norm(J, axis=1).prod(axis=1)
        J[flat] = np.eye(dim + 1)
        step = np.linalg.solve(J, residual[..., None])[..., 0]
        step[flat] = np.inf
        # far from the facet the Newton steps of curved ones may run away: nothing is sought there
        xi = np.clip(xi + step[:, :dim], -4.0, 4.0)
        s = np.where(flat, np.inf, s + step[:, dim])
        s = np.where(np.isfinite(s), s, 0.0)
        if np.abs(step[:, :dim]).max(initial=0.0, where=~flat[:, None]) < 1e-13:
            break
    lost = ~(np.abs(step[:, :dim]).max(axis=1, initial=0.0) < 1e-9)
    xi[lost] = 4.0
    return xi, np.where(lost, np.inf, s)


def _outside(of: Shape, xi: FloatArray) -> FloatArray:
    """Measure how far reference points are outside a shape."""
    if of.n_corners == 3:
        return np.asarray(np.maximum(-xi.min(axis=1), xi.sum(axis=1) - 1))
    return np.asarray(np.abs(xi).max(axis=1) - 1) / 2


def _clamped(of: Shape, xi: FloatArray) -> FloatArray:
    """Move points that are a little outside to the border."""
    if of.n_corners == 3:
        bary = np.maximum(np.column_stack([1 - xi.sum(axis=1), xi]), 0.0)
        return np.asarray(bary[:, 1:] / bary.sum(axis=1)[:, None])
    return np.clip(xi, -1.0, 1.0)
