"""Sides and vertex stars of a mesh of triangles or tetrahedra, as equilibrated stresses need them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.topology import group_by_nodes


@dataclass(frozen=True, eq=False)
class Simplices:
    """A mesh whose cells have their nodes in increasing order, so that both cells of a side list its nodes alike.

    Attributes
    ----------
    points : (n, d) float64, length
    cells : (m, d + 1) int64
        Nodes, increasing in each cell; side k faces node k.
    side : (m, d + 1) int64
        Sides of each cell.
    sign : (m, d + 1) float64
        1 for the first cell of a side, -1 for the second.
    nodes : (n_sides, d) int64
        Nodes of each side, increasing.
    cell, local : (n_sides, 2) int64
        Cells of each side, the first one first, and which of their sides it is; -1 past the boundary.
    map : (m, d, d) float64, length
        Matrix of the map of the reference simplex.
    volume : (m,) float64
    outward : (m, d + 1, d) float64
        Outward normals times the measures of the sides.
    star : (m, d + 1) int64
        Number of the star of each corner: the cells around a node that are linked by sides.
    n_stars : int
    """

    points: FloatArray
    cells: IntArray
    side: IntArray
    sign: FloatArray
    nodes: IntArray
    cell: IntArray
    local: IntArray
    map: FloatArray
    volume: FloatArray
    outward: FloatArray
    star: IntArray
    n_stars: int

    @property
    def dim(self) -> int:
        """Dimension of the space."""
        return int(self.points.shape[1])

    @property
    def boundary(self) -> IntArray:
        """Sides of one cell only."""
        return np.flatnonzero(self.cell[:, 1] < 0)


def others(dim: int) -> IntArray:
    """Return the corners of each side of a simplex, (dim + 1, dim), increasing."""
    return np.array([[c for c in range(dim + 1) if c != k] for k in range(dim + 1)])


def slots(dim: int) -> IntArray:
    """Return the place of each corner in each side of a simplex, (dim + 1 sides, dim + 1 corners); -1 when absent."""
    place = np.full((dim + 1, dim + 1), -1)
    for k, corners in enumerate(others(dim)):
        place[k, corners] = np.arange(dim)
    return place


def simplices(points: FloatArray, cells: IntArray) -> Simplices:
    """Build the sides and the stars of a mesh.

    Parameters
    ----------
    points : (n, d) float64, length
        d = 2 or 3.
    cells : (m, d + 1) int64

    Returns
    -------
    Simplices

    Raises
    ------
    InvertedElement
        A flat cell.
    BadValue
        A side of more than two cells.

    Cost
    ----
    Two sorts of the sides and one search of connected components.
    """
    dim = points.shape[1]
    geometry.check_cells(shape("TRI3" if dim == 2 else "TET4"), points[cells])
    cells = np.sort(cells, axis=1)
    m, n = cells.shape
    nodes = cells[:, others(dim)].reshape(-1, dim)
    group, first = group_by_nodes(nodes)
    count = np.bincount(group)
    if count.max(initial=0) > 2:
        raise BadValue("cells around a side", int(count.max()), "at most 2")
    second = np.full(len(first), -1, np.int64)
    late = np.setdiff1d(np.arange(m * n), first, assume_unique=True)
    second[group[late]] = late
    sign = np.ones(m * n)
    sign[late] = -1.0
    halves = np.stack([first, second], axis=1)
    owner, local = np.divmod(halves, n)
    owner[halves < 0], local[halves < 0] = -1, -1

    X = points[cells]
    F = np.ascontiguousarray((X[:, 1:] - X[:, :1]).swapaxes(1, 2))
    volume = np.abs(np.linalg.det(F)) / (2.0 if dim == 2 else 6.0)
    inverse = np.linalg.inv(F)
    slope = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
    side = group.reshape(m, n)
    star, n_stars = _stars(dim, m, owner, local)
    return Simplices(
        points,
        cells,
        side,
        sign.reshape(m, n),
        nodes[first],
        owner,
        local,
        F,
        volume,
        -dim * volume[:, None, None] * slope,
        star,
        n_stars,
    )


def oriented(points: FloatArray, cells: IntArray) -> IntArray:
    """Swap two nodes of the cells that are inside out, (m, d + 1)."""
    X, found = points[cells], cells.copy()
    wrong = np.linalg.det(X[:, 1:] - X[:, :1]) < 0
    found[wrong, :2] = cells[wrong, 1::-1]
    return found


def _stars(dim: int, m: int, owner: IntArray, local: IntArray) -> tuple[IntArray, int]:
    """Find the sets of corners linked by sides, (m, dim + 1)."""
    from scipy.sparse.csgraph import connected_components

    inner = np.flatnonzero(owner[:, 1] >= 0)
    corner = owner[inner][:, :, None] * (dim + 1) + others(dim)[local[inner]]
    rows, columns = corner[:, 0].ravel(), corner[:, 1].ravel()
    size = m * (dim + 1)
    links = sp.csr_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(size, size))
    n_stars, star = connected_components(links, directed=False)
    return star.reshape(m, dim + 1).astype(np.int64), int(n_stars)
