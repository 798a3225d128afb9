"""Halved simplices, divided quadrangles and hexahedra: conformity, hanging nodes, undoing, groups, contacts."""

from itertools import permutations

import numpy as np
import pytest
import scipy.sparse as sp
from hanging_relations import relation_matrix

from gibiane_ops.kernels import assembly, connectivity, elasticity, geometry, hanging, integrals, topology
from gibiane_ops.kernels.adapt import halvings, hierarchy, octree
from gibiane_ops.kernels.adapt.resized import resized
from gibiane_ops.kernels.elements.quadratic import QUADRATIC
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.mesh import bisection

NAMES = {("simplex", 2): "TRI3", ("simplex", 3): "TET4", ("tensor", 2): "QUA4", ("tensor", 3): "CUB8"}
FAMILY = {2: "DEFO", 3: "TRID"}


def grid(n, dim):
    line = np.linspace(0, 1, n + 1)
    points = np.stack(np.meshgrid(*[line] * dim, indexing="ij"), -1).reshape(-1, dim)
    index = np.arange((n + 1) ** dim).reshape((n + 1,) * dim)
    corners = [index[tuple(slice(o, n + o) for o in offset)] for offset in octree.offsets(dim)]
    return points, np.stack(corners, -1).reshape(-1, 2**dim)


def simplices(n, dim):
    points, _ = grid(n, dim)
    index = np.arange((n + 1) ** dim).reshape((n + 1,) * dim)
    parts = []
    for order in permutations(range(dim)):
        at = np.zeros(dim, int)
        corners = [index[tuple(slice(o, n + o) for o in at)]]
        for axis in order:
            at[axis] = 1
            corners.append(index[tuple(slice(o, n + o) for o in at)])
        parts.append(np.stack(corners, -1).reshape(-1, dim + 1))
    cells = np.concatenate(parts)
    wrong = geometry.measures(shape(NAMES["simplex", dim]), points[cells]) < 0
    cells[wrong] = cells[wrong][:, [1, 0, *range(2, dim + 1)]]
    return points, cells


def moved_inside(points, rng, by):
    points = points.copy()
    inside = ((points > 0) & (points < 1)).all(axis=1)
    points[inside] += rng.uniform(-by, by, (int(inside.sum()), points.shape[1]))
    return points


def random_octree(dim, rng, rounds=3, start=3):
    points, cells = grid(start, dim)
    tree = octree.planted(moved_inside(points, rng, 0.06), cells)
    for _ in range(rounds):
        tree, _ = octree.balanced(octree.divided(tree, rng.random(len(tree.root)) < 0.15))
    return tree


def stiffness(name, points, cells):
    dim = points.shape[1]
    each = elasticity.element_stiffness(shape(name), points[cells], isotropic(1.0, 0.3, FAMILY[dim]))
    return assembly.assemble(len(points), dim, [(cells, each)])


# -- simplices --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dim", [2, 3])
def test_halved_simplices_fill_the_domain_and_no_node_hangs(dim):
    rng = np.random.default_rng(dim)
    points, cells = simplices(3, dim)
    name = NAMES["simplex", dim]
    mesh = bisection.started(moved_inside(points, rng, 0.05), cells)
    for _ in range(4):
        mesh = bisection.refined(mesh, rng.random(len(mesh.leaves)) < 0.2)
    volumes = geometry.measures(shape(name), mesh.points[mesh.leaf_cells])
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(1.0, rel=1e-12)
    (facets,) = topology.boundary([(name, mesh.leaf_cells)]).values()
    place = mesh.points[facets.nodes]
    assert (np.isclose(place, 0).all(axis=1) | np.isclose(place, 1).all(axis=1)).any(axis=1).all()
    assert len(hanging.hanging_nodes(mesh.points, [(name, mesh.leaf_cells)])[0]) == 0


@pytest.mark.parametrize("dim", [2, 3])
def test_halvings_undone_give_the_first_mesh_back(dim):
    points, cells = simplices(3, dim)
    mesh = bisection.started(points, cells)
    fine = halvings.adapted(mesh, 0.05 + 0.3 * np.linalg.norm(points, axis=1))
    fine = halvings.adapted(fine, 0.03 + 0.2 * np.linalg.norm(fine.points, axis=1))
    assert len(fine.leaves) > 2 * len(cells)
    coarse = halvings.adapted(fine, np.full(len(fine.points), 0.6))
    assert np.array_equal(coarse.leaf_cells, cells)
    assert np.array_equal(coarse.points, points)


