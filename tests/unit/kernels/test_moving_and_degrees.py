"""Configurational forces against differences of the energy, freedoms of nodes, the choice between degree and size."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from gibiane_ops.kernels import assembly, elasticity, integrals, topology
from gibiane_ops.kernels.adapt import degrees, moving, shares
from gibiane_ops.kernels.adapt.sizes import size_map
from gibiane_ops.kernels.arrays import stress_tensor
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.materials import isotropic

FAMILY = {2: "DEFO", 3: "TRID"}


def block(name, seed=0):
    dim = shape(name).dim
    n = 3
    line = np.linspace(0, 1, n)
    points = np.stack(np.meshgrid(*[line] * dim, indexing="ij"), -1).reshape(-1, dim)
    index = np.arange(n**dim).reshape((n,) * dim)
    of = {2: shape("QUA4"), 3: shape("CUB8")}[dim]
    offsets = np.round((of.ref_nodes + 1) / 2).astype(int)
    cells = np.stack([index[tuple(slice(o, n - 1 + o) for o in offset)] for offset in offsets], -1)
    cells = cells.reshape(-1, 2**dim)
    if name == "TRI3":
        cells = cells[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    if name == "TET4":
        cut = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]
        cells = cells[:, cut].reshape(-1, 4)
    points = points.copy()
    inside = ((points > 0) & (points < 1)).all(axis=1)
    points[inside] += np.random.default_rng(seed).uniform(-0.1, 0.1, (int(inside.sum()), dim))
    return points, cells


def solved(name, points, cells):
    """Clamp the bottom, pull the top sideways; return the displacement, the stress and the potential energy."""
    dim = points.shape[1]
    D = isotropic(1.0, 0.3, FAMILY[dim])
    of = shape(name)
    K = sp.csc_array(assembly.assemble(len(points), dim, [(cells, elasticity.element_stiffness(of, points[cells], D))]))
    (facets,) = topology.boundary([(name, cells)]).values()
    top = facets.nodes[np.isclose(points[facets.nodes][:, :, -1], 1).all(axis=1)]
    pull = np.zeros(dim)
    pull[0], pull[-1] = 1.0, 0.4
    load = integrals.distributed_load(shape(facets.name), points[top], pull)
    F = assembly.assemble_vector(len(points), dim, [(top, load)]).ravel()
    free = np.flatnonzero(np.repeat(points[:, -1] > 1e-12, dim))
    u = np.zeros(points.size)
    u[free] = spsolve(K[free][:, free], F[free])
    U = u.reshape(-1, dim)
    stress = elasticity.stresses(elasticity.strains(of, points[cells], U[cells], of.gauss[0]), D)
    return U, stress, -0.5 * float(F @ u)


@pytest.mark.parametrize("name", ["TRI3", "QUA4", "TET4", "CUB8"])
def test_the_forces_are_the_derivative_of_the_energy(name):
    points, cells = block(name)
    dim = points.shape[1]
    U, stress, _ = solved(name, points, cells)
    each = moving.configurational_forces(shape(name), points[cells], U[cells], stress_tensor(stress)[..., :dim, :dim])
    G = np.zeros_like(points)
    np.add.at(G, cells, each)
    middle = np.flatnonzero(((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1))
    step = 1e-5
    for node in middle:
        for axis in range(dim):
            there, back = points.copy(), points.copy()
            there[node, axis] += step
            back[node, axis] -= step
            slope = (solved(name, there, cells)[2] - solved(name, back, cells)[2]) / (2 * step)
            assert G[node, axis] == pytest.approx(slope, rel=1e-6, abs=1e-8 * np.abs(G).max())


def test_uniform_stress_moves_nothing():
    points, cells = block("TET4", 3)
    D = isotropic(1.0, 0.3, "TRID")
    U = points @ np.array([[0.1, 0.02, 0.0], [0.0, -0.1, 0.03], [0.05, 0.0, 0.2]])
    stress = elasticity.stresses(elasticity.strains(shape("TET4"), points[cells], U[cells], shape("TET4").gauss[0]), D)
    each = moving.configurational_forces(shape("TET4"), points[cells], U[cells], stress_tensor(stress))
    G = np.zeros_like(points)
    np.add.at(G, cells, each)
    inside = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    assert np.abs(G[inside]).max() <= 1e-14 * np.abs(each).max() * 10


@pytest.mark.parametrize("name", ["TRI3", "TET4"])
def test_the_energy_never_rises(name):
    points, cells = block(name, 1)
    dim = points.shape[1]
    blocks = [(name, cells)]
    history = []
    for _ in range(8):
        U, stress, energy = solved(name, points, cells)
        history.append(energy)
        tensor = stress_tensor(stress)[..., :dim, :dim]
        each = moving.configurational_forces(shape(name), points[cells], U[cells], tensor)
        G = np.zeros_like(points)
        np.add.at(G, cells, each)
        inner = elasticity.internal_forces(shape(name), points[cells], stress)
        own = [0.5 * np.abs((inner.reshape(len(cells), -1) * U[cells].reshape(len(cells), -1)).sum(axis=1))]
        free = moving.freedoms(points, moving.limits_of(blocks, [], dim))
        free[np.isclose(points[:, -1], 1)] = 0.0  # loaded
        move = moving.steps(points, blocks, G, own, free)
        share = moving.longest_step(points, blocks, move)
        while share > 1e-3 and solved(name, points + share * move, cells)[2] > energy:
            share /= 2
        points = points + share * move
    assert np.all(np.diff(history) <= 1e-14 * abs(history[0]))
    assert history[-1] < history[0] * (1 + 1e-3)  # energies are negative: it fell by 0.1 % at least
    assert np.allclose(points.min(axis=0), 0)
    assert np.allclose(points.max(axis=0), 1)


def test_nodes_slide_in_planes_and_along_edges_and_corners_stay():
    points, cells = block("TET4")
    free = moving.freedoms(points, moving.limits_of([("TET4", cells)], [], 3))
    rank = np.round(np.trace(free, axis1=1, axis2=2))
    on = (np.isclose(points, 0) | np.isclose(points, 1)).sum(axis=1)
    assert np.array_equal(rank, 3 - on)
    face = np.flatnonzero((on == 1) & np.isclose(points[:, 2], 1))
    assert np.allclose(free[face][:, 2], 0)
    # A part of the top is named: its outline keeps its place.
    (facets,) = topology.boundary([("TET4", cells)]).values()
    top = facets.nodes[np.isclose(points[facets.nodes][:, :, 2], 1).all(axis=1)]
    half = top[(points[top][:, :, 0] <= 0.5 + 1e-9).all(axis=1)]
    free = moving.freedoms(points, moving.limits_of([("TET4", cells)], [half], 3))
    assert np.allclose(free[face], np.diag([0.0, 1.0, 0.0]))


def test_a_step_stops_before_elements_are_flat():
    points, cells = block("TET4")
    inside = np.flatnonzero(((points > 0) & (points < 1)).all(axis=1))
    move = np.zeros_like(points)
    move[inside, 0] = 5.0
    share = moving.longest_step(points, [("TET4", cells)], move)
    assert 0 < share < 0.2
    assert moving.smallest_angles("TET4", (points + share * move)[cells]).min() >= moving.LEAST_ANGLE
    assert moving.smallest_angles("TRI3", np.array([[[0, 0], [1, 0], [0.5, np.sqrt(3) / 2]]]))[0] == pytest.approx(60)


# -- degree or size ---------------------------------------------------------------------------------------------------


def choices(error2, left, order=None, may_rise=None):
    error2 = np.asarray(error2, float)
    m = len(error2)
    order = np.ones(m) if order is None else order
    may_rise = np.ones(m, bool) if may_rise is None else may_rise
    return degrees.Choices(
        np.stack([error2, error2 * left]), np.stack([order, np.where(order == 1, 2.0, order)]),
        np.repeat([[0.5], [2.0]], m, axis=1), np.stack([np.ones(m, bool), may_rise]),
    )  # fmt: skip


def test_smooth_elements_rise_and_rough_ones_are_divided():
    left = np.r_[np.full(4, 1.0), np.full(96, 0.004)]
    error2 = np.r_[np.full(4, 1e-2), np.full(96, 1e-3)]
    found = degrees.plan(choices(error2, left), 0.1, 2)
    assert (found.ratios[:4] < 0.5).all()
    assert not found.quadratic[:4].any()
    assert found.quadratic[4:].all()
    assert (found.ratios[4:] > found.ratios[:4].max()).all()
    assert found.predicted == pytest.approx(0.1, rel=1e-6)


def test_no_other_sizes_and_degrees_of_the_same_error_have_fewer_nodes():
    rng = np.random.default_rng(3)
    m = 40
    error2, left = rng.uniform(0.1, 10.0, m) * 1e-3, rng.uniform(0.001, 1.0, m)
    order = np.where(np.arange(m) < 6, 0.5, 1.0)
    of = choices(error2, left, order)
    best = degrees.plan(of, 0.05, 2)
    assert 0 < best.quadratic.sum() < m
    for _ in range(300):
        high = rng.random(m) < 0.5 if rng.random() < 0.5 else best.quadratic ^ (rng.random(m) < 0.1)
        q, c, e2 = (np.where(high, each[1], each[0]) for each in (of.order, of.nodes, of.error2))
        r = best.ratios * rng.uniform(0.8, 1.25, m)
        low, top = 1e-6, 1e6  # one factor on all sizes gives the very error of the plan
        for _ in range(80):
            middle = np.sqrt(low * top)
            low, top = (low, middle) if ((middle * r) ** (2 * q) * e2).sum() > best.predicted**2 else (middle, top)
        assert (c * (low * r) ** -2).sum() >= best.nodes * (1 - 1e-9)


def test_sizes_that_may_not_grow_stay():
    of = choices(np.full(10, 1e-4), 0.01)
    found = degrees.plan(of, 1.0, 2, largest=1.0)
    assert (found.ratios == 1.0).all()
    assert not found.quadratic.any()
    assert found.predicted == pytest.approx(np.sqrt(10 * 1e-4))
    with pytest.raises(BadValue):
        degrees.plan(of, 0.0, 2)


def test_nothing_is_asked_where_there_is_no_error():
    found = degrees.plan(choices(np.zeros(5), 0.5), 0.1, 2)
    assert (found.ratios == 1).all()
    assert found.predicted == 0


def test_a_lone_element_does_not_differ_from_its_neighbours():
    points, cells = block("TRI3")
    blocks = [("TRI3", cells)]
    left = np.full(len(cells), 1e-3)
    left[3] = 1.0  # alone it would stay linear
    of = choices(np.full(len(cells), 1e-2), left)
    assert not degrees.plan(of, 0.05, 2).quadratic[3]
    sizes, quadratic = degrees.degree_map(points, blocks, of, 0.05)
    assert quadratic.all()
    # what is chosen is what sizes are made for
    alone = size_map(points, blocks, np.sqrt(of.error2[1]), 0.05, order=of.order[1])
    assert sizes.nodal == pytest.approx(alone.nodal)


def test_elements_that_err_little_stay_linear():
    points, cells = block("TRI3")
    error2 = np.where(points[cells][..., 0].mean(axis=1) < 0.5, 1e-9, 1e-2)
    _, quadratic = degrees.degree_map(points, [("TRI3", cells)], choices(error2, 0.01), 0.1)
    assert quadratic.any()
    assert not quadratic.all()
    assert (error2[quadratic] == 1e-2).sum() >= (error2 == 1e-2).sum() - 1


def test_the_number_of_elements_is_a_limit():
    points, cells = block("TRI3")
    of = choices(np.full(len(cells), 1e-2), 0.5)
    free, _ = degrees.degree_map(points, [("TRI3", cells)], of, 1e-3)
    bound, _ = degrees.degree_map(points, [("TRI3", cells)], of, 1e-3, max_count=40)
    assert free.count > 200
    assert bound.count == pytest.approx(40)


def test_what_quadratic_elements_leave_is_measured():
    """A stress x along x: the mean leaves h^2 / 12 of it; a solution off by a hundredth of x, 1e-4 of that."""
    of = shape("TRI6")
    X = of.ref_nodes[None] * 2.0
    smooth = X[:, :, :1] * np.array([1.0, 0.0, 0.0, 0.0])
    exact = np.matmul(of.N(of.gauss[0]), smooth)
    found = shares.left_measured(of, X, smooth, exact + 0.01 * (exact - exact.mean(axis=1, keepdims=True)))
    assert found == pytest.approx(1e-4, rel=0.3)
    assert shares.left_measured(of, X, smooth, exact) == pytest.approx(shares.LEAST_LEFT)
    assert shares.left_measured(of, X, smooth, 0 * exact) == pytest.approx(1.0)
    assert shares.left_measured(of, X, 0 * smooth, 0 * exact) == pytest.approx(1.0)


def test_raising_alone_takes_the_best_and_stops_at_the_target():
    error2 = np.array([1.0, 0.5, 0.25, 1e-3])
    still = {"left": np.full(4, 0.1), "added": np.full(4, 3.0)}
    raised, predicted = degrees.raise_only(error2, 0.95, may_rise=np.array([True, True, True, True]), **still)
    assert raised.tolist() == [True, False, False, False]
    assert predicted == pytest.approx(np.sqrt(0.1 + 0.5 + 0.25 + 1e-3))
    raised, _ = degrees.raise_only(error2, 1e-3, may_rise=np.array([False, True, True, True]), **still)
    assert raised.tolist() == [False, True, True, True]


@pytest.mark.parametrize("name", ["QUA4", "TRI3"])
def test_the_smoothness_length_of_an_exponential_is_its_decay(name):
    line = np.linspace(0, 1, 9)
    points = np.stack(np.meshgrid(line, line, indexing="ij"), -1).reshape(-1, 2)
    index = np.arange(81).reshape(9, 9)
    cells = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], -1).reshape(-1, 4)
    cells = cells if name == "QUA4" else cells[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    value = np.exp(points[:, 0] / 0.5)[:, None]
    length = shares.smoothness(points, [(name, cells)], [value[cells]])
    x = points[cells].mean(axis=1)[:, 0]
    # beside x = 0 and 1 slopes are one-sided, and the length up to twice too large
    assert length[(x > 0.3) & (x < 0.7)] == pytest.approx(0.5, rel=0.06)
    assert (length < 1.05).all()
    assert np.isinf(shares.smoothness(points, [(name, cells)], [(0.3 * points[:, :1] + 1.0)[cells]])).all()


def test_what_the_second_degree_leaves_is_at_most_everything():
    left = shares.left_by_degree(np.array([0.1, 100.0, 0.1]), np.array([1.0, 1.0, 1.0]), np.array([False, False, True]))
    assert left == pytest.approx([0.01 / 60, 1.0, shares.LEFT_AT_PEAK])


def test_raising_alone_counts_the_gain_of_a_node():
    """The element that gains a little less by far fewer nodes rises first."""
    raised, predicted = degrees.raise_only(
        np.array([1.0, 0.9]), 1.1, left=np.zeros(2), added=np.array([10.0, 1.0]), may_rise=np.full(2, True)
    )
    assert raised.tolist() == [False, True]
    assert predicted == pytest.approx(1.0)


def test_steps_are_h2_g_over_w_and_at_most_a_fifth_of_the_size():
    # Two squares of side 2 with energies 1 and 3; the common nodes see 4, the others of the first 1.
    points = np.array([[0.0, 0], [2, 0], [4, 0], [0, 2], [2, 2], [4, 2]])
    forces = np.zeros((6, 2))
    forces[0], forces[1], forces[4] = [0.05, 0.0], [0.0, -0.08], [30.0, 40.0]
    free = np.tile(np.eye(2), (6, 1, 1))
    cells = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    move = moving.steps(points, [("QUA4", cells)], forces, [np.array([1.0, 3.0])], free)
    assert move[0] == pytest.approx([-0.2, 0.0])
    assert move[1] == pytest.approx([0.0, 0.08])
    assert move[4] == pytest.approx([-0.24, -0.32])
    assert np.abs(move[[2, 3, 5]]).max() == 0.0
