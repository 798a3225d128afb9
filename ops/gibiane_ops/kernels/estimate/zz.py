"""Error of a finite-element stress, measured as its distance to the smoothed stress in energy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.quadrature import Rule
from gibiane_ops.kernels.recovery import StressBlock, extrapolate
from gibiane_ops.kernels.supports import extension


@dataclass(frozen=True, eq=False)
class SolidError:
    """Squared energy norms of each cell of a block, without the factor 1/2.

    Attributes
    ----------
    error : (m,) float64, energy
        ``int (s* - s_h) : D^-1 : (s* - s_h)``.
    energy : (m,) float64, energy
        ``int s_h : D^-1 : s_h``.
    sum_energy : (m,) float64, energy
        ``int (s* + s_h) : D^-1 : (s* + s_h)``, about four times `energy`.
    """

    error: FloatArray
    energy: FloatArray
    sum_energy: FloatArray


def solid_error(
    points: FloatArray, block: StressBlock, nodal: FloatArray, compliance: FloatArray, *, axisymmetric: bool = False
) -> SolidError:
    """Compare the stresses of a block with the smoothed stress, cell by cell.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    block : StressBlock
    nodal : (n_points, c) float64, force / length^2
        Smoothed stress of the solid, see `recovery.recover`.
    compliance : (c, c) or (m, c, c) float64, length^2 / force
        Inverse of the Hooke law, the same everywhere or one per cell.
    axisymmetric : bool
        Whether the cells are sections of a body of revolution, over the whole of which energies are then taken.

    Returns
    -------
    SolidError

    Notes
    -----
    The rule is that of the stiffness for linear elements (CUB8: 2x2x2), but a simplex with one stress point takes its
    mass rule (TET4: four points), because the smoothed field is linear there. In elements of second degree the
    smoothed field is quadratic and its square of degree 4: all take their mass rule, to which their stresses are
    extended (`supports.extension`).

    Source
    ------
    Zienkiewicz and Zhu 1987.
    """
    xi, density = _integration(block.shape, points[block.cells], axisymmetric)
    smooth = np.matmul(block.shape.N(xi), nodal[block.cells])
    raw = block.stress
    if block.shape.degree > 1:
        raw = np.asarray(np.matmul(extension(block.shape, block.shape.gauss[0], xi), raw), np.float64)
    raw = np.broadcast_to(raw, smooth.shape)
    return SolidError(
        _energy(smooth - raw, density, compliance),
        _energy(raw, density, compliance),
        _energy(smooth + raw, density, compliance),
    )


def _integration(shape: Shape, X: FloatArray, axisymmetric: bool) -> tuple[FloatArray, FloatArray]:
    """Return the points of the rule, (q, dim), and the measures that they carry, (m, q)."""
    own = shape.degree == 1 and len(shape.stiffness_rule.weights) > 1
    rule = shape.stiffness_rule if own else shape.mass_rule
    return rule.points, geometry.point_measures(shape, X, (rule.points, rule.weights), axisymmetric=axisymmetric)


def _energy(stress: FloatArray, density: FloatArray, compliance: FloatArray) -> FloatArray:
    """Integrate ``s : D^-1 : s`` over each cell; stress is (m, q, c), density (m, q)."""
    strain = np.matmul(stress, compliance)
    return np.asarray((density * (strain * stress).sum(axis=2)).sum(axis=1), np.float64)


def true_error(
    points: FloatArray,
    block: StressBlock,
    exact: FloatArray,
    rule: Rule,
    compliance: FloatArray,
    *,
    axisymmetric: bool = False,
) -> SolidError:
    """Compare the stresses of a block with the exact stress, cell by cell.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    block : StressBlock
    exact : (m, q, c) float64, force / length^2
        Exact stress at the points of the rule.
    rule : Rule
        Of the block's shape. One point is not enough for linear simplices, whose stress is best there.
    compliance : (c, c) or (m, c, c) float64, length^2 / force
    axisymmetric : bool

    Returns
    -------
    SolidError
    """
    X = points[block.cells]
    density = geometry.point_measures(block.shape, X, (rule.points, rule.weights), axisymmetric=axisymmetric)
    raw = np.matmul(block.shape.N(rule.points), extrapolate(block.shape, block.stress))
    return SolidError(
        _energy(exact - raw, density, compliance),
        _energy(raw, density, compliance),
        _energy(exact + raw, density, compliance),
    )


def stress_energy(
    points: FloatArray, block: StressBlock, compliance: FloatArray, *, axisymmetric: bool = False
) -> FloatArray:
    """Integrate ``s_h : D^-1 : s_h`` over each cell by the stiffness rule, (m,).

    Parameters
    ----------
    points : (n_points, dim) float64, length
    block : StressBlock
    compliance : (c, c) or (m, c, c) float64, length^2 / force
    axisymmetric : bool
    """
    X, rule = points[block.cells], block.shape.gauss
    return _energy(block.stress, geometry.point_measures(block.shape, X, rule, axisymmetric=axisymmetric), compliance)
