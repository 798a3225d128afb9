"""Two projections on Coulomb's cone; they differ, so each method names the one it uses."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray


def norms(tangential: FloatArray) -> FloatArray:
    """Compute the length of each tangential vector, shape (n, d - 1) to (n,)."""
    return np.asarray(np.sqrt(np.einsum("ni,ni->n", tangential, tangential)))


def radial_projection(r: FloatArray, mu: FloatArray) -> FloatArray:
    """Keep the compression of each force and shorten its tangential part to the friction bound.

    Parameters
    ----------
    r : (n, d) float64, force or force per area
        Normal component first; compression is negative. A tension is cut to zero, and its tangential part with it.
    mu : (n,) float64
        Friction coefficients, infinity allowed.

    Returns
    -------
    (n, d) float64
        ``r_n' = min(r_n, 0)`` and ``r_t' = r_t min(1, mu abs(r_n') / abs(r_t))``.

    Notes
    -----
    Used to correct a density that leaves the cone: the pressure is not touched.
    """
    normal = np.minimum(r[:, 0], 0.0)
    bound = friction_bound(normal, mu)
    length = norms(r[:, 1:])
    cut = np.divide(bound, length, out=np.ones_like(length), where=length > bound)
    return np.column_stack([normal, cut[:, None] * r[:, 1:]])


def orthogonal_projection(r: FloatArray, mu: FloatArray) -> FloatArray:
    """Find the nearest point of Coulomb's cone ``abs(r_t) <= -mu r_n``.

    Parameters
    ----------
    r : (n, d) float64
        Normal component first; compression is negative.
    mu : (n,) float64
        Friction coefficients, finite.

    Returns
    -------
    (n, d) float64

    Notes
    -----
    With p = -r_n and t = abs(r_t): unchanged when t <= mu p, zero when mu t <= -p, otherwise
    ``p' = (p + mu t) / (1 + mu^2)`` and ``t' = mu p'``. This is the projection of the bipotential method.

    Source
    ------
    De Saxce and Feng 1998, Mathematical and Computer Modelling 28.
    """
    p, t = -r[:, 0], norms(r[:, 1:])
    inside = t <= mu * p
    polar = mu * t <= -p
    shared = (p + mu * t) / (1 + mu**2)
    pressure = np.where(inside, p, np.where(polar, 0.0, shared))
    length = np.where(inside, t, np.where(polar, 0.0, mu * shared))
    ratio = np.divide(length, t, out=np.zeros_like(t), where=t > 0)
    return np.column_stack([-pressure, ratio[:, None] * r[:, 1:]])


def friction_bound(normal: FloatArray, mu: FloatArray) -> FloatArray:
    """Compute ``mu max(-normal, 0)``; zero without compression, even for an infinite coefficient."""
    compression = np.maximum(-normal, 0.0)
    return np.multiply(mu, compression, out=np.zeros_like(compression), where=compression > 0)
