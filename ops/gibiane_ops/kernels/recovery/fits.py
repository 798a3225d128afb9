"""Least-squares polynomials through samples, one for each of many patches: first or second degree, multilinear."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray

FLAT = 1e-8
"""A patch whose samples spread less than this in one direction (ratio of variances) has no slope."""

UNSEEN = 0.02
"""A curvature whose mean square over the samples is smaller than this, in units of their spread, is left out.

Inner patches of usual meshes have 0.4 and more, slivers 0.15; one curved layer sees its curvature too dimly."""

MULTILINEAR = 0
"""In place of a degree: linear terms and the products xy, in space also xz, yz and xyz."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Places and values that belong to patches.

    Attributes
    ----------
    patch : (k,) int64
        Patch of each sample, increasing; every patch has some.
    places : (k, dim) float64, length
    values : (k, c) float64
    """

    patch: IntArray
    places: FloatArray
    values: FloatArray

    @classmethod
    def around(
        cls, nodes: IntArray, star: tuple[IntArray, IntArray], sampled: Sequence[tuple[FloatArray, FloatArray]]
    ) -> Samples:
        """Gather the samples of the cells around each node of a list.

        Parameters
        ----------
        nodes : (n,) int64
        star : (indptr, cells)
            Cells around each node, see `connectivity.node_to_cells`.
        sampled : list of ((m, k, dim), (m, k, c)) float64
            Places and values in the cells, block after block.

        Returns
        -------
        Samples
        """
        indptr, cells = star
        patch, entry = ranges(indptr[nodes], indptr[nodes + 1] - indptr[nodes])
        per_cell = np.concatenate([np.full(len(places), places.shape[1]) for places, _ in sampled])
        start = np.cumsum(per_cell) - per_cell
        cell = cells[entry]
        row, sample = ranges(start[cell], per_cell[cell])
        places = np.concatenate([each.reshape(-1, each.shape[2]) for each, _ in sampled])
        values = np.concatenate([each.reshape(-1, each.shape[2]) for _, each in sampled])
        return cls(patch[row], places[sample], values[sample])

    def alike(self, degree: IntArray) -> Iterator[tuple[IntArray, FloatArray, FloatArray, int]]:
        """Yield patches of one degree and number k of samples, their places (n, k, dim), values, and the degree."""
        length = np.bincount(self.patch, minlength=len(degree))
        first = np.cumsum(length) - length
        kinds, kind = np.unique(length * 3 + degree, return_inverse=True)
        for number, key in enumerate(kinds):
            patches = np.flatnonzero(kind == number)
            rows = first[patches][:, None] + np.arange(key // 3)
            yield patches, self.places[rows], self.values[rows], int(key % 3)


def ranges(start: IntArray, length: IntArray) -> tuple[IntArray, IntArray]:
    """Return the numbers start[i], start[i] + 1, ... of every range in one array, after the range of each."""
    row = np.repeat(np.arange(len(start)), length)
    first = np.cumsum(length) - length
    return row, np.arange(len(row)) - first[row] + start[row]


@dataclass(frozen=True, eq=False)
class Fits:
    """Polynomials ``value + d . slope + d . curvature . d + triple d_x d_y d_z`` with d the place less the centre.

    Attributes
    ----------
    centre : (n, dim) float64, length
    value : (n, c) float64
    slope : (n, dim, c) float64
    curvature : (n, dim, dim, c) float64
    triple : (n, c) float64
        Zero in a plane.
    failed : (n,) bool
        Too few samples for a slope: the polynomial is their mean.
    flattened : (n,) bool
        Some curvatures asked for are left out, because the samples do not determine them.
    """

    centre: FloatArray
    value: FloatArray
    slope: FloatArray
    curvature: FloatArray
    triple: FloatArray
    failed: NDArray[np.bool_]
    flattened: NDArray[np.bool_]

    @classmethod
    def zero(cls, n: int, dim: int, c: int) -> Fits:
        """Make n polynomials that are zero."""
        return cls(
            np.zeros((n, dim)), np.zeros((n, c)), np.zeros((n, dim, c)), np.zeros((n, dim, dim, c)), np.zeros((n, c)),
            np.zeros(n, bool), np.zeros(n, bool),
        )  # fmt: skip

    def at(self, patch: IntArray, places: FloatArray) -> FloatArray:
        """Evaluate polynomials at places, one for each; (k, c)."""
        d = (places - self.centre[patch])[:, None]
        result = self.value[patch] + np.matmul(d, self.slope[patch])[:, 0]
        if self.curvature.any():
            n, dim = d.shape[0], d.shape[2]
            squares = (d.swapaxes(1, 2) * d).reshape(n, 1, dim * dim)
            result += np.matmul(squares, self.curvature.reshape(len(self.centre), dim * dim, -1)[patch])[:, 0]
        if self.triple.any():
            result += d[:, 0].prod(axis=1)[:, None] * self.triple[patch]
        return np.asarray(result, np.float64)


def fit(samples: Samples, degree: IntArray) -> Fits:
    """Fit a polynomial to the samples of each patch.

    Parameters
    ----------
    samples : Samples
    degree : (n,) int64
        1, 2 or `MULTILINEAR` for each patch.

    Returns
    -------
    Fits

    Notes
    -----
    Coordinates are scaled by the second moments of the samples, so that thin patches are like others. Curvatures are
    fitted to what constant and linear terms leave, in the directions in which the samples determine them; the least
    sum of squares is unique in the scaled coordinates. Products of coordinates, which depend on the axes, are fitted in
    the same way in those of the places, each scaled by the spread along it. All functions up to the first degree are
    reproduced wherever slopes exist.

    Cost
    ----
    One batch for each number of samples in a patch.
    """
    found = Fits.zero(len(degree), samples.places.shape[1], samples.values.shape[1])
    for patches, places, values, each in samples.alike(degree):
        _fit_alike(found, patches, places, values, each)
    return found


def _fit_alike(found: Fits, patches: IntArray, places: FloatArray, values: FloatArray, degree: int) -> None:
    """Fit the patches of a list, all of k samples: places (n, k, dim), values (n, k, c)."""
    k = places.shape[1]
    centre = places.mean(axis=1)
    offset = places - centre[:, None]
    spread, axes = np.linalg.eigh(np.matmul(offset.swapaxes(1, 2), offset) / k)
    good = spread[:, 0] > FLAT * spread[:, -1]
    found.centre[patches] = centre
    found.value[patches] = values.mean(axis=1)
    found.failed[patches] = ~good
    patches, offset, values = patches[good], offset[good], values[good]
    # In these coordinates the constant and linear terms are orthonormal over the samples.
    scaling = axes[good] / np.sqrt(spread[good])[:, None, :]
    y = np.matmul(offset, scaling)
    slope = np.matmul(y.swapaxes(1, 2), values) / k
    if degree == 2 and len(patches):
        slope += _add_curvature(found, patches, scaling, y, values)
    elif degree == MULTILINEAR and len(patches):
        slope += _add_products(found, patches, offset, y, values)
    found.slope[patches] = np.matmul(scaling, slope)


def _add_curvature(
    found: Fits, patches: IntArray, scaling: FloatArray, y: FloatArray, values: FloatArray
) -> FloatArray:
    """Fit the quadratic terms to what the linear ones leave; return what this adds to the slopes in y."""
    dim = y.shape[2]
    i, j = np.triu_indices(dim)
    # The root of 2 makes the sum of the squares of the coefficients that of the curvature matrix: no axis is preferred.
    root = np.where(i == j, 1.0, np.sqrt(2.0))
    coefficients, slope = _fit_terms(found, patches, y[:, :, i] * y[:, :, j] * root, y, values)
    matrix = np.zeros((len(patches), dim, dim, values.shape[2]))
    matrix[:, i, j] = matrix[:, j, i] = coefficients / np.where(i == j, 1.0, np.sqrt(2.0))[:, None]
    found.curvature[patches] = np.einsum("nai,nijc,nbj->nabc", scaling, matrix, scaling, optimize=True)
    return slope


def _add_products(found: Fits, patches: IntArray, offset: FloatArray, y: FloatArray, values: FloatArray) -> FloatArray:
    """Fit the products of coordinates to what the linear terms leave; return what this adds to the slopes in y."""
    dim = y.shape[2]
    i, j = np.triu_indices(dim, 1)
    size = np.sqrt((offset**2).mean(axis=1))
    d = offset / size[:, None]
    terms = d[:, :, i] * d[:, :, j]
    if dim == 3:
        terms = np.concatenate([terms, d.prod(axis=2, keepdims=True)], axis=2)
    coefficients, slope = _fit_terms(found, patches, terms, y, values)
    half = coefficients[:, : len(i)] / (2 * size[:, i] * size[:, j])[:, :, None]
    matrix = np.zeros((len(patches), dim, dim, values.shape[2]))
    matrix[:, i, j] = matrix[:, j, i] = half
    found.curvature[patches] = matrix
    if dim == 3:
        found.triple[patches] = coefficients[:, -1] / size.prod(axis=1)[:, None]
    return slope


def _fit_terms(
    found: Fits, patches: IntArray, terms: FloatArray, y: FloatArray, values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Fit terms (n, k, t) to what constant and linear ones leave; return their coefficients, and their slopes in y."""
    k = y.shape[1]
    mean = terms.mean(axis=1)
    along = np.matmul(y.swapaxes(1, 2), terms) / k
    rest = terms - mean[:, None] - np.matmul(y, along)
    seen, modes = np.linalg.eigh(np.matmul(rest.swapaxes(1, 2), rest) / k)
    kept = seen > UNSEEN
    inverse = np.where(kept, 1.0 / np.where(kept, seen, 1.0), 0.0)
    loads = np.matmul(modes.swapaxes(1, 2), np.matmul(rest.swapaxes(1, 2), values) / k)
    coefficients = np.asarray(np.matmul(modes, inverse[:, :, None] * loads), np.float64)
    found.flattened[patches] = ~kept.all(axis=1)
    found.value[patches] -= np.matmul(mean[:, None], coefficients)[:, 0]
    return coefficients, np.asarray(-np.matmul(along, coefficients), np.float64)
