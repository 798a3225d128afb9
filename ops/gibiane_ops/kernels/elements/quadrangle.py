"""QUA4, the square [-1, 1]^2, nodes counterclockwise from (-1, -1)."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.tensor import multilinear

_NODES = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_N, _dN = multilinear(_NODES)

QUA4 = Shape(
    name="QUA4",
    dim=2,
    degree=1,
    ref_nodes=_NODES,
    N=_N,
    dN=_dN,
    faces=(("SEG2", (0, 1)), ("SEG2", (1, 2)), ("SEG2", (2, 3)), ("SEG2", (3, 0))),
    edges=((0, 1), (1, 2), (2, 3), (3, 0)),
    stiffness_rule=quadrature.square(2),
    mass_rule=quadrature.square(2),
    gmsh_type=3,
    meshio_name="quad",
    n_corners=4,
)
