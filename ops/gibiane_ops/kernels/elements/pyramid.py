"""PYR5 and PY13, the pyramid of base [-1, 1]^2 (nodes 0-3, counterclockwise from (-1, -1)) and apex (0, 0, 1).

Mid-nodes of PY13: the sides of the base, then the edges to the apex.
"""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements import quadratic
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
    stiffness_rule=quadrature.pyramid_5(),
    mass_rule=quadrature.pyramid(2),
    gmsh_type=7,
    meshio_name="pyramid",
    n_corners=5,
)


def _space(xi: FloatArray) -> FloatArray:
    """Return the functions that span the interpolation of PY13: degree 2, and those of the base made conical."""
    x, y, z, r = xi[:, 0], xi[:, 1], xi[:, 2], _height(xi)[:, 0]
    one = np.ones_like(x)
    return np.stack(
        [one, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z, x * y / r, x * x * y / r, x * y * y / r], 1
    )


def _slopes(xi: FloatArray) -> FloatArray:
    """Return the derivatives of `_space`, (q, 13, 3)."""
    x, y, z, r = xi[:, 0], xi[:, 1], xi[:, 2], _height(xi)[:, 0]
    one, nil = np.ones_like(x), np.zeros_like(x)
    by_x = [nil, one, nil, nil, 2 * x, nil, nil, y, z, nil, y / r, 2 * x * y / r, y * y / r]
    by_y = [nil, nil, one, nil, nil, 2 * y, nil, x, nil, z, x / r, x * x / r, 2 * x * y / r]
    q = x * y / (r * r)
    by_z = [nil, nil, nil, one, nil, nil, 2 * z, nil, x, y, q, x * q, y * q]
    return np.stack([np.stack(each, 1) for each in (by_x, by_y, by_z)], 2)


# On the faces the space is that of QUA8 and of TRI6, so that the pyramid joins its neighbours (Bedrosian 1992).
_NODAL = np.linalg.inv(_space(quadratic.ref_nodes(PYR5)))


def _N13(xi: FloatArray) -> FloatArray:
    return np.asarray(_space(xi) @ _NODAL, np.float64)


def _dN13(xi: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("qsi,sa->qai", _slopes(xi), _NODAL), np.float64)


PY13 = Shape(
    name="PY13",
    dim=PYR5.dim,
    degree=2,
    ref_nodes=quadratic.ref_nodes(PYR5),
    N=_N13,
    dN=_dN13,
    faces=quadratic.faces(PYR5),
    edges=quadratic.edges(PYR5),
    stiffness_rule=quadrature.pyramid(3),
    mass_rule=quadrature.pyramid(3),
    gmsh_type=19,
    meshio_name="pyramid13",
    n_corners=PYR5.n_corners,
)
