"""Points of elements where finite-element stresses are better than elsewhere, and the stresses there."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import geometry, quadrature
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.recovery.blocks import StressBlock, centre_values
from gibiane_ops.kernels.supports import through_points

_FEWER = {
    "QUA8": quadrature.square(2),
    "CU20": quadrature.cube(2),
    "PR15": quadrature.prism(2, 2),
    "PY13": quadrature.pyramid(2),
}
"""Rules with fewer points than that of the stiffness."""

_ON_SURFACE = {"SEG3": quadrature.line(2), "TRI6": quadrature.triangle(2), "QUA8": quadrature.square(2)}
"""Points of facets where patches look at the tractions: as dense as the samples."""


def surface_points(facet: Shape) -> FloatArray:
    """Give the reference points of a facet at which patches look at tractions: its middle, some in the second degree.

    Parameters
    ----------
    facet : Shape

    Returns
    -------
    (q, dim) float64
    """
    if facet.name in _ON_SURFACE:
        return _ON_SURFACE[facet.name].points
    return np.asarray(facet.ref_nodes.mean(axis=0, keepdims=True), np.float64)


def superconvergent_samples(points: FloatArray, block: StressBlock) -> tuple[FloatArray, FloatArray]:
    """Give the places and values of the stresses that patches are fitted to.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    block : StressBlock

    Returns
    -------
    places : (m, k, dim) float64, length
    values : (m, k, c) float64

    Notes
    -----
    Linear shapes: the centre. QUA8 2x2 and CU20 2x2x2 Gauss points, TRI6 3 and TE10 4 points of the stiffness. PR15
    and PY13 have no superconvergent points proved; taken are those that fit their neighbours': the 3 points of TRI6 at
    2 heights, and the 2x2x2 points of the cone over QUA8. Where the rule of the stiffness is another, its values are
    interpolated without loss (`supports.through_points`).

    Source
    ------
    Barlow 1976; Zienkiewicz and Zhu 1992.
    """
    shape, X = block.shape, points[block.cells]
    if shape.degree == 1:
        return geometry.centroids(shape, X)[:, None], centre_values(shape, block.stress)[:, None]
    if shape.name not in _FEWER:
        return geometry.positions(shape, X, shape.gauss[0]), block.stress
    xi = _FEWER[shape.name].points
    return geometry.positions(shape, X, xi), np.asarray(np.matmul(through_points(shape, xi), block.stress), np.float64)
