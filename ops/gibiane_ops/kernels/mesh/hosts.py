"""Which element of a mesh holds each of many points, and the values of fields there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels import connectivity
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.mesh.locate import overshoot, reference_coordinates
from gibiane_ops.kernels.topology import Block

# How many elements of nearest centre are tried before all those whose sphere holds the point.
NEAREST = 4
# Round-off in reference coordinates.
INSIDE = 1e-10


@dataclass(frozen=True, eq=False)
class Hosts:
    """The element of each point.

    Attributes
    ----------
    cell : (k,) int64
        Number of the element, counted through the blocks; -1 for none.
    xi : (k, 3) float64
        Reference coordinates there (unused columns are zero).
    out : (k,) float64
        How far outside, relative to the element; at most the tolerance, or infinite for none.
    """

    cell: IntArray
    xi: FloatArray
    out: FloatArray


class _Search:
    """Points looked for in a mesh, and the best element found for each."""

    def __init__(self, points: FloatArray, coords: FloatArray, blocks: Sequence[Block], tolerance: float) -> None:
        self.points = points
        self.coords = coords
        self.blocks = blocks
        self.start = np.concatenate([[0], np.cumsum([len(cells) for _, cells in blocks])]).astype(np.int64)
        X = [coords[cells] for _, cells in blocks]
        self.centre = np.concatenate([x.mean(axis=1) for x in X])
        self.radius = np.concatenate([np.linalg.norm(x - x.mean(axis=1, keepdims=True), axis=2).max(axis=1) for x in X])
        self.low = np.concatenate([x.min(axis=1) for x in X])
        self.high = np.concatenate([x.max(axis=1) for x in X])
        # Elements of second degree may bulge beyond the box of their nodes.
        slack = np.concatenate([np.full(len(c), tolerance + (shape(n).degree - 1) / 4) for n, c in blocks])
        self.low -= (slack * self.radius)[:, None]
        self.high += (slack * self.radius)[:, None]
        self.cell = np.full(len(points), -1, np.int64)
        self.xi = np.zeros((len(points), 3))
        self.out = np.full(len(points), np.inf)

    def possible(self, point: IntArray, element: IntArray) -> tuple[IntArray, IntArray]:
        """Keep the pairs whose point is in the box of the element."""
        x = self.points[point]
        rows = ((x >= self.low[element]) & (x <= self.high[element])).all(axis=1)
        return point[rows], element[rows]

    def measure(self, point: IntArray, element: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return reference coordinates (n, 3) and overshoot (n,) of points in elements, pair by pair."""
        xi, out = np.zeros((len(point), 3)), np.empty(len(point))
        block = np.searchsorted(self.start, element, side="right") - 1
        for number, (name, cells) in enumerate(self.blocks):
            rows = np.flatnonzero(block == number)
            if not len(rows):
                continue
            own = element[rows]
            X = self.coords[cells[own - self.start[number]]]
            found = reference_coordinates(name, X, self.points[point[rows]])
            image = np.einsum("mn,mni->mi", shape(name).N(found), X)
            off = np.linalg.norm(image - self.points[point[rows]], axis=1) / self.radius[own]
            xi[rows, : shape(name).dim] = found
            out[rows] = np.maximum(overshoot(name, found), off)
        return xi, out

    def keep(self, point: IntArray, element: IntArray, xi: FloatArray, out: FloatArray) -> None:
        """Take for each point the pair that overshoots least, the first element of equal ones."""
        # Differences of round-off must not decide.
        order = np.lexsort((element, np.maximum(out, INSIDE), point))
        order = order[np.unique(point[order], return_index=True)[1]]
        better = order[out[order] < self.out[point[order]]]
        self.cell[point[better]] = element[better]
        self.xi[point[better]] = xi[better]
        self.out[point[better]] = out[better]


def find_hosts(
    points: FloatArray, coords: FloatArray, blocks: Sequence[Block], tolerance: float = 1e-5, *, nearest: bool = False
) -> Hosts:
    """Find the element that holds each of many points.

    Parameters
    ----------
    points : (k, dim) float64, length
    coords : (n_points, dim) float64, length
        Nodes of the mesh.
    blocks : sequence of (str, (m, n_nodes) int64)
        Solids, or surfaces and lines in a larger space.
    tolerance : float
        How far outside an element a point may be, relative to the size of the element.
    nearest : bool
        Give to a point that no element holds the place nearest to it in the elements around the nearest node; `out`
        stays infinite there.

    Returns
    -------
    Hosts
        Of several elements the one that the point overshoots least, the first of equal ones.

    Cost
    ----
    Most points are found in one of the elements of nearest centre; for the others, all elements whose circumscribed
    sphere holds the point are tried. 300 000 points take a few seconds.
    """
    from scipy.spatial import cKDTree

    blocks = [block for block in blocks if len(block[1])]
    if not len(points) or not blocks:
        none = np.full(len(points), -1, np.int64)
        return Hosts(none, np.zeros((len(points), 3)), np.full(len(points), np.inf))
    search = _Search(points, coords, blocks, tolerance)
    tries = min(NEAREST, len(search.centre))
    _, near = cKDTree(search.centre).query(points, k=tries)
    near = near.reshape(len(points), tries).astype(np.int64)
    for column in range(tries):
        left = np.flatnonzero(search.out > INSIDE)
        point, element = search.possible(left, near[left, column])
        search.keep(point, element, *search.measure(point, element))
    left = np.flatnonzero(search.out > INSIDE)
    if len(left):
        found = cKDTree(points[left]).query_ball_point(search.centre, search.radius * (1 + 2 * tolerance))
        count = np.array([len(each) for each in found])
        if count.any():
            element = np.repeat(np.arange(len(found)), count)
            point = left[np.concatenate([np.asarray(each, np.int64) for each in found if len(each)])]
            point, element = search.possible(point, element)
            search.keep(point, element, *search.measure(point, element))
    lost = np.flatnonzero(search.out > tolerance)
    search.cell[lost], search.xi[lost], search.out[lost] = -1, 0.0, np.inf
    if nearest and len(lost):
        _take_nearest(search, lost)
    return Hosts(search.cell, search.xi, search.out)