def test_angles_stay_bounded_towards_a_corner():
    """Halving the longest edge forty times towards one corner, angles do not go to zero."""
    points, cells = simplices(1, 3)
    mesh = bisection.started(points, cells)
    for _ in range(40):
        mesh = bisection.refined(mesh, (mesh.leaf_cells == 0).any(axis=1))
    X = mesh.points[mesh.leaf_cells]
    h = np.linalg.norm(X[:, :, None] - X[:, None], axis=3).max(axis=(1, 2))
    assert h.min() < 2e-3
    assert (geometry.measures(shape("TET4"), X) / h**3).min() > 0.01


# -- quadrangles and hexahedra ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("dim", [2, 3])
def test_neighbours_differ_by_one_level(dim):
    tree = random_octree(dim, np.random.default_rng(5))
    points, cells = tree.corners
    size = np.linalg.norm(np.ptp(points[cells], axis=1), axis=1)
    assert tree.level.max() >= 2
    indptr, around = connectivity.node_to_cells([(NAMES["tensor", dim], cells)], len(points))
    nodes, masters = hanging.hanging_nodes(points, [(NAMES["tensor", dim], cells)])
    # Around the masters of a hanging node stand elements of two neighbouring levels only where they share an edge.
    for node, ends in zip(nodes, masters[:, :2], strict=True):
        own = set(around[indptr[node] : indptr[node + 1]])
        both = set(around[indptr[ends[0]] : indptr[ends[0] + 1]]) & set(around[indptr[ends[1]] : indptr[ends[1] + 1]])
        for large in both:
            assert all(tree.level[small] - tree.level[large] <= 1 for small in own)
    assert size.min() > 0


@pytest.mark.parametrize("dim", [2, 3])
def test_patch_test_and_rigid_motions_with_hanging_nodes(dim):
    rng = np.random.default_rng(11)
    name = NAMES["tensor", dim]
    points, cells = random_octree(dim, rng, *{2: (4, 3), 3: (3, 2)}[dim]).corners
    nodes, masters = hanging.hanging_nodes(points, [(name, cells)])
    assert len(nodes) > 5
    T = relation_matrix(len(points), nodes, masters)
    assert abs(T.sum(axis=1) - 1).max() <= 1e-15
    own = np.setdiff1d(np.arange(len(points)), nodes)
    u = points @ rng.uniform(-1, 1, (dim, dim)) + rng.uniform(-1, 1, dim)
    assert abs(T @ u[own] - u).max() <= 1e-14
    every = sp.csr_array(sp.kron(T, sp.eye_array(dim)))
    K = stiffness(name, points, cells)
    free = ((points[own] > 1e-12) & (points[own] < 1 - 1e-12)).all(axis=1)
    assert abs((every.T @ (K @ u.ravel())).reshape(-1, dim)[free]).max() <= 1e-12
    values = np.linalg.eigvalsh((every.T @ K @ every).toarray())
    modes = {2: 3, 3: 6}[dim]
    assert abs(values[:modes]).max() <= 1e-12 * values[-1]
    assert values[modes] > 1e-6 * values[-1]


@pytest.mark.parametrize("dim", [2, 3])
def test_energy_never_decreases_when_elements_are_divided(dim):
    rng = np.random.default_rng(3)
    name = NAMES["tensor", dim]
    tree = octree.planted(*grid(2, dim))
    before = 0.0
    for _ in range(3 if dim == 3 else 5):
        points, cells = tree.corners
        T = relation_matrix(len(points), *hanging.hanging_nodes(points, [(name, cells)]))
        every = sp.csr_array(sp.kron(T, sp.eye_array(dim)))
        (facets,) = topology.boundary([(name, cells)]).values()
        top = facets.nodes[np.isclose(points[facets.nodes][:, :, -1], 1).all(axis=1)]
        load = integrals.pressure_load(shape(facets.name), points[top], 1.0)
        F = every.T @ assembly.assemble_vector(len(points), dim, [(top, load)]).ravel()
        K = sp.csc_array(every.T @ stiffness(name, points, cells) @ every)
        own = np.setdiff1d(np.arange(len(points)), hanging.hanging_nodes(points, [(name, cells)])[0])
        free = np.flatnonzero(np.repeat(points[own][:, -1] > 1e-12, dim))
        from scipy.sparse.linalg import spsolve

        energy = float(F[free] @ spsolve(K[free][:, free], F[free]))
        assert energy >= before * (1 - 1e-12)
        before = energy
        tree, _ = octree.balanced(octree.divided(tree, rng.random(len(tree.root)) < 0.3))


