"""Condensation: supports on contact nodes, linear relations, chains of bodies and gaps, against closed forms."""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels.assembly import assemble
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.contact.condense import condense
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.node_pairs import node_pairs
from gibiane_ops.kernels.contact.pairs import ContactPairs, joined
from gibiane_ops.kernels.elasticity import element_stiffness
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue, SingularSystem
from gibiane_ops.kernels.materials import isotropic

E, NU = 1000.0, 0.3
NONE = np.zeros(0, dtype=np.int64)


def conditions(rows, n):
    """Build rows from lists of {unknown: coefficient}, with values."""
    C = sp.lil_array((len(rows), n))
    for i, (row, _) in enumerate(rows):
        for j, value in row.items():
            C[i, j] = value
    return reduce_conditions(sp.csr_array(C), np.array([value for _, value in rows], dtype=float))


def fixing(dofs, n, value=0.0):
    return conditions([({int(i): 1.0}, value) for i in dofs], n)


def cubes(n_bodies, gap=0.0, nu=NU):
    """Stack of unit cubes, one CUB8 each, in contact; body 1 of each pair is the upper one."""
    corner = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]])
    points = np.vstack([corner + [0, 0, i * (1 + gap)] for i in range(n_bodies)])
    cells = np.arange(8 * n_bodies).reshape(-1, 8)
    K = assemble(len(points), 3, [(cells, element_stiffness(shape("CUB8"), points[cells], isotropic(E, nu, "TRID")))])
    zones = []
    for i in range(n_bodies - 1):
        slave, master = cells[i + 1, [3, 2, 1, 0]], cells[i, 4:]
        zones.append(node_pairs(points, [("QUA4", slave[None])], [("QUA4", master[None])], tolerance=0.3))
    return points, K, joined(zones)


def springs(stiffness, pairs, normals, gap=None):
    """Bodies made of independent springs to the ground, one per unknown: the answer can be written down."""
    d = len(normals[0])
    pairs = np.asarray(pairs)
    n = len(pairs)
    zero = np.zeros(n) if gap is None else np.asarray(gap, dtype=float)
    normals = np.asarray(normals, dtype=float)
    points = np.column_stack([np.arange(n, dtype=float)] * d) ** np.arange(1, d + 1)
    contact = ContactPairs(pairs, normals, zero, points, np.zeros(n, np.int64), NONE, NONE, NONE, NONE)
    return sp.csr_array(sp.diags_array(np.asarray(stiffness, dtype=float))), contact


def test_two_springs_close_a_gap():
    # unknowns: node 0 (body 1, above) and node 1 (body 2); springs 3 and 6 along y; pushed down by 9, gap 1
    K, contact = springs([1, 3, 1, 6], [[0, 1]], [[0, -1.0]], [1.0])
    tied = condense(K, contact, fixing([], 4))
    interface = tied.interface(np.array([0, -9.0, 0, 0]))
    state = solve_coulomb(interface, 0.2)
    # (3 u + 6 (u + 1)) = -9 -> u1 = -5/3, u2 = -2/3, force 4
    np.testing.assert_allclose(interface.expand(state.w), [0, -5 / 3, 0, -2 / 3], atol=1e-12)
    np.testing.assert_allclose(interface.to_global(state.r), [[0, 4.0]], atol=1e-11)
    apart = solve_coulomb(tied.interface(np.array([0, -2.0, 0, 0])), 0.2)
    assert apart.report.n_open == 1
    np.testing.assert_allclose(tied.interface(np.array([0, -2.0, 0, 0])).expand(apart.w), [0, -2 / 3, 0, 0], atol=1e-12)


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("held", ["neither", "one", "other", "both"])
def test_supports_on_contact_nodes(held, swap):
    """Check the pair law where the tangential displacement of one node, of the other, or of both is prescribed."""
    slave, master = (1, 0) if swap else (0, 1)
    normal = [0, 1.0] if swap else [0, -1.0]
    K, contact = springs([2, 3, 4, 6], [[slave, master]], [normal])
    dofs = {"neither": [], "one": [0], "other": [2], "both": [0, 2]}[held]
    tied = condense(K, contact, fixing(dofs, 4))
    F = np.array([1.0, -9, 0, 0])
    interface = tied.interface(F)
    state = solve_coulomb(interface, 0.1)
    u = interface.expand(state.w)
    # along y both springs share 9: force 6 on the second; friction up to 0.6 on x
    np.testing.assert_allclose(u[[1, 3]], [-1, -1], atol=1e-12)
    np.testing.assert_allclose(np.abs(interface.to_global(state.r)[0, 1]), 6, rtol=1e-11)
    # neither: tied force would be 1 * 4/6 > 0.6, so slip; a held node cannot follow
    expected = {"neither": [0.2, 0.15], "one": [0, 0], "other": [0.2, 0], "both": [0, 0]}[held]
    np.testing.assert_allclose(u[[0, 2]], expected, atol=1e-12)
    friction = np.abs(interface.to_global(state.r)[0, 0])
    assert friction == pytest.approx({"neither": 0.6, "one": 0.0, "other": 0.6, "both": 0.0}[held], abs=1e-12)
    residual = K @ u - F
    residual[[slave * 2, slave * 2 + 1]] -= interface.to_global(state.r)[0]
    residual[[master * 2, master * 2 + 1]] += interface.to_global(state.r)[0]
    np.testing.assert_allclose(np.delete(residual, dofs), 0, atol=1e-11)


