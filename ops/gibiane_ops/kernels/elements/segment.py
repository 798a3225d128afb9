"""SEG2 and SEG3, the segment [-1, 1]; the middle node of SEG3 comes last."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.elements import quadratic
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

_N2, _dN2 = quadratic.serendipity_basis(SEG2)

SEG3 = Shape(
    name="SEG3",
    dim=SEG2.dim,
    degree=2,
    ref_nodes=quadratic.ref_nodes(SEG2),
    N=_N2,
    dN=_dN2,
    faces=quadratic.faces(SEG2),
    edges=quadratic.edges(SEG2),
    stiffness_rule=quadrature.line(2),
    mass_rule=quadrature.line(3),
    gmsh_type=8,
    meshio_name="line3",
    n_corners=SEG2.n_corners,
)
