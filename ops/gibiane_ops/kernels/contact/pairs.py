"""Pairs of two contact surfaces, node to node or interpolated: relative displacements, normals and initial gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.facets import SHIFT

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

    @property
    def coincident(self) -> bool:
        """Whether the nodes of the two surfaces lie together, or those of one before an obstacle."""
        return not len(self.row)

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
