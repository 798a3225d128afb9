"""TET4 and TE10, the tetrahedron (0, 0, 0) (1, 0, 0) (0, 1, 0) (0, 0, 1).

Mid-nodes of TE10 on edges 0-1, 1-2, 2-0, 0-3, 1-3, 2-3.
"""

from __future__ import annotations

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.elements import quadratic, simplex
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

_N2, _dN2 = quadratic.simplex_basis(TET4)

TE10 = Shape(
    name="TE10",
    dim=TET4.dim,
    degree=2,
    ref_nodes=quadratic.ref_nodes(TET4),
    N=_N2,
    dN=_dN2,
    faces=quadratic.faces(TET4),
    edges=quadratic.edges(TET4),
    stiffness_rule=quadrature.tetrahedron(2),
    mass_rule=quadrature.tetrahedron(5),
    gmsh_type=11,
    meshio_name="tetra10",
    n_corners=TET4.n_corners,
)
