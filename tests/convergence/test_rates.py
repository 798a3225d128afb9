"""Rates of convergence in energy on a smooth manufactured problem."""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels import assembly, geometry, quadrature, topology
from gibiane_ops.kernels.arrays import strain_vector
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.elements.table import SHAPES
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.solve import factorize

E, NU = 2.6, 0.3
LAMBDA, G = 1.5, 1.0
TETRAHEDRA = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]
# Rules finer than those of the stiffness, at whose points the error is smaller than elsewhere.
CASES = {
    "TRI3": ([[0, 1, 2], [0, 2, 3]], quadrature.triangle(4), (6, 12)),
    "QUA4": ([[0, 1, 2, 3]], quadrature.square(3), (6, 12)),
    "TET4": (TETRAHEDRA, quadrature.tetrahedron(2), (4, 8)),
    "CUB8": ([[0, 1, 2, 3, 4, 5, 6, 7]], quadrature.cube(3), (4, 8)),
}
AMPLITUDE = np.array([1.0, -0.6, 0.8])
WAVE = np.array([1.7, 1.1, -0.9])


def unit_box(n: int, dim: int, cut: list[list[int]]) -> tuple[np.ndarray, np.ndarray]:
    points = np.stack(np.meshgrid(*[np.linspace(0, 1, n + 1)] * dim, indexing="ij"), -1).reshape(-1, dim)
    number = np.arange((n + 1) ** dim).reshape([n + 1] * dim)
    corners = SHAPES["QUA4" if dim == 2 else "CUB8"].ref_nodes > 0
    cells = np.stack([number[tuple(slice(int(c), int(c) + n) for c in corner)] for corner in corners], -1)
    return points, cells.reshape(-1, 2**dim)[:, cut].reshape(-1, len(cut[0]))


def energy_error(name: str, n: int) -> float:
    """Solve for u = a sin(k.x) and return the energy norm of the error.

    Its body force is ((lambda + G)(k.a) k + G |k|^2 a) sin(k.x).
    """
    cut, rule, _ = CASES[name]
    each = SHAPES[name]
    dim = each.dim
    a, k = AMPLITUDE[:dim], WAVE[:dim]
    D = isotropic(E, NU, "TRID" if dim == 3 else "DEFO")
    points, cells = unit_box(n, dim, cut)
    X = points[cells]
    K = assembly.assemble(len(points), dim, [(cells, assembly.element_stiffness(each, X, D))])
    N, weights = each.N(rule.points), rule.weights
    wave = np.sin(geometry.positions(each, X, rule.points) @ k)
    factor = geometry.measure_densities(each, X, rule.points) * weights
    force = ((LAMBDA + G) * (k @ a) * k + G * (k @ k) * a) * (wave * factor)[..., None]
    F = assembly.assemble_vector(len(points), dim, [(cells, np.matmul(N.T, force))])
    skin = np.unique(topology.boundary([(name, cells)])[each.faces[0][0]].nodes)
    unknowns = (skin[:, None] * dim + np.arange(dim)).ravel()
    C = sp.csr_array((np.ones(len(unknowns)), (np.arange(len(unknowns)), unknowns)), shape=(len(unknowns), points.size))
    reduction = reduce_conditions(C, (np.sin(points[skin] @ k)[:, None] * a).ravel())
    u = reduction.expand(factorize(reduction.matrix(K)).solve(reduction.load(K, F))).reshape(-1, dim)
    H = np.zeros((*factor.shape, 3, 3))
    H[..., :dim, :dim] = np.outer(a, k) * np.cos(geometry.positions(each, X, rule.points) @ k)[..., None, None]
    exact = strain_vector((H + H.swapaxes(-1, -2)) / 2, len(D))
    gap = exact - assembly.strains(each, X, u[cells], rule.points)
    return float(np.sqrt(np.einsum("mqs,st,mqt,mq->", gap, D, gap, factor)))


@pytest.mark.parametrize("name", CASES)
def test_energy_error_halves_with_the_size(name: str) -> None:
    coarse, fine = CASES[name][2]
    rate = np.log2(energy_error(name, coarse) / energy_error(name, fine))
    assert 0.95 < rate < 1.1
