"""PRI6 and PR15, the triangle (0, 0) (1, 0) (0, 1) swept over [-1, 1]: corners 0-2 below, 3-5 above them.

Mid-nodes of PR15: the sides of the lower triangle, those of the upper one, the vertical edges.
"""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements import quadratic, simplex
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


def _N15(xi: FloatArray) -> FloatArray:
    flat, z = simplex.N(xi[:, :2]), xi[:, 2:]
    sides = 2 * flat * np.roll(flat, -1, axis=1)
    below, above = flat * (1 - z) * (2 * flat - 2 - z) / 2, flat * (1 + z) * (2 * flat - 2 + z) / 2
    return np.hstack([below, above, sides * (1 - z), sides * (1 + z), flat * (1 - z * z)])


def _dN15(xi: FloatArray) -> FloatArray:
    flat, slope, z = simplex.N(xi[:, :2])[:, :, None], simplex.dN(xi[:, :2]), xi[:, 2, None, None]
    after, slope_after = np.roll(flat, -1, axis=1), np.roll(slope, -1, axis=1)
    sides, slope_sides = 2 * flat * after, 2 * (slope * after + flat * slope_after)
    in_plane = [
        slope * (1 - z) * (4 * flat - 2 - z) / 2,
        slope * (1 + z) * (4 * flat - 2 + z) / 2,
        slope_sides * (1 - z),
        slope_sides * (1 + z),
        slope * (1 - z * z),
    ]
    upward = [
        flat * (1 + 2 * z - 2 * flat) / 2,
        flat * (2 * flat - 1 + 2 * z) / 2,
        -sides,
        sides,
        -2 * flat * z,
    ]
    return np.concatenate([np.concatenate(in_plane, axis=1), np.concatenate(upward, axis=1)], axis=2)


PR15 = Shape(
    name="PR15",
    dim=PRI6.dim,
    degree=2,
    ref_nodes=quadratic.ref_nodes(PRI6),
    N=_N15,
    dN=_dN15,
    faces=quadratic.faces(PRI6),
    edges=quadratic.edges(PRI6),
    stiffness_rule=quadrature.prism(2, 3),
    mass_rule=quadrature.prism(4, 3),
    gmsh_type=18,
    meshio_name="wedge15",
    n_corners=PRI6.n_corners,
)
