"""The mid-nodes of the session: one per edge, so that meshes of second degree that share corners share them too."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.values.nodes import NodeStore, node_store


class Middles:
    """Mid-nodes by edge.

    Attributes
    ----------
    ends : (k, 2) int64
        Ends of the edges, the smaller id first, rows sorted.
    middles : (k,) int64
    """

    def __init__(self, store: NodeStore) -> None:
        self.store = store
        self._version = store.version
        self._ends = np.zeros((0, 2), np.int64)
        self._middles = np.zeros(0, np.int64)

    @property
    def ends(self) -> IntArray:
        """Ends of the edges, after merges of nodes."""
        self._refresh()
        return self._ends

    @property
    def middles(self) -> IntArray:
        """Mid-nodes of the edges, after merges of nodes."""
        self._refresh()
        return self._middles

    def _refresh(self) -> None:
        if self._version != self.store.version:
            self._version = self.store.version
            self._keep(self.store.canonical(self._ends), self.store.canonical(self._middles))

    def _keep(self, ends: IntArray, middles: IntArray) -> None:
        """Store edges sorted; of two mid-nodes of one edge the first known stays."""
        self._ends, first = np.unique(np.sort(ends, axis=1), axis=0, return_index=True)
        self._middles = middles[first]

    def record(self, ends: IntArray, middles: IntArray) -> None:
        """Say which nodes stand in the middle of edges, for instance on a curve.

        Parameters
        ----------
        ends : (k, 2) int64
        middles : (k,) int64
        """
        self._keep(np.concatenate([self.ends, ends]), np.concatenate([self.middles, middles]))

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
        wanted, place = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
        every = np.concatenate([self.ends, wanted])
        _, row, inverse = np.unique(every, axis=0, return_index=True, return_inverse=True)
        known = row[inverse[len(self.ends) :]]
        result = np.full(len(wanted), -1, np.int64)
        old = known < len(self.ends)
        result[old] = self.middles[known[old]]
        new = wanted[~old]
        x: FloatArray = self.store.coords[new].mean(axis=1)
        result[~old] = self.store.add(x, self.store.density[new].mean(axis=1))
        self.record(new, result[~old])
        return result[place.ravel()]


def middles_of(owner: Any) -> Middles:
    """Return the mid-nodes of a session (or of the session of a context)."""
    state: dict[str, Any] = owner.state
    found: Middles | None = state.get("middles")
    if found is None:
        found = state["middles"] = Middles(node_store(owner))
    return found
