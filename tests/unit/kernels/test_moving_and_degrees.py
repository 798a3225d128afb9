"""Configurational forces against differences of the energy, freedoms of nodes, the choice between degree and size."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from gibiane_ops.kernels import assembly, topology
from gibiane_ops.kernels.adapt import degrees, moving
from gibiane_ops.kernels.arrays import stress_tensor
from gibiane_ops.kernels.elements.table import shape
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
    K = sp.csc_array(assembly.assemble(len(points), dim, [(cells, assembly.element_stiffness(of, points[cells], D))]))
    (facets,) = topology.boundary([(name, cells)]).values()
    top = facets.nodes[np.isclose(points[facets.nodes][:, :, -1], 1).all(axis=1)]
    pull = np.zeros(dim)
    pull[0], pull[-1] = 1.0, 0.4
    load = assembly.distributed_load(shape(facets.name), points[top], pull)
    F = assembly.assemble_vector(len(points), dim, [(top, load)]).ravel()
    free = np.flatnonzero(np.repeat(points[:, -1] > 1e-12, dim))
    u = np.zeros(points.size)
    u[free] = spsolve(K[free][:, free], F[free])
    U = u.reshape(-1, dim)
    stress = assembly.stresses(assembly.strains(of, points[cells], U[cells], of.gauss[0]), D)
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
    stress = assembly.stresses(assembly.strains(shape("TET4"), points[cells], U[cells], shape("TET4").gauss[0]), D)
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
        inner = assembly.internal_forces(shape(name), points[cells], stress)
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


def test_smooth_elements_rise_and_singular_ones_are_divided():
    m = 100
    order = np.ones(m)
    order[:4] = 0.5
    error2 = np.full(m, 1e-4)
    error2[:4] = 1e-2
    found = degrees.plan(
        error2, 0.1, order=order, may_rise=order == 1, ratio=np.full(m, 0.2), added=np.full(m, 3.0), dim=2
    )
    assert (found.halvings[:4] >= 2).all()
    assert not found.raised[:4].any()
    assert (found.halvings[4:] == 0).all()
    assert found.raised[4:].any()
    assert found.predicted <= 0.1


def test_a_smooth_problem_chooses_the_degree_everywhere():
    m = 50
    found = degrees.plan(
        np.full(m, 1e-3), np.sqrt(m * 1e-3) / 3, order=np.ones(m), may_rise=np.ones(m, bool), ratio=np.full(m, 0.3),
        added=np.full(m, 7.0), dim=3,
    )  # fmt: skip
    assert found.raised.sum() >= 0.95 * m
    assert (found.halvings == 0).all()


def test_only_what_is_needed_is_changed():
    error2 = np.array([1.0, 0.5, 0.25, 1e-3])
    still = {"order": np.ones(4), "may_rise": np.zeros(4, bool), "ratio": np.ones(4), "added": np.ones(4), "dim": 2}
    found = degrees.plan(error2, 1.2, **still)
    assert found.halvings.tolist() == [1, 0, 0, 0]
    assert found.predicted == pytest.approx(np.sqrt(0.25 + 0.5 + 0.25 + 1e-3))
    nothing = degrees.plan(error2, 2.0, **still)
    assert (nothing.halvings == 0).all()
    assert nothing.predicted == pytest.approx(np.sqrt(error2.sum()))


def test_out_of_reach_the_most_profitable_part_is_done():
    error2 = np.r_[1.0, np.full(999, 1e-6)]
    found = degrees.plan(
        error2,
        1e-9,
        order=np.ones(1000),
        may_rise=np.zeros(1000, bool),
        ratio=np.ones(1000),
        added=np.ones(1000),
        dim=2,
    )
    assert found.halvings[0] >= 1
    assert (found.halvings[1:] == 0).all()


def test_the_smoothness_length_of_an_exponential_is_its_decay():
    points, cells = block("QUA4")
    value = np.exp(points[:, 0] / 5)[:, None]
    length = degrees.smoothness(points, [("QUA4", cells)], [value[cells]])
    assert length == pytest.approx(np.full(len(cells), 5.0), rel=0.02)


def test_layers_grow_from_the_marked_elements():
    points, cells = block("QUA4")
    marked = np.zeros(4, bool)
    marked[0] = True
    assert degrees.near_singular(len(points), [("QUA4", cells)], marked, 1).all()
    assert degrees.near_singular(len(points), [("QUA4", cells)], marked, 0).sum() == 1
