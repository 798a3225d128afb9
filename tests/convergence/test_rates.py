"""Rates of convergence on smooth manufactured problems: p in energy, p + 1 in displacement, every shape and mode."""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels import assembly, bars, elasticity, geometry, quadrature, topology
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


# Plane stress is plane strain with another first constant of Lame.
PLANE_STRESS = 2 * LAMBDA * G / (LAMBDA + 2 * G)
CASES = [(name, mode) for name in SIZES for mode in (("TRID",) if SHAPES[name].dim == 3 else ("DEFO", "CONT", "AXIS"))]


def wave(x: np.ndarray, mode: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return displacement, strain (Voigt) and body force of ``u = a sin(k.x)`` at points (..., dim)."""
    dim = x.shape[-1]
    a, k = AMPLITUDE[:dim], WAVE[:dim]
    first = PLANE_STRESS if mode == "CONT" else LAMBDA
    phase = x @ k
    H = np.zeros((*phase.shape, 3, 3))
    H[..., :dim, :dim] = np.outer(a, k) * np.cos(phase)[..., None, None]
    force = ((first + G) * (k @ a) * k + G * (k @ k) * a) * np.sin(phase)[..., None]
    strain = strain_vector((H + H.swapaxes(-1, -2)) / 2, 6 if dim == 3 else 4)
    return a * np.sin(phase)[..., None], strain, force


def ring(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return displacement, strain (rr zz tt rz) and body force of ``u = (A r^2 cos kz, B r^2 sin kz)``."""
    A, B, k = 0.7, -0.4, 1.3
    r, c, s = x[..., 0], np.cos(k * x[..., 1]), np.sin(k * x[..., 1])
    u = np.stack([A * r**2 * c, B * r**2 * s], -1)
    strain = np.stack([2 * A * r * c, B * k * r**2 * c, A * r * c, (2 * B - A * k * r) * r * s], -1)
    radial = LAMBDA * (3 * A + 2 * B * k * r) * c + 6 * G * A * c + G * (2 * B * k * r - A * k**2 * r**2) * c
    axial = 4 * G * B * s - 3 * (LAMBDA + G) * A * k * r * s - (LAMBDA + 2 * G) * B * k**2 * r**2 * s
    return u, strain, -np.stack([radial, axial], -1)


def errors(name: str, mode: str, n: int) -> tuple[float, float]:
    """Solve with the body force of a known field, imposed on the boundary; return energy and L2 norm of the error."""
    each = SHAPES[name]
    linear = next((low for low, high in QUADRATIC.items() if high == name), name)
    dim, rule, axis = each.dim, RULES[linear], mode == "AXIS"
    D = isotropic(E, NU, mode)
    points, cells = unit_box(n, linear, name != linear)
    if axis:
        points = points + [1.0, 0.0]
    X = points[cells]
    K = assembly.assemble(len(points), dim, [(cells, elasticity.element_stiffness(each, X, D, axisymmetric=axis))])
    N = each.N(rule.points)
    places = geometry.positions(each, X, rule.points)
    u, strain, force = ring(places) if axis else wave(places, mode)
    factor = geometry.measure_densities(each, X, rule.points) * rule.weights
    factor = factor * (2 * np.pi * places[..., 0] if axis else 1.0)
    F = assembly.assemble_vector(len(points), dim, [(cells, np.matmul(N.T, force * factor[..., None]))])
    skin = np.unique(np.concatenate([f.nodes.ravel() for f in topology.boundary([(name, cells)]).values()]))
    unknowns = (skin[:, None] * dim + np.arange(dim)).ravel()
    C = sp.csr_array((np.ones(len(unknowns)), (np.arange(len(unknowns)), unknowns)), shape=(len(unknowns), points.size))
    imposed = (ring(points[skin]) if axis else wave(points[skin], mode))[0]
    reduction = reduce_conditions(C, imposed.ravel())
    found = reduction.expand(factorize(reduction.matrix(K)).solve(reduction.load(K, F))).reshape(-1, dim)
    gap = strain - elasticity.strains(each, X, found[cells], rule.points, axisymmetric=axis)
    energy = np.einsum("mqs,st,mqt,mq->", gap, D, gap, factor)
    distance = u - np.matmul(N, found[cells])
    return float(np.sqrt(energy)), float(np.sqrt(np.einsum("mqi,mqi,mq->", distance, distance, factor)))


@pytest.mark.parametrize(("name", "mode"), CASES)
def test_rates(name: str, mode: str) -> None:
    """The error in energy goes as h^p, that of the displacement as h^(p + 1)."""
    coarse, fine = SIZES[name]
    p, ratio = SHAPES[name].degree, np.log(fine / coarse)
    (energy, distance), (less_energy, less_distance) = errors(name, mode, coarse), errors(name, mode, fine)
    assert p - 0.1 < np.log(energy / less_energy) / ratio < p + 0.25
    assert p + 0.85 < np.log(distance / less_distance) / ratio < p + 1.3


@pytest.mark.parametrize("name", ["SEG2", "SEG3"])
def test_rates_of_bars(name: str) -> None:
    """An inclined row of bars stretched by ``u = sin(3 s)`` along it."""
    each = SHAPES[name]
    rule, way, modulus = quadrature.line(5), np.array([0.6, 0.8]), 2.5
    found = []
    for n in (4, 8):
        s = np.linspace(0, 1, n * each.degree + 1)
        points, first = s[:, None] * way, np.arange(n) * each.degree
        cells = np.stack([first, first + each.degree] + ([first + 1] if each.degree == 2 else []), -1)
        X = points[cells]
        K = assembly.assemble(len(points), 2, [(cells, bars.bar_stiffness(each, X, np.full((n, 1, 1), modulus)))])
        at = geometry.positions(each, X, rule.points) @ way
        factor = geometry.measure_densities(each, X, rule.points) * rule.weights
        force = (9 * modulus * np.sin(3 * at) * factor)[..., None] * way
        F = assembly.assemble_vector(len(points), 2, [(cells, np.matmul(each.N(rule.points).T, force))])
        # along the row, by a change of unknowns: across it bars have no stiffness
        T = np.kron(np.eye(len(points)), way[:, None])
        k, f = T.T @ K.toarray() @ T, T.T @ F
        inner = np.arange(1, len(points) - 1)
        v = np.sin(3 * s)
        v[inner] = np.linalg.solve(k[np.ix_(inner, inner)], f[inner] - k[np.ix_(inner, [0, len(s) - 1])] @ v[[0, -1]])
        u = (v[:, None] * way)[cells]
        strain = 3 * np.cos(3 * at) - bars.bar_strains(each, X, u, rule.points)[..., 0]
        gap = np.sin(3 * at)[..., None] * way - np.matmul(each.N(rule.points), u)
        found.append((np.sqrt((strain**2 * factor).sum()), np.sqrt(((gap**2).sum(-1) * factor).sum())))
    p = each.degree
    assert np.log2(found[0][0] / found[1][0]) == pytest.approx(p, abs=0.1)
    assert np.log2(found[0][1] / found[1][1]) == pytest.approx(p + 1, abs=0.1)
