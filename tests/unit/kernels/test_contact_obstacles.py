"""Rigid obstacles without unknowns, and stops: unilateral conditions on displacements."""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels.assembly import assemble
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.contact.condense import condense
from gibiane_ops.kernels.contact.facets import integrals, surface_of
from gibiane_ops.kernels.contact.gauss_seidel import solve_gauss_seidel
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.node_pairs import node_pairs, with_surface
from gibiane_ops.kernels.contact.obstacle import obstacle_pairs
from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.kernels.elasticity import element_stiffness
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import ContradictoryConditions, EmptyContact, TooLarge
from gibiane_ops.kernels.materials import isotropic

CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]])
BASE, TOP = np.array([[0, 3, 2, 1]]), np.array([[4, 5, 6, 7]])
E = 1000.0


def stiffness(points, cells):
    return assemble(
        len(points), 3, [(cells, element_stiffness(shape("CUB8"), points[cells], isotropic(E, 0.3, "TRID")))]
    )


def free(n):
    return reduce_conditions(sp.csr_array((0, n)))


def fixing(dofs, n):
    dofs = np.asarray(dofs)
    return reduce_conditions(sp.csr_array((np.ones(len(dofs)), (np.arange(len(dofs)), dofs)), (len(dofs), n)))


def test_cube_on_a_rigid_plane():
    # the plane is one large square; the cube stands 0.01 above it and is pushed down and sideways
    points = np.vstack([CUBE + [0, 0, 0.01], [[-3, -3, 0], [4, -3, 0], [4, 4, 0], [-3, 4, 0.0]]])
    pairs = obstacle_pairs(points, [("QUA4", BASE)], [("QUA4", np.array([[8, 9, 10, 11]]))])
    np.testing.assert_allclose(pairs.gap, 0.01)
    np.testing.assert_allclose(pairs.normals, [[0, 0, -1.0]] * 4, atol=1e-15)
    np.testing.assert_array_equal(pairs.pairs[:, 1], -1)
    K = stiffness(CUBE, np.arange(8)[None])
    F = np.zeros((8, 3))
    F[:4] = [0.5, 0, -5]
    # nothing else holds the cube: the tied matrix is that of the cube glued to the plane
    interface = condense(K, pairs, free(24)).interface(F.ravel())
    assert interface.rigid.shape[1] == 6
    state = solve_coulomb(interface, 0.2)
    U = interface.expand(state.w).reshape(-1, 3)
    np.testing.assert_allclose(U, [[0, 0, -0.01]] * 8, atol=1e-12)
    np.testing.assert_allclose(interface.to_global(state.r), [[-0.5, 0, 5]] * 4, atol=1e-10)


def test_obstacle_gives_what_a_clamped_body_gives():
    # the same surface as the master of a node pair whose body is clamped
    points = np.vstack([CUBE, CUBE[BASE[0][::-1]]])
    K = stiffness(points, np.arange(8)[None])
    F = np.zeros((12, 3))
    F[4:8] = [0.1, 0.05, -2]
    F[4, 2] = 0.5
    tied = node_pairs(points, [("QUA4", BASE)], [("QUA4", np.array([[8, 9, 10, 11]]))])
    clamped = condense(K, tied, fixing(np.arange(24, 36), 36)).interface(F.ravel())
    obstacle = obstacle_pairs(points[:8], [("QUA4", BASE)], [("QUA4", BASE[:, ::-1])])
    rigid = condense(K[:24, :24], obstacle, free(24)).interface(F[:8].ravel())
    first, second = solve_coulomb(clamped, 0.3), solve_coulomb(rigid, 0.3)
    np.testing.assert_allclose(rigid.expand(second.w), clamped.expand(first.w)[:24], atol=1e-12)
    np.testing.assert_array_equal(first.status, second.status)


def test_inclined_obstacle_and_nodes_beside_it():
    # a wedge face at 45 degrees under half of the base
    points = np.vstack([CUBE, [[0.3, 0, -0.3], [0.3, 1, -0.3], [-1, 1, 1.0], [-1, 0, 1.0]]])
    pairs = obstacle_pairs(points, [("QUA4", BASE)], [("QUA4", np.array([[8, 9, 10, 11]]))])
    np.testing.assert_array_equal(np.sort(pairs.pairs[:, 0]), [0, 3])
    np.testing.assert_array_equal(np.sort(pairs.unpaired_slave), [1, 2])
    np.testing.assert_allclose(pairs.gap, 0, atol=1e-12)
    np.testing.assert_allclose(pairs.normals, [[-np.sqrt(0.5), 0, -np.sqrt(0.5)]] * 2)


