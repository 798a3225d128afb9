"""The nodes of a session: coordinates, densities, and which nodes ELIM has merged."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class NodeStore:
    """Growing arrays of nodes shared by every mesh and field of a session.

    A node is an id, from 0. Merged nodes keep their ids: `canonical` gives the one that stands for them, and
    `version` changes whenever meshes and fields must renumber themselves.
    """

    def __init__(self) -> None:
        self._coords = np.zeros((64, 3))
        self._density = np.zeros(64)
        self._alias = np.arange(64)
        self.count = 0
        self.version = 0

    @property
    def coords(self) -> FloatArray:
        """Coordinates, (count, 3), length; the third is zero in the plane. Writing moves the nodes."""
        return self._coords[: self.count]

    @property
    def density(self) -> FloatArray:
        """Densities (wanted element sizes), (count,), length."""
        return self._density[: self.count]

    def add(self, points: Any, density: Any = 0.0) -> IntArray:
        """Add nodes; return their ids.

        Parameters
        ----------
        points : (k, 1..3) array, length
        density : scalar or (k,) array, length
        """
        points = np.atleast_2d(np.asarray(points, np.float64))
        k = len(points)
        need = self.count + k
        if need > len(self._coords):
            size = max(need, 2 * len(self._coords))
            self._coords = np.vstack([self.coords, np.zeros((size - self.count, 3))])
            self._density = np.concatenate([self.density, np.zeros(size - self.count)])
            self._alias = np.concatenate([self._alias[: self.count], np.arange(self.count, size)])
        ids = np.arange(self.count, need)
        self._coords[ids] = 0.0
        self._coords[ids, : points.shape[1]] = points
        self._density[ids] = density
        self.count = need
        return ids

    def canonical(self, ids: Any) -> IntArray:
        """Return the ids that stand for `ids` after all merges."""
        return self._alias[np.asarray(ids, np.int64)]

    def merge(self, kept: IntArray, dropped: IntArray) -> None:
        """Make each node `kept[i]` and `dropped[i]` one: the one of smaller id stands for both from now on."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        kept, dropped = self.canonical(kept), self.canonical(dropped)
        links = coo_array((np.ones(len(kept), bool), (kept, dropped)), shape=(self.count, self.count))
        count, group = connected_components(links, directed=False)
        # Of each group of linked nodes the first stands for all: the last one written.
        first = np.empty(count, np.int64)
        first[group[::-1]] = np.arange(self.count - 1, -1, -1)
        self._alias[: self.count] = first[group][self._alias[: self.count]]
        self.version += 1


def node_store(owner: Any) -> NodeStore:
    """Return the nodes of a session (or of the session of a context)."""
    found: NodeStore = owner.state.setdefault("nodes", NodeStore())
    return found
