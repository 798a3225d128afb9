"""Cells and facets cut by a plane: what is left on one side, and the section itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.plot.camera import FloatArray
from gibiane_ops.kernels.plot.raster import IntArray
from gibiane_ops.kernels.topology import Block

Plane = tuple[FloatArray, FloatArray]


@dataclass
class Cutter:
    """A plane, and the points that it makes on the sides of cells.

    Attributes
    ----------
    points : (n, 3) float64, length
    plane : ((3,), (3,)) float64
        A point and the normal; what lies on the side of the normal goes.
    ends : list of (k, 2) int64
        The two points that each new point stands between; new points are numbered from n.
    """

    points: FloatArray
    plane: Plane
    ends: list[IntArray] = field(default_factory=list)
    _numbers: dict[int, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        origin, normal = self.plane
        height = (self.points - origin) @ (normal / np.linalg.norm(normal))
        size = float(np.ptp(self.points, axis=0).max(initial=0.0)) or 1.0
        # a point on the plane goes: a cell that only touches the plane from beyond leaves nothing
        self.height: FloatArray = np.where(np.abs(height) < 1e-9 * size, 1e-9 * size, height)

    def crossing(self, pairs: IntArray) -> IntArray:
        """Return the numbers of the points where sides meet the plane, the same for the same side.

        Parameters
        ----------
        pairs : (k, 2) int64
            Points on either side of the plane.
        """
        low, high = pairs.min(axis=1), pairs.max(axis=1)
        key = low * len(self.points) + high
        unique, first, inverse = np.unique(key, return_index=True, return_inverse=True)
        numbers = np.empty(len(unique), np.int64)
        fresh = []
        for i, k in enumerate(unique.tolist()):
            found = self._numbers.get(k)
            if found is None:
                found = self._numbers[k] = len(self.points) + len(self._numbers)
                fresh.append(first[i])
            numbers[i] = found
        self.ends.append(np.column_stack([low, high])[fresh])
        return numbers[inverse]

    def weights(self) -> tuple[IntArray, IntArray, FloatArray]:
        """Return for every point, old then new, the two points it stands between and the weight of the second."""
        ends = np.concatenate([np.zeros((0, 2), np.int64), *self.ends])
        own = np.arange(len(self.points))
        a, b = np.concatenate([own, ends[:, 0]]), np.concatenate([own, ends[:, 1]])
        ha, hb = self.height[ends[:, 0]], self.height[ends[:, 1]]
        return a, b, np.concatenate([np.zeros(len(own)), ha / (ha - hb)])

    def trim(self, facets: IntArray) -> list[tuple[IntArray, IntArray]]:
        """Cut convex facets, keeping what lies behind the plane.

        Parameters
        ----------
        facets : (m, k) int64

        Returns
        -------
        list of (polygons (p, q) int64, rows (p,) int64)
            By number of corners and by the way they are cut; the facet that each is a part of.
        """
        gone = self.height[facets] > 0.0
        k = facets.shape[1]
        code = gone @ (1 << np.arange(k))
        result = []
        for pattern in np.unique(code).tolist():
            if pattern == (1 << k) - 1:
                continue
            rows = np.flatnonzero(code == pattern)
            f = facets[rows]
            corners = []
            for i in range(k):
                j = (i + 1) % k
                here, there = pattern >> i & 1, pattern >> j & 1
                if not here:
                    corners.append(f[:, i])
                if here != there:
                    corners.append(self.crossing(f[:, [i, j]]))
            result.append((np.column_stack(corners), rows))
        return result

    def section(self, block: Block) -> list[tuple[IntArray, IntArray]]:
        """Find where the plane crosses convex cells of dimension 3.

        Parameters
        ----------
        block : (str, (m, n_nodes) int64)

        Returns
        -------
        list of (polygons (p, q) int64, rows (p,) int64)
            Corners in turn; the cell that each is in.

        Notes
        -----
        The corners are where the edges cross, turned about their mean: right for convex cells.
        """
        name, cells = block
        gone = self.height[cells[:, : shape(name).n_corners]] > 0.0
        rows = np.flatnonzero(gone.any(axis=1) & ~gone.all(axis=1))
        if not len(rows):
            return []
        edges = np.array([edge[:2] for edge in shape(name).edges])
        pairs = cells[rows][:, edges]
        crossed = (self.height[pairs] > 0.0).sum(axis=2) == 1
        number = np.full(crossed.shape, -1, np.int64)
        number[crossed] = self.crossing(pairs[crossed])
        ends = self.weights()
        placed = self.points[ends[0]] + ends[2][:, None] * (self.points[ends[1]] - self.points[ends[0]])
        normal = self.plane[1] / np.linalg.norm(self.plane[1])
        across = np.cross(normal, [1.0, 0.0, 0.0] if abs(normal[0]) < 0.9 else [0.0, 1.0, 0.0])
        result = []
        counts = crossed.sum(axis=1)
        for count in np.unique(counts[counts >= 3]).tolist():
            chosen = np.flatnonzero(counts == count)
            corners = number[chosen][crossed[chosen]].reshape(-1, count)
            from_mean = placed[corners] - placed[corners].mean(axis=1, keepdims=True)
            angle = np.arctan2(from_mean @ np.cross(normal, across), from_mean @ across)
            turned = np.take_along_axis(corners, np.argsort(angle, axis=1), axis=1)
            result.append((turned, rows[chosen]))
        return result


def joined(parts: Sequence[tuple[IntArray, IntArray]]) -> tuple[list[IntArray], IntArray]:
    """Gather polygons by number of corners; return them with what each is a part of, in their order."""
    facets: list[IntArray] = []
    owners: list[IntArray] = []
    for count in sorted({polygons.shape[1] for polygons, _ in parts}):
        same = [(p, o) for p, o in parts if p.shape[1] == count]
        facets.append(np.concatenate([p for p, _ in same]))
        owners.append(np.concatenate([o for _, o in same]))
    return facets, np.concatenate(owners) if owners else np.zeros(0, np.int64)
