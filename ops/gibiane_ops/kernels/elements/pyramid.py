"""PYR5, the pyramid of base [-1, 1]^2 (nodes 0-3, counterclockwise from (-1, -1)) and apex (0, 0, 1)."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.shape import Shape

_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def _height(xi: FloatArray) -> FloatArray:
    """Return 1 - z kept away from zero: the rational functions have a limit at the apex, but read 0/0 there."""
    return np.maximum(1.0 - xi[:, 2:], 1e-14)


def _N(xi: FloatArray) -> FloatArray:
    # Bedrosian 1992: N_a = (r + x_a x)(r + y_a y) / (4 r) with r = 1 - z; the apex takes z.
    r = _height(xi)
    base = (r + _SQUARE[:, 0] * xi[:, :1]) * (r + _SQUARE[:, 1] * xi[:, 1:2]) / (4 * r)
    return np.hstack([base, xi[:, 2:]])


def _dN(xi: FloatArray) -> FloatArray:
    r = _height(xi)
    along_x, along_y = r + _SQUARE[:, 0] * xi[:, :1], r + _SQUARE[:, 1] * xi[:, 1:2]
    gradient = np.zeros((len(xi), 5, 3))
    gradient[:, :4, 0] = _SQUARE[:, 0] * along_y / (4 * r)
    gradient[:, :4, 1] = _SQUARE[:, 1] * along_x / (4 * r)
    gradient[:, :4, 2] = -(along_x + along_y) / (4 * r) + along_x * along_y / (4 * r * r)
    gradient[:, 4, 2] = 1.0
    return gradient


PYR5 = Shape(
    name="PYR5",
    dim=3,
    degree=1,
    ref_nodes=np.vstack([np.c_[_SQUARE, np.zeros(4)], [[0.0, 0.0, 1.0]]]),
    N=_N,
    dN=_dN,
    faces=(
        ("QUA4", (0, 3, 2, 1)),
        ("TRI3", (0, 1, 4)),
        ("TRI3", (1, 2, 4)),
        ("TRI3", (2, 3, 4)),
        ("TRI3", (3, 0, 4)),
    ),
    edges=((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
    stiffness_rule=quadrature.pyramid(),
    mass_rule=quadrature.pyramid(),
    gmsh_type=7,
    meshio_name="pyramid",
    n_corners=5,
)