def _take_nearest(search: _Search, lost: IntArray) -> None:
    """Give lost points the nearest of the places that `_brought_inside` finds in the elements around a node."""
    from scipy.spatial import cKDTree

    used = np.unique(np.concatenate([cells.ravel() for _, cells in search.blocks]))
    around, cells = connectivity.node_to_cells(search.blocks, len(search.coords))
    _, at = cKDTree(search.coords[used]).query(search.points[lost])
    node = used[at]
    count = around[node + 1] - around[node]
    point = np.repeat(lost, count)
    first = np.repeat(around[node] - np.concatenate([[0], np.cumsum(count)[:-1]]), count)
    element = cells[first + np.arange(len(point))]
    xi, _ = search.measure(point, element)
    block = np.searchsorted(search.start, element, side="right") - 1
    distance = np.empty(len(point))
    for number, (name, nodes) in enumerate(search.blocks):
        rows = np.flatnonzero(block == number)
        kind = shape(name)
        xi[rows, : kind.dim] = _brought_inside(name, xi[rows, : kind.dim])
        X = search.coords[nodes[element[rows] - search.start[number]]]
        image = np.einsum("mn,mni->mi", kind.N(xi[rows, : kind.dim]), X)
        distance[rows] = np.linalg.norm(image - search.points[point[rows]], axis=1)
    order = np.lexsort((element, distance, point))
    order = order[np.unique(point[order], return_index=True)[1]]
    search.cell[point[order]], search.xi[point[order]] = element[order], xi[order]


def _brought_inside(name: str, xi: FloatArray) -> FloatArray:
    """Bring reference points to the border of the element, axis by axis where its border follows the axes."""
    kind = shape(name)
    result = np.clip(xi, kind.ref_nodes.min(axis=0), kind.ref_nodes.max(axis=0))
    corners, dim = kind.n_corners, kind.dim
    if (corners, dim) in ((3, 2), (4, 3), (6, 3)):
        # Barycentric coordinates: the negative ones become zero, the others keep their ratios.
        flat = slice(0, 3 if corners == 4 else 2)
        bary = np.maximum(np.column_stack([1 - xi[:, flat].sum(axis=1), xi[:, flat]]), 0.0)
        result[:, flat] = bary[:, 1:] / bary.sum(axis=1, keepdims=True)
    elif (corners, dim) == (5, 3):
        room = (1 - result[:, 2])[:, None]
        result[:, :2] = np.clip(xi[:, :2], -room, room)
    return np.asarray(result, np.float64)


def interpolated(hosts: Hosts, blocks: Sequence[Block], values: Sequence[FloatArray]) -> FloatArray:
    """Interpolate values that elements have at their nodes.

    Parameters
    ----------
    hosts : Hosts
    blocks : sequence of (str, (m, n_nodes) int64)
        Those that the hosts were found in.
    values : sequence of (m, n_nodes, c) float64
        One array per block.

    Returns
    -------
    (k, c) float64
        Zero where there is no host.
    """
    result = np.zeros((len(hosts.cell), values[0].shape[2]))
    start = 0
    for (name, cells), own in zip(blocks, values, strict=True):
        rows = np.flatnonzero((hosts.cell >= start) & (hosts.cell < start + len(cells)))
        N = shape(name).N(hosts.xi[rows, : shape(name).dim])
        result[rows] = np.einsum("kn,knc->kc", N, own[hosts.cell[rows] - start])
        start += len(cells)
    return result


def hosted(
    points: FloatArray, coords: FloatArray, blocks: Sequence[Block], tolerance: float = 1e-5
) -> tuple[IntArray, sp.csr_array]:
    """Find the points that an element holds and the weights of its nodes there.

    Parameters
    ----------
    points, coords, blocks, tolerance
        See `find_hosts`.

    Returns
    -------
    inside : (j,) int64
        Rows of the points that an element holds, increasing.
    weights : (j, n_points) csr_array
        Row i interpolates at point inside[i] the values at the nodes of the mesh; rows sum to 1.
    """
    blocks = [block for block in blocks if len(block[1])]
    hosts = find_hosts(points, coords, blocks, tolerance)
    inside = np.flatnonzero(hosts.cell >= 0)
    rows, columns, values = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
    start = 0
    for name, cells in blocks:
        own = np.flatnonzero((hosts.cell[inside] >= start) & (hosts.cell[inside] < start + len(cells)))
        rows.append(np.repeat(own, cells.shape[1]))
        columns.append(cells[hosts.cell[inside[own]] - start].ravel())
        values.append(shape(name).N(hosts.xi[inside[own], : shape(name).dim]).ravel())
        start += len(cells)
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return inside, sp.csr_array(entries, shape=(len(inside), len(coords)))
