"""The L-shaped plate: near the reentrant corner the stress is singular, and uniform refinement converges slowly."""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels import assembly, elasticity, geometry, topology
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.elements.quadratic import QUADRATIC
from gibiane_ops.kernels.elements.table import SHAPES
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.solve import factorize

E, NU = 1.0, 0.3
G, KAPPA = E / (2 * (1 + NU)), 3 - 4 * NU
# First root of sin(3 pi L / 2) + L sin(3 pi / 2) = 0 and the ratio that frees the sides (Szabo and Babuska 1991).
EXPONENT, RATIO = 0.544483736782464, 0.543075578836737
CUTS = {"QUA4": [[0, 1, 2, 3]], "TRI3": [[0, 1, 2], [0, 2, 3]]}


def displacement(x: np.ndarray) -> np.ndarray:
    """Return the first symmetric singular field of a corner of 270 degrees whose sides leave it along x < 0 and y < 0.

    The axis of symmetry is the first diagonal; the sides are free of traction (plane strain).
    """
    turned = np.pi / 4
    r = np.linalg.norm(x, axis=-1)
    angle = np.arctan2(x[..., 1], x[..., 0]) - turned
    angle = (angle + np.pi) % (2 * np.pi) - np.pi
    L, Q = EXPONENT, RATIO
    scale = r**L / (2 * G)
    u = scale * ((KAPPA - Q * (L + 1)) * np.cos(L * angle) - L * np.cos((L - 2) * angle))
    v = scale * ((KAPPA + Q * (L + 1)) * np.sin(L * angle) + L * np.sin((L - 2) * angle))
    c, s = np.cos(turned), np.sin(turned)
    return np.stack([c * u - s * v, s * u + c * v], axis=-1)


def l_shape(n: int, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Cut [-1, 1]^2 without its lower left quarter into 3 n^2 squares."""
    linear = next((low for low, high in QUADRATIC.items() if high == name), name)
    size = 2 * n + 1
    line = np.linspace(-1, 1, size)
    points = np.stack(np.meshgrid(line, line, indexing="ij"), -1).reshape(-1, 2)
    number = np.arange(size * size).reshape(size, size)
    cells = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], -1).reshape(-1, 4)
    cells = cells[~(points[cells].mean(axis=1) < 0).all(axis=1)][:, CUTS[linear]].reshape(-1, SHAPES[linear].n_nodes)
    used, cells = np.unique(cells, return_inverse=True)
    points, cells = points[used], cells.reshape(-1, SHAPES[linear].n_nodes)
    if name != linear:
        pairs = np.sort(cells[:, np.array(SHAPES[linear].edges)].reshape(-1, 2), axis=1)
        unique, middle = np.unique(pairs, axis=0, return_inverse=True)
        cells = np.hstack([cells, len(points) + middle.reshape(len(cells), -1)])
        points = np.vstack([points, points[unique].mean(axis=1)])
    return points, cells


def strain_energy(name: str, n: int) -> float:
    """Solve with the exact displacement imposed on the outer sides, the two sides of the corner free; return u.K.u."""
    points, cells = l_shape(n, name)
    each = SHAPES[name]
    K = assembly.assemble(
        len(points), 2, [(cells, elasticity.element_stiffness(each, points[cells], isotropic(E, NU, "DEFO")))]
    )
    (facets,) = topology.boundary([(name, cells)]).values()
    outer = np.unique(facets.nodes[np.isclose(np.abs(points[facets.nodes]), 1).all(axis=1).any(axis=1)])
    unknowns = (outer[:, None] * 2 + [0, 1]).ravel()
    C = sp.csr_array((np.ones(len(unknowns)), (np.arange(len(unknowns)), unknowns)), shape=(len(unknowns), points.size))
    reduction = reduce_conditions(C, displacement(points[outer]).ravel())
    u = reduction.expand(factorize(reduction.matrix(K)).solve(reduction.load(K, np.zeros(points.size))))
    return float(u @ (K @ u))


def test_the_singular_field_is_in_balance_and_its_sides_are_free() -> None:
    """Differences of the field: stress free on y = 0, x < 0 and on x = 0, y < 0, forces in balance inside."""
    D, step = isotropic(E, NU, "DEFO")[np.ix_([0, 1, 3], [0, 1, 3])], 1e-5

    def stress(x: np.ndarray) -> np.ndarray:
        slope = [(displacement(x + step * d) - displacement(x - step * d)) / (2 * step) for d in np.eye(2)]
        return D @ np.array([slope[0][0], slope[1][1], slope[0][1] + slope[1][0]])

    scale = np.abs(stress(np.array([0.5, 0.5]))).max()
    assert np.abs(stress(np.array([-0.5, 2e-5]))[[1, 2]]).max() < 1e-3 * scale
    assert np.abs(stress(np.array([2e-5, -0.5]))[[0, 2]]).max() < 1e-3 * scale
    at, h = np.array([0.4, 0.3]), 1e-3
    by_x, by_y = ((stress(at + h * d) - stress(at - h * d)) / (2 * h) for d in np.eye(2))
    assert abs(by_x[0] + by_y[2]) < 1e-3 * scale
    assert abs(by_x[2] + by_y[1]) < 1e-3 * scale


@pytest.mark.parametrize("name", ["TRI3", "QUA4", "TRI6", "QUA8"])
def test_the_rate_is_the_exponent_whatever_the_degree(name: str) -> None:
    """The energy of the error, which successive meshes share, goes as h^(2 L): both degrees feel the corner alone."""
    sizes = (4, 8, 16) if SHAPES[name].degree == 2 else (8, 16, 32)
    energy = [strain_energy(name, n) for n in sizes]
    rate = np.log2((energy[0] - energy[1]) / (energy[1] - energy[2]))
    assert rate == pytest.approx(2 * EXPONENT, abs=0.08)


def test_the_mesh_is_an_l() -> None:
    points, cells = l_shape(4, "QUA8")
    assert geometry.measures(SHAPES["QUA8"], points[cells]).sum() == pytest.approx(3.0)
