"""Pairs of nodes at the same place, and what pairs need to know of the slave surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.facets import Surface, integrals, middles_of, surface_of
from gibiane_ops.kernels.contact.outward import nodal_normals
from gibiane_ops.kernels.contact.pairs import FACING, ROUND_OFF, ContactPairs
from gibiane_ops.kernels.errors import EmptyContact
from gibiane_ops.kernels.topology import Block, group_by_nodes, middles, middles_on_linear


def node_pairs(
    points: FloatArray,
    slave: Sequence[Block],
    master: Sequence[Block],
    *,
    tolerance: float | None = None,
    offset: float | None = None,
    axisymmetric: bool = False,
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
    axisymmetric : bool
        Areas go once round the axis.

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
    the nearest slave node only. A distance below ``ROUND_OFF`` times the size of the surfaces counts as zero. A middle
    of a quadratic facet on the side of a linear one follows its corners: it makes no pair, and is not left alone.

    Cost
    ----
    A k-d tree of the master nodes.
    """
    from scipy.spatial import cKDTree

    slave_nodes, slave_normals = nodal_normals(points, slave)
    master_nodes, master_normals = nodal_normals(points, master)
    following, led = (middles_on_linear(each)[:, 2] for each in (slave, master))
    own = ~np.isin(master_nodes, led)
    master_nodes, master_normals = master_nodes[own], master_normals[own]
    if not len(slave_nodes) or not len(master_nodes):
        raise EmptyContact("a surface without facets")
    size = float(np.ptp(points[np.r_[slave_nodes, master_nodes]], axis=0).max())
    reach = 1e-6 * size if tolerance is None else tolerance
    distance, nearest = cKDTree(points[master_nodes]).query(points[slave_nodes])
    distance[np.isin(slave_nodes, following)] = np.inf
    # two slave nodes may claim one master node: the nearer has it
    order = np.argsort(distance, kind="stable")
    claims = order[np.unique(nearest[order], return_index=True)[1]]
    kept = np.sort(claims[distance[claims] <= reach])
    if offset is not None:
        apart = points[master_nodes[nearest[kept]]] - points[slave_nodes[kept]]
        across = np.einsum("ni,ni->n", apart, slave_normals[kept])[:, None] * slave_normals[kept]
        kept = kept[np.linalg.norm(apart - across, axis=1) <= offset]
    surface = surface_of(points, slave, split=False)
    kept = _with_corners(surface, kept)
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
        np.setdiff1d(np.delete(slave_nodes, kept), following),
        np.delete(master_nodes, partner),
        np.flatnonzero(cosine > FACING),
        np.flatnonzero(gap < 0),
        middles=_middles(surface, kept),
        area=integrals(points, surface, axisymmetric)[kept],
        size=surface.size[kept],
    )


def all_partners(pairs: IntArray, slave: Sequence[Block], master: Sequence[Block]) -> IntArray:
    """Add the middles on the sides of linear facets to pairs of nodes.

    Parameters
    ----------
    pairs : (n, 2) int64
        Slave node and master node; -1 where there is none.
    slave, master : sequence of (shape name, (m, n_nodes) int64)

    Returns
    -------
    (k, 2) int64
        The pairs with two nodes, then those of middles whose corners are paired.
    """
    found = pairs[(pairs >= 0).all(axis=1)]
    own, other = middles(slave), middles(master)
    own = own[np.isin(own[:, :2], found[:, 0]).all(axis=1) & ~np.isin(own[:, 2], found[:, 0])]
    if not len(own) or not len(other):
        return np.asarray(found, np.int64)
    order = np.argsort(found[:, 0])
    ends = found[order[np.searchsorted(found[order, 0], own[:, :2])], 1]
    group, _ = group_by_nodes(np.vstack([other[:, :2], ends]))
    middle = np.full(int(group.max()) + 1, -1, np.int64)
    middle[group[: len(other)]] = other[:, 2]
    led = np.column_stack([own[:, 2], middle[group[len(other) :]]])
    return np.vstack([found, led[led[:, 1] >= 0]]).astype(np.int64)


def _with_corners(surface: Surface, kept: IntArray) -> IntArray:
    """Leave out the middle nodes of sides whose corners are not kept: their pair holds these too."""
    has = np.zeros(len(surface.nodes), dtype=bool)
    has[kept] = True
    middles = middles_of(surface.facets)
    has[middles[~has[middles[:, 1:]].all(axis=1), 0]] = False
    return kept[has[kept]]


def _middles(surface: Surface, kept: IntArray) -> IntArray:
    """Give the positions, among the kept nodes, of middle nodes and their corners."""
    position = np.full(len(surface.nodes), -1, np.int64)
    position[kept] = np.arange(len(kept))
    found = position[middles_of(surface.facets)]
    return found[found[:, 0] >= 0]


def with_surface(pairs: ContactPairs, points: FloatArray, slave: Sequence[Block], axisymmetric: bool) -> ContactPairs:
    """Add areas, sizes and the corners of quadratic facets to pairs that have none.

    Parameters
    ----------
    pairs : ContactPairs
        Of one zone.
    points : (n_points, d) float64, length
    slave : sequence of (shape name, (m, n_nodes) int64)
    axisymmetric : bool

    Returns
    -------
    ContactPairs
        Without the middles of sides whose corners have no pair; gaps are those of the pairs.
    """
    surface = surface_of(points, slave, split=False)
    place = np.searchsorted(surface.nodes, pairs.pairs[:, 0])
    kept = np.flatnonzero(np.isin(place, _with_corners(surface, place)))
    place = place[kept]
    found = replace(
        pairs.only(kept),
        unpaired_slave=np.setdiff1d(surface.nodes, np.union1d(surface.nodes[place], middles_on_linear(slave)[:, 2])),
        middles=_middles(surface, place),
        area=integrals(points, surface, axisymmetric)[place],
        size=surface.size[place],
    )
    return replace(found, gap=found.on_pairs(found.gap))
