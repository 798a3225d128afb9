"""Smoothing by patches that also look at equilibrium: body force inside, tractions imposed on the surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray, stress_tensor
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.recovery.blocks import Recovered, StressBlock
from gibiane_ops.kernels.recovery.fits import FLAT, Samples
from gibiane_ops.kernels.recovery.patches import lending, patch_nodes
from gibiane_ops.kernels.recovery.samples import superconvergent_samples

BALANCE, SURFACE = 1.0, 1.0
"""Weights of the equilibrium of a patch and of each facet of its surface; a sample has one."""

CHUNK = 4096


@dataclass(frozen=True, eq=False)
class Surface:
    """What is known on facets of the surface.

    Attributes
    ----------
    cell : (k,) int64
        Cell of each facet, counted through the blocks.
    centre, normal, traction : (k, d) float64
        Middle, outward unit normal, imposed traction there.
    known : (k, d, d) float64
        Projector on the directions in which the traction is known.
    """

    cell: IntArray
    centre: FloatArray
    normal: FloatArray
    traction: FloatArray
    known: FloatArray


def enriched_recovery(
    points: FloatArray, blocks: Sequence[StressBlock], body: FloatArray, surface: Surface
) -> Recovered:
    """Smooth by superconvergent patches with equilibrium and boundary tractions (SPRE).

    Parameters
    ----------
    points : (n_points, d) float64, length
    blocks : list of StressBlock
        Linear elements of one solid.
    body : (d,) float64, force / length^d
    surface : Surface

    Returns
    -------
    Recovered

    Raises
    ------
    BadValue
        Elements of second degree.

    Notes
    -----
    In each patch all the components are linear together and minimise ``sum |s - s_h|^2`` over the superconvergent
    points, plus ``r^2 |div s + f|^2`` for the mean radius r of the points, once for each of them, plus ``|s n - t|^2``
    at the middle of each facet of the surface that its elements have. Patches stand about the corners inside and are
    lent to the surface, as in `patches.patch_recovery`.

    Source
    ------
    Wiberg, Abdulwahab and Ziukas 1994.

    Cost
    ----
    One symmetric matrix of 24 unknowns a patch in space, 12 in a plane.
    """
    if any(block.shape.degree > 1 for block in blocks):
        raise BadValue("degree", 2, "1: patches with equilibrium are made for linear elements")
    n_points, dim = points.shape
    c = blocks[0].stress.shape[2]
    mesh = [(block.shape.name, block.cells) for block in blocks]
    used = topology.used_nodes([cells for _, cells in mesh])
    inner, own = patch_nodes(mesh, used, n_points)
    star = topology.node_to_cells(mesh, n_points)
    samples = Samples.around(own, star, [superconvergent_samples(points, block) for block in blocks])
    p = len(own)
    count = np.bincount(samples.patch, minlength=p)
    centre = _sums(samples.patch, samples.places, p) / count[:, None]
    offset = samples.places - centre[samples.patch]
    radius = np.sqrt(_sums(samples.patch, (offset**2).sum(axis=1, keepdims=True), p)[:, 0] / count / dim)
    radius = np.where(radius > 0, radius, 1.0)
    y = np.hstack([np.ones((len(offset), 1)), offset / radius[samples.patch, None]])
    gram = _sums(samples.patch, (y[:, :, None] * y[:, None]).reshape(len(y), -1), p).reshape(p, dim + 1, dim + 1)
    spread = np.linalg.eigvalsh(gram[:, 1:, 1:] / count[:, None, None] - _outer(gram[:, 0, 1:] / count[:, None]))
    failed = spread[:, 0] <= FLAT * spread[:, -1]
    right = _sums(samples.patch, (y[:, :, None] * samples.values[:, None]).reshape(len(y), -1), p).reshape(
        p, dim + 1, c
    )

    # Unknowns: function, then component.
    size = (dim + 1) * c
    A = np.einsum("pab,ij->paibj", gram, np.eye(c)).reshape(p, size, size)
    b = right.reshape(p, size)
    apply = stress_tensor(np.eye(c))[:, :dim, :dim]
    divergence = np.zeros((dim, dim + 1, c))
    divergence[:, 1:] = apply.transpose(1, 2, 0)
    D = divergence.reshape(dim, size)
    A += (BALANCE * count)[:, None, None] * (D.T @ D)
    b = b - (BALANCE * count * radius)[:, None] * (D.T @ body)
    patch, facet = _facets_of(own, star, surface.cell, sum(len(block.cells) for block in blocks))
    for start in range(0, len(patch), CHUNK):
        q, f = patch[start : start + CHUNK], facet[start : start + CHUNK]
        at = np.hstack([np.ones((len(q), 1)), (surface.centre[f] - centre[q]) / radius[q, None]])
        across = np.einsum("kij,sjl,kl->kis", surface.known[f], apply, surface.normal[f], optimize=True)
        rows = (at[:, None, :, None] * across[:, :, None]).reshape(len(q), dim, size)
        np.add.at(A, q, SURFACE * np.matmul(rows.swapaxes(1, 2), rows))
        given = np.einsum("kij,kj->ki", surface.known[f], surface.traction[f])
        np.add.at(b, q, SURFACE * np.einsum("kir,ki->kr", rows, given))
    good = ~failed
    solution = np.zeros((p, dim + 1, c))
    solution[good] = np.linalg.solve(A[good], b[good][..., None]).reshape(-1, dim + 1, c)
    solution[failed, 0] = right[failed, 0] / count[failed, None]

    shares = lending(topology.node_graph(mesh, n_points).astype(bool), used, inner, own).tocoo()
    node, patch = shares.coords
    at = np.hstack([np.ones((len(node), 1)), (points[node] - centre[patch]) / radius[patch, None]])
    values = shares.data[:, None] * np.matmul(at[:, None], solution[patch])[:, 0]
    total = sp.csr_array((np.ones(len(node)), (node, np.arange(len(node)))), shape=(n_points, len(node))) @ values
    return Recovered(np.asarray(total, np.float64), int(failed.sum()))


def _sums(patch: IntArray, values: FloatArray, n: int) -> FloatArray:
    """Add up the rows of each patch; patches are increasing and none is empty."""
    first = np.searchsorted(patch, np.arange(n))
    return np.asarray(np.add.reduceat(values, first, axis=0), np.float64)


def _outer(v: FloatArray) -> FloatArray:
    return np.asarray(v[:, :, None] * v[:, None], np.float64)


def _facets_of(
    nodes: IntArray, star: tuple[IntArray, IntArray], cell: IntArray, n_cells: int
) -> tuple[IntArray, IntArray]:
    """Return the pairs of a patch and a facet of the surface of one of its cells."""
    indptr, cells = star
    length = indptr[nodes + 1] - indptr[nodes]
    start = np.cumsum(length) - length
    entry = np.arange(length.sum()) - np.repeat(start, length) + np.repeat(indptr[nodes], length)
    incidence = sp.csr_array(
        (np.ones(len(entry), np.int32), (np.repeat(np.arange(len(nodes)), length), cells[entry])),
        shape=(len(nodes), n_cells),
    )
    owners = sp.csr_array((np.ones(len(cell), np.int32), (cell, np.arange(len(cell)))), shape=(n_cells, len(cell)))
    patch, facet = (incidence @ owners).nonzero()
    order = np.argsort(patch, kind="stable")
    return patch[order].astype(np.int64), facet[order].astype(np.int64)
