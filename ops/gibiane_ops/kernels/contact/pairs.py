"""Pairs of two contact surfaces, node to node or interpolated: relative displacements, normals and initial gaps."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.facets import SHIFT, Surface, integrals, middles_of, surface_of
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue, EmptyContact
from gibiane_ops.kernels.geometry import normal_densities
from gibiane_ops.kernels.topology import Block, group_by_nodes

ROUND_OFF = 1e-9
"""Distances below this fraction of the size of the surfaces are zero."""

FACING = -0.5
"""Cosine of the normals of a pair above which the surfaces do not face each other."""

DEEP = 1e-6
"""Overlaps below this fraction of the size of the facets are no penetration."""


def _no_nodes() -> IntArray:
    return np.zeros(0, np.int64)


def _no_values() -> FloatArray:
    return np.zeros(0)


def _no_middles() -> IntArray:
    return np.zeros((0, 3), np.int64)


@dataclass(frozen=True, eq=False)
class ContactPairs:
    """Pairs of one or several contact zones: a slave node, and what lies in front of it on the master.

    The relative displacement of pair p is ``w_p = u_s - sum_j c_pj u_j``: s is its slave node, c_pj is 1 for the master
    node of a plain pair, an entry of (`row`, `node`, `coefficient`) otherwise, with its sign turned. For the middle m
    of a side of a quadratic facet, between the corners a and b, ``w_m~ = (w_m - (w_a + w_b) / 5) / (3 / 5)`` in place
    of w_m: forces on this basis have the sign of the pressure, those on plain corners have not.

    Attributes
    ----------
    pairs : (n, 2) int64
        Slave node (body 1) and master node (body 2); -1 where no single node faces the slave node: inside a facet, or
        before a rigid obstacle, which has no unknowns.
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
        Positions of those whose surfaces overlap.
    row, node : (k,) int64
    coefficient : (k,) float64
        Displacements of nodes that w counts beside those of `pairs` and of the slave's corners, minus the master's.
    middles : (k, 3) int64
        Positions of the pairs of middle nodes, and of those of their two corners.
    area, size : (n,) float64, area, length
        Share of the slave surface, and extent of its facets; empty when unknown.
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
    row: IntArray = field(default_factory=_no_nodes)
    node: IntArray = field(default_factory=_no_nodes)
    coefficient: FloatArray = field(default_factory=_no_values)
    middles: IntArray = field(default_factory=_no_middles)
    area: FloatArray = field(default_factory=_no_values)
    size: FloatArray = field(default_factory=_no_values)

    @staticmethod
    def interpolated(
        points: FloatArray,
        slave: IntArray,
        master: tuple[IntArray, IntArray, FloatArray],
        middles: IntArray,
        *,
        normals: FloatArray,
        gap: FloatArray,
        area: FloatArray,
        size: FloatArray,
        unpaired_slave: IntArray,
        unpaired_master: IntArray,
        penetrating: IntArray,
        not_facing: IntArray | None = None,
    ) -> ContactPairs:
        """Make pairs of one zone whose masters are points inside facets; entries of the same node are added up."""
        n = len(slave)
        entries = sp.coo_array((master[2], (master[0], master[1])), shape=(n, len(points)))
        entries.sum_duplicates()
        size_of = np.abs(entries.data)
        used = size_of > 1e-14
        row, node = entries.coords
        return ContactPairs(
            np.column_stack([slave, np.full(n, -1)]), normals, gap, points[slave].reshape(n, -1),
            np.zeros(n, np.int64), unpaired_slave, unpaired_master,
            _no_nodes() if not_facing is None else not_facing, penetrating,
            row[used].astype(np.int64), node[used].astype(np.int64), entries.data[used], middles, area, size,
        )  # fmt: skip

    @property
    def plain(self) -> NDArray[np.bool_]:
        """Pairs of two nodes, or of a node and an obstacle, without any other displacement: (n,) bool."""
        plain = np.ones(len(self.pairs), dtype=bool)
        plain[self.row] = False
        plain[self.middles[:, 0]] = False
        return plain

    def matrix(self, n_nodes: int) -> sp.csr_array:
        """Give the relative displacements from those of the nodes, one component: ``w = matrix @ u``.

        Parameters
        ----------
        n_nodes : int

        Returns
        -------
        (n, n_nodes) csr_array
        """
        n = len(self.pairs)
        solid = np.flatnonzero(self.pairs[:, 1] >= 0)
        row = np.concatenate([np.arange(n), solid, self.row])
        node = np.concatenate([self.pairs[:, 0], self.pairs[solid, 1], self.node])
        value = np.concatenate([np.ones(n), -np.ones(len(solid)), self.coefficient])
        matrix = sp.csr_array((value, (row, node)), shape=(n, n_nodes))
        if len(self.middles):
            # entries of interpolated middles are of the changed basis already, their slave nodes are not
            inner = sp.csr_array((self.coefficient, (self.row, self.node)), shape=(n, n_nodes))
            return sp.csr_array(self._basis() @ (matrix - inner) + inner)
        return matrix

    def _basis(self) -> sp.csr_array:
        """Give the values of pairs from those at their nodes."""
        n = len(self.pairs)
        m, a, b = self.middles.T
        diagonal = np.ones(n)
        diagonal[m] = 1 / (1 - 2 * SHIFT)
        row = np.concatenate([np.arange(n), m, m])
        column = np.concatenate([np.arange(n), a, b])
        side = np.full(len(m), -SHIFT / (1 - 2 * SHIFT))
        return sp.csr_array((np.concatenate([diagonal, side, side]), (row, column)), shape=(n, n))

    def only(self, kept: IntArray) -> ContactPairs:
        """Keep some pairs; a middle must keep its corners."""
        new = np.full(len(self.pairs), -1, np.int64)
        new[kept] = np.arange(len(kept))
        used = new[self.row] >= 0
        away, deep = (place[place >= 0] for place in (new[self.not_facing], new[self.penetrating]))
        area, size = (values[kept] if len(values) else values for values in (self.area, self.size))
        return ContactPairs(
            self.pairs[kept], self.normals[kept], self.gap[kept], self.points[kept], self.zone[kept],
            self.unpaired_slave, self.unpaired_master, away, deep,
            new[self.row[used]], self.node[used], self.coefficient[used],
            new[self.middles[new[self.middles[:, 0]] >= 0]], area, size,
        )  # fmt: skip

    def on_changed_basis(self) -> ContactPairs:
        """Take entries and gaps that were written for plain nodes to the changed basis of quadratic facets."""
        if not len(self.middles):
            return self
        n = len(self.pairs)
        columns, place = np.unique(self.node, return_inverse=True)
        entries = sp.csr_array((self.coefficient, (self.row, place)), shape=(n, len(columns)))
        changed = sp.coo_array(self._basis() @ entries)
        row, column = changed.coords
        return replace(
            self,
            gap=self.on_pairs(self.gap),
            row=row.astype(np.int64),
            node=columns[column],
            coefficient=changed.data,
        )

    def on_pairs(self, nodal: FloatArray) -> FloatArray:
        """Turn values at the slave nodes, such as displacements and gaps, (n, ...), into those of the pairs."""
        return np.asarray(self._basis() @ nodal) if len(self.middles) else nodal

    def at_nodes(self, values: FloatArray) -> FloatArray:
        """Turn displacements and gaps of the pairs, (n, ...), into those at their slave nodes."""
        found = values.copy()
        m, a, b = self.middles.T
        found[m] = (1 - 2 * SHIFT) * values[m] + SHIFT * (values[a] + values[b])
        return found

    def forces_on_pairs(self, nodal: FloatArray) -> FloatArray:
        """Turn forces on the slave nodes, (n, ...), into those of the pairs."""
        found = nodal.copy()
        m, a, b = self.middles.T
        found[m] = (1 - 2 * SHIFT) * nodal[m]
        np.add.at(found, np.concatenate([a, b]), SHIFT * np.concatenate([nodal[m], nodal[m]]))
        return found


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
        np.delete(slave_nodes, kept),
        np.delete(master_nodes, partner),
        np.flatnonzero(cosine > FACING),
        np.flatnonzero(gap < 0),
        middles=_middles(surface, kept),
        area=integrals(points, surface, axisymmetric)[kept],
        size=surface.size[kept],
    )


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
        unpaired_slave=np.setdiff1d(surface.nodes, surface.nodes[place]),
        middles=_middles(surface, place),
        area=integrals(points, surface, axisymmetric)[place],
        size=surface.size[place],
    )
    return replace(found, gap=found.on_pairs(found.gap))


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
        np.concatenate([zone.row + start for zone, start in zip(zones, starts, strict=False)]),
        np.concatenate([zone.node for zone in zones]),
        np.concatenate([zone.coefficient for zone in zones]),
        np.concatenate([zone.middles + start for zone, start in zip(zones, starts, strict=False)]),
        np.concatenate([_filled(zone.area, len(zone.pairs)) for zone in zones]),
        np.concatenate([_filled(zone.size, len(zone.pairs)) for zone in zones]),
    )


