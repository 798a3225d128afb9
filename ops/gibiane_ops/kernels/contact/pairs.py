"""Pairs of facing nodes of two contact surfaces, their normals and initial gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue, EmptyContact
from gibiane_ops.kernels.geometry import normal_densities
from gibiane_ops.kernels.topology import Block, group_by_nodes

ROUND_OFF = 1e-9
"""Distances below this fraction of the size of the surfaces are zero."""

FACING = -0.5
"""Cosine of the normals of a pair above which the surfaces do not face each other."""


@dataclass(frozen=True, eq=False)
class ContactPairs:
    """Node pairs of one or several contact zones.

    Attributes
    ----------
    pairs : (n, 2) int64
        Slave node (body 1) and master node (body 2); -1 for a rigid obstacle, which has no unknowns.
    normals : (n, d) float64
        Unit outward normals of body 1.
    gap : (n,) float64, length
        Initial distance along the normal, negative where the bodies penetrate each other.
    points : (n, d) float64, length
        Slave nodes.
    zone : (n,) int64
        Number of the contact zone.
    unpaired_slave, unpaired_master : (k,) int64
        Nodes of the surfaces left without a partner.
    not_facing : (k,) int64
        Positions, in ``pairs``, of those whose surfaces do not face each other.
    penetrating : (k,) int64
        Positions of those with a negative gap.
    """

    pairs: IntArray
    normals: FloatArray
    gap: FloatArray
    points: FloatArray
    zone: IntArray
    unpaired_slave: IntArray
    unpaired_master: IntArray
    not_facing: IntArray
    penetrating: IntArray


def node_pairs(
    points: FloatArray,
    slave: Sequence[Block],
    master: Sequence[Block],
    *,
    tolerance: float | None = None,
    offset: float | None = None,
) -> ContactPairs:
    """Pair each slave node with the master node at the same place.

    Parameters
    ----------
    points : (n_points, d) float64, length
    slave, master : sequence of (shape name, (m, n_nodes) int64)
        Facets of the two contact surfaces, turning so that normals leave their body (see ``facets_of_body``).
    tolerance : float, optional
        Largest distance of two paired nodes; a millionth of the size of the surfaces when left out. Surfaces with an
        initial gap need one above the gap and below half of the node spacing.
    offset : float, optional
        Largest distance of two paired nodes along the surface, no limit when left out.

    Returns
    -------
    ContactPairs
        One zone; ``joined`` puts several together.

    Raises
    ------
    EmptyContact
        When no node finds a partner.

    Notes
    -----
    The normal of a node is the mean of the normals of its slave facets, weighted by their areas. A master node goes to
    the nearest slave node only. A distance below ``ROUND_OFF`` times the size of the surfaces counts as zero.

    Cost
    ----
    A k-d tree of the master nodes.
    """
    from scipy.spatial import cKDTree

    slave_nodes, slave_normals = nodal_normals(points, slave)
    master_nodes, master_normals = nodal_normals(points, master)
    if not len(slave_nodes) or not len(master_nodes):
        raise EmptyContact("a surface without facets")
    size = float(np.ptp(points[np.r_[slave_nodes, master_nodes]], axis=0).max())
    reach = 1e-6 * size if tolerance is None else tolerance
    distance, nearest = cKDTree(points[master_nodes]).query(points[slave_nodes])
    # two slave nodes may claim one master node: the nearer has it
    order = np.argsort(distance, kind="stable")
    claims = order[np.unique(nearest[order], return_index=True)[1]]
    kept = np.sort(claims[distance[claims] <= reach])
    if offset is not None:
        apart = points[master_nodes[nearest[kept]]] - points[slave_nodes[kept]]
        across = np.einsum("ni,ni->n", apart, slave_normals[kept])[:, None] * slave_normals[kept]
        kept = kept[np.linalg.norm(apart - across, axis=1) <= offset]
    if not len(kept):
        raise EmptyContact(f"the nearest nodes are {distance.min():g} apart, the tolerance is {reach:g}")
    partner = nearest[kept]
    pairs = np.column_stack([slave_nodes[kept], master_nodes[partner]]).astype(np.int64)
    normals = slave_normals[kept]
    gap = np.einsum("ni,ni->n", points[pairs[:, 1]] - points[pairs[:, 0]], normals)
    gap[np.abs(gap) <= ROUND_OFF * size] = 0.0
    cosine = np.einsum("ni,ni->n", normals, master_normals[partner])
    return ContactPairs(
        pairs,
        normals,
        gap,
        points[pairs[:, 0]],
        np.zeros(len(pairs), np.int64),
        np.delete(slave_nodes, kept),
        np.delete(master_nodes, partner),
        np.flatnonzero(cosine > FACING),
        np.flatnonzero(gap < 0),
    )


def no_pairs(dim: int) -> ContactPairs:
    """Make a contact without any pair.

    Parameters
    ----------
    dim : int

    Returns
    -------
    ContactPairs
    """
    none, empty = np.zeros(0, np.int64), np.zeros((0, dim))
    return ContactPairs(np.zeros((0, 2), np.int64), empty, np.zeros(0), empty, none, none, none, none, none)


def joined(zones: Sequence[ContactPairs]) -> ContactPairs:
    """Put the pairs of several zones together.

    Parameters
    ----------
    zones : sequence of ContactPairs

    Returns
    -------
    ContactPairs
        Zones renumbered in the given order.
    """
    counts = [len(zone.pairs) for zone in zones]
    starts = np.cumsum([0, *counts])
    return ContactPairs(
        np.concatenate([zone.pairs for zone in zones]),
        np.concatenate([zone.normals for zone in zones]),
        np.concatenate([zone.gap for zone in zones]),
        np.concatenate([zone.points for zone in zones]),
        np.repeat(np.arange(len(zones)), counts),
        np.concatenate([zone.unpaired_slave for zone in zones]),
        np.concatenate([zone.unpaired_master for zone in zones]),
        np.concatenate([zone.not_facing + start for zone, start in zip(zones, starts, strict=False)]),
        np.concatenate([zone.penetrating + start for zone, start in zip(zones, starts, strict=False)]),
    )


def nodal_normals(points: FloatArray, facets: Sequence[Block]) -> tuple[IntArray, FloatArray]:
    """Average the normals of the facets at their nodes, weighted by area.

    Parameters
    ----------
    points : (n_points, d) float64, length
    facets : sequence of (shape name, (m, n_nodes) int64)

    Returns
    -------
    nodes : (k,) int64
        Nodes of the facets, increasing.
    normals : (k, d) float64
        Unit vectors.

    Raises
    ------
    BadValue
        When the normals around a node cancel, as on a surface folded on itself.
    """
    total = np.zeros_like(points)
    for name, cells in facets:
        rule = shape(name).mass_rule
        area = np.einsum("mqi,q->mi", normal_densities(shape(name), points[cells], rule.points), rule.weights)
        for column in cells.T:
            np.add.at(total, column, area)
    used = [np.ravel(cells) for _, cells in facets]
    nodes = np.unique(np.concatenate(used)).astype(np.int64) if used else np.zeros(0, np.int64)
    length = np.linalg.norm(total[nodes], axis=1)
    flat = length <= ROUND_OFF * length.max(initial=0)
    if flat.any():
        raise BadValue("contact normal", nodes[flat].tolist(), "a surface that is not folded on itself")
    return nodes, total[nodes] / length[:, None]


def facets_of_body(body: Sequence[Block], surface: Sequence[Block]) -> list[Block]:
    """Turn the facets of a surface so that their normals leave the body that they bound.

    Parameters
    ----------
    body : sequence of (shape name, (m, n_nodes) int64)
        Cells.
    surface : sequence of (shape name, (m, n_nodes) int64)
        Facets in any orientation.

    Returns
    -------
    list of (shape name, (m, n_nodes) int64)

    Raises
    ------
    EmptyContact
        When a facet is not on the boundary of the body.
    """
    marked = np.zeros(1 + max((int(cells.max()) for _, cells in [*body, *surface] if cells.size), default=0), bool)
    for _, cells in surface:
        marked[cells] = True
    turned: list[Block] = []
    for name, cells in surface:
        if not len(cells):
            continue
        n_corners = shape(name).n_corners
        skin = _facets_on(body, name, marked)
        group, first = group_by_nodes(np.concatenate([skin, cells])[:, :n_corners])
        match = first[group[len(skin) :]]
        # A facet between two cells is not on the boundary.
        shared = np.bincount(group[: len(skin)], minlength=len(first))[group[len(skin) :]] > 1
        lost = int(((match >= len(skin)) | shared).sum())
        if lost:
            raise EmptyContact(f"{lost} facets of the surface are not on the boundary of the body")
        turned.append((name, skin[match]))
    return turned


def _facets_on(body: Sequence[Block], name: str, marked: NDArray[np.bool_]) -> IntArray:
    """Return the facets of one shape, turned outwards, of the cells of a body, whose corners are all marked."""
    found = [np.zeros((0, shape(name).n_nodes), np.int64)]
    corners = shape(name).n_corners
    for of, cells in body:
        for facet, local in shape(of).faces:
            if facet == name:
                on = marked[cells[:, local[:corners]]].all(axis=1)
                found.append(cells[on][:, list(local)])
    return np.concatenate(found)
