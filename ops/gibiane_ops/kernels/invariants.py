"""Scalars made of a stress: equivalent stresses, principal values and directions, invariants."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, stress_tensor


def von_mises(stress: FloatArray) -> FloatArray:
    """Compute the equivalent stress of von Mises.

    Parameters
    ----------
    stress : (..., 6) or (..., 4) float64

    Returns
    -------
    (...) float64
        ``sqrt(3/2 s : s)``, s the deviator.
    """
    mean = stress[..., :3].mean(axis=-1, keepdims=True)
    deviator = stress[..., :3] - mean
    return np.asarray(np.sqrt(1.5 * ((deviator**2).sum(axis=-1) + 2 * (stress[..., 3:] ** 2).sum(axis=-1))), np.float64)


def principal(tensor: FloatArray, *, in_plane: bool = False) -> tuple[FloatArray, FloatArray]:
    """Compute principal values and directions.

    Parameters
    ----------
    tensor : (..., 3, 3) float64, symmetric
    in_plane : bool
        Keep the direction z (third axis, a principal one) last; only the two others are ordered.

    Returns
    -------
    values : (..., 3) float64
        Decreasing.
    directions : (..., 3, 3) float64
        ``directions[..., k]`` is the unit vector of value k; its largest component is positive.
    """
    if in_plane:
        values, vectors = np.zeros(tensor.shape[:-1]), np.zeros(tensor.shape)
        found = np.linalg.eigh(tensor[..., :2, :2])
        values[..., :2], values[..., 2] = found.eigenvalues[..., ::-1], tensor[..., 2, 2]
        vectors[..., :2, :2] = found.eigenvectors[..., ::-1].swapaxes(-1, -2)
        vectors[..., 2, 2] = 1.0
    else:
        found = np.linalg.eigh(tensor)
        values = found.eigenvalues[..., ::-1]
        vectors = found.eigenvectors[..., ::-1].swapaxes(-1, -2)
    largest = np.take_along_axis(vectors, np.abs(vectors).argmax(axis=-1)[..., None], axis=-1)
    return np.asarray(values), np.asarray(vectors * np.where(largest < 0, -1.0, 1.0), np.float64)


def tresca(stress: FloatArray) -> FloatArray:
    """Compute the equivalent stress of Tresca.

    Parameters
    ----------
    stress : (..., 6) or (..., 4) float64

    Returns
    -------
    (...) float64
        Largest difference of two principal stresses.
    """
    values = np.linalg.eigvalsh(stress_tensor(stress))
    return np.asarray(values[..., 2] - values[..., 0], np.float64)


def invariants(tensor: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute the three invariants of a symmetric tensor.

    Parameters
    ----------
    tensor : (..., 3, 3) float64, symmetric

    Returns
    -------
    first, second, third : (...) float64
        Trace, sum of the principal 2x2 minors, determinant.
    """
    trace = np.trace(tensor, axis1=-2, axis2=-1)
    square = np.einsum("...ij,...ij->...", tensor, tensor)
    return np.asarray(trace), np.asarray((trace**2 - square) / 2), np.asarray(np.linalg.det(tensor))
