"""CUB8 and CU20, the cube [-1, 1]^3: corners 0-3 at the bottom, counterclockwise seen from above, 4-7 above them.

The mid-nodes of CU20 follow: bottom, top, vertical edges.
"""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.elements import quadratic
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.tensor import multilinear

_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_NODES = np.vstack([np.c_[_SQUARE, np.full(4, -1.0)], np.c_[_SQUARE, np.full(4, 1.0)]])
_N, _dN = multilinear(_NODES)

CUB8 = Shape(
    name="CUB8",
    dim=3,
    degree=1,
    ref_nodes=_NODES,
    N=_N,
    dN=_dN,
    faces=(
        ("QUA4", (0, 3, 2, 1)),
        ("QUA4", (4, 5, 6, 7)),
        ("QUA4", (0, 1, 5, 4)),
        ("QUA4", (1, 2, 6, 5)),
        ("QUA4", (2, 3, 7, 6)),
        ("QUA4", (3, 0, 4, 7)),
    ),
    edges=(
        (0, 1),
        (1, 2),
        (2, 3),
        (3, 0),
        (4, 5),
        (5, 6),
        (6, 7),
        (7, 4),
        (0, 4),
        (1, 5),
        (2, 6),
        (3, 7),
    ),
    stiffness_rule=quadrature.cube(2),
    mass_rule=quadrature.cube(2),
    gmsh_type=5,
    meshio_name="hexahedron",
    n_corners=8,
)

_N2, _dN2 = quadratic.serendipity_basis(CUB8)

CU20 = Shape(
    name="CU20",
    dim=CUB8.dim,
    degree=2,
    ref_nodes=quadratic.ref_nodes(CUB8),
    N=_N2,
    dN=_dN2,
    faces=quadratic.faces(CUB8),
    edges=quadratic.edges(CUB8),
    stiffness_rule=quadrature.cube(3),
    mass_rule=quadrature.cube(3),
    gmsh_type=17,
    meshio_name="hexahedron20",
    n_corners=CUB8.n_corners,
)