@pytest.mark.parametrize("dim", [2, 3])
def test_two_divisions_put_back_together_give_the_same_mesh(dim):
    points, cells = grid(2, dim)
    tree = octree.planted(moved_inside(points, np.random.default_rng(2), 0.05), cells)
    first = tree.corners
    marked = np.zeros(len(cells), bool)
    marked[0] = True
    once = octree.divided(tree, marked)
    twice = octree.divided(once, np.arange(len(once.root)) == {2: 2, 3: 6}[dim])  # the child in the middle
    fine, rounds = octree.balanced(twice)
    assert rounds >= 1
    coarse, _ = resized(fine, np.full(len(fine.corners[0]), 0.6))
    assert np.array_equal(coarse.corners[0], first[0])
    assert np.array_equal(coarse.corners[1], first[1])


def test_only_complete_groups_are_put_back_together():
    tree = octree.planted(*grid(1, 3))
    tree = octree.divided(octree.divided(tree, np.array([True])), np.arange(8) == 3)
    back, place = octree.merged_back(tree, np.ones(len(tree.root), bool))
    assert len(back.root) == 8
    assert np.array_equal(back.level, np.ones(8))
    assert np.array_equal(np.bincount(place), [1, 1, 1, 8, 1, 1, 1, 1])
    lonely, _ = octree.merged_back(tree, tree.level == 1)
    assert len(lonely.root) == len(tree.root)


def test_too_many_divisions_are_refused():
    tree = octree.planted(*grid(1, 2))
    for _ in range(octree.DEEPEST):
        tree = octree.divided(tree, np.arange(len(tree.root)) == 0)
    with pytest.raises(BadValue, match="divisions"):
        octree.divided(tree, np.arange(len(tree.root)) == 0)


# -- groups and contacts ----------------------------------------------------------------------------------------------


def two_blocks(kind, dim=3):
    points, cells = (simplices if kind == "simplex" else grid)(2, dim)
    name, n = NAMES[kind, dim], len(points)
    up = np.zeros(dim)
    up[-1] = 1.0
    P, C = np.vstack([points, points + up]), np.vstack([cells, cells + n])
    (facets,) = topology.boundary([(name, C)]).values()

    def on(value, upper):
        inside = (facets.nodes >= n).all(axis=1) == upper
        return facets.nodes[np.isclose(P[facets.nodes][:, :, -1], value).all(axis=1) & inside]

    groups = {"low": C[: len(cells)], "master": on(1, False), "slave": on(1, True)[:, ::-1], "base": on(0, False)}
    groups["corner"] = np.array([[0]])
    if dim == 3:
        edges = topology.edges([(name, C)])
        groups["line"] = edges[np.isclose(P[edges][:, :, :2], 0).all(axis=(1, 2))]
    return name, P, C, groups


@pytest.mark.parametrize("kind", ["simplex", "tensor"])
@pytest.mark.parametrize("dim", [2, 3])
def test_groups_and_contacts_follow(kind, dim):
    name, points, cells, groups = two_blocks(kind, dim)
    state = hierarchy.founded(name, points, cells, groups, [("slave", "master")])
    centre = np.zeros(dim)
    centre[-1] = 1.0
    for _ in range(3):
        mesh = state.mesh()
        sizes = 0.03 + 0.3 * np.linalg.norm(mesh.points - centre, axis=1)
        state, counts = hierarchy.adapted(state, sizes)
        assert counts
    mesh = state.mesh()
    assert len(mesh.cells) > 3 * len(cells)
    of = shape(name)
    face = shape(of.faces[0][0])
    X = mesh.points
    first, second = mesh.pairs[0].T
    assert np.array_equal(X[first], X[second])
    assert not np.intersect1d(first, second).size
    assert set(first) == set(np.unique(mesh.groups["slave"]))
    assert geometry.measures(of, X[mesh.groups["low"]]).sum() == pytest.approx(1.0)
    for group in ("master", "slave", "base"):
        facets = X[mesh.groups[group]]
        assert np.ptp(facets[:, :, -1]) < 1e-12
        assert geometry.measures(face, facets).sum() == pytest.approx(1.0)
    # Slave facets were given turned over, and stay so: their normals point up, into their solid.
    normal = geometry.facet_normals(face, X[mesh.groups["slave"]])
    assert (normal[:, -1] > 0).all()
    assert np.array_equal(X[mesh.groups["corner"]].ravel(), np.zeros(dim))
    if dim == 3:
        lengths = np.linalg.norm(np.diff(X[mesh.groups["line"]], axis=1), axis=2)
        assert lengths.sum() == pytest.approx(2.0)
        assert len(lengths) > 4


