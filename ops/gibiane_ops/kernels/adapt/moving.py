"""Moving nodes to lower the potential energy: configurational forces, what nodes may do, how far they may go."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.topology import Block

LEAST_VOLUME = 0.2
"""Smallest ratio of the volume of an element to what it was."""

LEAST_ANGLE = 10.0
"""Smallest angle between two faces (or sides) of a simplex, degrees."""

FLAT = 1e-9
"""Share below which a normal adds no direction to those of a node."""


def configurational_forces(of: Shape, X: FloatArray, u: FloatArray, stress: FloatArray) -> FloatArray:
    """Differentiate the potential energy of elements by the places of their nodes.

    Parameters
    ----------
    of : Shape
    X : (m, n_nodes, dim) float64, length
    u : (m, n_nodes, dim) float64, length
        Displacements.
    stress : (m, q, dim, dim) float64
        At the points of the stiffness rule.

    Returns
    -------
    (m, n_nodes, dim) float64, force
        Add over the elements of a node: the derivative of ``W - F.u``, the loads not moving with the nodes.

    Notes
    -----
    ``G_a = int (W I - (grad u)^T s) grad N_a``, ``(grad u)_ij = du_i/dx_j``, ``W = s : grad u / 2``.

    Source
    ------
    J. D. Eshelby 1975 (energy-momentum tensor); M. Braun 1997 (nodes moved by configurational forces).
    """
    xi, weights = of.gauss
    gradients, density = geometry.gradients(of, X, xi)
    slope = np.einsum("mni,mqnj->mqij", u, gradients)
    energy = np.einsum("mqij,mqij->mq", stress, slope) / 2
    tensor = -np.einsum("mqki,mqkj->mqij", slope, stress)
    each = np.arange(X.shape[2])
    tensor[:, :, each, each] += energy[:, :, None]
    return np.asarray(np.einsum("mq,mqij,mqnj->mni", density * weights, tensor, gradients), np.float64)


def freedoms(points: FloatArray, limits: Sequence[IntArray]) -> FloatArray:
    """Find the directions in which nodes may move without changing the domain or its parts.

    Parameters
    ----------
    points : (n, dim) float64, length
    limits : sequence of (k, c) int64
        Facets of the boundary and between parts, which keep their place as a whole; edges that limit faces; nodes that
        stay. c is the number of corners of each.

    Returns
    -------
    (n, dim, dim) float64
        Projection on the directions that are free: the plane of a flat boundary, the line of a straight edge, none at a
        corner; the identity inside.
    """
    n, dim = points.shape
    held = np.zeros((n, dim, dim))
    for cells in limits:
        if len(cells) == 0:
            continue
        X = points[cells]
        if cells.shape[1] == 1:
            project = np.broadcast_to(np.eye(dim), (len(cells), dim, dim))
        elif dim == 3 and cells.shape[1] > 2:
            normal = np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0])
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            project = normal[:, :, None] * normal[:, None, :]
        else:
            along = X[:, 1] - X[:, 0]
            along /= np.linalg.norm(along, axis=1, keepdims=True)
            project = np.eye(dim) - along[:, :, None] * along[:, None, :]
        np.add.at(held, cells, project[:, None])
    values, vectors = np.linalg.eigh(held)
    free = vectors * (values <= FLAT)[:, None, :]
    return np.asarray(free @ np.swapaxes(free, 1, 2), np.float64)


def smallest_angles(name: str, X: FloatArray) -> FloatArray:
    """Return the smallest angle between faces of tetrahedra, or sides of triangles, degrees.

    Parameters
    ----------
    name : str
        TET4 or TRI3.
    X : (m, dim + 1, dim) float64, length

    Returns
    -------
    (m,) float64
    """
    of = shape(name)
    gradients = geometry.gradients(of, X, of.ref_nodes[:1])[0][:, 0]
    normal = gradients / np.linalg.norm(gradients, axis=2, keepdims=True)
    cosine = -np.einsum("mid,mjd->mij", normal, normal)
    i, j = np.triu_indices(normal.shape[1], 1)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine[:, i, j].max(axis=1), -1, 1))), np.float64)


def steps(
    points: FloatArray, blocks: Sequence[Block], forces: FloatArray, energy: Sequence[FloatArray], free: FloatArray
) -> FloatArray:
    """Turn configurational forces into moves of the nodes, at most a fifth of the size of their elements.

    Parameters
    ----------
    points : (n, dim) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)
    forces : (n, dim) float64, force
    energy : sequence of (m,) float64
        Strain energy of each element.
    free : (n, dim, dim) float64
        See `freedoms`.

    Returns
    -------
    (n, dim) float64, length

    Notes
    -----
    ``-h^2 G / W``, h and W the smallest size and the strain energy around the node: W / h^2 has the size of the second
    derivative.
    """
    n, dim = points.shape
    size, around = np.full(n, np.inf), np.zeros(n)
    for (name, cells), each in zip(blocks, energy, strict=True):
        h = np.abs(geometry.measures(shape(name), points[cells])) ** (1 / dim)
        np.minimum.at(size, cells, h[:, None])
        np.add.at(around, cells, each[:, None])
    used = np.isfinite(size) & (around > 0)
    move = np.zeros_like(forces)
    move[used] = -np.einsum("nij,nj->ni", free[used], forces[used]) * (size[used] ** 2 / around[used])[:, None]
    length = np.linalg.norm(move, axis=1)
    limit = np.where(used, size / 5, 0.0)
    share = np.where(length > limit, limit / np.maximum(length, 1e-300), 1.0)
    return np.asarray(move * share[:, None], np.float64)


def limits_of(blocks: Sequence[Block], groups: Sequence[IntArray], dim: int) -> list[IntArray]:
    """List what moving nodes must keep: the boundary, the parts that groups name, and what limits these.

    Parameters
    ----------
    blocks : sequence of (str, (m, n_nodes) int64)
    groups : sequence of (k, c) int64
        Elements, facets, edges or nodes.
    dim : int

    Returns
    -------
    list of (k, c) int64
        For `freedoms`.
    """
    found = [facets.nodes for facets in topology.boundary(blocks).values()]
    sizes = {shape(name).n_nodes for name, _ in blocks}
    for group in groups:
        if group.shape[1] in sizes and group.shape[1] > dim:
            name = next(name for name, _ in blocks if shape(name).n_nodes == group.shape[1])
            found += [facets.nodes for facets in topology.boundary([(name, group)]).values()]
            continue
        found.append(group)
        rest = group
        while rest.shape[1] > 1:
            rest = _contour(rest)
            found.append(rest)
    return found


def _contour(cells: IntArray) -> IntArray:
    """Return what limits faces (edges that one of them has) or lines (their ends)."""
    n = cells.shape[1]
    parts = cells.reshape(-1, 1) if n == 2 else np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2)
    index, first = topology.group_by_nodes(parts)
    return np.asarray(parts[first[np.bincount(index, minlength=len(first)) == 1]], np.int64)


def longest_step(points: FloatArray, blocks: Sequence[Block], move: FloatArray) -> float:
    """Shorten a move until elements keep enough volume and simplices their angles.

    Parameters
    ----------
    points, move : (n, dim) float64, length
    blocks : sequence of (str, (m, n_nodes) int64)

    Returns
    -------
    float
        The first of 1, 1/2, 1/4 ... that is good; 0 when none of twenty is.
    """
    share = 1.0
    for _ in range(20):
        if all(_good(name, points[cells], (points + share * move)[cells]) for name, cells in blocks):
            return share
        share /= 2
    return 0.0


def _good(name: str, old: FloatArray, new: FloatArray) -> bool:
    of = shape(name)
    volume = geometry.measures(of, new)
    if (volume < LEAST_VOLUME * geometry.measures(of, old)).any():
        return False
    if name not in ("TRI3", "TET4"):
        return bool((geometry.measure_densities(of, new, of.ref_nodes[: of.n_corners]) > 0).all())
    before, after = smallest_angles(name, old), smallest_angles(name, new)
    return bool(((after >= LEAST_ANGLE) | (after >= before)).all())
