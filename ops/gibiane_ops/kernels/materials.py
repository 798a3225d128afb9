"""Hooke laws: stiffness and compliance of isotropic and orthotropic elastic materials, and thermal strains."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gibiane_ops.kernels.arrays import PAIRS, FloatArray, strain_vector
from gibiane_ops.kernels.errors import BadValue

# Number of strain components of each mode of analysis.
MODES: dict[str, int] = {"TRID": 6, "DEFO": 4, "CONT": 4, "AXIS": 4}


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
    mode : {'TRID', 'DEFO', 'CONT', 'AXIS'}
        3D, plane strain, plane stress, axisymmetric.

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
    the zz row (the stress that holds eps_zz = 0); in a body of revolution zz is the hoop component. Plane stress has a
    zero zz row and column, hence a singular D: use `compliance` to go from stress to strain or for the energy of a
    stress.
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
    mode : {'TRID', 'DEFO', 'CONT', 'AXIS'}

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


def orthotropic_compliance(
    E: ArrayLike, nu: ArrayLike, G: ArrayLike, axes: ArrayLike | None = None, mode: str = "TRID"
) -> FloatArray:
    """Build the compliance of an orthotropic material, ``strain = S stress``, in the axes of space.

    Parameters
    ----------
    E : (..., 3) float64, force / length^2
        Young's moduli along the material axes 1 2 3.
    nu : (..., 3) float64
        Poisson's ratios nu12 nu13 nu23: a stress along i alone gives ``eps_jj = -nu_ij eps_ii``.
    G : (..., 3) float64, force / length^2
        Shear moduli G12 G13 G23.
    axes : (..., 3, 3) float64, optional
        Rows: the material axes, orthonormal; those of space by default. In a plane mode the third is the z axis.
    mode : {'TRID', 'DEFO', 'CONT', 'AXIS'}

    Returns
    -------
    (..., 6, 6) or (..., 4, 4) float64, symmetric
        Order xx yy zz xy xz yz, or xx yy zz xy; engineering shears. Cut to the components present, see `compliance`.

    Raises
    ------
    BadValue
        When some stress would have a negative energy, or the mode is unknown.

    Notes
    -----
    ``S_ii = 1 / E_i``, ``S_ij = -nu_ij / E_i``; the stress turns as ``s' = A s A^T``, A the axes, so that
    ``S_space = T^T S T`` with T the matrix of this turn on vectors of components.

    Source
    ------
    Lekhnitskii 1963.
    """
    if mode not in MODES:
        raise BadValue("mode", mode, f"one of {' '.join(MODES)}")
    young, poisson, shear = (np.asarray(each, np.float64) for each in (E, nu, G))
    young, poisson, shear = np.broadcast_arrays(young, poisson, shear)
    for what, value in (("Young's modulus", young), ("shear modulus", shear)):
        if not np.all(value > 0):
            raise BadValue(f"an orthotropic {what}", float(value.min()), "above 0")
    S = np.zeros((*young.shape[:-1], 6, 6))
    S[..., range(3), range(3)] = 1 / young
    S[..., range(3, 6), range(3, 6)] = 1 / shear
    for k, (i, j) in enumerate(PAIRS[3:]):
        S[..., i, j] = S[..., j, i] = -poisson[..., k] / young[..., i]
    lowest = np.linalg.eigvalsh(S)[..., 0]
    if not np.all(lowest > 0):
        worst = poisson[np.unravel_index(int(np.argmin(lowest)), lowest.shape)]
        shown = " ".join(f"{x:g}" for x in np.atleast_1d(worst))
        raise BadValue("the set NU12 NU13 NU23", shown, "with these moduli some stress would have a negative energy")
    if axes is not None:
        T = _turn(np.asarray(axes, np.float64))
        S = np.matmul(T.swapaxes(-1, -2), np.matmul(S, T))
    n = MODES[mode]
    return S[..., :n, :n]


def orthotropic(
    E: ArrayLike, nu: ArrayLike, G: ArrayLike, axes: ArrayLike | None = None, mode: str = "TRID"
) -> FloatArray:
    """Build the elastic stiffness of an orthotropic material, ``stress = D strain``, in the axes of space.

    Parameters
    ----------
    E, nu, G, axes, mode
        See `orthotropic_compliance`.

    Returns
    -------
    (..., 6, 6) or (..., 4, 4) float64, symmetric
        Inverse of the compliance; in plane stress, inverse of its in-plane part, with a zero zz row and column.

    Raises
    ------
    BadValue
        As `orthotropic_compliance`.
    """
    S = orthotropic_compliance(E, nu, G, axes, mode)
    if mode != "CONT":
        return np.asarray(np.linalg.inv(S), np.float64)
    plane = np.array([0, 1, 3])
    D = np.zeros_like(S)
    D[..., plane[:, None], plane] = np.linalg.inv(S[..., plane[:, None], plane])
    return D


def _turn(axes: FloatArray) -> FloatArray:
    """Return the matrices that give stress components in other axes, (..., 6, 6)."""
    T = np.empty((*axes.shape[:-2], 6, 6))
    for row, (i, j) in enumerate(PAIRS):
        for column, (p, q) in enumerate(PAIRS):
            term = axes[..., i, p] * axes[..., j, q]
            T[..., row, column] = term if p == q else term + axes[..., i, q] * axes[..., j, p]
    return T


def thermal_strain(expansion: ArrayLike, axes: ArrayLike | None = None, mode: str = "TRID") -> FloatArray:
    """Build the strain of a free body heated by one degree.

    Parameters
    ----------
    expansion : (..., 3) float64, 1 / temperature
        Coefficients along the material axes.
    axes : (..., 3, 3) float64, optional
        Rows: the material axes; those of space by default.
    mode : {'TRID', 'DEFO', 'CONT', 'AXIS'}

    Returns
    -------
    (..., 6) or (..., 4) float64, 1 / temperature
        Order xx yy zz xy xz yz, or xx yy zz xy; engineering shears.
    """
    alpha = np.asarray(expansion, np.float64)
    A = np.eye(3) if axes is None else np.asarray(axes, np.float64)
    return strain_vector(np.matmul(A.swapaxes(-1, -2) * alpha[..., None, :], A), MODES[mode])
