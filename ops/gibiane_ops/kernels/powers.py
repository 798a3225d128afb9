"""Real powers of numbers of any sign."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gibiane_ops.kernels.arrays import FloatArray

# How far 1 / exponent may be from a whole number for a root: the rounding of 1 / 9 is well below.
ROOT = 1e-12


def undefined(base: ArrayLike, exponent: ArrayLike) -> NDArray[np.bool_]:
    """Find the powers that are not real numbers.

    Parameters
    ----------
    base, exponent : float64, shapes that broadcast

    Returns
    -------
    bool, the common shape
        True where the base is negative, and the exponent neither whole nor the reciprocal of an odd number.
    """
    base, exponent = np.broadcast_arrays(np.asarray(base, np.float64), np.asarray(exponent, np.float64))
    return np.asarray((base < 0) & (exponent != np.rint(exponent)) & ~_odd_root(exponent), np.bool_)


def real_power(base: ArrayLike, exponent: ArrayLike) -> FloatArray:
    """Raise numbers to powers, roots of odd degree of negative numbers included.

    Parameters
    ----------
    base, exponent : float64, shapes that broadcast
        None `undefined`, no zero to a negative power.

    Returns
    -------
    float64, the common shape
        ``(-8) ** (1/3) = -2``: the sign of the base times the power of its modulus for odd roots and odd powers.
    """
    base, exponent = np.broadcast_arrays(np.asarray(base, np.float64), np.asarray(exponent, np.float64))
    odd = _odd_root(exponent) | (np.fmod(exponent, 2.0) != 0)
    sign = np.where((base < 0) & odd, -1.0, 1.0)
    return np.asarray(sign * np.abs(base) ** exponent, np.float64)


def _odd_root(exponent: FloatArray) -> NDArray[np.bool_]:
    """Find the exponents that are 1/n with n odd."""
    degree = 1.0 / np.where(exponent == 0, np.inf, exponent)
    whole = np.rint(degree)
    return np.asarray((np.abs(degree - whole) <= ROOT * np.abs(whole)) & (np.fmod(whole, 2.0) != 0), np.bool_)