def test_prescribed_normals_close_the_gap_themselves():
    K, contact = springs([1, 3, 1, 6], [[0, 1]], [[0, -1.0]], [1.0])
    reduction = conditions([({1: 1.0}, -0.25), ({3: 1.0}, 0.25)], 4)
    interface = condense(K, contact, reduction).interface(np.zeros(4))
    assert interface.gap[0] == pytest.approx(0.5)
    assert not interface.active[0, 0]
    state = solve_coulomb(interface, 0.3)
    np.testing.assert_allclose(interface.expand(state.w), [0, -0.25, 0, 0.25], atol=1e-14)


def test_prescribed_displacement_presses_the_other_body():
    K, contact = springs([1, 3, 1, 6], [[0, 1]], [[0, -1.0]], [0.5])
    reduction = conditions([({1: 1.0}, -2.0)], 4)
    tied = condense(K, contact, reduction)
    interface = tied.interface(np.zeros(4))
    state = solve_coulomb(interface, 0.3)
    np.testing.assert_allclose(interface.expand(state.w), [0, -2, 0, -1.5], atol=1e-12)
    np.testing.assert_allclose(state.r[0, 0], -9, rtol=1e-12)
    # the same factor serves another prescribed value
    other = conditions([({1: 1.0}, -0.2)], 4).offset
    again = tied.interface(np.zeros(4), other)
    np.testing.assert_allclose(again.expand(solve_coulomb(again, 0.3).w), [0, -0.2, 0, 0], atol=1e-14)


def test_relation_between_contact_and_other_unknowns():
    # node 2 (no contact) follows half of node 0 along y: u5 = u1 / 2 + 0.1; its spring of 8 then adds 8 / 4 = 2
    K, contact = springs([1, 3, 1, 6, 1, 8], [[0, 1]], [[0, -1.0]])
    reduction = conditions([({5: 1.0, 1: -0.5}, 0.1), ({0: 1.0}, 0.0)], 6)
    interface = condense(K, contact, reduction).interface(np.array([0, -9.0, 0, 0, 0, 0]))
    state = solve_coulomb(interface, 0.3)
    u = interface.expand(state.w)
    # 3 u + 6 u + 8 (u/2 + 0.1)/2 = -9
    expected = -9.4 / 11
    np.testing.assert_allclose(u[[1, 3, 5]], [expected, expected, expected / 2 + 0.1], rtol=1e-12)
    pulled = condense(K, contact, reduction).interface(np.array([0, 9.0, 0, 0, 0, 0]))
    u = pulled.expand(solve_coulomb(pulled, 0.3).w)
    # open: 3 u + 8 (u/2 + 0.1)/2 = 9
    np.testing.assert_allclose(u[[1, 3, 5]], [8.6 / 5, 0, 4.3 / 5 + 0.1], atol=1e-12)


def test_relation_on_both_nodes_of_a_pair():
    # u1 + u3 = -1 ties the two sides while they stay free to part
    K, contact = springs([1, 3, 1, 6], [[0, 1]], [[0, -1.0]])
    reduction = conditions([({1: 1.0, 3: 1.0}, -1.0)], 4)
    interface = condense(K, contact, reduction).interface(np.zeros(4))
    u = interface.expand(solve_coulomb(interface, 0.3).w)
    # minimum of 3 u1^2 + 6 u3^2 under the relation is u1 = -2/3, u3 = -1/3: penetrates, so both are -1/2
    np.testing.assert_allclose(u[[1, 3]], [-0.5, -0.5], atol=1e-12)


