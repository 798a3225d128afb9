"""Rates on singular problems: uniform refinement shows the singularity, adapted meshes and hp do not.

The L-shaped plate of scripts/scenes (2D) and the same drawn out in space, whose edge is singular along a line.
"""

from functools import lru_cache

import numpy as np
import pytest
import scipy.sparse as sp
from hanging_relations import relation_matrix

from gibiane_ops.kernels import assembly, elasticity, geometry, hanging, integrals, recovery, topology
from gibiane_ops.kernels.adapt import hierarchy
from gibiane_ops.kernels.adapt.orders import singular_orders
from gibiane_ops.kernels.adapt.sizes import size_map
from gibiane_ops.kernels.elements.quadratic import QUADRATIC
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.zz import solid_error
from gibiane_ops.kernels.materials import compliance, isotropic
from gibiane_ops.kernels.recovery import StressBlock
from gibiane_ops.kernels.solve import factorize

FAMILY = {2: "DEFO", 3: "TRID"}
EXPONENT = 0.5445


def l_shape(n, name):
    """Cut (-1, 1)^2 without its lower left quarter, times (0, 1/2) in space, into 3 n^2 squares or bricks."""
    of = shape(name)
    dim = of.dim
    lines = [np.linspace(-1, 1, 2 * n + 1)] * 2 + [np.linspace(0, 0.5, max(n // 2, 1) + 1)] * (dim - 2)
    points = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, dim)
    counts = tuple(len(line) for line in lines)
    index = np.arange(len(points)).reshape(counts)
    offsets = np.round((shape({2: "QUA4", 3: "CUB8"}[dim]).ref_nodes + 1) / 2).astype(int)
    cells = np.stack(
        [index[tuple(slice(o, c - 1 + o) for o, c in zip(offset, counts, strict=True))] for offset in offsets], -1
    ).reshape(-1, 2**dim)
    cells = cells[~(points[cells].mean(axis=1)[:, :2] < 0).all(axis=1)]
    cut = {
        "TRI3": [[0, 1, 2], [0, 2, 3]],
        "TET4": [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]],
    }
    if name in cut:
        cells = cells[:, cut[name]].reshape(-1, of.n_nodes)
    used, cells = np.unique(cells, return_inverse=True)
    return points[used], cells.reshape(-1, of.n_nodes)


def raised(points, cells, name):
    """Give every element mid-nodes."""
    high = shape(QUADRATIC[name])
    pairs = np.sort(cells[:, np.array([edge[:2] for edge in high.edges])].reshape(-1, 2), axis=1)
    edges, index = np.unique(pairs, axis=0, return_inverse=True)
    return (
        np.vstack([points, points[edges].mean(axis=1)]),
        np.hstack([cells, len(points) + index.reshape(len(cells), -1)]),
        QUADRATIC[name],
    )


def solved(points, cells, name):
    """Pull the outer sides; return the displacement, the energy u.K.u and the number of free nodes."""
    of = shape(name)
    dim = of.dim
    each = elasticity.element_stiffness(of, points[cells], isotropic(1.0, 0.3, FAMILY[dim]))
    K = assembly.assemble(len(points), dim, [(cells, each)])
    F = np.zeros((len(points), dim))
    for facets in topology.boundary([(name, cells)]).values():
        for axis in range(2):
            on = facets.nodes[np.isclose(points[facets.nodes][:, :, axis], 1).all(axis=1)]
            pull = np.eye(dim)[axis]
            load = integrals.distributed_load(shape(facets.name), points[on], pull)
            F += assembly.assemble_vector(len(points), dim, [(on, load)]).reshape(-1, dim)
    nodes, masters = hanging.hanging_nodes(points, [(name, cells)])
    T = sp.csr_array(sp.kron(relation_matrix(len(points), nodes, masters), sp.eye_array(dim)))
    own = np.setdiff1d(np.arange(len(points)), nodes)
    held = np.zeros((len(own), dim), bool)
    held[:, 0] = np.isclose(points[own, 0], -1)
    held[:, 1] = np.isclose(points[own, 1], -1)
    if dim == 3:
        held[:, 2] = np.isclose(points[own, 2], 0) | np.isclose(points[own, 2], 0.5)
    free = np.flatnonzero(~held.ravel())
    A = sp.csr_array(T.T @ K @ T)[free][:, free]
    b = (T.T @ F.ravel())[free]
    x = np.zeros(held.size)
    x[free] = factorize(sp.csr_array(A)).solve(b)
    return (T @ x).reshape(-1, dim), float(b @ x[free]), len(own)


def error_map(points, cells, name, U):
    of = shape(name)
    D, S = isotropic(1.0, 0.3, FAMILY[of.dim]), compliance(1.0, 0.3, FAMILY[of.dim])
    block = StressBlock(of, cells, elasticity.stresses(elasticity.strains(of, points[cells], U[cells], of.gauss[0]), D))
    return np.sqrt(solid_error(points, block, recovery.mean_of_nodes(len(points), [block]), S).error)


def adapted_meshes(name, n, targets):
    """Divide in place towards ever smaller errors; return the meshes."""
    points, cells = l_shape(n, name)
    state = hierarchy.founded(name, points, cells)
    found = []
    for target in targets:
        mesh = state.mesh()
        U, energy, count = solved(mesh.points, mesh.cells, name)
        found.append((mesh, energy, count))
        error = error_map(mesh.points, mesh.cells, name, U)
        measure = np.abs(geometry.measures(shape(name), mesh.points[mesh.cells]))
        blocks = [(name, mesh.cells)]
        order = singular_orders(len(mesh.points), blocks, error**2, measure, 1.0, beta=2.0)
        sizes = size_map(mesh.points, blocks, error, target * np.sqrt((error**2).sum()), order=order)
        state, _ = hierarchy.adapted(state, sizes.nodal)
    mesh = state.mesh()
    found.append((mesh, *solved(mesh.points, mesh.cells, name)[1:]))
    return found


def rates(counts, errors):
    return -np.diff(np.log(errors)) / np.diff(np.log(counts))


@lru_cache
def exact_energy():
    """Take the energy of quadratic triangles on an adapted mesh of the plate."""
    mesh, _, _ = adapted_meshes("TRI3", 4, (0.5, 0.5, 0.5, 0.6))[-1]
    return solved(*raised(mesh.points, mesh.cells, "TRI3"))[1]


@pytest.mark.parametrize("name", ["TRI3", "QUA4"])
def test_adapted_meshes_of_the_plate_recover_the_rate_of_a_smooth_solution(name):
    found = adapted_meshes(name, 4, (0.5, 0.5, 0.6))
    exact = exact_energy()
    counts = np.array([count for _, _, count in found])
    errors = np.sqrt([exact - energy for _, energy, _ in found])
    # error ~ N^(-p/d) = N^(-1/2), faster while the first, uniform mesh is being left behind
    assert -0.65 <= np.polyfit(np.log(counts[1:]), np.log(errors[1:]), 1)[0] <= -0.45
    uniform = [solved(*l_shape(n, name), name) for n in (8, 16, 32)]
    counts = np.array([count for _, _, count in uniform])
    errors = np.sqrt([exact - energy for _, energy, _ in uniform])
    # error ~ h^0.5445 = N^(-0.272)
    assert rates(counts, errors)[-1] == pytest.approx(EXPONENT / 2, abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["TET4", "CUB8"])
def test_refinement_towards_a_singular_edge_recovers_the_rate_in_space(name):
    found = adapted_meshes(name, 4, (0.6, 0.6, 0.7))
    exact = 0.5 * exact_energy()  # plane strain, half as thick
    counts = np.array([count for _, _, count in found])
    errors = np.sqrt([exact - energy for _, energy, _ in found])
    slope = np.polyfit(np.log(counts[1:]), np.log(errors[1:]), 1)[0]
    assert slope <= -0.28  # N^(-1/3); uniform meshes: N^(-0.18)
    uniform = [solved(*l_shape(n, name), name) for n in (4, 8, 12)]
    counts = np.array([count for _, _, count in uniform])
    errors = np.sqrt([exact - energy for _, energy, _ in uniform])
    assert rates(counts, errors)[-1] == pytest.approx(EXPONENT / 3, abs=0.04)
