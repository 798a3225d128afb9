"""Where a solution is singular, and how slowly elements converge there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane_ops.kernels import connectivity, topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.topology import Block

BoolArray = NDArray[np.bool_]

SINGULAR_ORDER = 0.5
"""Order of convergence taken beside a singular node: displacement in the square root of the distance."""

RINGS = 4
"""Rings of elements around a singular node or edge from which its order is fitted."""

CREST = 0.6
"""Least error density of a node on a singularity, as a share of that of its neighbours."""

FEWEST = 6
"""Fewest elements in a fit."""


def singular_nodes(
    n_points: int, blocks: Sequence[Block], error2: FloatArray, measures: FloatArray, beta: float
) -> BoolArray:
    """Find the nodes around which the error peaks.

    Parameters
    ----------
    n_points : int
    blocks : list of (str, (m, n_nodes) int64)
    error2, measures : (n_cells,) float64
        Squared error and measure of each cell, through the blocks.
    beta : float
        A node is singular when its error density is at least beta times that of the whole; 3 for linear solid
        elements, 2 for plane or second-order ones.

    Returns
    -------
    (n_points,) bool
        In space the singular nodes of an edge follow one another.

    Notes
    -----
    Error density: root of the sum of squared errors over the sum of measures, of the cells of a node or of all cells.

    Source
    ------
    Coorevits, Ladeveze and Pelle 1994.
    """
    whole = float(error2.sum() / measures.sum())
    return np.asarray((_densities(n_points, blocks, error2, measures) >= beta**2 * whole) & (whole > 0), np.bool_)


def _densities(n_points: int, blocks: Sequence[Block], error2: FloatArray, measures: FloatArray) -> FloatArray:
    """Divide the squared errors around each node by the measures there."""
    indptr, cells = connectivity.node_to_cells(blocks, n_points)
    used = np.flatnonzero(np.diff(indptr))
    result = np.zeros(n_points)
    result[used] = np.add.reduceat(error2[cells], indptr[used]) / np.add.reduceat(measures[cells], indptr[used])
    return result


def singular_orders(
    n_points: int,
    blocks: Sequence[Block],
    error2: FloatArray,
    measures: FloatArray,
    order: float | FloatArray,
    *,
    beta: float = 3.0,
) -> FloatArray:
    """Give each element its order of convergence, lower where the error peaks.

    Parameters
    ----------
    n_points, blocks, error2, measures, beta
        See `singular_nodes`.
    order : float or (n_cells,) float64
        Order away from singularities; an element that touches a singular node has `SINGULAR_ORDER` at most.

    Returns
    -------
    (n_cells,) float64
    """
    peak = singular_nodes(n_points, blocks, error2, measures, beta)
    touched = np.concatenate([peak[each].any(axis=1) for _, each in blocks])
    return np.where(touched, np.minimum(SINGULAR_ORDER, order), order)


def fitted_orders(
    points: FloatArray,
    blocks: Sequence[Block],
    error2: FloatArray,
    measures: FloatArray,
    order: float | FloatArray,
    *,
    beta: float = 3.0,
) -> tuple[FloatArray, list[float]]:
    """Give the elements at each singular node or edge the order that the error around it shows.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    blocks, error2, measures, beta
        See `singular_nodes`.
    order : float or (n_cells,) float64
        Order p away from singularities.

    Returns
    -------
    orders : (n_cells,) float64
    found : list of float
        The order of each singular node or edge (nodes joined by edges of the mesh), in the order of their first nodes;
        `SINGULAR_ORDER` where too few elements surround it.

    Notes
    -----
    Where the displacement goes as r^lambda the error density of an element of size h at distance r goes as
    ``h^(2p) r^(2 (lambda - 1 - p))``: a straight line is fitted through the logarithms over `RINGS` rings, the elements
    that touch the singularity left out. The order is lambda, between 0.2 and p.

    Source
    ------
    Coorevits, Ladeveze and Pelle 1994 (decay over rings); Strang and Fix 1973 (orders at singularities).
    """
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    peak = singular_nodes(len(points), blocks, error2, measures, beta)
    regular = np.broadcast_to(np.asarray(order, np.float64), error2.shape)
    result = regular.copy()
    if not peak.any():
        return result, []
    corner = topology.corner_blocks(blocks)
    ends = topology.edges(corner)
    # The crest: nodes beside the singularity peak too, but less than their neighbour on it.
    density = _densities(len(points), blocks, error2, measures)
    highest = density.copy()
    np.maximum.at(highest, ends[:, 0], density[ends[:, 1]])
    np.maximum.at(highest, ends[:, 1], density[ends[:, 0]])
    peak &= density >= CREST * highest
    inside = ends[peak[ends].all(axis=1)]
    links = sp.coo_array((np.ones(len(inside), np.int8), inside.T), shape=(len(points),) * 2)
    label = connected_components(links, directed=False)[1]
    dim = points.shape[1]
    size = np.asarray(measures, np.float64) ** (1 / dim)
    centre = np.concatenate([points[cells].mean(axis=1) for _, cells in corner])
    found = []
    for each in dict.fromkeys(label[peak].tolist()):
        nodes = np.flatnonzero(peak & (label == each))
        ring = _rings(len(points), corner, nodes)
        distance = cKDTree(points[nodes]).query(centre)[0]
        around = (ring > 1) & (ring <= RINGS + 1) & (error2 > 0)
        value = SINGULAR_ORDER
        if around.sum() >= FEWEST and np.ptp(np.log(distance[around])) > 0:
            p = float(regular[around].mean())
            decay = np.log(error2[around] / measures[around]) - 2 * p * np.log(size[around])
            slope = float(np.polyfit(np.log(distance[around]), decay, 1)[0])
            value = float(np.clip(1 + p + slope / 2, 0.2, p))
        found.append(value)
        touched = ring == 1
        result[touched] = np.minimum(result[touched], value)
    return result, found


def _rings(n_points: int, blocks: Sequence[Block], nodes: IntArray) -> IntArray:
    """Give the elements their ring around nodes: 1 for those that touch them, 0 beyond the last ring looked at."""
    reached = np.zeros(n_points, bool)
    reached[nodes] = True
    ring = np.zeros(sum(len(cells) for _, cells in blocks), np.int64)
    for number in range(1, RINGS + 2):
        touched = np.concatenate([reached[cells].any(axis=1) for _, cells in blocks])
        ring[touched & (ring == 0)] = number
        start = 0
        for _, cells in blocks:
            reached[cells[touched[start : start + len(cells)]]] = True
            start += len(cells)
    return ring
