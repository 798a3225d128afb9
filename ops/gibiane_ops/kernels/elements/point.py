"""POI1, the point."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.shape import Shape


def _N(xi: FloatArray) -> FloatArray:
    return np.ones((len(xi), 1))


def _dN(xi: FloatArray) -> FloatArray:
    return np.zeros((len(xi), 1, 0))


POI1 = Shape(
    name="POI1",
    dim=0,
    degree=0,
    ref_nodes=np.zeros((1, 0)),
    N=_N,
    dN=_dN,
    faces=(),
    edges=(),
    stiffness_rule=quadrature.point(),
    mass_rule=quadrature.point(),
    gmsh_type=15,
    meshio_name="vertex",
    n_corners=1,
)
