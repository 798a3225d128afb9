"""Multigrid: aggregates, near-null vectors kept, iterations that do not grow with the mesh."""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels import assembly, elasticity, multigrid
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.iterations import amg
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.multigrid import Multigrid, aggregate
from gibiane_ops.kernels.rigid import rigid_modes


def solid(n, dim=3, stretch=1.0):
    """A clamped block of n^dim elements: matrix with the clamped unknowns kept apart, and its modes."""
    of = shape("CUB8" if dim == 3 else "QUA4")
    axes = [np.arange(n + 1.0)] * (dim - 1) + [stretch * np.arange(n + 1.0)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, dim)
    number = np.arange(len(points)).reshape((n + 1,) * dim)
    corners = (of.ref_nodes > 0).astype(int)
    cells = np.stack([number[tuple(slice(c, c + n) for c in corner)] for corner in corners], -1).reshape(-1, 2**dim)
    D = isotropic(1.0, 0.3) if dim == 3 else isotropic(1.0, 0.3)[:4, :4]
    K = assembly.assemble(len(points), dim, [(cells, elasticity.element_stiffness(of, points[cells], D))])
    clamped = np.repeat(points[:, -1] == 0, dim)
    keep = sp.diags_array(np.where(clamped, 0.0, 1.0))
    A = sp.csr_array(keep @ K @ keep + sp.diags_array(np.where(clamped, K.diagonal(), 0.0)))
    modes = rigid_modes(points, points.mean(axis=0))
    modes[clamped] = 0
    b = np.where(clamped, 0.0, np.random.default_rng(0).standard_normal(len(clamped)))
    return A, modes, b


@pytest.mark.parametrize("dim", [2, 3])
def test_iterations_do_not_grow_with_the_mesh(dim):
    counts = []
    for n in (6, 12) if dim == 3 else (20, 60):
        A, modes, b = solid(n, dim)
        solver = amg(A, modes, dim, 1e-10)
        x = solver(b)
        assert np.linalg.norm(A @ x - b) <= 1e-9 * np.linalg.norm(b)
        counts.append(solver.iterations)
    assert max(counts) <= 22
    assert counts[1] <= counts[0] + 8


def test_without_rigid_modes_it_is_slower():
    A, modes, b = solid(10)
    with_modes, without = amg(A, modes, 3, 1e-10), amg(A, None, 3, 1e-10)
    with_modes(b)
    without(b)
    assert with_modes.iterations < without.iterations


def test_columns_together_are_columns_alone():
    A, modes, b = solid(8)
    solver = amg(A, modes, 3, 1e-12)
    many = np.stack([b, np.zeros_like(b), 1e-9 * np.roll(b, 3)], axis=1)
    together = solver(many)
    np.testing.assert_array_equal(together[:, 1], 0)
    np.testing.assert_allclose(together[:, 2], solver(many[:, 2]), rtol=0, atol=1e-9 * np.abs(together[:, 2]).max())


def test_the_same_matrix_gives_the_same_bits():
    A, modes, b = solid(8)
    np.testing.assert_array_equal(amg(A, modes, 3, 1e-10)(b), amg(A, modes, 3, 1e-10)(b))


def test_units_do_not_matter():
    A, modes, b = solid(8)
    x, y = amg(A, modes, 3, 1e-10), amg(1e15 * A, modes, 3, 1e-10)
    np.testing.assert_allclose(1e15 * y(b), x(b), rtol=1e-6, atol=1e-9)
    assert x.iterations == y.iterations


def test_a_cycle_is_symmetric_and_positive():
    A, modes, _ = solid(7)
    cycle = Multigrid(A, modes, 3)
    assert len(cycle.levels) >= 1
    u, v = np.random.default_rng(5).standard_normal((2, A.shape[0]))
    assert u @ cycle(v) == pytest.approx(v @ cycle(u), rel=1e-4)
    assert v @ cycle(v) > 0


def test_aggregates_cover_the_nodes_that_have_neighbours():
    links = sp.random_array((300, 300), density=0.01, random_state=np.random.default_rng(1), format="csr")
    keep = sp.diags_array((np.arange(300) != 7) * 1.0)
    links = keep @ links @ keep
    links.eliminate_zeros()
    graph = sp.csr_array(links + links.T + sp.eye_array(300))
    graph.sort_indices()
    label = aggregate(graph)
    alone = np.diff(graph.indptr) == 1
    assert alone[7]
    np.testing.assert_array_equal(label[alone], -1)
    assert (label[~alone] >= 0).all()
    np.testing.assert_array_equal(np.unique(label[~alone]), np.arange(label.max() + 1))
    # each aggregate hangs together
    for name in range(label.max() + 1):
        members = np.flatnonzero(label == name)
        part = graph[members][:, members]
        assert sp.csgraph.connected_components(part)[0] == 1


def test_nothing_to_gather():
    A = sp.diags_array(np.arange(1.0, 9001.0), format="csr")
    x = amg(A, None, 1, 1e-12)(np.ones(9000))
    np.testing.assert_allclose(x, 1 / np.arange(1.0, 9001.0), rtol=1e-10)


def test_single_precision_is_no_limit(monkeypatch):
    monkeypatch.setattr(multigrid, "COARSEST", 100)
    A, modes, b = solid(6)
    x = amg(A, modes, 3, 1e-13)(b)
    assert np.linalg.norm(A @ x - b) <= 1e-12 * np.linalg.norm(b)
