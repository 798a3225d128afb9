"""What is seen of a mesh: the facets of its surface, with the part beyond a plane taken away or each cell shrunk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.plot.camera import FloatArray, in_space
from gibiane_ops.kernels.plot.layers import beyond
from gibiane_ops.kernels.plot.raster import BoolArray, IntArray
from gibiane_ops.kernels.topology import Block, boundary, faces_of


@dataclass(frozen=True, eq=False)
class Skin:
    """Facets to draw.

    Attributes
    ----------
    points : (n, dim) float64, length
    facets : list of (k, 3) or (k, 4) int64
        Nodes of triangles and quadrangles, in `points`.
    cell : (n_facets,) int64
        The cell behind each facet, counted through the blocks.
    node : (n,) int64
        The node of the mesh that each point is.
    """

    points: FloatArray
    facets: list[IntArray]
    cell: IntArray
    node: IntArray


def skin(
    points: FloatArray,
    blocks: Sequence[Block],
    *,
    plane: tuple[FloatArray, FloatArray] | None = None,
    shrink: float | None = None,
    keep: BoolArray | None = None,
) -> Skin:
    """Collect the facets that show a mesh.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)
        Cells of dimension 2 are facets themselves, those of dimension 3 show their boundary; others show nothing.
    plane : ((3,), (3,)) float64, optional
        Point and normal: the cells whose centre lies on the side of the normal are left out.
    shrink : float, optional
        Draw every cell on its own, reduced by this factor about its centre.
    keep : (n_cells,) bool, optional
        Cells to draw, through the blocks.

    Returns
    -------
    Skin
    """
    kept = _kept(points, blocks, plane, keep)
    if shrink is not None:
        points, node, kept = _apart(points, kept, shrink)
    else:
        node = np.arange(len(points))
    facets: list[IntArray] = []
    owners: list[IntArray] = []
    volumes = [(name, cells) for name, cells, _ in kept if shape(name).dim == 3]
    numbers = [each for name, _, each in kept if shape(name).dim == 3]
    if volumes:
        found = faces_of(volumes) if shrink is not None else boundary(volumes)
        number = np.concatenate(numbers)
        for name, each in found.items():
            facets.append(each.nodes[:, : shape(name).n_corners])
            owners.append(number[each.cell])
    for name, cells, number in kept:
        if shape(name).dim == 2:
            facets.append(cells[:, : shape(name).n_corners])
            owners.append(number)
    return Skin(points, facets, np.concatenate(owners) if owners else np.zeros(0, np.int64), node)


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
