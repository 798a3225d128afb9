"""Element matrices and vectors against hand-computed values, and the assembly against a plain loop."""

import numpy as np
import pytest

from gibiane_ops.kernels import assembly, elasticity, geometry, integrals
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import InvertedElement
from gibiane_ops.kernels.materials import isotropic

SQUARE = np.array([[[0.0, 0], [1, 0], [1, 1], [0, 1]]])


def test_square_in_plane_stress_by_hand() -> None:
    E, nu = 210000.0, 0.3
    K = elasticity.element_stiffness(shape("QUA4"), SQUARE, isotropic(E, nu, "CONT"))[0]
    a = E / (1 - nu**2)
    assert K[0, 0] == pytest.approx(a * (3 - nu) / 6)
    assert K[0, 1] == pytest.approx(a * (1 + nu) / 8)
    assert K[0, 2] == pytest.approx(-a * (3 + nu) / 12)
    assert K[0, 4] == pytest.approx(-a * (3 - nu) / 12)


def test_cube_diagonal_by_hand() -> None:
    # int N,x^2 = int N,y^2 = int N,z^2 = 1/9 on the unit cube: K[0, 0] = (lambda + 4 G) / 9.
    X = (shape("CUB8").ref_nodes[None] + 1) / 2
    K = elasticity.element_stiffness(shape("CUB8"), X, isotropic(2.6, 0.3))[0]
    assert K[0, 0] == pytest.approx((1.5 + 4) / 9)


@pytest.mark.parametrize("name", ["TRI3", "QUA4", "TET4", "PYR5", "PRI6", "CUB8"])
def test_stiffness_is_the_integral_of_B_D_B(name: str) -> None:
    rng = np.random.default_rng(5)
    each = shape(name)
    X = each.ref_nodes + 0.1 * rng.standard_normal((3, *each.ref_nodes.shape))
    n = 6 if each.dim == 3 else 4
    A = rng.standard_normal((3, n, n))
    D = A + A.transpose(0, 2, 1)
    points, weights = each.gauss
    B = elasticity.strain_operator(each, X, points)
    expected = np.einsum("mqsi,mst,mqtj,mq->mij", B, D, B, geometry.check_cells(each, X) * weights)
    K = elasticity.element_stiffness(each, X, D)
    assert np.allclose(K, expected, atol=1e-12 * np.abs(expected).max())
    assert np.allclose(elasticity.element_stiffness(each, X, D[0])[0], expected[0], atol=1e-12 * np.abs(expected).max())
    U = rng.standard_normal(X.shape)
    strain = elasticity.strains(each, X, U, points)
    assert np.allclose(strain, np.einsum("mqsi,mi->mqs", B, U.reshape(3, -1)), atol=1e-12)
    forces = elasticity.internal_forces(each, X, elasticity.stresses(strain, D))
    assert np.allclose(forces.reshape(3, -1), np.einsum("mij,mj->mi", K, U.reshape(3, -1)), atol=1e-10)


def test_strains_by_hand() -> None:
    # u = (2x + 3y, 5y): eps = (2, 5, 0, 3).
    U = SQUARE @ np.array([[2.0, 0], [3, 5]])
    strain = elasticity.strains(shape("QUA4"), SQUARE, U, np.zeros((1, 2)))
    assert strain[0, 0] == pytest.approx([2, 5, 0, 3])


def test_inverted_cell_is_refused_by_its_number() -> None:
    X = np.concatenate([SQUARE] * 1500 + [SQUARE[:, ::-1]])
    with pytest.raises(InvertedElement) as caught:
        elasticity.element_stiffness(shape("QUA4"), X, isotropic(1.0, 0.3, "DEFO"))
    assert caught.value.ids.tolist() == [1500]


def test_pressure_on_a_square_pushes_against_the_normal() -> None:
    X = np.array([[[0.0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0]]])
    forces = integrals.pressure_load(shape("QUA4"), X, 4.0)
    assert forces == pytest.approx(np.tile([0.0, 0, -6.0], (1, 4, 1)))


def test_linear_pressure_on_an_edge() -> None:
    # p from 0 to 6 over a length 2 on the bottom edge, outward normal -y: nodal forces L/6 (2 p1 + p2, p1 + 2 p2).
    forces = integrals.pressure_load(shape("SEG2"), np.array([[[0.0, 0], [2, 0]]]), np.array([[0.0, 6.0]]))
    assert forces == pytest.approx(np.array([[[0, 2.0], [0, 4.0]]]))


def test_pressure_per_facet() -> None:
    X = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]] * 2)
    forces = integrals.pressure_load(shape("TRI3"), X, np.array([6.0, 12.0]))
    assert forces[:, :, 2] == pytest.approx(np.array([[-1.0] * 3, [-2.0] * 3]))


