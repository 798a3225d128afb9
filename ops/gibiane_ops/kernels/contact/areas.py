"""Share of the area of a surface that belongs to each of its nodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.assembly import face_mass
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.topology import Block


def nodal_areas(points: FloatArray, facets: Sequence[Block], nodes: IntArray) -> FloatArray:
    """Compute the area of each node, the integral of its shape function.

    Parameters
    ----------
    points : (n_points, d) float64, length
    facets : sequence of (shape name, (m, n_nodes) int64)
    nodes : (k,) int64

    Returns
    -------
    (k,) float64, length^(d - 1)
        They add up to the area of the surface. On quadratic triangles corners have none, on QUA8 a negative one.
    """
    total = np.zeros(len(points))
    for name, cells in facets:
        np.add.at(total, cells, face_mass(shape(name), points[cells]).sum(axis=2))
    return np.asarray(total[nodes])
