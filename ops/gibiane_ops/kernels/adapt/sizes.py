"""Sizes of the next mesh: the coarsest one expected to meet a prescribed error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels import connectivity, geometry, topology
from gibiane_ops.kernels.adapt.ratios import ratios_by_order, uniform_order_ratios
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.topology import Block

REGULAR: dict[str, float] = {"TRI3": 4 / np.sqrt(3), "TET4": 6 * np.sqrt(2)}
"""Number of regular simplices of edge 1 in a unit of measure; 1 for the shapes that are not simplices."""


def element_sizes(of: Shape, measures: FloatArray) -> FloatArray:
    """Give the edge of the regular element of the same measure.

    Parameters
    ----------
    of : Shape
    measures : (m,) float64, length^dim
        Lengths, areas or volumes.

    Returns
    -------
    (m,) float64, length
        TET4 ``(6 sqrt(2) V)^(1/3)``, TRI3 ``sqrt(4 A / sqrt(3))``, others ``measure^(1/dim)``.
    """
    return np.asarray((REGULAR.get(of.name, 1.0) * measures) ** (1 / of.dim), np.float64)


def nodal_sizes(
    n_points: int,
    blocks: Sequence[Block],
    sizes: FloatArray,
    *,
    smallest_of_star: bool = False,
    pairs: IntArray | None = None,
) -> FloatArray:
    """Bring element sizes to the nodes.

    Parameters
    ----------
    n_points : int
    blocks : list of (str, (m, n_nodes) int64)
    sizes : (n_cells,) float64, length
    smallest_of_star : bool
        Take the minimum over the elements of a node instead of their geometric mean.
    pairs : (k, 2) int64, optional
        Nodes at one place on the two sides of a contact: both take the geometric mean (or the minimum) of the two.

    Returns
    -------
    (n_points,) float64, length
        Infinite at points that no element uses.
    """
    indptr, cells = connectivity.node_to_cells(blocks, n_points)
    used = np.flatnonzero(np.diff(indptr))
    result = np.full(n_points, np.inf)
    if smallest_of_star:
        result[used] = np.minimum.reduceat(sizes[cells], indptr[used])
    else:
        total = np.add.reduceat(np.log(sizes)[cells], indptr[used])
        result[used] = np.exp(total / np.diff(indptr)[used])
    if pairs is not None and len(pairs):
        both = result[pairs]
        common = both.min(axis=1) if smallest_of_star else np.sqrt(both.prod(axis=1))
        result[pairs] = common[:, None]
    return result


def limit_growth(points: FloatArray, edges: IntArray, sizes: FloatArray, growth: float) -> FloatArray:
    """Reduce sizes so that they grow slowly from one node to the next.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    edges : (k, 2) int64
        Pairs of neighbours; a pair of zero length gets one size.
    sizes : (n_points,) float64, length
    growth : float
        At least 1.

    Returns
    -------
    (n_points,) float64, length
        The largest field below `sizes` with ``h_i <= h_j + (growth - 1) |x_i - x_j|`` on every edge.

    Raises
    ------
    BadValue
        When growth < 1.

    Cost
    ----
    One pass over the edges per ring of nodes that a small size reaches.
    """
    if growth < 1:
        raise BadValue("growth", growth, "growth >= 1")
    i, j = np.hstack([edges.T, edges.T[::-1]])
    slack = (growth - 1) * np.linalg.norm(points[i] - points[j], axis=1)
    result = sizes.copy()
    while True:
        before = result.copy()
        np.minimum.at(result, i, before[j] + slack)
        if (result == before).all():
            return result


def predicted_count(points: FloatArray, blocks: Sequence[Block], sizes: FloatArray) -> float:
    """Count the regular elements that a field of sizes asks for.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    blocks : list of (str, (m, n_nodes) int64)
        Mesh that carries the field.
    sizes : (n_points,) float64, length

    Returns
    -------
    float
        ``sum int c h^-d``, c from `REGULAR`, h interpolated between the corners, with the mass rule of each shape.
    """
    total = 0.0
    for name, cells in topology.corner_blocks(blocks):
        of = shape(name)
        xi, weights = of.mass_gauss
        density = geometry.measure_densities(of, points[cells], xi) * weights
        h = sizes[cells] @ of.N(xi).T
        total += REGULAR.get(name, 1.0) * float((density * h ** (-of.dim)).sum())
    return total


@dataclass(frozen=True, eq=False)
class SizeMap:
    """Sizes asked of the next mesh.

    Attributes
    ----------
    nodal : (n_points,) float64, length
        Edge of the regular element wanted at each node; infinite at points that no element uses.
    count : float
        Number of elements that this field asks for, see `predicted_count`.
    optimum : float
        Number of elements of the optimum before growth, bounds and cap, ``sum r_E^-d``.
    ratios : (n_cells,) float64
        New over old size of each element.
    reachable : float
        Error expected when no size is below the smallest one: the target unless this limit acts.
    """

    nodal: FloatArray
    count: float
    optimum: float
    ratios: FloatArray
    reachable: float


def size_map(
    points: FloatArray,
    blocks: Sequence[Block],
    error: FloatArray,
    target: float,
    *,
    order: float | FloatArray = 1.0,
    equal: bool = False,
    smallest: float = 0.0,
    largest: float = np.inf,
    growth: float | None = 1.5,
    max_count: float | None = None,
    smallest_of_star: bool = False,
    pairs: IntArray | None = None,
) -> SizeMap:
    """Compute the sizes of the coarsest mesh expected to meet a prescribed error.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    blocks : list of (str, (m, n_nodes) int64)
        Cells of one dimension.
    error : (n_cells,) float64
        Error of each cell, through the blocks, in the same unit as target (usually relative).
    target : float
        Prescribed error of the whole.
    order : float or (n_cells,) float64
        Order of convergence, one for all or one per cell.
    equal : bool
        See `ratios_by_order`.
    smallest, largest : float, length
        Bounds of the sizes.
    growth : float, optional
        See `limit_growth`; None leaves the sizes as they are.
    max_count : float, optional
        When more elements are asked for, every size is multiplied so that this number is; it wins over the largest
        size and the growth.
    smallest_of_star : bool
        See `nodal_sizes`.
    pairs : (k, 2) int64, optional
        See `nodal_sizes`.

    Returns
    -------
    SizeMap

    Raises
    ------
    BadValue
        When target, order, max_count or the bounds are not positive, or the bounds are crossed.

    Notes
    -----
    Averaging to the nodes smooths the sizes and so changes the number of elements that they ask for; the nodal field
    is multiplied by one number that restores the optimum. Without any error the sizes stay as they are; none exceeds
    the extent of the mesh. Mid-nodes take the mean of the two ends of their edge.
    """
    orders = np.asarray(order, np.float64)
    for what, value in (("target", target), ("order", float(orders.min())), ("largest size", largest)):
        if not value > 0:
            raise BadValue(what, value, f"{what} > 0")
    if not 0 <= smallest <= largest:
        raise BadValue("smallest size", smallest, f"0 <= smallest size <= {largest:g}")
    if max_count is not None and not max_count > 0:
        raise BadValue("largest number of elements", max_count, "a positive number")
    dim = shape(blocks[0][0]).dim
    measures = [geometry.measures(shape(name), points[cells]) for name, cells in blocks]
    middles, blocks = topology.middles(blocks), topology.corner_blocks(blocks)
    old = np.concatenate([element_sizes(shape(name), each) for (name, _), each in zip(blocks, measures, strict=True)])
    error2 = np.asarray(error, np.float64) ** 2
    if not error2.any():
        ratios = np.ones_like(error2)
    elif orders.ndim == 0:
        ratios = uniform_order_ratios(error2, target, float(orders), dim)
    else:
        ratios = ratios_by_order(error2, target, orders, dim, equal=equal)
    optimum = float((ratios**-dim).sum())
    possible = np.maximum(ratios, smallest / old)
    within = bool((possible == ratios).all())
    reachable = target if within else float(np.sqrt((possible ** (2 * orders) * error2).sum()))
    nodal = nodal_sizes(len(points), blocks, ratios * old, smallest_of_star=smallest_of_star, pairs=pairs)
    nodal *= (predicted_count(points, blocks, nodal) / optimum) ** (1 / dim)
    if growth is not None:
        links = [topology.edges(blocks)] if pairs is None else [topology.edges(blocks), pairs]
        nodal = limit_growth(points, np.concatenate(links), nodal, growth)
    nodal = np.clip(nodal, smallest, np.where(np.isfinite(nodal), largest, np.inf))
    # A size beyond that of the domain, of an error that is all but zero, says nothing.
    nodal = np.minimum(nodal, max(float(np.ptp(points, axis=0).max()), smallest))
    count = predicted_count(points, blocks, nodal)
    if max_count is not None and count > max_count:
        nodal *= (count / max_count) ** (1 / dim)
        count = float(max_count)
    nodal[middles[:, 2]] = nodal[middles[:, :2]].mean(axis=1)
    return SizeMap(nodal, count, optimum, ratios, reachable)