@pytest.mark.parametrize("name", ["TRI3", "QUA4", "TRI6", "QUA8"])
def test_pressure_on_more_facets_than_one_piece_holds(name: str) -> None:
    # Each facet gives what it gives alone, wherever the pieces begin and end.
    of, rng = shape(name), np.random.default_rng(3)
    m = 16 * geometry.PIECE + 1025
    X = np.concatenate([of.ref_nodes, np.zeros((of.n_nodes, 1))], axis=1) + 0.1 * rng.standard_normal(
        (m, of.n_nodes, 3)
    )
    p = rng.uniform(1, 2, (m, of.n_nodes))
    forces, per_facet = integrals.pressure_load(of, X, p), integrals.pressure_load(of, X, p[:, 0])
    points, weights = of.mass_gauss
    for i in (0, 1023, 1024, 16 * geometry.PIECE - 1, 16 * geometry.PIECE, m - 1):
        tangents = np.einsum("ni,qnd->qid", X[i], of.dN(points))
        flux = np.cross(tangents[..., 0], tangents[..., 1]) * weights[:, None]
        N = of.N(points)
        np.testing.assert_allclose(forces[i], -N.T @ (flux * (N @ p[i])[:, None]), rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(per_facet[i], -N.T @ flux * p[i, 0], rtol=1e-12, atol=1e-14)


def test_distributed_loads_by_hand() -> None:
    cube = (shape("CUB8").ref_nodes[None] + 1) / 2
    weight = integrals.distributed_load(shape("CUB8"), cube, [0.0, 0, -8])
    assert weight == pytest.approx(np.tile([0.0, 0, -1], (1, 8, 1)))
    line = np.array([[[0.0, 0, 0], [0, 0, 2]]])
    per_cell = integrals.distributed_load(shape("SEG2"), line, np.array([[3.0, 0, 0]]))
    assert per_cell[0, :, 0] == pytest.approx([3, 3])
    nodal = integrals.distributed_load(shape("SEG2"), line, np.array([[[0.0], [6.0]]]))
    assert nodal[0, :, 0] == pytest.approx([2, 4])
    point = integrals.distributed_load(shape("POI1"), np.zeros((1, 1, 3)), [1.0, 2, 3])
    assert point[0, 0] == pytest.approx([1, 2, 3])


def test_face_mass_by_hand() -> None:
    square = np.array([[[0.0, 0, 5], [2, 0, 5], [2, 3, 5], [0, 3, 5]]])
    expected = np.array([[4.0, 2, 1, 2], [2, 4, 2, 1], [1, 2, 4, 2], [2, 1, 2, 4]]) * 6 / 36
    assert integrals.face_mass(shape("QUA4"), square)[0] == pytest.approx(expected)
    triangle = np.array([[[0.0, 0, 0], [3, 0, 4], [0, 2, 0]]])
    assert integrals.face_mass(shape("TRI3"), triangle)[0] == pytest.approx(5 / 12 * (np.eye(3) + 1))


def test_face_without_area_has_no_mass() -> None:
    with pytest.raises(InvertedElement):
        integrals.face_mass(shape("SEG2"), np.zeros((1, 2, 3)))


def test_mass_of_elements_of_different_density() -> None:
    X = np.concatenate([SQUARE, 2 * SQUARE])
    M = integrals.element_mass(shape("QUA4"), X, np.array([3.0, 5.0]))
    assert M.sum(axis=(1, 2)) == pytest.approx([3.0, 20.0])


@pytest.mark.parametrize("d", [1, 2, 3])
def test_assembly_of_mixed_blocks_against_a_loop(d: int) -> None:
    rng = np.random.default_rng(7)
    n = 9
    blocks = []
    for size, count in ((4, 5), (3, 4)):
        cells = np.array([rng.permutation(n - 1)[:size] for _ in range(count)])
        blocks.append((cells, rng.standard_normal((count, size * d, size * d))))
    dense = np.zeros((n * d, n * d))
    vector = np.zeros(n * d)
    loads = []
    for cells, Ke in blocks:
        Fe = rng.standard_normal((*cells.shape, d))
        loads.append((cells, Fe))
        for cell, k, f in zip(cells, Ke, Fe, strict=True):
            unknowns = (cell[:, None] * d + np.arange(d)).ravel()
            dense[np.ix_(unknowns, unknowns)] += k
            vector[unknowns] += f.ravel()
    K = assembly.assemble(n, d, blocks)
    assert K.format == "csr"
    assert K.has_sorted_indices
    assert np.allclose(K.toarray(), dense, atol=1e-13)
    assert np.allclose(assembly.assemble_vector(n, d, loads), vector, atol=1e-13)


def test_node_blocks_stay_whole() -> None:
    # A diagonal law leaves zeros inside the blocks; they are kept for solvers that work by blocks.
    K = assembly.assemble(
        4, 2, [(np.array([[0, 1, 2, 3]]), elasticity.element_stiffness(shape("QUA4"), SQUARE, np.diag([1.0, 0, 0, 0])))]
    )
    assert K.nnz == 64
