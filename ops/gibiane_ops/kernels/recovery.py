"""Smoothed stresses: from values at integration points to a continuous field at the nodes of one solid.

Each function works on one solid at a time: a stress is never smoothed across two materials or across a contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels import assembly, geometry, topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.errors import BadValue, NotConverged

CG_TOLERANCE = 1e-13
"""Relative residual of the conjugate gradients of the projection."""

RANK_LIMIT = 1e-8
"""A patch whose normal matrix, scaled to a unit diagonal, has a smaller ratio of eigenvalues is not fitted."""

METHODS = ("MOYE", "MOYC", "PROJ", "LUMP", "SPR")


class StressBlock(NamedTuple):
    """Cells of one shape with their stresses.

    Attributes
    ----------
    shape : Shape
    cells : (m, n_nodes) int64
        Node ids.
    stress : (m, q, c) float64
        Values at the q points of the stiffness rule of the shape.
    """

    shape: Shape
    cells: IntArray
    stress: FloatArray


@dataclass(frozen=True, eq=False)
class Recovered:
    """A smoothed field.

    Attributes
    ----------
    nodal : (n_points, c) float64
        Values at the nodes; zero at points that are not nodes of the solid.
    fallbacks : int
        Nodes whose patch could not be fitted and took the mean of their elements instead; 0 except for SPR.
    """

    nodal: FloatArray
    fallbacks: int = 0


def extrapolate(shape: Shape, values: FloatArray) -> FloatArray:
    """Extend values at the stiffness points of each cell to its nodes.

    Parameters
    ----------
    shape : Shape
    values : (m, q, c) float64

    Returns
    -------
    (m, n_nodes, c) float64

    Notes
    -----
    The nodal values of the interpolation that takes the given values at the points: trilinear through the 8 points
    for CUB8, constant for a simplex with one point. Where points and nodes differ in number, the one of least norm
    and least squares (pseudo-inverse).

    Source
    ------
    Hinton and Campbell 1974.
    """
    return np.asarray(np.matmul(np.linalg.pinv(shape.N(shape.gauss[0])), values), np.float64)


def centre_values(shape: Shape, values: FloatArray) -> FloatArray:
    """Give the value at the centre of each cell of what `extrapolate` builds.

    Parameters
    ----------
    shape : Shape
    values : (m, q, c) float64

    Returns
    -------
    (m, c) float64
    """
    centre = shape.ref_nodes[: shape.n_corners].mean(axis=0, keepdims=True)
    weights = shape.N(centre) @ np.linalg.pinv(shape.N(shape.gauss[0]))
    return np.asarray(np.matmul(weights, values)[:, 0], np.float64)


def nodal_mean(n_points: int, cells: Sequence[IntArray], values: Sequence[FloatArray]) -> FloatArray:
    """Average element values at the nodes, every element counting once.

    Parameters
    ----------
    n_points : int
    cells : list of (m, n_nodes) int64
    values : list of (m, n_nodes, c) float64
        Values of each element at its own nodes.

    Returns
    -------
    (n_points, c) float64
        Zero where no element arrives.
    """
    total = assembly.assemble_vector(n_points, values[0].shape[2], list(zip(cells, values, strict=True)))
    count = np.bincount(np.concatenate([each.ravel() for each in cells]), minlength=n_points)
    return np.asarray(total.reshape(n_points, -1) / np.maximum(count, 1)[:, None], np.float64)


def mean_of_nodes(n_points: int, blocks: Sequence[StressBlock]) -> FloatArray:
    """Smooth by the nodal mean of extrapolated stresses (MOYE).

    Parameters
    ----------
    n_points : int
    blocks : list of StressBlock

    Returns
    -------
    (n_points, c) float64
    """
    values = [extrapolate(block.shape, block.stress) for block in blocks]
    return nodal_mean(n_points, [block.cells for block in blocks], values)


def mean_of_centres(n_points: int, blocks: Sequence[StressBlock]) -> FloatArray:
    """Smooth by the nodal mean of the stresses at the centres of the elements (MOYC).

    Parameters
    ----------
    n_points : int
    blocks : list of StressBlock

    Returns
    -------
    (n_points, c) float64
    """
    values = [
        np.repeat(centre_values(block.shape, block.stress)[:, None], block.shape.n_nodes, axis=1) for block in blocks
    ]
    return nodal_mean(n_points, [block.cells for block in blocks], values)


def project(points: FloatArray, blocks: Sequence[StressBlock], *, lumped: bool = False) -> FloatArray:
    """Smooth by projection on the continuous interpolation, in the L2 norm (PROJ, or LUMP).

    Parameters
    ----------
    points : (n_points, dim) float64, length
    blocks : list of StressBlock
    lumped : bool
        Replace the mass matrix by the sum of its rows.

    Returns
    -------
    (n_points, c) float64

    Raises
    ------
    NotConverged
        When the conjugate gradients stall.

    Notes
    -----
    ``M s = int N^T sigma_h`` with the mass matrix of one scalar, each component in turn; sigma_h between its points is
    what `extrapolate` builds.

    Source
    ------
    Zienkiewicz and Zhu 1987.

    Cost
    ----
    Some twenty products by M for each component.
    """
    n_points, c = len(points), blocks[0].stress.shape[2]
    masses = [(block.cells, assembly.element_mass(block.shape, points[block.cells])) for block in blocks]
    # sigma_h is an interpolation of nodal values: the element mass matrix integrates N^T sigma_h as it is.
    loads = [
        (block.cells, np.matmul(mass, extrapolate(block.shape, block.stress)))
        for block, (_, mass) in zip(blocks, masses, strict=True)
    ]
    b = assembly.assemble_vector(n_points, c, loads).reshape(n_points, c)
    M = sp.csr_matrix(assembly.assemble(n_points, 1, masses))
    used = np.unique(np.concatenate([block.cells.ravel() for block in blocks]))
    nodal = np.zeros((n_points, c))
    if lumped:
        nodal[used] = b[used] / np.asarray(M.sum(axis=1)).reshape(n_points, 1)[used]
    else:
        nodal[used] = _conjugate_gradients(M[used][:, used], b[used])
    return nodal


def _conjugate_gradients(A: sp.csr_matrix, b: FloatArray) -> FloatArray:
    """Solve for several right-hand sides with a diagonal preconditioner; mass matrices need few iterations."""
    from scipy.sparse.linalg import cg

    inverse_diagonal = sp.diags(1.0 / A.diagonal())
    x = np.zeros_like(b)
    for k in range(b.shape[1]):
        x[:, k], failed = cg(A, b[:, k], rtol=CG_TOLERANCE, maxiter=1000, M=inverse_diagonal)
        if failed:
            residual = float(np.linalg.norm(A @ x[:, k] - b[:, k]) / np.linalg.norm(b[:, k]))
            raise NotConverged([residual], x)
    return x


def patch_recovery(points: FloatArray, blocks: Sequence[StressBlock]) -> Recovered:
    """Smooth by superconvergent patches with linear polynomials (SPR).

    Parameters
    ----------
    points : (n_points, dim) float64, length
    blocks : list of StressBlock

    Returns
    -------
    Recovered

    Notes
    -----
    About each node inside the solid, the linear polynomial nearest (least squares) to the stresses at the centres of
    its elements. A node of the surface takes the mean of the polynomials of the inner nodes that share an element
    with it, or those of the next ring of nodes, and so on: a patch of its own would be one-sided and often of
    deficient rank. Only in a piece without any inner node does a node of the surface use its own elements.

    Source
    ------
    Zienkiewicz and Zhu 1992.

    Cost
    ----
    Batched 4 x 4 systems, one per inner node; no loop over nodes.
    """
    mesh = [(block.shape.name, block.cells) for block in blocks]
    values = np.vstack([centre_values(block.shape, block.stress) for block in blocks])
    centres = np.vstack([geometry.centroids(block.shape, points[block.cells]) for block in blocks])
    star = topology.node_to_cells(mesh, len(points))
    used = np.flatnonzero(np.diff(star[0]))
    surface = np.concatenate([facets.nodes.ravel() for facets in topology.boundary(mesh).values()])
    inner = np.setdiff1d(used, surface)
    # A piece without any inner node has no polynomial to borrow: its nodes keep their own.
    count, piece = topology.solids(mesh, len(points))
    has_inner = np.zeros(count, bool)
    has_inner[piece[inner]] = True
    own = np.concatenate([inner, used[~has_inner[piece[used]]]])
    value, slope, failed = _linear_fits(points, star, own, centres, values)

    nodal = np.zeros((len(points), values.shape[1]))
    nodal[own] = value[own]
    lender = np.zeros(len(points), bool)
    lender[inner] = True
    pending = np.setdiff1d(used, own)
    graph = topology.node_graph(mesh, len(points)).astype(bool)
    reach = graph[pending]
    while len(pending):
        borrower, j = reach.nonzero()
        borrower, j = borrower[lender[j]], j[lender[j]]
        i = pending[borrower]
        fitted = value[j] + np.einsum("kcd,kd->kc", slope[j], points[i] - points[j])
        total = sp.csr_array((np.ones(len(i)), (borrower, np.arange(len(i)))), shape=(len(pending), len(i))) @ fitted
        n_lenders = np.bincount(borrower, minlength=len(pending))
        found = n_lenders > 0
        nodal[pending[found]] = total[found] / n_lenders[found][:, None]
        pending, reach = pending[~found], reach[~found] @ graph
    return Recovered(nodal, failed)


def _linear_fits(
    points: FloatArray, star: tuple[IntArray, IntArray], nodes: IntArray, centres: FloatArray, values: FloatArray
) -> tuple[FloatArray, FloatArray, int]:
    """Fit value + slope . (x - x_node) to the samples of the elements around each node of a list.

    Returns the values (n_points, c) and slopes (n_points, c, dim), and the number of nodes that took the mean.
    """
    n_points, dim = points.shape
    c = values.shape[1]
    value, slope = np.zeros((n_points, c)), np.zeros((n_points, c, dim))
    if len(nodes) == 0:
        return value, slope, 0
    indptr, cells = star
    length = indptr[nodes + 1] - indptr[nodes]
    first = np.r_[0, np.cumsum(length)[:-1]]
    row = np.repeat(np.arange(len(nodes)), length)
    sample = cells[np.arange(len(row)) - first[row] + indptr[nodes[row]]]
    offset = centres[sample] - points[nodes[row]]
    size = np.maximum.reduceat(np.linalg.norm(offset, axis=1), first)
    basis = np.hstack([np.ones((len(row), 1)), offset / size[row][:, None]])
    A = np.add.reduceat(basis[:, :, None] * basis[:, None, :], first)
    b = np.add.reduceat(basis[:, :, None] * values[sample][:, None, :], first)
    eigenvalues = np.linalg.eigvalsh(A)
    good = eigenvalues[:, 0] > RANK_LIMIT * eigenvalues[:, -1]
    value, slope = np.zeros((n_points, c)), np.zeros((n_points, c, dim))
    solved = np.linalg.solve(A[good], b[good])
    value[nodes[good]] = solved[:, 0]
    slope[nodes[good]] = solved[:, 1:].transpose(0, 2, 1) / size[good][:, None, None]
    value[nodes[~good]] = b[~good, 0] / A[~good, 0, 0][:, None]
    return value, slope, int((~good).sum())


def recover(points: FloatArray, blocks: Sequence[StressBlock], method: str = "SPR") -> Recovered:
    """Smooth the stresses of one solid by a named method.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    blocks : list of StressBlock
    method : {'MOYE', 'MOYC', 'PROJ', 'LUMP', 'SPR'}
        Nodal mean of extrapolated or of centre values, L2 projection (consistent or lumped), patch recovery.

    Returns
    -------
    Recovered

    Raises
    ------
    BadValue
        Unknown method.
    NotConverged
        PROJ only.
    """
    match method:
        case "MOYE":
            return Recovered(mean_of_nodes(len(points), blocks))
        case "MOYC":
            return Recovered(mean_of_centres(len(points), blocks))
        case "PROJ" | "LUMP":
            return Recovered(project(points, blocks, lumped=method == "LUMP"))
        case "SPR":
            return patch_recovery(points, blocks)
        case _:
            raise BadValue("method", method, f"one of {' '.join(METHODS)}")
