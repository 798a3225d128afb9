"""Forces of nodes that several contact zones share, told apart by the forces of their partners."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.pairs import ContactPairs


def forces_by_zone(zones: Sequence[ContactPairs], total: Callable[[IntArray], FloatArray]) -> list[FloatArray]:
    """Find the contact force of each pair on its slave node.

    Parameters
    ----------
    zones : sequence of ContactPairs
    total : callable
        Contact forces of nodes, (k,) int64 to (k, d) float64, force: of all the zones together.

    Returns
    -------
    list of (n, d) float64, force
        By zone. A node of one pair only bears the force of this pair. One of several has that of each partner, turned
        round, where the partner is in no other pair; what is left belongs to the first of its other pairs.
    """
    ends = np.concatenate([zone.pairs for zone in zones])
    plain = np.concatenate([zone.plain for zone in zones])
    slave, master = ends.T
    force = total(slave)
    used, count = np.unique(ends[ends >= 0], return_counts=True)
    sure = count[np.searchsorted(used, slave)] == 1
    if not sure.all():
        alone = (master >= 0) & plain
        alone[alone] = count[np.searchsorted(used, master[alone])] == 1
        told = ~sure & alone
        force[told] = -total(master[told])
        sure |= told
        for node in np.unique(slave[~sure]):
            known = force[sure & (slave == node)].sum(axis=0) - force[sure & plain & (master == node)].sum(axis=0)
            rows = np.flatnonzero(~sure & (slave == node))
            force[rows] = 0.0
            force[rows[0]] = total(np.array([node]))[0] - known
    return np.split(force, np.cumsum([len(zone.pairs) for zone in zones])[:-1])
