"""TET4, the tetrahedron (0, 0, 0) (1, 0, 0) (0, 1, 0) (0, 0, 1)."""

from __future__ import annotations

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.elements import simplex
from gibiane_ops.kernels.elements.shape import Shape

TET4 = Shape(
    name="TET4",
    dim=3,
    degree=1,
    ref_nodes=simplex.simplex_nodes(3),
    N=simplex.N,
    dN=simplex.dN,
    faces=(("TRI3", (0, 2, 1)), ("TRI3", (0, 1, 3)), ("TRI3", (1, 2, 3)), ("TRI3", (2, 0, 3))),
    edges=((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    stiffness_rule=quadrature.tetrahedron(1),
    mass_rule=quadrature.tetrahedron(2),
    gmsh_type=4,
    meshio_name="tetra",
    n_corners=4,
)
