"""Surfaces as contact sees them: nodes with one normal per side of a sharp edge, and a basis of positive integrals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import EmptyContact
from gibiane_ops.kernels.geometry import circumferences, measure_densities, normal_densities
from gibiane_ops.kernels.topology import Block, middles_on_linear

SHIFT = 0.2
"""Share of the functions of its two middle nodes that a corner of a quadratic facet takes over."""

SHARP = np.cos(np.deg2rad(30.0))
"""Facets whose normals turn by more belong to two sides of an edge."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A contact surface whose nodes have one normal each.

    Attributes
    ----------
    nodes : (k,) int64
        Node of the mesh; one that lies on a sharp edge comes once for each side of it.
    normals : (k, d) float64
        Unit, area-weighted mean of the normals of the facets of this side.
    facets : list of (shape name, (m, n_nodes) int64)
        Positions in `nodes`.
    size : (k,) float64, length
        Mean extent of the facets around.
    """

    nodes: IntArray
    normals: FloatArray
    facets: list[Block]
    size: FloatArray


def surface_of(points: FloatArray, facets: Sequence[Block], *, split: bool = True) -> Surface:
    """Give each node of a surface its normal, or its normals where the surface has a sharp edge.

    Parameters
    ----------
    points : (n_points, d) float64, length
    facets : sequence of (shape name, (m, n_nodes) int64)
    split : bool
        False: one normal per node, whatever the edges.

    Returns
    -------
    Surface

    Raises
    ------
    EmptyContact
        When there is no facet.

    Notes
    -----
    Around a node, facets whose normals differ by less than 30 degrees, directly or through others, are of one side.
    """
    facets = [(name, cells) for name, cells in facets if len(cells)]
    if not facets:
        raise EmptyContact("a surface without facets")
    node, vector, extent = _around(points, facets)
    nodes, local = np.unique(node, return_inverse=True)
    unit = vector / np.linalg.norm(vector, axis=1)[:, None]
    mean = _sums(vector, local, len(nodes))
    length = np.linalg.norm(mean, axis=1)
    mean = mean / np.where(length > 0, length, 1.0)[:, None]
    # below the half angle from the mean no two facets differ by more than the angle
    turned = np.einsum("ki,ki->k", unit, mean[local]) < np.sqrt((1 + SHARP) / 2)
    side = local.astype(np.int64)
    count = len(nodes)
    owner = list(range(count))
    for i in np.unique(local[turned]) if split else ():
        at = np.flatnonzero(local == i)
        groups = _sides(unit[at])
        for group in range(1, int(groups.max()) + 1):
            side[at[groups == group]] = count
            owner.append(int(i))
            count += 1
    total = _sums(vector, side, count)
    length = np.linalg.norm(total, axis=1)
    size = np.bincount(side, extent, minlength=count) / np.bincount(side, minlength=count)
    cells, start = [], 0
    for name, own in facets:
        cells.append((name, side[start : start + own.size].reshape(own.shape)))
        start += own.size
    return Surface(nodes[owner], total / np.where(length > 0, length, 1.0)[:, None], cells, size)


def _around(points: FloatArray, facets: Sequence[Block]) -> tuple[IntArray, FloatArray, FloatArray]:
    """List, for each corner and middle of each facet: its node, the normal of the facet times its area, its extent."""
    node, vector, extent = [], [], []
    for name, cells in facets:
        of = shape(name)
        X = points[cells]
        # the normal at the node itself, so that a curved quadratic facet has that of each of its nodes
        at = normal_densities(of, X, of.ref_nodes)
        mean = np.einsum("mqi,q->mi", normal_densities(of, X, of.mass_gauss[0]), of.mass_gauss[1])
        area = np.linalg.norm(mean, axis=1)
        lengths = np.linalg.norm(at, axis=2)
        direction = np.where(lengths[..., None] > 0, at / np.where(lengths > 0, lengths, 1.0)[..., None], 0.0)
        if of.degree == 1:
            direction = np.broadcast_to((mean / area[:, None])[:, None], direction.shape)
        node.append(cells.ravel())
        vector.append((direction * area[:, None, None]).reshape(-1, points.shape[1]))
        extent.append(np.repeat(area ** (1 / of.dim), cells.shape[1]))
    return np.concatenate(node), np.concatenate(vector), np.concatenate(extent)


def _sums(vector: FloatArray, place: IntArray, count: int) -> FloatArray:
    return np.stack([np.bincount(place, column, minlength=count) for column in vector.T], axis=1)


def _sides(unit: FloatArray) -> IntArray:
    """Group the facets around a node by sides."""
    from scipy.sparse.csgraph import connected_components

    return np.asarray(connected_components(unit @ unit.T >= SHARP, directed=False)[1], np.int64)


def transformation(of: Shape) -> FloatArray:
    """Give the matrix T of the functions ``N~ = N T`` whose integrals over a facet are positive.

    Parameters
    ----------
    of : Shape
        A facet of first or second degree.

    Returns
    -------
    (n_nodes, n_nodes) float64
        The identity on linear facets.

    Notes
    -----
    ``N~_c = N_c + a sum N_m`` over the middles m of the two sides of a corner c, ``N~_m = (1 - 2 a) N_m``, a = 1/5;
    on a side that is a whole facet (SEG3) likewise. Integrals of N~: 2/15 and 1/5 of the area on TRI6, 1/20 and 1/5 on
    QUA8, 3/10 and 2/5 of the length on SEG3.

    Source
    ------
    A. Popp, B. I. Wohlmuth, M. W. Gee, W. A. Wall, SIAM J. Sci. Comput. 34, 2012.
    """
    T = np.eye(of.n_nodes)
    if of.degree > 1:
        for a, b, m in of.edges:
            T[m, [a, b]] = SHIFT
            T[m, m] = 1 - 2 * SHIFT
    return T


def middles_of(facets: Sequence[Block]) -> IntArray:
    """List the middle nodes of quadratic facets with the two corners of their side.

    Parameters
    ----------
    facets : sequence of (shape name, (m, n_nodes) int64)

    Returns
    -------
    (k, 3) int64
        Middle, corner, corner, each middle once.
    """
    found = [np.zeros((0, 3), np.int64)]
    for name, cells in facets:
        if shape(name).degree > 1:
            found.extend(cells[:, [m, a, b]] for a, b, m in shape(name).edges)
    every = np.concatenate(found)
    return every[np.unique(every[:, 0], return_index=True)[1]]


def integrals(points: FloatArray, surface: Surface, axisymmetric: bool = False) -> FloatArray:
    """Integrate the functions N~ of a surface: the area of each node.

    A middle on the side of a linear facet follows the two corners, which share its area.

    Parameters
    ----------
    points : (n_points, d) float64, length
    surface : Surface
    axisymmetric : bool
        Integrals go once round the axis.

    Returns
    -------
    (k,) float64, area
        Positive, zero at middles that follow corners, adding up to the area of the surface.
    """
    total = np.zeros(len(surface.nodes))
    held = middles_on_linear(surface.facets)
    for name, local in surface.facets:
        of, X = shape(name), points[surface.nodes[local]]
        xi, weights = of.mass_gauss
        measure = measure_densities(of, X, xi) * weights
        if axisymmetric:
            measure = measure * circumferences(of, X, xi)
        np.add.at(total, local, measure @ of.N(xi) @ transformation(of))
    np.add.at(total, held[:, :2], 0.5 * total[held[:, 2], None])
    total[held[:, 2]] = 0.0
    return total
