"""Smoothing by patches that also look at equilibrium: body force inside, tractions imposed on the surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray, IntArray, component_of, stress_tensor
from gibiane_ops.kernels.recovery.blocks import Recovered, StressBlock
from gibiane_ops.kernels.recovery.fits import Fits, Samples, ranges
from gibiane_ops.kernels.recovery.orthonormal import Basis
from gibiane_ops.kernels.recovery.patches import Patches, lower_to_elements
from gibiane_ops.kernels.recovery.samples import superconvergent_samples

BALANCE, SURFACE = 1.0, 1.0
"""Weights of the equilibrium at each sample and of each point of the surface; a sample has one."""

CHUNK = 256
"""Patches, and points of the surface times 16, worked on at a time."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What is known at points of the surface.

    Attributes
    ----------
    cell : (k,) int64
        Cell that each point is on, counted through the blocks.
    place, normal, traction : (k, d) float64
        Where, outward unit normal, imposed traction there.
    known : (k, d, d) float64
        Projector on the directions in which the traction is known.
    """

    cell: IntArray
    place: FloatArray
    normal: FloatArray
    traction: FloatArray
    known: FloatArray


def enriched_recovery(
    points: FloatArray,
    blocks: Sequence[StressBlock],
    body: FloatArray,
    surface: Surface,
    *,
    axisymmetric: bool = False,
) -> Recovered:
    """Smooth by superconvergent patches with equilibrium and boundary tractions (SPRE).

    Parameters
    ----------
    points : (n_points, d) float64, length
    blocks : list of StressBlock
        Elements of one solid.
    body : (d,) float64, force / length^d
    surface : Surface
        Middles of linear facets; some points of those of second degree.
    axisymmetric : bool
        Cells are sections of a body of revolution; zz is the hoop stress.

    Returns
    -------
    Recovered

    Notes
    -----
    In each patch all the components are polynomials together, of the degree of the elements, and minimise
    ``sum |s - s_h|^2 + r^2 |div s + f|^2`` over the superconvergent points, r their mean distance from the middle, plus
    ``|s n - t|^2`` at the points of the surface that its elements have. Round an axis the divergence holds
    ``(s_rr - s_tt) / r`` and ``s_rz / r``. Patches stand about the corners inside and are lent to the surface, and
    curvatures that the samples do not determine are left out, as in `patches.patch_recovery`.

    Source
    ------
    Wiberg, Abdulwahab and Ziukas 1994.

    Cost
    ----
    One symmetric matrix a patch: of 24 unknowns in space, 12 in a plane, with elements of second degree 60 and 24.
    """
    (n_points, dim), c = points.shape, blocks[0].stress.shape[2]
    patches = Patches.of([(block.shape.name, block.cells) for block in blocks], n_points)
    highest = np.full(n_points, 2)
    lower_to_elements(highest, blocks)
    sampled = [superconvergent_samples(points, block) for block in blocks]
    samples = Samples.around(patches.own, patches.star, sampled)
    indptr, on_surface = _points_of(patches, surface.cell, sum(len(block.cells) for block in blocks))
    fits = Fits.zero(len(patches.own), dim, c)
    for alike, places, values, degree in samples.alike(highest[patches.own]):
        for start in range(0, len(alike), CHUNK):
            some = slice(start, start + CHUNK)
            basis = Basis.over(places[some], degree)
            A, b = _normal_equations(basis, places[some], values[some], body, axisymmetric)
            first = indptr[alike[some]]
            patch, entry = ranges(first, indptr[alike[some] + 1] - first)
            _add_tractions(A, b, basis, surface, patch, on_surface[entry])
            coefficients = np.asarray(np.linalg.solve(A, b[..., None]), np.float64).reshape(len(b), -1, c)
            # the mean alone of a patch without slopes: equilibrium has nothing to say about it
            failed = ~basis.kept[:, 1]
            coefficients[failed] = 0.0
            coefficients[failed, 0] = values[some][failed].mean(axis=1)
            basis.put(fits, alike[some], coefficients)
    return Recovered(patches.lent(points, fits), int(fits.failed.sum()), int(fits.flattened.sum()))


def _normal_equations(
    basis: Basis, places: FloatArray, values: FloatArray, body: FloatArray, axisymmetric: bool
) -> tuple[FloatArray, FloatArray]:
    """Return the matrices, (n, s, s), and right sides of samples and equilibrium; unknowns by function, component."""
    (n, k, dim), c = places.shape, values.shape[2]
    functions = basis.at(places)
    m = functions.shape[2]
    size = m * c
    # Functions are orthonormal over the samples; a zero one keeps its own zero coefficient.
    A = np.zeros((n, size, size))
    A[:, np.arange(size), np.arange(size)] = np.repeat(np.where(basis.kept, float(k), 1.0), c, axis=1)
    b = np.matmul(functions.swapaxes(1, 2), values).reshape(n, size)
    flat = m == 1 + dim and not axisymmetric
    where, count = (places[:, :1], k) if flat else (places, 1)
    q = where.shape[1]
    rows = np.einsum("cij,nqaj->nqiac", _tensors(c, dim), basis.gradients(where), optimize=True)
    if axisymmetric:
        over_r = functions / places[:, :, :1]
        rows[:, :, 0, :, component_of(0, 0)] += over_r
        rows[:, :, 0, :, component_of(2, 2)] -= over_r
        rows[:, :, 1, :, component_of(0, 1)] += over_r
    rows = rows.reshape(n, q * dim, size)
    weight = BALANCE * count * basis.radius**2
    A += weight[:, None, None] * np.matmul(rows.swapaxes(1, 2), rows)
    b -= weight[:, None] * np.matmul(np.tile(body, q), rows)
    return A, b


def _add_tractions(
    A: FloatArray, b: FloatArray, basis: Basis, surface: Surface, patch: IntArray, point: IntArray
) -> None:
    """Add the points of the surface to the equations of patches, a pair (patch, point) for each entry."""
    dim = surface.place.shape[1]
    size = A.shape[1]
    c = size // basis.kept.shape[1]
    for start in range(0, len(patch), 16 * CHUNK):
        p, f = patch[start : start + 16 * CHUNK], point[start : start + 16 * CHUNK]
        functions = basis.take(p).at(surface.place[f][:, None])[:, 0]
        across = np.einsum("kij,sjl,kl->kis", surface.known[f], _tensors(c, dim), surface.normal[f], optimize=True)
        rows = (functions[:, None, :, None] * across[:, :, None]).reshape(len(p), dim, size)
        given = np.einsum("kij,kj->ki", surface.known[f], surface.traction[f])
        first = np.flatnonzero(np.r_[True, p[1:] != p[:-1]])
        A[p[first]] += SURFACE * np.add.reduceat(np.matmul(rows.swapaxes(1, 2), rows), first)
        b[p[first]] += SURFACE * np.add.reduceat(np.matmul(given[:, None], rows)[:, 0], first)


def _tensors(c: int, dim: int) -> FloatArray:
    """Return the part in space of the tensors of unit components, (c, dim, dim)."""
    return stress_tensor(np.eye(c))[:, :dim, :dim]


def _points_of(patches: Patches, cell: IntArray, n_cells: int) -> tuple[IntArray, IntArray]:
    """Return the points of the surface on the cells of each patch: those of patch i from indptr[i] on."""
    indptr, cells = patches.star
    own = patches.own
    row, entry = ranges(indptr[own], indptr[own + 1] - indptr[own])
    incidence = sp.csr_array((np.ones(len(row), np.int32), (row, cells[entry])), shape=(len(own), n_cells))
    owners = sp.csr_array((np.ones(len(cell), np.int32), (cell, np.arange(len(cell)))), shape=(n_cells, len(cell)))
    found = sp.csr_array(incidence @ owners)
    return found.indptr.astype(np.int64), found.indices.astype(np.int64)
