"""Rates of convergence on a smooth manufactured problem: p in energy, p + 1 in displacement, on every shape."""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels import assembly, geometry, quadrature, topology
from gibiane_ops.kernels.arrays import strain_vector
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.elements.quadratic import QUADRATIC
from gibiane_ops.kernels.elements.table import SHAPES
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.solve import factorize

E, NU = 2.6, 0.3
LAMBDA, G = 1.5, 1.0
CUTS = {
    "TRI3": [[0, 1, 2], [0, 2, 3]],
    "QUA4": [[0, 1, 2, 3]],
    "TET4": [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]],
    "PYR5": [[*reversed(nodes), 8] for _, nodes in SHAPES["CUB8"].faces],
    "PRI6": [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]],
    "CUB8": [[0, 1, 2, 3, 4, 5, 6, 7]],
}
# Rules finer than those of the stiffness, at whose points the error is smaller than elsewhere.
RULES = {
    "TRI3": quadrature.triangle(4),
    "QUA4": quadrature.square(4),
    "TET4": quadrature.tetrahedron(5),
    "PYR5": quadrature.pyramid(4),
    "PRI6": quadrature.prism(4, 4),
    "CUB8": quadrature.cube(4),
}
# Cells per side of the unit box, coarse and fine.
SIZES = {"TRI3": (6, 12), "QUA4": (6, 12), "TRI6": (3, 6), "QUA8": (3, 6)} | {
    "TET4": (4, 8), "PYR5": (3, 6), "PRI6": (4, 8), "CUB8": (4, 8),
    "TE10": (2, 4), "PY13": (2, 4), "PR15": (2, 4), "CU20": (2, 4)
}  # fmt: skip
AMPLITUDE = np.array([1.0, -0.6, 0.8])
WAVE = np.array([1.7, 1.1, -0.9])


def unit_box(n: int, linear: str, middles: bool) -> tuple[np.ndarray, np.ndarray]:
    dim = SHAPES[linear].dim
    points = np.stack(np.meshgrid(*[np.linspace(0, 1, n + 1)] * dim, indexing="ij"), -1).reshape(-1, dim)
    number = np.arange((n + 1) ** dim).reshape([n + 1] * dim)
    corners = SHAPES["QUA4" if dim == 2 else "CUB8"].ref_nodes > 0
    cells = np.stack([number[tuple(slice(int(c), int(c) + n) for c in corner)] for corner in corners], -1)
    cells = cells.reshape(-1, 2**dim)
    if linear == "PYR5":
        cells = np.c_[cells, len(points) + np.arange(len(cells))]
        points = np.vstack([points, points[cells[:, :8]].mean(axis=1)])
    cells = cells[:, CUTS[linear]].reshape(-1, SHAPES[linear].n_nodes)
    if middles:
        pairs = np.sort(cells[:, np.array(SHAPES[linear].edges)].reshape(-1, 2), axis=1)
        unique, number = np.unique(pairs, axis=0, return_inverse=True)
        cells = np.hstack([cells, len(points) + number.reshape(len(cells), -1)])
        points = np.vstack([points, points[unique].mean(axis=1)])
    return points, cells


def errors(name: str, n: int) -> tuple[float, float]:
    """Solve for u = a sin(k.x) and return the energy norm and the L2 norm of the error.

    Its body force is ((lambda + G)(k.a) k + G |k|^2 a) sin(k.x).
    """
    each = SHAPES[name]
    linear = next((low for low, high in QUADRATIC.items() if high == name), name)
    dim, rule = each.dim, RULES[linear]
    a, k = AMPLITUDE[:dim], WAVE[:dim]
    D = isotropic(E, NU, "TRID" if dim == 3 else "DEFO")
    points, cells = unit_box(n, linear, name != linear)
    X = points[cells]
    K = assembly.assemble(len(points), dim, [(cells, assembly.element_stiffness(each, X, D))])
    N, weights = each.N(rule.points), rule.weights
    phase = geometry.positions(each, X, rule.points) @ k
    factor = geometry.measure_densities(each, X, rule.points) * weights
    force = ((LAMBDA + G) * (k @ a) * k + G * (k @ k) * a) * (np.sin(phase) * factor)[..., None]
    F = assembly.assemble_vector(len(points), dim, [(cells, np.matmul(N.T, force))])
    skin = np.unique(np.concatenate([f.nodes.ravel() for f in topology.boundary([(name, cells)]).values()]))
    unknowns = (skin[:, None] * dim + np.arange(dim)).ravel()
    C = sp.csr_array((np.ones(len(unknowns)), (np.arange(len(unknowns)), unknowns)), shape=(len(unknowns), points.size))
    reduction = reduce_conditions(C, (np.sin(points[skin] @ k)[:, None] * a).ravel())
    u = reduction.expand(factorize(reduction.matrix(K)).solve(reduction.load(K, F))).reshape(-1, dim)
    H = np.zeros((*factor.shape, 3, 3))
    H[..., :dim, :dim] = np.outer(a, k) * np.cos(phase)[..., None, None]
    gap = strain_vector((H + H.swapaxes(-1, -2)) / 2, len(D)) - assembly.strains(each, X, u[cells], rule.points)
    energy = np.einsum("mqs,st,mqt,mq->", gap, D, gap, factor)
    distance = np.sin(phase)[..., None] * a - np.matmul(N, u[cells])
    return float(np.sqrt(energy)), float(np.sqrt(np.einsum("mqi,mqi,mq->", distance, distance, factor)))


@pytest.mark.parametrize("name", SIZES)
def test_rates(name: str) -> None:
    """The error in energy goes as h^p, that of the displacement as h^(p + 1)."""
    coarse, fine = SIZES[name]
    p, ratio = SHAPES[name].degree, np.log(fine / coarse)
    (energy, distance), (less_energy, less_distance) = errors(name, coarse), errors(name, fine)
    assert p - 0.1 < np.log(energy / less_energy) / ratio < p + 0.25
    assert p + 0.85 < np.log(distance / less_distance) / ratio < p + 1.3
