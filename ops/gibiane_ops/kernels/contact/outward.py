"""Facets that turn outwards from their body, and normals at their nodes."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.pairs import ROUND_OFF
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue, EmptyContact
from gibiane_ops.kernels.geometry import normal_densities
from gibiane_ops.kernels.topology import Block, group_by_nodes


def nodal_normals(points: FloatArray, facets: Sequence[Block]) -> tuple[IntArray, FloatArray]:
    """Average the normals of the facets at their nodes, weighted by area.

    Parameters
    ----------
    points : (n_points, d) float64, length
    facets : sequence of (shape name, (m, n_nodes) int64)

    Returns
    -------
    nodes : (k,) int64
        Nodes of the facets, increasing.
    normals : (k, d) float64
        Unit vectors.

    Raises
    ------
    BadValue
        When the normals around a node cancel, as on a surface folded on itself.
    """
    total = np.zeros_like(points)
    for name, cells in facets:
        rule = shape(name).mass_rule
        area = np.einsum("mqi,q->mi", normal_densities(shape(name), points[cells], rule.points), rule.weights)
        for column in cells.T:
            np.add.at(total, column, area)
    used = [np.ravel(cells) for _, cells in facets]
    nodes = np.unique(np.concatenate(used)).astype(np.int64) if used else np.zeros(0, np.int64)
    length = np.linalg.norm(total[nodes], axis=1)
    flat = length <= ROUND_OFF * length.max(initial=0)
    if flat.any():
        raise BadValue("contact normal", nodes[flat].tolist(), "a surface that is not folded on itself")
    return nodes, total[nodes] / length[:, None]


def facets_of_body(body: Sequence[Block], surface: Sequence[Block]) -> list[Block]:
    """Turn the facets of a surface so that their normals leave the body that they bound.

    Parameters
    ----------
    body : sequence of (shape name, (m, n_nodes) int64)
        Cells.
    surface : sequence of (shape name, (m, n_nodes) int64)
        Facets in any orientation.

    Returns
    -------
    list of (shape name, (m, n_nodes) int64)

    Raises
    ------
    EmptyContact
        When a facet is not on the boundary of the body.
    """
    marked = np.zeros(1 + max((int(cells.max()) for _, cells in [*body, *surface] if cells.size), default=0), bool)
    for _, cells in surface:
        marked[cells] = True
    turned: list[Block] = []
    for name, cells in surface:
        if not len(cells):
            continue
        n_corners = shape(name).n_corners
        skin = _facets_on(body, name, marked)
        if _same_facets(skin[:, :n_corners], cells[:, :n_corners]):
            turned.append((name, skin))
            continue
        group, first = group_by_nodes(np.concatenate([skin, cells])[:, :n_corners])
        match = first[group[len(skin) :]]
        # A facet between two cells is not on the boundary.
        shared = np.bincount(group[: len(skin)], minlength=len(first))[group[len(skin) :]] > 1
        lost = int(((match >= len(skin)) | shared).sum())
        if lost:
            raise EmptyContact(f"{lost} facets of the surface are not on the boundary of the body")
        turned.append((name, skin[match]))
    return turned


def _same_facets(a: IntArray, b: IntArray) -> bool:
    """Tell whether two lists hold the same facets in the same order, each once: the usual case, and a quick one."""
    if len(a) != len(b):
        return False
    for column in b.T:
        if not functools.reduce(np.logical_or, [column == other for other in a.T]).all():
            return False
    mixed = (a.astype(np.uint64) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(31))) * np.uint64(0xBF58476D1CE4E5B9)
    return _distinct(functools.reduce(np.add, mixed.T))


def _distinct(key: NDArray[np.uint64]) -> bool:
    """Tell whether well mixed keys differ from each other; only those that share a slot of a table are sorted."""
    bits = (8 * len(key)).bit_length()
    slot = (key >> np.uint64(64 - bits)).astype(np.int64)
    last = np.empty(1 << bits, np.int32)
    number = np.arange(len(key), dtype=np.int32)
    last[slot] = number
    winner = last[slot]
    shared = winner != number
    shared[winner[shared]] = True
    doubtful = np.sort(key[shared])
    return bool((doubtful[1:] != doubtful[:-1]).all())


def _facets_on(body: Sequence[Block], name: str, marked: NDArray[np.bool_]) -> IntArray:
    """Return the facets of one shape, turned outwards, of the cells of a body, whose corners are all marked."""
    found = [np.zeros((0, shape(name).n_nodes), np.int64)]
    corners = shape(name).n_corners
    for of, cells in body:
        faces = [local for facet, local in shape(of).faces if facet == name]
        on_surface = np.ascontiguousarray(marked[cells[:, : shape(of).n_corners]].T)
        for local in faces:
            on = functools.reduce(np.logical_and, [on_surface[i] for i in local[:corners]])
            rows = np.flatnonzero(on)
            if len(rows):
                found.append((cells if len(rows) == len(cells) else cells[rows])[:, list(local)])
    return np.concatenate(found)
