"""One degree on the two sides of a contact, so that quadratic facets pair node by node, mid-nodes included."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.elements.table import shape

BoolArray = NDArray[np.bool_]


def contact_facets(name: str, cells: IntArray, pairs: Sequence[IntArray]) -> tuple[IntArray, IntArray]:
    """Find the two elements at each facet of a contact.

    Parameters
    ----------
    name : str
        TRI3, QUA4, TET4 or CUB8.
    cells : (m, n_nodes) int64
    pairs : sequence of (k, 2) int64
        Nodes at the same place on the two sides of each contact.

    Returns
    -------
    beside : (f, 2) int64
        The two elements.
    nodes : (f, c) int64
        Corners of the facet, each pair by its first node.
    """
    of = shape(name)
    faces = np.array([nodes for _, nodes in of.faces])
    own = cells[:, faces].reshape(-1, faces.shape[1])
    merged = merged_nodes(cells, pairs)[own]
    group, first = topology.group_by_nodes(merged)
    other = np.flatnonzero(first[group] != np.arange(len(group)))
    one = first[group[other]]
    # an inner facet has the same nodes on its two sides, a facet of a contact has not
    apart = (np.sort(own[one], axis=1) != np.sort(own[other], axis=1)).any(axis=1)
    one, other = one[apart], other[apart]
    return np.stack([one, other], axis=1) // len(faces), merged[one]


def merged_nodes(cells: IntArray, pairs: Sequence[IntArray]) -> IntArray:
    """Give each node the first node of its pair, (n,) int64; those without a pair keep their number."""
    merged = np.arange(int(cells.max(initial=-1)) + 1)
    for first, second in (pair.T for pair in pairs):
        merged[second] = merged[first]
    return merged


def paired_degrees(
    name: str, cells: IntArray, pairs: Sequence[IntArray], degree: IntArray, may_rise: BoolArray
) -> IntArray:
    """Give the elements at a contact degrees with which their facets pair.

    Parameters
    ----------
    name, cells, pairs
        See `contact_facets`.
    degree : (m,) int64
        1 or 2, as wanted.
    may_rise : (m,) bool
        Elements that can be of degree 2.

    Returns
    -------
    (m,) int64

    Notes
    -----
    An element whose partner at a facet is quadratic becomes so too; where one of the two cannot, both are linear. The
    side of quadratic facets only must not be that of a linear element that touches it from inside: its mid-node would
    follow the corners in one solid, and not pair. Such an element rises, or if it cannot the facets around that side
    become linear.
    """
    beside, nodes = contact_facets(name, cells, pairs)
    able = may_rise.copy()
    if not len(beside) or (degree == 1).all():
        return np.where(able, degree, 1)
    facet = shape(shape(name).faces[0][0])
    merged = merged_nodes(cells, pairs)
    n = np.int64(len(merged))
    sides = _keys(nodes[:, np.array([edge[:2] for edge in facet.edges])], n)
    edges = _keys(merged[cells[:, np.array([edge[:2] for edge in shape(name).edges])]], n)
    while True:
        able = _spread(able, beside, np.minimum)
        found = np.where(able, degree, 1)
        while True:
            before = found
            found = _spread(found, beside, np.maximum)
            if facet.dim < 2:
                return found
            high = found[beside[:, 0]] == 2
            curved = np.setdiff1d(sides[high], sides[~high])
            touching = np.isin(edges, curved).any(axis=1) & (found == 1)
            found = np.where(touching & able, 2, found)
            if (found == before).all():
                break
        stiff = np.isin(sides, edges[touching]).any(axis=1) & high
        if not stiff.any():
            return found
        able[beside[stiff]] = False


def _spread(values: NDArray[Any], beside: IntArray, how: np.ufunc) -> NDArray[Any]:
    """Give the two elements at each facet the lesser or greater of their values, until nothing changes."""
    while True:
        new = values.copy()
        how.at(new, beside, how(values[beside[:, 0]], values[beside[:, 1]])[:, None])
        if (new == values).all():
            return values
        values = new


def _keys(ends: IntArray, n: np.int64) -> IntArray:
    """Give pairs of nodes one number each, (..., 2) to (...)."""
    pair = np.sort(ends, axis=-1)
    return np.asarray(pair[..., 0] * n + pair[..., 1], np.int64)
