"""Explicit residuals: what the finite-element stress leaves of the balance inside cells and across facets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray, IntArray, stress_tensor
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.hanging import pieces_of_facets
from gibiane_ops.kernels.recovery import StressBlock, extrapolate
from gibiane_ops.kernels.topology import Facets, faces_of, facet_families

INTERIOR = 1.0 / 24.0
"""Constant of the residual inside linear cells; divided by the square of the degree."""

FACETS = 1.0 / 24.0
"""Constant of the jumps across facets and of the residual on the boundary; divided by the degree."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """Squared residuals, shared between the cells; one array for each block.

    Attributes
    ----------
    interior : list of (m,) float64, energy
        ``C (h / p)^2 / E int |div sigma_h + f|^2``.
    jumps : list of (m,) float64, energy
        Half of ``C h / p / E int |[sigma_h n]|^2`` for each inner facet of a cell.
    boundary : list of (m,) float64, energy
        ``C h / p / E int |t - sigma_h n|^2`` over the facets with imposed tractions.
    """

    interior: list[FloatArray]
    jumps: list[FloatArray]
    boundary: list[FloatArray]

    @property
    def total(self) -> list[FloatArray]:
        """Sum of the three, by cell."""
        return [a + b + c for a, b, c in zip(self.interior, self.jumps, self.boundary, strict=True)]


def residuals(
    points: FloatArray,
    blocks: Sequence[StressBlock],
    modulus: Sequence[FloatArray],
    body: FloatArray,
    traction: Mapping[str, FloatArray],
    free: Mapping[str, FloatArray],
    *,
    interior: float = INTERIOR,
    facets: float = FACETS,
    axisymmetric: bool = False,
) -> Residuals:
    """Measure the residuals of equilibrium of a stress.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    blocks : list of StressBlock
        Linear elements and those of second degree, all the solids together.
    modulus : list of (m,) float64, force / length^2
        Young's modulus of the cells of each block.
    body : (dim,) float64, force / length^3
        Body force.
    traction : dict of str to (k, n, dim) float64, force / length^2
        Imposed tractions at the nodes of the facets of `hanging.outer_boundary` of these blocks, in its order.
    free : dict of str to (k, dim, dim) float64
        Projectors on the directions in which displacements are prescribed there: no residual in them.
    interior, facets : float
        Constants C of the two kinds.
    axisymmetric : bool
        Cells are sections of a body of revolution, over the whole of which the integrals go; zz is the hoop stress.

    Returns
    -------
    Residuals

    Notes
    -----
    ``eta_K^2 = C (h_K / p)^2 / E int |div sigma_h + f|^2 + 1/2 sum_F C h_F / p / E int |[sigma_h n]|^2`` with h the
    largest distance between corners and p the degree, on a facet the higher of its two cells; boundary facets count
    whole. Small cells beside a large one (hanging nodes) share its facet. Between its points sigma_h is what
    `recovery.extrapolate` builds: the stress itself on cells with straight edges (QUA8, CU20: parallelepipeds). Round
    an axis the divergence holds ``(s_rr - s_tt) / r`` and ``s_rz / r``. The true error is below a multiple of eta that
    depends on the shapes of the elements and is not known: an estimate, not a bound.

    Source
    ------
    Babuska and Rheinboldt 1978; Kelly, Gago, Zienkiewicz and Babuska 1983 (part II: the powers of p).

    Cost
    ----
    One sort of the facets; no system is solved.
    """
    dim = points.shape[1]
    cuts = np.cumsum([len(block.cells) for block in blocks])[:-1]
    tensors = [stress_tensor(extrapolate(block.shape, block.stress)) for block in blocks]
    inside = [
        interior / block.shape.degree**2 * _size(block.shape, points[block.cells]) ** 2 / E
        * _interior(points, block, values, body, axisymmetric)
        for block, values, E in zip(blocks, tensors, modulus, strict=True)
    ]  # fmt: skip
    young = np.concatenate(list(modulus))
    degree = np.concatenate([np.full(len(block.cells), block.shape.degree) for block in blocks])
    across, outside = np.zeros(len(young)), np.zeros(len(young))
    every = faces_of([(block.shape.name, block.cells) for block in blocks])
    for family, group, first in facet_families(every):
        of = max((shape(name) for name in family), key=lambda each: each.degree)
        found = [_on_facets(every[name], blocks, tensors)[..., :dim, :dim] for name in family]
        T = np.concatenate([_completed(of, values) for values in found])
        X = np.concatenate([_completed(of, points[every[name].nodes]) for name in family])
        corners = np.concatenate([every[name].nodes[:, : of.n_corners] for name in family])
        cell = np.concatenate([every[name].cell for name in family])
        count = np.bincount(group)
        second = np.setdiff1d(np.arange(len(group)), first, assume_unique=True)
        one, two = first[group[second]], second
        gap = T[one] - _aligned(of, T[two], corners[two], corners[one])
        edge = np.flatnonzero(count[group] == 1)
        piece, whole, weights = _pieces(points, family, [every[name].nodes for name in family], edge)
        if len(piece):
            # the stress of the large cell at the nodes of the facets of the small ones
            c = of.n_corners
            large = np.einsum("kab,kbij->kaij", weights, T[whole, :c])
            gap = np.concatenate([gap, T[piece] - _completed(of, large)])
            one, two = np.concatenate([one, piece]), np.concatenate([two, whole])
            edge = np.setdiff1d(edge, np.concatenate([piece, whole]))
        pair = cell[one], cell[two]
        C = facets * _size(of, X[one]) / np.maximum(degree[pair[0]], degree[pair[1]])
        jump = C * _square(of, X[one], gap, None, axisymmetric) * 2 / (young[pair[0]] + young[pair[1]])
        for each in pair:
            across += np.bincount(each, jump / 2, minlength=len(across))
        if len(edge):
            here = [name for name in family if name in traction]
            imposed = np.concatenate([_completed(of, traction[name]) for name in here])
            kept = np.eye(dim) - np.concatenate([free[name] for name in here])
            C = facets * _size(of, X[edge]) / degree[cell[edge]]
            value = C * _square(of, X[edge], T[edge], (imposed, kept), axisymmetric) / young[cell[edge]]
            outside += np.bincount(cell[edge], value, minlength=len(outside))
    return Residuals(inside, np.split(across, cuts), np.split(outside, cuts))


def _pieces(
    points: FloatArray, family: Sequence[str], nodes: Sequence[IntArray], alone: IntArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the facets that are pieces of others among those of one cell only, see `hanging.pieces_of_facets`."""
    start = 0
    for name, each in zip(family, nodes, strict=True):
        if name in ("SEG2", "QUA4"):
            rows = alone[(alone >= start) & (alone < start + len(each))]
            piece, whole, weights = pieces_of_facets(points, each[rows - start])
            return rows[piece], rows[whole], weights
        start += len(each)
    none = np.zeros(0, np.int64)
    return none, none, np.zeros((0, 1, 1))