def test_obstacle_in_the_plane_with_many_facets():
    # nodes of a bottom line above a parabola cut into segments: the gap is the distance to the nearest segment's line
    x = np.linspace(-1, 1, 41)
    curve = np.column_stack([x, -(x**2) / 2])
    line = np.column_stack([np.linspace(-0.4, 0.4, 9), np.full(9, 0.02)])
    points = np.vstack([curve, line])
    obstacle = np.column_stack([np.arange(1, 41), np.arange(40)])  # normals upwards, to the right of the line
    slave = np.column_stack([np.arange(41, 49), np.arange(42, 50)])
    pairs = obstacle_pairs(points, [("SEG2", slave)], [("SEG2", obstacle)])
    assert len(pairs.pairs) == 9
    # distance of a point to y = -x^2 / 2, near x = 0: 0.02 at the middle, growing outwards
    assert pairs.gap[4] == pytest.approx(0.02, abs=1e-3)
    assert (np.diff(pairs.gap[4:]) > 0).all()
    with pytest.raises(EmptyContact):
        obstacle_pairs(points, [("SEG2", slave)], [("SEG2", obstacle[:2])])


def test_middles_beside_a_linear_facet_follow_their_corners():
    # a square of one quadratic and one linear triangle: the middle of the diagonal, node 6, is tied to its ends
    square = [[0, 0, 0.1], [1, 0, 0.1], [1, 1, 0.1], [0, 1, 0.1], [0.5, 0, 0.1], [1, 0.5, 0.1], [0.5, 0.5, 0.1]]
    points = np.array([*square, [-3, -3, 0], [4, -3, 0], [4, 4, 0], [-3, 4, 0]])
    slave = [("TRI6", np.array([[0, 1, 2, 4, 5, 6]])), ("TRI3", np.array([[0, 2, 3]]))]
    found = obstacle_pairs(points, slave, [("QUA4", np.array([[7, 8, 9, 10]]))])
    for pairs in (found, with_surface(found, points, slave, False)):
        np.testing.assert_array_equal(np.sort(pairs.pairs[:, 0]), [0, 1, 2, 3, 4, 5])
        assert len(pairs.unpaired_slave) == 0
        np.testing.assert_allclose(pairs.gap, 0.1)


def test_obstacle_that_looks_away():
    points = np.vstack([CUBE, CUBE[:4]])
    pairs = obstacle_pairs(points, [("QUA4", BASE)], [("QUA4", np.array([[11, 10, 9, 8]]))])
    assert len(pairs.not_facing) == 4


def no_pairs(d):
    none, empty = np.zeros(0, np.int64), np.zeros((0, d))
    return ContactPairs(np.zeros((0, 2), np.int64), empty, np.zeros(0), empty, none, none, none, none, none)


def test_stops_on_springs():
    # springs 2, 3, 4 pushed by 10, 3, -8 with stops at 1, 2 and, from below, -1
    K = sp.csr_array(sp.diags_array([2.0, 3.0, 4.0, 1.0]))
    stops = sp.csr_array(np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0]]))
    interface = condense(K, no_pairs(2), free(4), stops=stops).interface(
        np.array([10.0, 3, -8, 5]), stop_values=np.array([1.0, 2, 1])
    )
    for solve in (solve_coulomb, solve_gauss_seidel):
        state = solve(interface, 0.0)
        np.testing.assert_allclose(interface.expand(state.w), [1, 1, -1, 5], atol=1e-7)
        np.testing.assert_allclose(state.r[:, 0], [-8, 0, -4], atol=1e-6)


def test_stop_on_a_difference_holds_a_body():
    # two springs joined by a stop u0 - u1 <= 0.5; node 1 has no other support
    K = sp.csr_array(np.diag([2.0, 0.0, 1.0, 1.0]))
    stops = sp.csr_array(np.array([[-1.0, 1, 0, 0]]))
    interface = condense(K, no_pairs(2), free(4), stops=stops).interface(
        np.array([0, 4.0, 0, 0]), stop_values=np.array([0.5])
    )
    state = solve_coulomb(interface, 0.0)
    np.testing.assert_allclose(interface.expand(state.w)[:2], [2, 2.5], atol=1e-12)


def test_stops_that_conditions_hold_already():
    K = sp.csr_array(sp.diags_array([2.0, 3.0]))
    twice = sp.csr_array(np.array([[1.0, 0], [-1, 0]]))
    with pytest.raises(ContradictoryConditions):
        condense(K, no_pairs(2), free(2), stops=twice)
    with pytest.raises(ContradictoryConditions):
        condense(K, no_pairs(2), fixing([0], 2), stops=twice[:1])


def test_interface_too_large_for_the_memory():
    points = np.vstack([CUBE, CUBE[BASE[0][::-1]]])
    pairs = node_pairs(points, [("QUA4", BASE)], [("QUA4", np.array([[8, 9, 10, 11]]))])
    with pytest.raises(TooLarge) as caught:
        condense(stiffness(points, np.arange(8)[None]), pairs, fixing(np.arange(24, 36), 36), memory_limit=5e3)
    assert caught.value.needed == 5 * 8 * 12**2


def test_areas_of_nodes():
    points = np.array([[0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0], [4, 0, 0.0]])
    facets = [("QUA4", np.array([[0, 1, 2, 3]])), ("TRI3", np.array([[1, 4, 2]]))]
    np.testing.assert_allclose(integrals(points, surface_of(points, facets))[[0, 1, 4]], [1.5, 2.5, 1.0])
