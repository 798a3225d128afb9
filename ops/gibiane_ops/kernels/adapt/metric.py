"""Sizes that depend on the direction: the metric of the mesh on which a field is interpolated best."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.adapt.sizes import REGULAR
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.topology import Block

LEAST_BEND = 1e-6
"""Second derivatives below this share of the largest are taken as this share: a metric has no zero."""

SWEEPS = 10
"""Rings of neighbours over which a small size is felt, at most."""


def hessians(points: FloatArray, blocks: Sequence[Block], values: FloatArray) -> FloatArray:
    """Recover the second derivatives of a nodal field by averaging gradients twice.

    Parameters
    ----------
    points : (n, dim) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)
        Linear elements.
    values : (n, c) float64

    Returns
    -------
    (n, c, dim, dim) float64, unit of values / length^2
        Symmetric.

    Notes
    -----
    At a node the mean of the gradients of its elements, weighted by their measures, twice. Means of one side are poor:
    a node of the boundary takes the mean of the second derivatives of its neighbours inside, if it has any.

    Source
    ------
    Zienkiewicz and Zhu 1992 (double averaging); Alauzet and Loseille 2010.
    """
    first = _averaged(points, blocks, values)
    second = _averaged(points, blocks, first.reshape(len(points), -1))
    H = second.reshape(*first.shape, points.shape[1])
    H = 0.5 * (H + H.swapaxes(2, 3))
    outside = np.zeros(len(points), bool)
    for facets in topology.boundary(blocks).values():
        outside[facets.nodes] = True
    ends = topology.edges(blocks)
    both = np.concatenate([ends, ends[:, ::-1]])
    both = both[outside[both[:, 0]] & ~outside[both[:, 1]]]
    number = np.bincount(both[:, 0], minlength=len(points))
    total = np.zeros_like(H)
    np.add.at(total, both[:, 0], H[both[:, 1]])
    known = number > 0
    H[known] = total[known] / number[known][:, None, None, None]
    return np.asarray(H, np.float64)


def _averaged(points: FloatArray, blocks: Sequence[Block], values: FloatArray) -> FloatArray:
    """Return the gradients at the nodes, (n, c, dim)."""
    total, weight = np.zeros((len(points), values.shape[1], points.shape[1])), np.zeros(len(points))
    for name, cells in blocks:
        of = shape(name)
        each, density = geometry.gradients(of, points[cells], of.gauss[0])
        w = density * of.gauss[1]
        slope = np.einsum("mq,mqnd,mnc->mcd", w, each, values[cells])
        np.add.at(total, cells, slope[:, None])
        np.add.at(weight, cells, w.sum(axis=1)[:, None])
    weight[weight == 0] = 1.0
    return np.asarray(total / weight[:, None, None], np.float64)


def metric_map(
    points: FloatArray,
    blocks: Sequence[Block],
    hessian: FloatArray,
    count: float,
    *,
    smallest: float = 0.0,
    largest: float = np.inf,
    stretch: float = 100.0,
    growth: float | None = 1.5,
) -> FloatArray:
    """Compute the metric of a mesh of a given number of simplices that interpolates a field best.

    Parameters
    ----------
    points : (n, dim) float64, length
    blocks : sequence of (str, (m, dim + 1) int64)
        TRI3 in a plane or TET4 in space.
    hessian : (n, c, dim, dim) float64
        Second derivatives of the components of the field, in one unit.
    count : float
        Elements wanted.
    smallest, largest : float, length
        Bounds of the sizes.
    stretch : float
        Largest ratio of the sizes of an element in two directions, at least 1.
    growth : float, optional
        Largest factor between the sizes of one element and the next, more than 1; None leaves them.

    Returns
    -------
    (n, dim, dim) float64, length^-2
        An edge e is as long as wanted when ``e.M.e = 1``.

    Raises
    ------
    BadValue
        When count, growth, stretch or the bounds make no sense, or the field has no second derivative.

    Notes
    -----
    With ``|H|`` the root of the sum of the squares of the H of the components (a matrix),
    ``M = D det(|H|)^(-1/(4+d)) |H|`` is the least error of interpolation in the mean square for a number of elements;
    D gives this number, found by bisection with the bounds.

    Source
    ------
    Loseille and Alauzet 2011 (continuous mesh); Alauzet 2010 (growth).
    """
    for what, value in (("number of elements", count), ("largest size", largest)):
        if not value > 0:
            raise BadValue(what, value, f"{what} > 0")
    if not 0 <= smallest <= largest:
        raise BadValue("smallest size", smallest, f"0 <= smallest size <= {largest:g}")
    if not stretch >= 1:
        raise BadValue("stretch", stretch, "stretch >= 1")
    if growth is not None and not growth > 1:
        raise BadValue("growth", growth, "growth > 1")
    dim = points.shape[1]
    bend, axes = np.linalg.eigh(np.einsum("ncij,ncjk->nik", hessian, hessian))
    bend = np.sqrt(np.maximum(bend, 0.0))
    if not bend.max(initial=0.0) > 0:
        raise BadValue("second derivative of the field", 0.0, "a field that is not linear")
    bend = np.maximum(bend, LEAST_BEND * bend.max())
    shaped = bend * bend.prod(axis=1, keepdims=True) ** (-1 / (4 + dim))
    shaped = np.maximum(shaped, shaped.max(axis=1, keepdims=True) / stretch**2)
    least, most = largest**-2, np.inf if smallest == 0 else smallest**-2
    ends = topology.edges(blocks)

    def bounded(log_d: float) -> FloatArray:
        values = np.clip(np.exp(log_d) * shaped, least, most)
        return np.asarray(np.einsum("nij,nj,nkj->nik", axes, values, axes), np.float64)

    def found(log_d: float) -> FloatArray:
        M = bounded(log_d)
        return M if growth is None else limit_metric_growth(points, ends, M, growth)

    middle = float(np.log(count) * 2 / dim - np.log(shaped).mean())
    low, high = middle - 60.0, middle + 60.0
    for _ in range(60):
        log_d = 0.5 * (low + high)
        low, high = (log_d, high) if metric_count(points, blocks, bounded(log_d)) < count else (low, log_d)
    # Growth only makes sizes smaller: a few steps bring the number back.
    log_d = low
    for _ in range(0 if growth is None else 6):
        got = metric_count(points, blocks, found(log_d))
        if abs(got / count - 1) < 0.01:
            break
        log_d -= 2 / dim * float(np.log(got / count))
    return found(log_d)


def metric_count(points: FloatArray, blocks: Sequence[Block], metric: FloatArray) -> float:
    """Count the regular simplices that a metric asks for.

    Parameters
    ----------
    points : (n, dim) float64, length
    blocks : sequence of (str, (m, dim + 1) int64)
    metric : (n, dim, dim) float64, length^-2

    Returns
    -------
    float
        ``sum int c det(M)^(1/2)``, c from `REGULAR`, the root linear between the nodes.
    """
    density = np.sqrt(np.linalg.det(metric))
    return sum(
        REGULAR.get(name, 1.0) * float((geometry.measures(shape(name), points[c]) * density[c].mean(axis=1)).sum())
        for name, c in blocks
    )


def limit_metric_growth(points: FloatArray, edges: IntArray, metric: FloatArray, growth: float) -> FloatArray:
    """Shorten sizes so that they grow slowly from a node to the next, each direction with its own.

    Parameters
    ----------
    points : (n, dim) float64, length
    edges : (k, 2) int64
    metric : (n, dim, dim) float64, length^-2
    growth : float
        Factor of the sizes over an edge of length 1 in the metric.

    Returns
    -------
    (n, dim, dim) float64
        Nowhere larger sizes than given.

    Notes
    -----
    A node imposes on its neighbour its metric divided by ``(1 + l log growth)^2``, l the length of the edge in it; the
    neighbour takes the intersection. One neighbour of each node at a time, `SWEEPS` times or until nothing changes.
    """
    both = np.concatenate([edges, edges[:, ::-1]])
    both = both[np.argsort(both[:, 0], kind="stable")]
    start = np.searchsorted(both[:, 0], both[:, 0])
    turn = np.arange(len(both)) - start
    batches = [both[turn == k] for k in range(int(turn.max(initial=-1)) + 1)]
    result = metric.copy()
    for _ in range(SWEEPS):
        before = result.copy()
        for batch in batches:
            i, j = batch.T
            e = points[i] - points[j]
            length = np.sqrt(np.einsum("kd,kde,ke->k", e, before[j], e))
            imposed = before[j] / (1 + length * np.log(growth))[:, None, None] ** 2
            result[i] = intersection(result[i], imposed)
        if np.allclose(result, before, rtol=1e-3, atol=0.0):
            break
    return result


def intersection(one: FloatArray, two: FloatArray) -> FloatArray:
    """Return the metric of the largest sizes below those of two metrics.

    Parameters
    ----------
    one, two : (k, dim, dim) float64
        Positive definite.

    Returns
    -------
    (k, dim, dim) float64
        In the axes that are conjugate for both, the larger value of the two.
    """
    L = np.linalg.cholesky(one)
    inverse = np.linalg.inv(L)
    values, vectors = np.linalg.eigh(inverse @ two @ inverse.swapaxes(1, 2))
    inner = np.einsum("kij,kj,klj->kil", vectors, np.maximum(values, 1.0), vectors)
    return np.asarray(L @ inner @ L.swapaxes(1, 2), np.float64)
