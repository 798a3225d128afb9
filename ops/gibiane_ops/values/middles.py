"""The mid-nodes of the session: one per edge, so that meshes of second degree that share corners share them too."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.values.nodes import NodeStore, node_store

BoolArray = NDArray[np.bool_]


def _keys(ends: IntArray) -> IntArray:
    """Return one number per edge, the same from both ends; they sort as the pairs of sorted ends do."""
    return np.asarray(ends.min(axis=1) << 32 | ends.max(axis=1), np.int64)


class Middles:
    """Mid-nodes by edge: a sorted array of edges, and the node in the middle of each."""

    def __init__(self, store: NodeStore) -> None:
        self.store = store
        self._version = store.version
        self._edges = np.zeros(0, np.int64)
        self._middles = np.zeros(0, np.int64)

    def _refresh(self) -> None:
        """Follow merges of nodes; of two mid-nodes that an edge then has, the first made stays."""
        if self._version == self.store.version:
            return
        self._version = self.store.version
        ends = self.store.canonical(np.stack([self._edges >> 32, self._edges & 0xFFFFFFFF], axis=1))
        middles = self.store.canonical(self._middles)
        order = np.lexsort((middles, _keys(ends)))
        order = order[ends[order, 0] != ends[order, 1]]
        self._edges, first = np.unique(_keys(ends[order]), return_index=True)
        self._middles = middles[order[first]]

    def record(self, ends: IntArray, middles: IntArray) -> None:
        """Say which nodes stand in the middle of edges, for instance on a curve, whatever stood there before.

        Parameters
        ----------
        ends : (k, 2) int64
            An edge whose ends are one node is left out; of repeated ones the last counts.
        middles : (k,) int64
        """
        self._refresh()
        real = ends[:, 0] != ends[:, 1]
        edges, last = np.unique(_keys(ends[real])[::-1], return_index=True)
        if not len(edges):
            return
        fresh = middles[real][::-1][last]
        place = np.searchsorted(edges, self._edges)
        stay = edges[np.minimum(place, len(edges) - 1)] != self._edges
        every = np.concatenate([self._edges[stay], edges])
        order = np.argsort(every, kind="stable")
        self._edges = every[order]
        self._middles = np.concatenate([self._middles[stay], fresh])[order]

    def known(self, ends: IntArray) -> BoolArray:
        """Tell which edges, (k, 2), have a mid-node already."""
        self._refresh()
        return self._find(_keys(ends))[1]

    def _find(self, edges: IntArray) -> tuple[IntArray, BoolArray]:
        if not len(self._edges):
            return np.zeros(len(edges), np.int64), np.zeros(len(edges), bool)
        place = np.minimum(np.searchsorted(self._edges, edges), len(self._edges) - 1)
        return place, self._edges[place] == edges

    def of(self, ends: IntArray) -> IntArray:
        """Return the mid-nodes of edges, made at their middle when there are none yet.

        Parameters
        ----------
        ends : (k, 2) int64
            In any order; the same edge may come several times.

        Returns
        -------
        (k,) int64
        """
        self._refresh()
        wanted, inverse = np.unique(_keys(ends), return_inverse=True)
        place, old = self._find(wanted)
        result = np.empty(len(wanted), np.int64)
        if old.any():
            result[old] = self._middles[place[old]]
        new = np.stack([wanted[~old] >> 32, wanted[~old] & 0xFFFFFFFF], axis=1)
        result[~old] = self.add(new, self.store.coords[new].mean(axis=1))
        return result[inverse.ravel()]

    def add(self, ends: IntArray, places: FloatArray) -> IntArray:
        """Make new mid-nodes of edges at given places.

        Parameters
        ----------
        ends : (k, 2) int64
            Each edge once.
        places : (k, 3) float64, length

        Returns
        -------
        (k,) int64
        """
        if not len(ends):
            return np.zeros(0, np.int64)
        nodes = self.store.add(places, self.store.density[ends].mean(axis=1))
        self.record(ends, nodes)
        return nodes


def middles_of(owner: Any) -> Middles:
    """Return the mid-nodes of a session (or of the session of a context)."""
    state: dict[str, Any] = owner.state
    found: Middles | None = state.get("middles")
    if found is None:
        found = state["middles"] = Middles(node_store(owner))
    return found
