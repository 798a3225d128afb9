"""Polynomials that are orthonormal over the samples of a patch, for many patches with as many samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.recovery.fits import FLAT, UNSEEN, Fits


@dataclass(frozen=True, eq=False)
class Basis:
    """Functions 1, y, and combinations of ``y y``, with ``y = (x - centre) . scaling``; those left out are zero.

    Attributes
    ----------
    centre : (n, dim) float64, length
    radius : (n,) float64, length
        Root mean square distance of the samples from it, for one direction.
    scaling : (n, dim, dim) float64, 1 / length
        Zero in patches without slopes.
    mean, along, modes : (n, t), (n, dim, t), (n, t, t) float64
        The functions of second degree are ``(y_i y_j root - mean - y . along) . modes``; t = 0 in the first degree.
    kept : (n, m) bool
        Which of the 1 + dim + t functions the samples determine.
    """

    centre: FloatArray
    radius: FloatArray
    scaling: FloatArray
    mean: FloatArray
    along: FloatArray
    modes: FloatArray
    kept: NDArray[np.bool_]

    @classmethod
    def over(cls, places: FloatArray, degree: int) -> Basis:
        """Make the functions of a degree, 1 or 2, over samples, (n, k, dim)."""
        n, k, dim = places.shape
        centre = places.mean(axis=1)
        offset = places - centre[:, None]
        spread, axes = np.linalg.eigh(np.matmul(offset.swapaxes(1, 2), offset) / k)
        good = spread[:, 0] > FLAT * spread[:, -1]
        scaling = axes / np.sqrt(np.where(good[:, None], spread, 1.0))[:, None, :] * good[:, None, None]
        radius = np.sqrt(np.where(good, spread.mean(axis=1), 1.0))
        kept = np.hstack([np.ones((n, 1), bool), np.repeat(good[:, None], dim, axis=1)])
        if degree < 2:
            none = np.zeros((n, 0)), np.zeros((n, dim, 0)), np.zeros((n, 0, 0))
            return cls(centre, radius, scaling, *none, kept)
        y = np.matmul(offset, scaling)
        terms = _products(y)
        mean = terms.mean(axis=1)
        along = np.matmul(y.swapaxes(1, 2), terms) / k
        rest = terms - mean[:, None] - np.matmul(y, along)
        seen, modes = np.linalg.eigh(np.matmul(rest.swapaxes(1, 2), rest) / k)
        clear = seen > UNSEEN
        modes = np.where(clear[:, None], modes / np.sqrt(np.where(clear, seen, 1.0))[:, None], 0.0)
        return cls(centre, radius, scaling, mean, along, modes, np.hstack([kept, clear]))

    def take(self, rows: IntArray) -> Basis:
        """Return the functions of some patches, one may come several times."""
        return Basis(
            self.centre[rows],
            self.radius[rows],
            self.scaling[rows],
            self.mean[rows],
            self.along[rows],
            self.modes[rows],
            self.kept[rows],
        )

    def at(self, places: FloatArray) -> FloatArray:
        """Evaluate at places, (n, q, dim): (n, q, m)."""
        y = np.matmul(places - self.centre[:, None], self.scaling)
        one = np.ones((*y.shape[:2], 1))
        if not self.mean.shape[1]:
            return np.concatenate([one, y], axis=2)
        rest = _products(y) - self.mean[:, None] - np.matmul(y, self.along)
        return np.concatenate([one, y, np.matmul(rest, self.modes)], axis=2)

    def gradients(self, places: FloatArray) -> FloatArray:
        """Differentiate at places, (n, q, dim): (n, q, m, dim)."""
        (n, q, dim), S = places.shape, self.scaling
        y = np.matmul(places - self.centre[:, None], S)
        first = np.broadcast_to(S.swapaxes(1, 2)[:, None], (n, q, dim, dim))
        parts = [np.zeros((n, q, 1, dim)), first]
        if self.mean.shape[1]:
            i, j, root = _pairs(dim)
            # d(y_i y_j)/dx = S_.i y_j + S_.j y_i
            rows = first[:, :, i] * y[:, :, j, None] + first[:, :, j] * y[:, :, i, None]
            rest = rows * root[:, None] - np.matmul(S, self.along).swapaxes(1, 2)[:, None]
            parts.append(np.matmul(self.modes.swapaxes(1, 2)[:, None], rest))
        return np.concatenate(parts, axis=2)

    def put(self, fits: Fits, patches: IntArray, coefficients: FloatArray) -> None:
        """Write the polynomials with these coefficients, (n, m, c), into those of some patches."""
        dim = self.centre.shape[1]
        value, slope = coefficients[:, 0], coefficients[:, 1 : 1 + dim]
        if self.mean.shape[1]:
            i, j, root = _pairs(dim)
            second = np.matmul(self.modes, coefficients[:, 1 + dim :])
            value = value - np.matmul(self.mean[:, None], second)[:, 0]
            slope = slope - np.matmul(self.along, second)
            matrix = np.zeros((len(patches), dim, dim, coefficients.shape[2]))
            half = np.where(i == j, 1.0, 0.5) * root
            matrix[:, i, j] = matrix[:, j, i] = second * half[:, None]
            fits.curvature[patches] = np.einsum("nai,nijc,nbj->nabc", self.scaling, matrix, self.scaling, optimize=True)
        fits.centre[patches], fits.value[patches] = self.centre, value
        fits.slope[patches] = np.matmul(self.scaling, slope)
        fits.failed[patches] = ~self.kept[:, 1]
        fits.flattened[patches] = self.kept[:, 1] & ~self.kept.all(axis=1)


def _pairs(dim: int) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the pairs of axes, and factors that make no direction preferred: 1, and the root of 2 off the diagonal."""
    i, j = np.triu_indices(dim)
    return i, j, np.where(i == j, 1.0, np.sqrt(2.0))


def _products(y: FloatArray) -> FloatArray:
    i, j, root = _pairs(y.shape[2])
    return np.asarray(y[:, :, i] * y[:, :, j] * root, np.float64)
