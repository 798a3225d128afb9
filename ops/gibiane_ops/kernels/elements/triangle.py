"""TRI3 and TRI6, the triangle (0, 0) (1, 0) (0, 1); mid-nodes of TRI6 on sides 0-1, 1-2, 2-0."""

from __future__ import annotations

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.elements import quadratic, simplex
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

_N2, _dN2 = quadratic.simplex_basis(TRI3)

TRI6 = Shape(
    name="TRI6",
    dim=TRI3.dim,
    degree=2,
    ref_nodes=quadratic.ref_nodes(TRI3),
    N=_N2,
    dN=_dN2,
    faces=quadratic.faces(TRI3),
    edges=quadratic.edges(TRI3),
    stiffness_rule=quadrature.triangle(2),
    mass_rule=quadrature.triangle(4),
    gmsh_type=9,
    meshio_name="triangle6",
    n_corners=TRI3.n_corners,
)
