"""What the smoothings take and give, and the stresses of one element beyond its integration points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.supports import moved


class StressBlock(NamedTuple):
    """Cells of one shape with their stresses.

    Attributes
    ----------
    shape : Shape
    cells : (m, n_nodes) int64
        Node ids.
    stress : (m, q, c) float64
        Values at the q points of the stiffness rule of the shape.
    """

    shape: Shape
    cells: IntArray
    stress: FloatArray


@dataclass(frozen=True, eq=False)
class Recovered:
    """A smoothed field.

    Attributes
    ----------
    nodal : (n_points, c) float64
        Values at the nodes; zero at points that are not nodes of the solid.
    fallbacks : int
        Nodes whose patch could not be fitted and took the mean of their elements instead; 0 except for SPR.
    flattened : int
        Nodes whose patch of second degree did not determine all its curvatures, and was given none in the directions
        that it does not see; 0 except for SPR.
    """

    nodal: FloatArray
    fallbacks: int = 0
    flattened: int = 0


def extrapolate(shape: Shape, values: FloatArray) -> FloatArray:
    """Extend values at the stiffness points of each cell to its nodes.

    Parameters
    ----------
    shape : Shape
    values : (m, q, c) float64

    Returns
    -------
    (m, n_nodes, c) float64

    Notes
    -----
    The nodal values of the interpolation nearest to the given values (least squares): trilinear through the 8 points
    for CUB8, constant for a simplex with one point, linear for TRI6 and TE10, that of the shape itself for QUA8, CU20
    and PY13.

    Source
    ------
    Hinton and Campbell 1974.
    """
    return moved(shape, values, "STRESSES", "NOEUD")


def centre_values(shape: Shape, values: FloatArray) -> FloatArray:
    """Give the value at the centre of each cell of what `extrapolate` builds.

    Parameters
    ----------
    shape : Shape
    values : (m, q, c) float64

    Returns
    -------
    (m, c) float64
    """
    return moved(shape, values, "STRESSES", "GRAVITE")[:, 0]
