"""Hooke laws: stiffness and compliance of an isotropic elastic material."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue

# Number of strain components of each mode of analysis.
MODES: dict[str, int] = {"TRID": 6, "DEFO": 4, "CONT": 4}


def _checked(E: ArrayLike, nu: ArrayLike, mode: str) -> tuple[FloatArray, FloatArray]:
    """Return E and nu as arrays of one shape, refusing what makes the law meaningless."""
    young, poisson = np.broadcast_arrays(np.asarray(E, np.float64), np.asarray(nu, np.float64))
    if mode not in MODES:
        raise BadValue("mode", mode, f"one of {' '.join(MODES)}")
    if not np.all(young > 0):
        raise BadValue("E", float(young.min()), "E > 0")
    if not np.all((poisson > -1) & (poisson < 0.5)):
        wrong = poisson[~((poisson > -1) & (poisson < 0.5))]
        raise BadValue("nu", float(wrong.flat[0]), "-1 < nu < 0.5")
    return young, poisson


def isotropic(E: ArrayLike, nu: ArrayLike, mode: str = "TRID") -> FloatArray:
    """Build the elastic stiffness D, ``stress = D strain``.

    Parameters
    ----------
    E : (...) float64, force / length^2
        Young's modulus, one value or one per element.
    nu : (...) float64
        Poisson's ratio.
    mode : {'TRID', 'DEFO', 'CONT'}
        3D, plane strain, plane stress.

    Returns
    -------
    (..., 6, 6) or (..., 4, 4) float64, symmetric
        Order xx yy zz xy xz yz, or xx yy zz xy; engineering shears.

    Raises
    ------
    BadValue
        E <= 0, nu outside ]-1, 0.5[, or unknown mode.

    Notes
    -----
    ``D = lambda 1x1 + 2 G I``, ``lambda = E nu / ((1 + nu)(1 - 2 nu))``, ``G = E / (2 (1 + nu))``. Plane strain keeps
    the zz row (the stress that holds eps_zz = 0). Plane stress has a zero zz row and column, hence a singular D: use
    `compliance` to go from stress to strain or for the energy of a stress.
    """
    young, poisson = _checked(E, nu, mode)
    G = young / (2 * (1 + poisson))
    if mode == "CONT":
        normal, cross = young / (1 - poisson**2), young * poisson / (1 - poisson**2)
        axes = 2
    else:
        cross = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
        normal, axes = cross + 2 * G, 3
    n = MODES[mode]
    D = np.zeros((*young.shape, n, n))
    D[..., :axes, :axes] = cross[..., None, None]
    D[..., range(axes), range(axes)] = normal[..., None]
    D[..., range(3, n), range(3, n)] = G[..., None]
    return D


def compliance(E: ArrayLike, nu: ArrayLike, mode: str = "TRID") -> FloatArray:
    """Build the elastic compliance, ``strain = S stress``.

    Parameters
    ----------
    E : (...) float64, force / length^2
    nu : (...) float64
    mode : {'TRID', 'DEFO', 'CONT'}

    Returns
    -------
    (..., 6, 6) or (..., 4, 4) float64, symmetric

    Raises
    ------
    BadValue
        As `isotropic`.

    Notes
    -----
    The 3D compliance cut to the components present: it gives eps_zz of plane stress (stress zz = 0) as well as of
    plane strain, and ``stress . S . stress`` is the energy density (without 1/2) in every mode.
    """
    young, poisson = _checked(E, nu, mode)
    n = MODES[mode]
    S = np.zeros((*young.shape, n, n))
    S[..., :3, :3] = (-poisson / young)[..., None, None]
    S[..., range(3), range(3)] = (1 / young)[..., None]
    S[..., range(3, n), range(3, n)] = (2 * (1 + poisson) / young)[..., None]
    return S
