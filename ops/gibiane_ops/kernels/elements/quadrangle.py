"""QUA4 and QUA8, the square [-1, 1]^2, corners counterclockwise from (-1, -1), then mid-nodes from side 0-1 on."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.elements import quadratic
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

_N2, _dN2 = quadratic.serendipity_basis(QUA4)

QUA8 = Shape(
    name="QUA8",
    dim=QUA4.dim,
    degree=2,
    ref_nodes=quadratic.ref_nodes(QUA4),
    N=_N2,
    dN=_dN2,
    faces=quadratic.faces(QUA4),
    edges=quadratic.edges(QUA4),
    stiffness_rule=quadrature.square(3),
    mass_rule=quadrature.square(3),
    gmsh_type=16,
    meshio_name="quad8",
    n_corners=QUA4.n_corners,
)
