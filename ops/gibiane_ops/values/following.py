"""Contact pairs of middles that conditions tie to the corners of their side: they follow these, and are no pairs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.kernels.topology import group_by_nodes
from gibiane_ops.values.nodes import IntArray, NodeStore
from gibiane_ops.values.rigidite import ContactPart

EXACT = 1e-9
"""Largest difference of the coefficients of a tie from 1 and minus a half."""


def without_followers(
    store: NodeStore, nodes: IntArray, dim: int, C: sp.csr_array, contacts: Sequence[ContactPart]
) -> tuple[list[ContactPart], IntArray]:
    """Leave out the pairs whose relative displacement is the mean of those at the ends of their side.

    RELA ties the middle of a side that a linear element shares to its ends. Where such a side belongs to quadratic
    facets of a contact, on both surfaces or before an obstacle, the pair of the middle would repeat theirs. What its
    share of the surface bears goes to the ends, half and half.

    Parameters
    ----------
    store : NodeStore
    nodes : (n,) int64, sorted
        Nodes of the session that have unknowns.
    dim : int
        Unknowns of a node.
    C : (m, n dim) csr_array
        Conditions.
    contacts : list of ContactPart

    Returns
    -------
    contacts : list of ContactPart
    multipliers : (k,) int64
        The multiplier nodes of the pairs left out.
    """
    if not any(len(part.pairs.middles) for part in contacts):
        return list(contacts), np.zeros(0, np.int64)
    tied = nodes[_tied_triples(C, dim)]
    found, out = [], [np.zeros(0, np.int64)]
    for part in contacts:
        pairs = part.pairs
        slave = _are_in(store.canonical(pairs.pairs[pairs.middles, 0]), tied)
        other = pairs.pairs[pairs.middles, 1]
        master = _are_in(store.canonical(np.maximum(other, 0)), tied) | (other < 0).all(axis=1)
        middle = pairs.middles[slave & master & ~np.isin(pairs.middles[:, 0], pairs.row)]
        if not len(middle):
            found.append(part)
            continue
        kept = np.setdiff1d(np.arange(len(pairs.pairs)), middle[:, 0])
        law = part.law.shared(middle, kept)
        found.append(ContactPart(part.zone, pairs.only(kept), law, part.multipliers[kept], part.vectors[kept]))
        out.append(part.multipliers[middle[:, 0]])
    return found, np.concatenate(out)


def _tied_triples(C: sp.csr_array, dim: int) -> IntArray:
    """Return the nodes, a middle and two ends, all of whose unknowns are tied ``u_m = (u_a + u_b) / 2``, (k, 3)."""
    first = C.indptr[:-1][np.diff(C.indptr) == 3]
    place = first[:, None] + np.arange(3)
    column, value = C.indices[place].astype(np.int64), np.asarray(C.data[place], np.float64)
    order = np.argsort(-np.abs(value), axis=1, kind="stable")
    column, value = np.take_along_axis(column, order, axis=1), np.take_along_axis(value, order, axis=1)
    means = (np.abs(value[:, 1:] / value[:, :1] + 0.5) < EXACT).all(axis=1)
    alike = (column % dim == column[:, :1] % dim).all(axis=1)
    node = np.sort(column[means & alike] // dim, axis=1)
    triples, count = np.unique(node, axis=0, return_counts=True)
    return np.asarray(triples[count == dim], np.int64)


def _are_in(triples: IntArray, tied: IntArray) -> NDArray[np.bool_]:
    """Tell which triples of nodes, (n, 3), are among others, in any order: (n,) bool."""
    group, _ = group_by_nodes(np.vstack([triples, tied]))
    return np.isin(group[: len(triples)], group[len(triples) :])


def carried(pairs: ContactPairs, nodes: IntArray) -> ContactPairs:
    """Leave out the middles that carry no force in a field on some nodes, while the ends of their side do."""
    known = np.isin(pairs.pairs[:, 0], nodes)
    m, a, b = pairs.middles.T
    following = m[~known[m] & known[a] & known[b]]
    return pairs.only(np.setdiff1d(np.arange(len(pairs.pairs)), following)) if len(following) else pairs
