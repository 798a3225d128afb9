"""PRI6, the triangle (0, 0) (1, 0) (0, 1) swept over [-1, 1]: nodes 0-2 below, 3-5 above them."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements import simplex
from gibiane_ops.kernels.elements.shape import Shape

_FLAT = simplex.simplex_nodes(2)


def _N(xi: FloatArray) -> FloatArray:
    flat, z = simplex.N(xi[:, :2]), xi[:, 2:]
    return np.hstack([flat * (1 - z), flat * (1 + z)]) / 2


def _dN(xi: FloatArray) -> FloatArray:
    flat, gradient, z = simplex.N(xi[:, :2]), simplex.dN(xi[:, :2]), xi[:, 2, None, None]
    below = np.concatenate([gradient * (1 - z), -flat[:, :, None]], axis=2)
    above = np.concatenate([gradient * (1 + z), flat[:, :, None]], axis=2)
    return np.concatenate([below, above], axis=1) / 2


PRI6 = Shape(
    name="PRI6",
    dim=3,
    degree=1,
    ref_nodes=np.vstack([np.c_[_FLAT, np.full(3, -1.0)], np.c_[_FLAT, np.full(3, 1.0)]]),
    N=_N,
    dN=_dN,
    faces=(
        ("TRI3", (0, 2, 1)),
        ("TRI3", (3, 4, 5)),
        ("QUA4", (0, 1, 4, 3)),
        ("QUA4", (1, 2, 5, 4)),
        ("QUA4", (2, 0, 3, 5)),
    ),
    edges=((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    stiffness_rule=quadrature.prism(2, 2),
    mass_rule=quadrature.prism(2, 2),
    gmsh_type=6,
    meshio_name="wedge",
    n_corners=6,
)