def test_a_group_of_other_nodes_and_sizes_of_zero_are_refused():
    name, points, cells, groups = two_blocks("simplex")
    with pytest.raises(BadValue, match="group"):
        hierarchy.founded(name, points, cells, {"wrong": np.array([[0, 1, len(points) - 1]])})
    state = hierarchy.founded(name, points, cells, groups)
    for bad in (0.0, np.nan, -1.0):
        with pytest.raises(BadValue, match="size"):
            hierarchy.adapted(state, np.full(len(points), bad))


def test_mid_nodes_beside_linear_elements_hang():
    points, cells = simplices(1, 2)
    edges = np.sort(cells[0][np.array([[0, 1], [1, 2], [2, 0]])], axis=1)
    P = np.vstack([points, points[edges].mean(axis=1)])
    high = np.concatenate([cells[0], 4 + np.arange(3)])[None]
    nodes, masters = hanging.hanging_nodes(P, [("TRI3", cells[1:]), ("TRI6", high)])
    shared = np.intersect1d(cells[0], cells[1])
    assert len(nodes) == 1
    assert set(masters[0, :2]) == set(shared)


def test_nodes_at_one_place_in_two_solids_do_not_hang():
    """A fine block on a coarse one, not tied: the fine nodes stand on coarse edges and are free."""
    a, cells_a = grid(1, 2)
    b, cells_b = grid(2, 2)
    P = np.vstack([a, b + [0, 1]])
    nodes, _ = hanging.hanging_nodes(P, [("QUA4", np.vstack([cells_a, cells_b + len(a)]))])
    assert len(nodes) == 0


@pytest.mark.parametrize("kind", ["simplex", "tensor"])
@pytest.mark.parametrize("dim", [2, 3])
def test_patch_test_across_degrees_and_energy_grows_with_the_quadratic_zone(kind, dim):
    """Linear and quadratic elements side by side: linear fields exact, and the energy of a load never decreases."""
    from scipy.sparse.linalg import spsolve

    points, cells = (simplices if kind == "simplex" else grid)(3, dim)
    points = moved_inside(points, np.random.default_rng(8), 0.04)
    name = NAMES[kind, dim]
    high = shape(QUADRATIC[name])
    pairs = np.sort(cells[:, np.array([edge[:2] for edge in high.edges])].reshape(-1, 2), axis=1)
    edges, index = np.unique(pairs, axis=0, return_inverse=True)
    P = np.vstack([points, points[edges].mean(axis=1)])
    both = np.hstack([cells, len(points) + index.reshape(len(cells), -1)])
    centre = points[cells].mean(axis=1)[:, 0]
    energies = []
    for limit in (0.0, 0.4, 0.7, 1.0):
        zone = centre < limit
        blocks = [(n, c) for n, c in ((name, cells[~zone]), (high.name, both[zone])) if len(c)]
        nodes, masters = hanging.hanging_nodes(P, blocks)
        assert bool(len(nodes)) == (0 < limit < 1)
        T = sp.csr_array(sp.kron(relation_matrix(len(P), nodes, masters), sp.eye_array(dim)))
        D = isotropic(1.0, 0.3, FAMILY[dim])
        K = assembly.assemble(len(P), dim, [(c, elasticity.element_stiffness(shape(n), P[c], D)) for n, c in blocks])
        own = np.setdiff1d(np.arange(len(P)), nodes)
        used = np.zeros(len(P), bool)
        for _, c in blocks:
            used[c] = True
        u = P @ np.random.default_rng(1).uniform(-1, 1, (dim, dim))
        inside = ((P[own] > 1e-12) & (P[own] < 1 - 1e-12)).all(axis=1) & used[own]
        assert abs((T.T @ (K @ u.ravel())).reshape(-1, dim)[inside]).max() <= 1e-12
        F = np.zeros((len(P), dim))
        for facets in topology.boundary(blocks).values():
            top = facets.nodes[np.isclose(P[facets.nodes][:, :, -1], 1).all(axis=1)]
            if len(top):
                load = integrals.distributed_load(shape(facets.name), P[top], np.eye(dim)[0])
                F += assembly.assemble_vector(len(P), dim, [(top, load)]).reshape(-1, dim)
        free = np.flatnonzero(np.repeat(used[own] & (P[own, -1] > 1e-12), dim))
        A, b = sp.csc_array(T.T @ K @ T)[free][:, free], (T.T @ F.ravel())[free]
        energies.append(float(b @ spsolve(A, b)))
    assert (np.diff(energies) > 0).all()
