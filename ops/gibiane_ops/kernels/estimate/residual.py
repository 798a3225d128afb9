"""Explicit residuals: what the finite-element stress leaves of the balance inside cells and across facets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels import geometry, integrals
from gibiane_ops.kernels.arrays import FloatArray, IntArray, stress_tensor
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.recovery import StressBlock, extrapolate
from gibiane_ops.kernels.topology import Facets, faces_of, group_by_nodes

INTERIOR = 1.0 / 24.0
"""Constant of the residual inside cells."""

FACETS = 1.0 / 24.0
"""Constant of the jumps across facets and of the residual on the boundary."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """Squared residuals, shared between the cells; one array for each block.

    Attributes
    ----------
    interior : list of (m,) float64, energy
        ``C h^2 / E int |div sigma_h + f|^2``.
    jumps : list of (m,) float64, energy
        Half of ``C h / E int |[sigma_h n]|^2`` for each inner facet of a cell.
    boundary : list of (m,) float64, energy
        ``C h / E int |t - sigma_h n|^2`` over the facets with imposed tractions.
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
) -> Residuals:
    """Measure the residuals of equilibrium of a stress.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    blocks : list of StressBlock
        Linear elements, all the solids together.
    modulus : list of (m,) float64, force / length^2
        Young's modulus of the cells of each block.
    body : (dim,) float64, force / length^3
        Body force.
    traction : dict of str to (k, n, dim) float64, force / length^2
        Imposed tractions at the nodes of the facets of `topology.boundary` of these blocks, in its order.
    free : dict of str to (k, dim, dim) float64
        Projectors on the directions in which displacements are prescribed there: no residual in them.
    interior, facets : float
        Constants C of the two kinds.

    Returns
    -------
    Residuals

    Notes
    -----
    ``eta_K^2 = C h_K^2 / E int |div sigma_h + f|^2 + 1/2 sum_F C h_F / E int |[sigma_h n]|^2`` with h the largest
    distance between corners; boundary facets count whole. The true error is below a multiple of eta that depends on
    the shapes of the elements and is not known: an estimate, not a bound.

    Source
    ------
    Babuska and Rheinboldt 1978; Kelly, Gago, Zienkiewicz and Babuska 1983.

    Cost
    ----
    One sort of the facets; no system is solved.
    """
    dim = points.shape[1]
    sizes = [len(block.cells) for block in blocks]
    nodal = [extrapolate(block.shape, block.stress) for block in blocks]
    inside = [
        interior * _size(block.shape, points[block.cells]) ** 2 / E * _interior(points, block, values, body)
        for block, values, E in zip(blocks, nodal, modulus, strict=True)
    ]
    young = np.concatenate(list(modulus))
    across, outside = np.zeros(len(young)), np.zeros(len(young))
    mesh = [(block.shape.name, block.cells) for block in blocks]
    for name, every in faces_of(mesh).items():
        of = shape(name)
        X = points[every.nodes]
        group, first = group_by_nodes(every.nodes[:, : of.n_corners])
        normal = geometry.facet_normals(of, X)
        flux = np.einsum("kaij,kj->kai", _on_facets(every, blocks, nodal)[..., :dim, :dim], normal)
        weight = facets * _size(of, X)
        count = np.bincount(group)
        second = np.setdiff1d(np.arange(len(group)), first, assume_unique=True)
        one, two = first[group[second]], second
        gap = flux[one] + _aligned(flux[two], every.nodes[two], every.nodes[one])
        pair = every.cell[one], every.cell[two]
        jump = weight[one] * _square(of, X[one], gap) * 2 / (young[pair[0]] + young[pair[1]])
        for cell in pair:
            across += np.bincount(cell, jump / 2, minlength=len(across))
        edge = np.flatnonzero(count[group] == 1)
        if len(edge):
            left = traction[name] - flux[edge]
            left -= np.einsum("kij,kaj->kai", free[name], left)
            cell = every.cell[edge]
            value = weight[edge] * _square(of, X[edge], left) / young[cell]
            outside += np.bincount(cell, value, minlength=len(outside))
    cuts = np.cumsum(sizes)[:-1]
    return Residuals(inside, np.split(across, cuts), np.split(outside, cuts))


def _size(of: Shape, X: FloatArray) -> FloatArray:
    """Return the largest distance between corners of each cell."""
    corners = X[:, : of.n_corners]
    return np.asarray(np.linalg.norm(corners[:, :, None] - corners[:, None], axis=-1).max(axis=(1, 2)), np.float64)


def _interior(points: FloatArray, block: StressBlock, nodal: FloatArray, body: FloatArray) -> FloatArray:
    """Integrate ``|div sigma_h + f|^2`` over each cell, sigma_h the interpolation of its values at the points."""
    X, dim = points[block.cells], points.shape[1]
    xi, weights = block.shape.gauss
    gradient, det = geometry.gradients(block.shape, X, xi)
    tensor = stress_tensor(nodal)[..., :dim, :dim]
    left = np.einsum("mqaj,maij->mqi", gradient, tensor, optimize=True) + body
    return np.asarray(((left**2).sum(axis=2) * det * weights).sum(axis=1), np.float64)


def _on_facets(facets: Facets, blocks: Sequence[StressBlock], nodal: Sequence[FloatArray]) -> FloatArray:
    """Return the stress tensors of the cells of facets at the nodes of these facets, (k, n, 3, 3)."""
    found = np.empty((*facets.nodes.shape, 3, 3))
    start = 0
    for block, values in zip(blocks, nodal, strict=True):
        rows = np.flatnonzero((facets.cell >= start) & (facets.cell < start + len(block.cells)))
        cell = facets.cell[rows] - start
        place = (block.cells[cell][:, None] == facets.nodes[rows][:, :, None]).argmax(axis=2)
        found[rows] = stress_tensor(values[cell[:, None], place])
        start += len(block.cells)
    return found


def _aligned(values: FloatArray, nodes: IntArray, target: IntArray) -> FloatArray:
    """Bring nodal values of facets into the order that the nodes have on the other side."""
    order = (nodes[:, None] == target[:, :, None]).argmax(axis=2)
    return np.asarray(np.take_along_axis(values, order[:, :, None], axis=1), np.float64)


def _square(of: Shape, X: FloatArray, values: FloatArray) -> FloatArray:
    """Integrate the square of nodal vectors interpolated over each facet."""
    mass = integrals.element_mass(of, X)
    return np.asarray((np.matmul(mass, values) * values).sum(axis=(1, 2)), np.float64)
