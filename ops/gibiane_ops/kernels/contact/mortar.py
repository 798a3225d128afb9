"""Mortar contact: surfaces of different meshes, integrated over their common parts with dual multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.facets import Surface, integrals, middles_of, surface_of, transformation
from gibiane_ops.kernels.contact.overlaps import Overlaps, overlaps
from gibiane_ops.kernels.contact.pairs import DEEP, ROUND_OFF, ContactPairs
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import EmptyContact
from gibiane_ops.kernels.topology import Block

COVERED = 1e-3
"""A node that has a smaller share of its area in front of the master stays free of contact."""

ILL = 1e12
"""A facet whose covered part is so small that its mass matrix is worse conditioned counts as uncovered."""


@dataclass(eq=False)
class _Sums:
    """What facets bring to their nodes; each array has one row per node of the slave surface."""

    D: FloatArray
    gap: FloatArray
    lowest: FloatArray
    facing: FloatArray
    row: list[IntArray]
    node: list[IntArray]
    value: list[FloatArray]


def mortar_pairs(
    points: FloatArray,
    slave: Sequence[Block],
    master: Sequence[Block],
    *,
    rigid: bool = False,
    axisymmetric: bool = False,
) -> ContactPairs:
    """Tie the mean of the slave displacement about each node to that of the master in front of it.

    Parameters
    ----------
    points : (n_points, d) float64, length
    slave, master : sequence of (shape name, (m, n_nodes) int64)
        Facets, normals out of their bodies.
    rigid : bool
        The master is an obstacle: its displacements do not count, and normals are those of the obstacle.
    axisymmetric : bool
        Integrals go once round the axis; the first coordinate is the radius.

    Returns
    -------
    ContactPairs
        ``w_p = u1~_p - sum_j P_pj u2_j``, P = D^-1 M, and the weighted gap. `area` is D: force over area is pressure.

    Raises
    ------
    EmptyContact
        When no part of the slave has the master in front of it.

    Notes
    -----
    On each slave facet ``psi = A N~``, ``A = diag(int N~) (int N~ N~^T)^-1``, so that ``int psi_p N~_q = delta_pq
    int N~_q``; ``M_pj = int psi_p N2_j``. All integrals are over the covered part, with the same points: rows of P
    add up to 1 and psi is dual to round-off. N~ is the basis of ``transformation``. Nodes of which less than a
    thousandth of the area is covered stay free of contact.

    A weighted gap may be a little negative between curved surfaces that do not penetrate each other; only where
    the surfaces themselves overlap is the pair in `penetrating`.

    Source
    ------
    B. I. Wohlmuth, SIAM J. Numer. Anal. 38, 2000; M. A. Puso, T. A. Laursen, CMAME 193, 2004; T. Cichosz, M. Bischoff,
    CMAME 200, 2011 (facets covered in part).

    Cost
    ----
    A k-d tree, and a clipped polygon per pair of facets that overlap.
    """
    surface = surface_of(points, slave)
    master = [(name, cells) for name, cells in master if len(cells)]
    if not master:
        raise EmptyContact("a surface without facets")
    n, d = surface.normals.shape
    sums = _Sums(np.zeros(n), np.zeros(n), np.full(n, np.inf), np.zeros((n, d)), [], [], [])
    for name, local in surface.facets:
        on_nodes = surface.nodes[local]
        _gather(sums, name, local, overlaps(points, name, on_nodes, master, axisymmetric), master)
    whole = integrals(points, surface, axisymmetric)
    kept = sums.D / whole > COVERED
    middles = middles_of(surface.facets)
    # the condition of a middle holds the displacements of its corners
    alone = ~kept[middles[:, 1:]].all(axis=1)
    kept[middles[alone, 0]] = False
    if not kept.any():
        raise EmptyContact("no part of one surface lies in front of the other")
    return _pairs(points, surface, master, sums, kept, middles[kept[middles[:, 0]]], rigid)


def _gather(sums: _Sums, name: str, local: IntArray, found: Overlaps, master: Sequence[Block]) -> None:
    """Turn the integrals over the common parts of facets into those of the nodes."""
    T = transformation(shape(name))
    m, n = local.shape
    mass = np.zeros((m, n, n))
    np.add.at(mass, found.slave, T.T @ found.mass @ T)
    D = np.zeros((m, n))
    np.add.at(D, found.slave, found.area @ T)
    size = np.einsum("mii->m", mass)
    covered = size > 0
    scaled = mass[covered] / size[covered][:, None, None]
    covered[covered] = np.linalg.cond(scaled) < ILL
    A = np.zeros((m, n, n))
    A[covered] = D[covered][:, :, None] * np.linalg.inv(mass[covered])
    used = covered[found.slave]
    s = found.slave
    at = local[s]
    np.add.at(sums.D, local[covered], D[covered])
    dual = A[s] @ T.T
    np.add.at(sums.gap, at[used], np.einsum("knm,km->kn", dual, found.gap)[used])
    np.add.at(sums.facing, at[used], np.einsum("kn,ki->kni", found.area @ T, found.normal)[used])
    np.minimum.at(sums.lowest, at[used], np.broadcast_to(found.lowest[:, None], at.shape)[used])
    for number, (_, cells) in enumerate(master):
        mine = used & (found.block == number)
        k = found.width[number]
        M = dual[mine] @ found.coupling[mine][:, :, :k]
        sums.row.append(np.broadcast_to(at[mine][:, :, None], M.shape).ravel())
        sums.node.append(np.broadcast_to(cells[found.master[mine]][:, None, :], M.shape).ravel())
        sums.value.append(M.ravel())


def _pairs(
    points: FloatArray,
    surface: Surface,
    master: Sequence[Block],
    sums: _Sums,
    kept: np.ndarray,
    middles: IntArray,
    rigid: bool,
) -> ContactPairs:
    ids = np.flatnonzero(kept)
    position = np.full(len(kept), -1, np.int64)
    position[ids] = np.arange(len(ids))
    D = sums.D[ids]
    row, node, value = (np.concatenate(each) for each in (sums.row, sums.node, sums.value))
    used = kept[row] & ~np.bool_(rigid)
    row, node, value = position[row[used]], node[used], value[used] / D[position[row[used]]]
    slave = surface.nodes[ids]
    normals = surface.normals[ids]
    if rigid:
        normals = -sums.facing[ids] / np.linalg.norm(sums.facing[ids], axis=1)[:, None]
    gap = sums.gap[ids] / D
    extent = float(np.ptp(points[slave], axis=0).max()) if len(slave) > 1 else float(surface.size.max())
    gap[np.abs(gap) <= ROUND_OFF * extent] = 0.0
    deep = (sums.lowest[ids] < -DEEP * surface.size[ids]) & (gap < -DEEP * surface.size[ids])
    masters = np.unique(np.concatenate([cells.ravel() for _, cells in master]))
    return ContactPairs.interpolated(
        points,
        slave,
        (row, node, -value),
        position[middles],
        normals=normals,
        gap=gap,
        area=D,
        size=surface.size[ids],
        unpaired_slave=np.setdiff1d(surface.nodes, slave),
        unpaired_master=np.setdiff1d(masters, node),
        penetrating=np.flatnonzero(deep),
    )
