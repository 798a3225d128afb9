"""TRI3, the triangle (0, 0) (1, 0) (0, 1)."""

from __future__ import annotations

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.elements import simplex
from gibiane_ops.kernels.elements.shape import Shape

TRI3 = Shape(
    name="TRI3",
    dim=2,
    degree=1,
    ref_nodes=simplex.simplex_nodes(2),
    N=simplex.N,
    dN=simplex.dN,
    faces=(("SEG2", (0, 1)), ("SEG2", (1, 2)), ("SEG2", (2, 0))),
    edges=((0, 1), (1, 2), (2, 0)),
    stiffness_rule=quadrature.triangle(1),
    mass_rule=quadrature.triangle(2),
    gmsh_type=2,
    meshio_name="triangle",
    n_corners=3,
)
