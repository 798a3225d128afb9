"""What is seen of a mesh: the facets of its surface, with the part beyond a plane taken away or each cell shrunk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.plot.camera import FloatArray, in_space
from gibiane_ops.kernels.plot.cut import Cutter, Plane, joined
from gibiane_ops.kernels.plot.layers import beyond
from gibiane_ops.kernels.plot.raster import BoolArray, IntArray
from gibiane_ops.kernels.topology import Block, boundary, faces_of


@dataclass(frozen=True, eq=False)
class Skin:
    """Facets to draw.

    Attributes
    ----------
    points : (n, dim) float64, length
    facets : list of (k, m) int64
        Corners of triangles, quadrangles and, where a plane cuts, of polygons of more corners, in `points`.
    cell : (n_facets,) int64
        The cell behind each facet, counted through the blocks.
    node : (n,) int64
        The node of the mesh that each point is, or the first of the two that it stands between.
    mate, weight : (n,) int64, (n,) float64, optional
        The second of the two, and its weight, when a plane has cut the mesh.
    """

    points: FloatArray
    facets: list[IntArray]
    cell: IntArray
    node: IntArray
    mate: IntArray | None = None
    weight: FloatArray | None = None

    def carry(self, nodal: FloatArray) -> FloatArray:
        """Return values at the points from values (n_nodes, ...) at the nodes of the mesh."""
        if self.mate is None or self.weight is None:
            return np.asarray(nodal[self.node])
        values: FloatArray = nodal[self.node].copy()
        between = np.flatnonzero(self.weight > 0.0)
        w = self.weight[between].reshape(-1, *[1] * (nodal.ndim - 1))
        values[between] += w * (nodal[self.mate[between]] - values[between])
        return values


def skin(
    points: FloatArray,
    blocks: Sequence[Block],
    *,
    plane: tuple[FloatArray, FloatArray] | None = None,
    shrink: float | None = None,
    keep: BoolArray | None = None,
    section: bool = False,
) -> Skin:
    """Collect the facets that show a mesh.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)
        Cells of dimension 2 are facets themselves, those of dimension 3 show their boundary; others show nothing.
    plane : ((3,), (3,)) float64, optional
        Point and normal: what lies on the side of the normal is cut away, and the section is closed. Reduced cells
        are not cut: those whose centre lies there are left out.
    shrink : float, optional
        Draw every cell on its own, reduced by this factor about its centre.
    keep : (n_cells,) bool, optional
        Cells to draw, through the blocks.
    section : bool
        Show the section of the solids by the plane, and nothing else.

    Returns
    -------
    Skin
    """
    kept = _kept(points, blocks, None if shrink is None else plane, keep)
    if shrink is not None:
        points, node, kept = _apart(points, kept, shrink)
    else:
        node = np.arange(len(points))
    shown: list[tuple[IntArray, IntArray]] = []
    volumes = [(name, cells) for name, cells, _ in kept if shape(name).dim == 3]
    numbers = [each for name, _, each in kept if shape(name).dim == 3]
    if volumes and not section:
        found = faces_of(volumes) if shrink is not None else boundary(volumes)
        number = np.concatenate(numbers)
        shown = [(each.nodes[:, : shape(name).n_corners], number[each.cell]) for name, each in found.items()]
    if not section:
        shown += [(cells[:, : shape(n).n_corners], number) for n, cells, number in kept if shape(n).dim == 2]
    if plane is None or shrink is not None or points.shape[1] != 3:
        owners = [owner for _, owner in shown]
        return Skin(points, [f for f, _ in shown], np.concatenate(owners) if owners else np.zeros(0, np.int64), node)
    return _cut(points, plane, shown, list(zip(volumes, numbers, strict=True)))


def _cut(
    points: FloatArray,
    plane: Plane,
    shown: list[tuple[IntArray, IntArray]],
    volumes: list[tuple[Block, IntArray]],
) -> Skin:
    """Cut facets by a plane and close them by the section of the volumes."""
    cutter = Cutter(points, plane)
    parts = [(polygons, owner[rows]) for f, owner in shown for polygons, rows in cutter.trim(f)]
    parts += [(polygons, number[rows]) for block, number in volumes for polygons, rows in cutter.section(block)]
    facets, owner = joined(parts)
    a, b, weight = cutter.weights()
    placed = points[a] + weight[:, None] * (points[b] - points[a])
    return Skin(placed, facets, owner, a, b, weight)


def _kept(
    points: FloatArray, blocks: Sequence[Block], plane: tuple[FloatArray, FloatArray] | None, keep: BoolArray | None
) -> list[tuple[str, IntArray, IntArray]]:
    """Return the blocks with the cells that are drawn, and the numbers of these."""
    result = []
    start = 0
    space = in_space(points)
    for name, cells in blocks:
        number = np.arange(start, start + len(cells))
        start += len(cells)
        chosen = np.ones(len(cells), bool) if keep is None else keep[number]
        if plane is not None:
            chosen = chosen & ~beyond(space, cells, *plane)
        if chosen.any():
            result.append((name, cells[chosen], number[chosen]))
    return result


def _apart(
    points: FloatArray, blocks: list[tuple[str, IntArray, IntArray]], shrink: float
) -> tuple[FloatArray, IntArray, list[tuple[str, IntArray, IntArray]]]:
    """Give each cell its own points, moved towards its centre."""
    moved, nodes, result = [np.zeros((0, points.shape[1]))], [np.zeros(0, np.int64)], []
    start = 0
    for name, cells, number in blocks:
        corners = points[cells]
        centre = corners.mean(axis=1, keepdims=True)
        moved.append((centre + shrink * (corners - centre)).reshape(-1, points.shape[1]))
        nodes.append(cells.ravel())
        result.append((name, np.arange(start, start + cells.size).reshape(cells.shape), number))
        start += cells.size
    return np.concatenate(moved), np.concatenate(nodes), result