def _size(of: Shape, X: FloatArray) -> FloatArray:
    """Return the largest distance between corners of each cell."""
    corners = X[:, : of.n_corners]
    return np.asarray(np.linalg.norm(corners[:, :, None] - corners[:, None], axis=-1).max(axis=(1, 2)), np.float64)


def _interior(
    points: FloatArray, block: StressBlock, tensors: FloatArray, body: FloatArray, axisymmetric: bool
) -> FloatArray:
    """Integrate ``|div sigma_h + f|^2`` over each cell, sigma_h the interpolation of its values at the points."""
    X, dim = points[block.cells], points.shape[1]
    xi, weights = block.shape.gauss
    gradient, det = geometry.gradients(block.shape, X, xi)
    left = np.einsum("mqaj,maij->mqi", gradient, tensors[..., :dim, :dim], optimize=True) + body
    measure = det * weights
    if axisymmetric:
        N = block.shape.N(xi)
        at = np.matmul(N, tensors.reshape(*tensors.shape[:2], 9)).reshape(len(X), len(xi), 3, 3)
        hoop = np.stack([at[..., 0, 0] - at[..., 2, 2], at[..., 0, 1]], axis=-1)
        left += hoop / np.matmul(N, X[:, :, :1])
        measure = measure * geometry.circumferences(block.shape, X, xi)
    return np.asarray(((left**2).sum(axis=2) * measure).sum(axis=1), np.float64)


def _on_facets(facets: Facets, blocks: Sequence[StressBlock], tensors: Sequence[FloatArray]) -> FloatArray:
    """Return the stress tensors of the cells of facets at the nodes of these facets, (k, n, 3, 3)."""
    found = np.empty((*facets.nodes.shape, 3, 3))
    start = 0
    for block, values in zip(blocks, tensors, strict=True):
        rows = np.flatnonzero((facets.cell >= start) & (facets.cell < start + len(block.cells)))
        cell = facets.cell[rows] - start
        place = (block.cells[cell][:, None] == facets.nodes[rows][:, :, None]).argmax(axis=2)
        found[rows] = values[cell[:, None], place]
        start += len(block.cells)
    return found


def _completed(of: Shape, values: FloatArray) -> FloatArray:
    """Give values at the nodes of linear facets, (k, n, ...), mid-nodes too where `of` has them: means of the ends."""
    if values.shape[1] == of.n_nodes:
        return values
    ends = np.array([edge[:2] for edge in of.edges])
    return np.concatenate([values, values[:, ends].mean(axis=2)], axis=1)


def _aligned(of: Shape, values: FloatArray, corners: IntArray, target: IntArray) -> FloatArray:
    """Bring nodal values of facets, (k, n, ...), into the order that the nodes have on the other side."""
    order = (corners[:, None] == target[:, :, None]).argmax(axis=2)
    if of.n_nodes > of.n_corners:
        side = np.zeros((of.n_corners, of.n_corners), np.int64)
        for a, b, middle in of.edges:
            side[a, b] = side[b, a] = middle
        ends = np.array([edge[:2] for edge in of.edges])
        order = np.hstack([order, side[order[:, ends[:, 0]], order[:, ends[:, 1]]]])
    return np.asarray(values[np.arange(len(values))[:, None], order], np.float64)


def _square(
    of: Shape, X: FloatArray, tensors: FloatArray, imposed: tuple[FloatArray, FloatArray] | None, axisymmetric: bool
) -> FloatArray:
    """Integrate ``|sigma n|^2`` over each facet, or ``|P (t - sigma n)|^2`` with t and P imposed there."""
    xi, weights = of.mass_gauss
    normal = geometry.normal_densities(of, X, xi)
    size = np.linalg.norm(normal, axis=2)
    N, (k, n, dim, _) = of.N(xi), tensors.shape
    at = np.matmul(N, tensors.reshape(k, n, dim * dim)).reshape(k, len(xi), dim, dim)
    flux = np.matmul(at, (normal / size[..., None])[..., None])[..., 0]
    if imposed is not None:
        traction, kept = imposed
        flux = np.matmul(np.matmul(N, traction) - flux, kept)
    measure = size * weights
    if axisymmetric:
        measure = measure * geometry.circumferences(of, X, xi)
    return np.asarray(((flux**2).sum(axis=2) * measure).sum(axis=1), np.float64)
