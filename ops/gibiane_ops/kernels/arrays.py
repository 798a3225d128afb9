"""Order of tensor components, and the conversions between vectors of components and 3x3 tensors.

The order is fixed here for the whole program: ``xx yy zz xy xz yz`` in 3D, ``xx yy zz xy`` in a plane.
Strain vectors hold engineering shears (``gamma_xy = 2 eps_xy``), stress vectors hold tensor components, so that
``strain . stress`` is the double contraction.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

COMPONENTS: tuple[str, ...] = ("xx", "yy", "zz", "xy", "xz", "yz")
PAIRS: tuple[tuple[int, int], ...] = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
N_COMPONENTS: dict[int, int] = {2: 4, 3: 6}

_ROW = np.array([i for i, _ in PAIRS])
_COL = np.array([j for _, j in PAIRS])
_POSITION = np.zeros((3, 3), np.int64)
_POSITION[_ROW, _COL] = _POSITION[_COL, _ROW] = np.arange(6)


def component_of(i: int, j: int) -> int:
    """Return the place of tensor component (i, j) in a vector.

    Parameters
    ----------
    i, j : int
        Axes, 0 to 2.

    Returns
    -------
    int
        Index in `COMPONENTS`, the same for (i, j) and (j, i).

    Examples
    --------
    >>> component_of(2, 1)
    5
    """
    return int(_POSITION[i, j])


def stress_tensor(stress: FloatArray) -> FloatArray:
    """Expand stress vectors into symmetric tensors.

    Parameters
    ----------
    stress : (..., 6) or (..., 4) float64

    Returns
    -------
    (..., 3, 3) float64
    """
    n = stress.shape[-1]
    tensor = np.zeros((*stress.shape[:-1], 3, 3))
    tensor[..., _ROW[:n], _COL[:n]] = stress
    tensor[..., _COL[:n], _ROW[:n]] = stress
    return tensor


def strain_tensor(strain: FloatArray) -> FloatArray:
    """Expand strain vectors (engineering shears) into symmetric tensors.

    Parameters
    ----------
    strain : (..., 6) or (..., 4) float64

    Returns
    -------
    (..., 3, 3) float64
    """
    n = strain.shape[-1]
    return stress_tensor(strain * np.where(_ROW[:n] == _COL[:n], 1.0, 0.5))


def stress_vector(tensor: FloatArray, n_components: int = 6) -> FloatArray:
    """Pick the components of symmetric tensors.

    Parameters
    ----------
    tensor : (..., 3, 3) float64, symmetric
    n_components : int
        6, or 4 for a plane.

    Returns
    -------
    (..., n_components) float64
    """
    return np.asarray(tensor[..., _ROW[:n_components], _COL[:n_components]], np.float64)


def strain_vector(tensor: FloatArray, n_components: int = 6) -> FloatArray:
    """Pick the components of symmetric strain tensors, shears doubled.

    Parameters
    ----------
    tensor : (..., 3, 3) float64, symmetric
    n_components : int
        6, or 4 for a plane.

    Returns
    -------
    (..., n_components) float64
    """
    factor = np.where(_ROW[:n_components] == _COL[:n_components], 1.0, 2.0)
    return stress_vector(tensor, n_components) * factor


def traction(stress: FloatArray, normal: FloatArray) -> FloatArray:
    """Apply stresses to normals, ``t = sigma . n``.

    Parameters
    ----------
    stress : (..., 6) or (..., 4) float64
    normal : (..., dim) float64
        Unit normals, dim 2 or 3.

    Returns
    -------
    (..., dim) float64
        Force per unit of area on the side that the normal leaves.
    """
    dim = normal.shape[-1]
    product: FloatArray = np.einsum("...ij,...j->...i", stress_tensor(stress)[..., :dim, :dim], normal)
    return product
