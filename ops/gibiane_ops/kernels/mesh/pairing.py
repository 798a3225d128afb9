"""Nodes at one place on the two sides of a contact, counted as one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import BadValue

PAIR_TOLERANCE = 1e-7
"""Largest distance of the two nodes of a pair, as a share of the size of the mesh."""


def merged_nodes(
    points: FloatArray, solid: IntArray, groups: Mapping[str, IntArray], pairs: Sequence[tuple[str, str]]
) -> tuple[IntArray, list[tuple[int, int]]]:
    """Give the nodes of the first face of each contact the numbers of those of the second.

    Parameters
    ----------
    points : (n, dim) float64, length
    solid : (n,) int64
        Solid of each node.
    groups : dict of str to (k, c) int64
        Facets have c = dim nodes on simplices, 2^(dim - 1) on quadrangles and hexahedra.
    pairs : sequence of (str, str)
        Names of the two faces of each contact.

    Returns
    -------
    merged : (n,) int64
        Number of each node once the contacts are closed.
    owners : list of (int, int)
        Solids of the first and of the second face.

    Raises
    ------
    BadValue
        A name that is no group of facets, nodes that do not lie at the same places, facets cut along other diagonals,
        one solid on both sides.
    """
    from scipy.spatial import cKDTree

    merged = np.arange(len(points))
    owners = []
    for first, second in pairs:
        for name in (first, second):
            if name not in groups or groups[name].shape[1] < points.shape[1]:
                raise BadValue("pair", name, "the name of a group of facets")
        a, b = np.unique(groups[first]), np.unique(groups[second])
        distance, nearest = cKDTree(points[b]).query(points[a])
        limit = PAIR_TOLERANCE * float(np.ptp(points, axis=0).max())
        if len(a) != len(b) or len(np.unique(nearest)) != len(a) or distance.max() > limit:
            raise BadValue(
                f"contact of {first} and {second}", float(distance.max()), "two faces with nodes at the same places"
            )
        partner = np.full(len(points), -1, np.int64)
        partner[a] = b[nearest]
        number, once = topology.group_by_nodes(np.vstack([groups[second], partner[groups[first]]]))
        alone = len(once) - len(np.unique(number[: len(groups[second])]))
        if len(groups[first]) != len(groups[second]) or alone:
            told = f"{max(alone, 1)} facets without partner"
            raise BadValue(f"contact of {first} and {second}", told, "two faces cut alike, along the same diagonals")
        owner = np.unique(solid[a])
        if len(owner) != 1 or owner[0] in solid[b]:
            raise BadValue(
                f"contact of {first} and {second}", "one solid on both sides", "faces of two different solids"
            )
        merged[a] = merged[b[nearest]]
        owners.append((int(owner[0]), int(solid[b[0]])))
    while (merged[merged] != merged).any():  # a node in several contacts
        merged = merged[merged]
    return merged, owners