@pytest.mark.parametrize("n_bodies", [2, 3, 4])
def test_stack_of_cubes_with_gaps(n_bodies):
    """Press a stack through its gaps: the top moves by the gaps plus the bar shortening s L / E."""
    gap = 0.01
    points, K, contact = cubes(n_bodies, gap=gap, nu=0.0)
    base = np.flatnonzero(points[:, 2] == 0)
    top = np.arange(8 * n_bodies)[-4:]
    n = 3 * len(points)
    held = np.r_[3 * base, 3 * base + 1, 3 * base + 2]
    F = np.zeros(n)
    F[3 * top + 2] = -5.0 / 4
    interface = condense(K, contact, fixing(held, n)).interface(F)
    assert interface.rigid.shape[1] == 6 * (n_bodies - 1)
    state = solve_coulomb(interface, 0.2)
    u = interface.expand(state.w)
    np.testing.assert_allclose(u[3 * top + 2], -(n_bodies - 1) * gap - n_bodies * 5.0 / E, rtol=1e-9)
    np.testing.assert_allclose(state.r[:, 0], -5 / 4, rtol=1e-9)
    assert state.report.worst < 1e-8


def test_node_slave_in_one_zone_and_master_in_another():
    # three springs in a row meeting at one place: 0 on 1 on 2
    K, contact = springs([1, 2, 1, 3, 1, 4], [[0, 1], [1, 2]], [[0, -1.0], [0, -1.0]], [0.0, 0.5])
    interface = condense(K, contact, fixing([], 6)).interface(np.array([0, -9.0, 0, 0, 0, 0]))
    u = interface.expand(solve_coulomb(interface, 0.0).w)
    # 2 u + 3 u + 4 (u + 0.5) = -9
    np.testing.assert_allclose(u[1::2], [-11 / 9, -11 / 9, -11 / 9 + 0.5], rtol=1e-12)


def test_loop_of_pairs_is_refused():
    K, contact = springs(np.ones(6), [[0, 1], [1, 2], [2, 0]], [[0, 1.0]] * 3)
    with pytest.raises(BadValue) as caught:
        condense(K, contact, fixing([], 6))
    assert caught.value.value == [0, 1, 2]


def test_oblique_normals_give_the_same_answer():
    """Rotate the whole problem: displacements and forces turn with it."""
    points, K, contact = cubes(2)
    n = 3 * len(points)
    F = np.zeros(n)
    F[3 * np.arange(12, 16) + 2] = [-1, -3, -2, -2]
    F[3 * np.arange(12, 16)] = 0.2
    base = np.arange(12)
    axis = np.array([1, 2, -0.5])
    a, b, c = 0.7 * axis / np.linalg.norm(axis)
    R = np.linalg.matrix_power(np.eye(3) + np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]]) / 2**20, 2**20)
    R = np.linalg.qr(R)[0] * np.sign(np.diag(np.linalg.qr(R)[1]))
    T = sp.kron(sp.eye_array(len(points)), R, format="csr")
    turned = ContactPairs(
        contact.pairs, contact.normals @ R.T, contact.gap, contact.points @ R.T, contact.zone, NONE, NONE, NONE, NONE
    )
    straight = condense(K, contact, fixing(base, n)).interface(F)
    oblique = condense(sp.csr_array(T @ K @ T.T), turned, fixing(base, n)).interface(T @ F)
    one, two = solve_coulomb(straight, 0.3), solve_coulomb(oblique, 0.3)
    assert one.report.n_slip + one.report.n_stick > 0
    u = straight.expand(one.w)
    np.testing.assert_allclose(oblique.expand(two.w), T @ u, atol=1e-9 * np.abs(u).max())
    np.testing.assert_allclose(oblique.to_global(two.r), straight.to_global(one.r) @ R.T, atol=1e-9)


def test_two_friction_coefficients():
    # independent pairs, each with its own coefficient
    K, contact = springs(np.ones(8), [[0, 1], [2, 3]], [[0, -1.0]] * 2)
    F = np.array([1.0, -4, 0, 0, 1.0, -4, 0, 0])
    interface = condense(K, contact, fixing([], 8)).interface(F)
    state = solve_coulomb(interface, np.array([0.1, 0.4]))
    np.testing.assert_allclose(interface.to_global(state.r)[:, 0], [-0.2, -0.5], rtol=1e-12)
    np.testing.assert_allclose(interface.to_global(state.r)[:, 1], 2, rtol=1e-12)


def test_body_that_nothing_holds():
    points, K, contact = cubes(2)
    with pytest.raises(SingularSystem) as caught:
        condense(K, contact, fixing([0, 1, 2], 3 * len(points)))
    assert set(caught.value.nodes) <= set(range(16))
    assert len(caught.value.nodes) > 0
