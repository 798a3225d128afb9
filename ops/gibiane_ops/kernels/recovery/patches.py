"""Smoothing by superconvergent patches: a polynomial about each corner inside the solid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels import connectivity, topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.recovery.blocks import Recovered, StressBlock
from gibiane_ops.kernels.recovery.fits import MULTILINEAR, Fits, Samples, fit
from gibiane_ops.kernels.recovery.samples import superconvergent_samples
from gibiane_ops.kernels.topology import Block

TENSOR = ("QUA4", "CUB8")
"""Elements whose own functions hold products of coordinates."""


def patch_recovery(
    points: FloatArray, blocks: Sequence[StressBlock], degree: int | None = None, *, full: bool = False
) -> Recovered:
    """Smooth by superconvergent patches (SPR).

    Parameters
    ----------
    points : (n_points, dim) float64, length
    blocks : list of StressBlock
    degree : int, optional
        Highest degree of the polynomials; that of the elements if absent.
    full : bool
        Take the functions of the elements where all those of a patch are QUA4 or CUB8: bilinear or trilinear, in the
        axes of the points. On linear simplices these are the linear ones.

    Returns
    -------
    Recovered

    Notes
    -----
    About each corner node inside the solid, the polynomial nearest (least squares) to the stresses at the
    superconvergent points of its elements: linear for linear elements, with all 6 or 10 quadratic terms for elements
    of second degree (linear where the two kinds meet). A corner of the surface takes the mean of the polynomials of
    the inner corners that share an element with it, or those of the next ring of corners, in space of the third: a
    patch of its own would be one-sided and often of deficient rank. With elements of second degree they share an edge
    with it, which in bricks leaves the nearest: a parabola goes wrong faster away from its patch. Only farther from any
    inner corner, in thin parts, does a corner of the surface use its own elements: of what is lent there the errors
    grow with the distance, or its square. A mid-node takes the mean of what the two ends of its edge use.

    Source
    ------
    Zienkiewicz and Zhu 1992.

    Cost
    ----
    Batches of small symmetric matrices (up to 6 x 6), one per inner corner; no loop over nodes.
    """
    mesh = [(block.shape.name, block.cells) for block in blocks]
    patches = Patches.of(mesh, len(points))
    highest = np.full(len(points), 2 if degree is None else degree)
    lower_to_elements(highest, blocks)
    if full:
        tensor = np.ones(len(points), bool)
        for block in blocks:
            tensor[block.cells] &= block.shape.name in TENSOR
        highest[tensor] = MULTILINEAR
    sampled = [superconvergent_samples(points, block) for block in blocks]
    fits = fit(Samples.around(patches.own, patches.star, sampled), highest[patches.own])
    return Recovered(patches.lent(points, fits), int(fits.failed.sum()), int(fits.flattened.sum()))


@dataclass(frozen=True, eq=False)
class Patches:
    """The corners that have a patch, and what the others take of it.

    Attributes
    ----------
    own : (p,) int64
        The corners inside, and these that need a patch of their own.
    star : (indptr, cells)
        Cells around each corner, see `connectivity.node_to_cells`.
    shares : (n_points, p) csr_array
        Share of each patch in the value at each node; rows of nodes sum to 1.
    """

    own: IntArray
    star: tuple[IntArray, IntArray]
    shares: sp.csr_array

    @classmethod
    def of(cls, blocks: Sequence[Block], n_points: int) -> Patches:
        """Place the patches of the elements of one solid."""
        mesh = topology.corner_blocks(blocks)
        used = topology.used_nodes([corners for _, corners in mesh])
        straight = all(shape(name).degree == 1 for name, _ in blocks)
        graph = (connectivity.node_graph(mesh, n_points) if straight else _edge_graph(mesh, n_points)).astype(bool)
        inner, own = patch_nodes(mesh, used, graph)
        weights = lending(graph, used, inner, own)
        shares = sp.csr_array(weights + _middles(blocks, n_points) @ weights)
        return cls(own, connectivity.node_to_cells(mesh, n_points), shares)

    def lent(self, points: FloatArray, fits: Fits) -> FloatArray:
        """Evaluate the polynomials of the patches at the nodes that take them, (n_points, c)."""
        shares = self.shares.tocoo()
        node, patch = shares.coords
        fitted = shares.data[:, None] * fits.at(patch, points[node])
        total = sp.csr_array((np.ones(len(node)), (node, np.arange(len(node)))), shape=(len(points), len(node)))
        return np.asarray(total @ fitted, np.float64)


def lower_to_elements(degree: IntArray, blocks: Sequence[StressBlock]) -> None:
    """Lower degrees at nodes, (n_points,), in place, to those of the elements around them."""
    for block in blocks:
        degree[block.cells] = np.minimum(degree[block.cells], block.shape.degree)


def patch_nodes(mesh: Sequence[Block], used: IntArray, graph: sp.csr_array) -> tuple[IntArray, IntArray]:
    """Return the corners inside the solid, and these with the corners that need a patch of their own."""
    surface = np.concatenate([facets.nodes.ravel() for facets in topology.boundary(mesh).values()])
    inner = np.setdiff1d(used, surface)
    # Far from any inner corner, in thin parts, there is no polynomial to borrow: one has as many rings as the
    # corner of a box needs to reach its inside along edges.
    near = np.zeros(graph.shape[0], bool)
    near[inner] = True
    for _ in range(shape(mesh[0][0]).dim):
        near = graph @ near
    return inner, np.concatenate([inner, used[~near[used]]])


def _edge_graph(mesh: Sequence[Block], n_points: int) -> sp.csr_array:
    """Return the graph of the corners joined by an edge, each joined to itself too."""
    first, second = topology.edges(mesh).T
    links = sp.csr_array((np.ones(len(first), np.int32), (first, second)), shape=(n_points, n_points))
    return sp.csr_array(links + links.T + sp.eye_array(n_points, dtype=np.int32))


def lending(graph: sp.csr_array, used: IntArray, inner: IntArray, own: IntArray) -> sp.csr_array:
    """Return the share of each patch in the value at each corner, (n_points, n_patches); rows of corners sum to 1."""
    n_points = graph.shape[0]
    patch = np.full(n_points, -1)
    patch[own] = np.arange(len(own))
    lender = np.zeros(n_points, bool)
    lender[inner] = True
    rows, columns, shares = [own], [patch[own]], [np.ones(len(own))]
    pending = np.setdiff1d(used, own)
    reach = graph[pending]
    while len(pending):
        borrower, j = reach.nonzero()
        borrower, j = borrower[lender[j]], j[lender[j]]
        n_lenders = np.bincount(borrower, minlength=len(pending))
        rows.append(pending[borrower])
        columns.append(patch[j])
        shares.append(1.0 / n_lenders[borrower])
        alone = n_lenders == 0
        pending, reach = pending[alone], reach[alone] @ graph
    entries = np.concatenate(shares), (np.concatenate(rows), np.concatenate(columns))
    return sp.csr_array(entries, shape=(n_points, len(own)))


def _middles(blocks: Sequence[Block], n_points: int) -> sp.csr_array:
    """Return the matrix of the means over the two ends of the edge of each mid-node, (n_points, n_points)."""
    edges = topology.middles(blocks)
    rows = np.repeat(edges[:, 2], 2)
    return sp.csr_array((np.full(len(rows), 0.5), (rows, edges[:, :2].ravel())), shape=(n_points, n_points))
