"""SEG2, the segment [-1, 1]."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.tensor import multilinear

_NODES = np.array([[-1.0], [1.0]])
_N, _dN = multilinear(_NODES)

SEG2 = Shape(
    name="SEG2",
    dim=1,
    degree=1,
    ref_nodes=_NODES,
    N=_N,
    dN=_dN,
    faces=(("POI1", (0,)), ("POI1", (1,))),
    edges=((0, 1),),
    stiffness_rule=quadrature.line(1),
    mass_rule=quadrature.line(2),
    gmsh_type=1,
    meshio_name="line",
    n_corners=2,
)