def _filled(values: FloatArray, n: int) -> FloatArray:
    return values if len(values) == n else np.full(n, np.nan)


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
        if _same_facets(skin[:, :n_corners], cells[:, :n_corners]):
            turned.append((name, skin))
            continue
        group, first = group_by_nodes(np.concatenate([skin, cells])[:, :n_corners])
        match = first[group[len(skin) :]]
        # A facet between two cells is not on the boundary.
        shared = np.bincount(group[: len(skin)], minlength=len(first))[group[len(skin) :]] > 1
        lost = int(((match >= len(skin)) | shared).sum())
        if lost:
            raise EmptyContact(f"{lost} facets of the surface are not on the boundary of the body")
        turned.append((name, skin[match]))
    return turned


def _same_facets(a: IntArray, b: IntArray) -> bool:
    """Tell whether two lists hold the same facets in the same order, each once: the usual case, and a quick one."""
    if len(a) != len(b):
        return False
    for column in b.T:
        if not functools.reduce(np.logical_or, [column == other for other in a.T]).all():
            return False
    mixed = (a.astype(np.uint64) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(31))) * np.uint64(0xBF58476D1CE4E5B9)
    return _distinct(functools.reduce(np.add, mixed.T))


def _distinct(key: NDArray[np.uint64]) -> bool:
    """Tell whether well mixed keys differ from each other; only those that share a slot of a table are sorted."""
    bits = (8 * len(key)).bit_length()
    slot = (key >> np.uint64(64 - bits)).astype(np.int64)
    last = np.empty(1 << bits, np.int32)
    number = np.arange(len(key), dtype=np.int32)
    last[slot] = number
    winner = last[slot]
    shared = winner != number
    shared[winner[shared]] = True
    doubtful = np.sort(key[shared])
    return bool((doubtful[1:] != doubtful[:-1]).all())


def _facets_on(body: Sequence[Block], name: str, marked: NDArray[np.bool_]) -> IntArray:
    """Return the facets of one shape, turned outwards, of the cells of a body, whose corners are all marked."""
    found = [np.zeros((0, shape(name).n_nodes), np.int64)]
    corners = shape(name).n_corners
    for of, cells in body:
        faces = [local for facet, local in shape(of).faces if facet == name]
        on_surface = np.ascontiguousarray(marked[cells[:, : shape(of).n_corners]].T)
        for local in faces:
            on = functools.reduce(np.logical_and, [on_surface[i] for i in local[:corners]])
            rows = np.flatnonzero(on)
            if len(rows):
                found.append((cells if len(rows) == len(cells) else cells[rows])[:, list(local)])
    return np.concatenate(found)
