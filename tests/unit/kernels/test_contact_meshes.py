"""Contact of surfaces of different meshes: mortar, node to facet, search, ties."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from two_grids import areas, grid, turned

from gibiane_ops.kernels.contact.clip import clip, fan
from gibiane_ops.kernels.contact.facets import middles_of, surface_of, transformation
from gibiane_ops.kernels.contact.mortar import mortar_pairs
from gibiane_ops.kernels.contact.node_facet import are_inside, node_facet_pairs
from gibiane_ops.kernels.contact.node_pairs import node_pairs
from gibiane_ops.kernels.contact.overlaps import overlaps
from gibiane_ops.kernels.contact.pairs import ContactPairs, joined
from gibiane_ops.kernels.contact.ties import tie_contact
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue, EmptyContact

KINDS = ["TRI3", "QUA4", "TRI6", "QUA8"]
NONE = np.zeros(0, np.int64)


def two(kind, n1, n2, other=None, bent=False, gap=0.0):
    """Slave above, master below."""
    a, slave = grid(kind, n1, False, 1 if bent else None, gap)
    b, master = grid(other or kind, n2, True, 2 if bent else None, 0.0, len(a))
    return np.vstack([a, b]), slave, master


def line(kind, x, down, start, y=0.0):
    n = len(x) - 1
    points = np.column_stack([x, np.full(n + 1, y)])
    cells = start + np.column_stack([np.arange(n), np.arange(1, n + 1)])
    if kind == "SEG3":
        cells = np.column_stack([cells, start + n + 1 + np.arange(n)])
        points = np.vstack([points, (points[:-1] + points[1:]) / 2])
    return points, [(kind, cells if down else turned(kind, cells))]


# -- polygons --------------------------------------------------------------------------------------------------------


def test_common_part_of_random_triangles_and_squares() -> None:
    rng = np.random.default_rng(0)
    triangle = rng.uniform(0, 1, (200, 3, 2))
    area = np.linalg.det(triangle[:, 1:] - triangle[:, :1])
    triangle[area < 0] = triangle[area < 0][:, ::-1]
    square = np.broadcast_to(np.array([[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8]]), (200, 4, 2))
    one, two_ = (np.zeros(200) for _ in range(2))
    for total, (a, b) in zip((one, two_), ((triangle, square), (square, triangle)), strict=True):
        owner, _, part = fan(*clip(a, b))
        np.add.at(total, owner, part)
    np.testing.assert_allclose(one, two_, atol=1e-15)
    # sampled: an independent measure
    samples = np.stack(np.meshgrid(*[0.2 + 0.6 * (np.arange(100) + 0.5) / 100] * 2), axis=-1).reshape(-1, 2)
    for i in range(20):
        t = triangle[i]
        inside = np.ones(len(samples), bool)
        for k in range(3):
            edge = t[(k + 1) % 3] - t[k]
            inside &= edge[0] * (samples[:, 1] - t[k, 1]) - edge[1] * (samples[:, 0] - t[k, 0]) >= 0
        assert abs(inside.mean() * 0.36 - one[i]) < 4e-3


def test_polygons_apart_have_no_common_part() -> None:
    unit = np.array([[[0.0, 0], [1, 0], [1, 1], [0, 1]]])
    assert len(fan(*clip(unit, unit + 2.0))[0]) == 0
    np.testing.assert_allclose(fan(*clip(unit, unit))[2].sum(), 1.0)


# -- basis of quadratic facets -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "corner", "middle"), [("TRI6", 2 / 15, 1 / 5), ("QUA8", 1 / 20, 1 / 5), ("SEG3", 3 / 10, 2 / 5)]
)
def test_changed_basis_has_positive_integrals(name, corner, middle) -> None:
    of = shape(name)
    xi, w = of.mass_gauss
    found = w @ of.N(xi) @ transformation(of) / w.sum()
    n = of.n_corners
    np.testing.assert_allclose(found, [corner] * n + [middle] * (of.n_nodes - n), atol=1e-15)


def test_uniform_pressure_on_quadratic_pairs_gives_forces_of_one_sign() -> None:
    for kind in ("TRI6", "QUA8"):
        points, slave, master = two(kind, 2, 2)
        pairs = node_pairs(points, slave, master)
        nodal = areas(points, slave)[pairs.pairs[:, 0]]
        assert nodal.min() < 1e-12
        on_pairs = pairs.forces_on_pairs(nodal)
        assert on_pairs.min() > 0
        np.testing.assert_allclose(on_pairs, pairs.area, atol=1e-14)
        # the work of forces on displacements does not depend on the basis
        w = np.random.default_rng(3).normal(size=len(nodal))
        np.testing.assert_allclose(on_pairs @ pairs.on_pairs(w), nodal @ w)
        np.testing.assert_allclose(pairs.at_nodes(pairs.on_pairs(w)), w)


def test_a_middle_without_its_corners_has_no_pair() -> None:
    points, slave, master = two("QUA8", 1, 1)
    points[4 + 4 + 0] += 0.3  # a corner of the master moves away
    found = node_pairs(points, slave, master)
    assert len(found.pairs) == 5
    assert len(found.middles) == 2
    assert found.unpaired_slave.size == 3


# -- mortar ------------------------------------------------------------------------------------------------------------

PATCHES = [
    ("TRI3", "TRI3", 3, 4, True), ("TRI3", "TRI3", 8, 4, True), ("TRI3", "TRI3", 4, 8, True),
    ("QUA4", "QUA4", 3, 4, False), ("QUA4", "TRI3", 4, 3, False), ("QUA4", "QUA4", 4, 5, True),
    ("TRI6", "TRI6", 3, 2, True), ("QUA8", "QUA8", 2, 3, False), ("QUA8", "TRI6", 3, 2, False),
    ("TRI6", "QUA4", 2, 3, False),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "other", "n1", "n2", "bent"), PATCHES)
def test_mortar_passes_a_uniform_pressure_and_linear_motions(kind, other, n1, n2, bent) -> None:
    points, slave, master = two(kind, n1, n2, other, bent)
    pairs = mortar_pairs(points, slave, master)
    M = pairs.matrix(len(points))
    n = len(areas(points, slave).nonzero()[0])
    assert len(pairs.pairs) == len(np.unique(slave[0][1])) >= n
    assert np.abs(M.sum(axis=1)).max() < 1e-12
    forces = M.T @ pairs.area
    exact = areas(points, slave) - areas(points, master)
    limit = 1e-10 if bent and "QUA" in kind + other else 1e-13
    assert np.abs(forces - exact).max() < limit * np.abs(exact).max()
    # both sides move alike along a linear field, and the resultant and the moment of any forces vanish
    assert np.abs(M @ points).max() < 1e-12
    r = np.random.default_rng(5).normal(size=(len(pairs.pairs), 3))
    F = M.T @ r
    np.testing.assert_allclose(F.sum(axis=0), 0, atol=1e-12)
    np.testing.assert_allclose(np.cross(points, F).sum(axis=0), 0, atol=1e-12)


def test_multipliers_are_dual() -> None:
    """The row of a node does not hold its slave neighbours: sums over facets of psi_p N_q vanish."""
    for kind in KINDS:
        points, slave, master = two(kind, 3, 4)
        name, cells = slave[0]
        found = overlaps(points, name, cells, master)
        T = transformation(shape(kind))
        mass, D = np.zeros((len(cells), T.shape[0], T.shape[0])), np.zeros((len(cells), T.shape[0]))
        np.add.at(mass, found.slave, T.T @ found.mass @ T)
        np.add.at(D, found.slave, found.area @ T)
        A = D[:, :, None] * np.linalg.inv(mass)
        np.testing.assert_allclose(A @ mass, np.einsum("mi,ij->mij", D, np.eye(T.shape[0])), atol=1e-14)
        np.testing.assert_allclose(found.area.sum(), 1.0)
    # on a triangle psi_i = 3 N_i - N_j - N_k
    triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    both = np.vstack([triangle, triangle])
    part = overlaps(both, "TRI3", np.array([[0, 2, 1]]), [("TRI3", np.array([[3, 4, 5]]))])
    A = part.area.sum(axis=0)[:, None] * np.linalg.inv(part.mass.sum(axis=0))
    np.testing.assert_allclose(A, 4 * np.eye(3) - 1, atol=1e-13)


def test_coincident_meshes_give_node_pairs() -> None:
    for kind in KINDS:
        points, slave, master = two(kind, 2, 2)
        pairs, mortar, facet = (make(points, slave, master) for make in (node_pairs, mortar_pairs, node_facet_pairs))
        order = np.argsort(pairs.pairs[:, 0])
        plain = pairs.matrix(len(points)).toarray()[order]
        for other in (mortar, facet):
            np.testing.assert_array_equal(other.pairs[:, 0], pairs.pairs[order, 0])
            np.testing.assert_allclose(other.matrix(len(points)).toarray(), plain, atol=1e-12)
            np.testing.assert_allclose(other.area, pairs.area[order], atol=1e-14)


@pytest.mark.parametrize("kind", ["SEG2", "SEG3"])
def test_mortar_on_lines(kind) -> None:
    a, slave = line(kind, np.array([0, 0.3, 0.5, 1.0]), True, 0, 0.1)
    b, master = line(kind, np.linspace(0, 1, 5), False, len(a))
    points = np.vstack([a, b])
    pairs = mortar_pairs(points, slave, master)
    M = pairs.matrix(len(points))
    np.testing.assert_allclose(M.T @ pairs.area, areas(points, slave) - areas(points, master), atol=1e-15)
    np.testing.assert_allclose(pairs.gap, 0.1)
    np.testing.assert_allclose(pairs.normals, [[0, -1]] * len(a), atol=1e-15)


def test_facets_covered_in_part() -> None:
    a, slave = grid("QUA4", 4, False, None, 0.0)
    b, master = grid("QUA4", 3, True, None, 0.0, len(a))
    b[:, 0] = b[:, 0] * 0.6 + 0.2  # from 0.2 to 0.8: facets 1 and 4 are covered from 0.2 to 0.25 only
    points = np.vstack([a, b])
    pairs = mortar_pairs(points, slave, master)
    M = pairs.matrix(len(points))
    assert pairs.area.sum() == pytest.approx(0.6)
    assert np.abs(M.sum(axis=1)).max() < 1e-12
    np.testing.assert_allclose((M.T @ pairs.area)[len(a) :], -areas(points, master)[len(a) :], atol=1e-13)
    b[:, 0] = (b[:, 0] - 0.2) / 0.6 * 0.5 + 0.2499999  # now less than a thousandth of the outer nodes
    found = mortar_pairs(np.vstack([a, b]), slave, master)
    assert set(np.round(a[found.pairs[:, 0], 0], 6)) == {0.25, 0.5, 0.75}
    assert len(found.unpaired_slave) == 10


def test_gap_of_a_curved_surface_and_its_penetration() -> None:
    points, slave, master = two("QUA4", 6, 5)
    n = len(np.unique(slave[0][1]))
    x = points[:n] - 0.5
    points[:n, 2] = (x[:, 0] ** 2 + x[:, 1] ** 2) / 10
    pairs = mortar_pairs(points, slave, master)
    exact = points[pairs.pairs[:, 0], 2]
    assert np.abs(pairs.gap - exact).max() < 2e-3
    assert pairs.penetrating.size == 0
    points[:n, 2] -= 0.01
    assert 0 < mortar_pairs(points, slave, master).penetrating.size < n


def test_rigid_master_has_no_displacement() -> None:
    points, slave, master = two("TRI3", 3, 2, gap=0.05)
    pairs = mortar_pairs(points, slave, master, rigid=True)
    M = pairs.matrix(len(points)).toarray()
    np.testing.assert_array_equal(M, np.eye(len(points))[pairs.pairs[:, 0]])
    np.testing.assert_allclose(pairs.gap, 0.05)
    np.testing.assert_allclose(pairs.normals, [[0, 0, -1]] * len(M), atol=1e-14)


def test_axisymmetric_areas_go_round_the_axis() -> None:
    a, slave = line("SEG2", np.linspace(0, 1, 4), True, 0)
    b, master = line("SEG2", np.linspace(0, 1, 6), False, len(a))
    pairs = mortar_pairs(np.vstack([a, b]), slave, master, axisymmetric=True)
    assert pairs.area.sum() == pytest.approx(np.pi)
    assert pairs.area.min() > 0


# -- node to facet -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_node_to_facet_balances_forces_and_follows_linear_motions(kind) -> None:
    points, slave, master = two(kind, 3, 4, bent=kind.startswith("TRI"))
    pairs = node_facet_pairs(points, slave, master)
    M = pairs.matrix(len(points))
    assert len(pairs.pairs) == len(np.unique(slave[0][1]))
    assert np.abs(M @ points).max() < 1e-12
    forces = M.T @ pairs.area
    assert np.abs(forces - (areas(points, slave) - areas(points, master))).max() > 1e-3  # no patch test


def test_nodes_past_the_border_catch_up_or_stay_free() -> None:
    points, slave, master = two("QUA4", 2, 1)
    points[-4:, 0] *= 0.97  # 3 % of the facet
    assert len(node_facet_pairs(points, slave, master).pairs) == 9
    points[-4:, 0] *= 0.9
    found = node_facet_pairs(points, slave, master)
    assert len(found.pairs) == 6
    assert len(found.unpaired_slave) == 3


def test_projection_on_a_curved_facet() -> None:
    """A parabola between three nodes, met by lines that are not normal to it."""
    master = [("SEG3", np.array([[1, 0, 2]]))]
    x = np.linspace(0.05, 0.95, 7)
    points = np.vstack([[[0, 0], [1, 0], [0.5, 0.1]], np.column_stack([x, 0.3 + 0.1 * x])])
    slave = [("SEG2", 3 + np.column_stack([np.arange(6), np.arange(1, 7)]))]
    pairs = node_facet_pairs(points, slave, master)
    foot = pairs.points + pairs.gap[:, None] * pairs.normals
    np.testing.assert_allclose(foot[:, 1], 0.4 * foot[:, 0] * (1 - foot[:, 0]), atol=1e-12)
    np.testing.assert_allclose(-(pairs.matrix(len(points))[:, :3] @ points[:3]), foot, atol=1e-12)


def test_surfaces_that_look_the_same_way_or_lie_elsewhere() -> None:
    points, slave, master = two("QUA4", 3, 4)
    same = [("QUA4", slave[0][1][:, ::-1])]
    for make in (mortar_pairs, node_facet_pairs):
        with pytest.raises(EmptyContact):
            make(points, same, master)
        points[-25:] += [5.0, 0, 0]
        with pytest.raises(EmptyContact):
            make(points, slave, master)
        points[-25:] -= [5.0, 0, 0]
        with pytest.raises(EmptyContact):
            make(points, [], master)
        with pytest.raises(EmptyContact):
            make(points, slave, [])
    assert len(node_facet_pairs(points, same, master, facing=False).not_facing) == 16


# -- sharp edges -------------------------------------------------------------------------------------------------------


def corner():
    """A slave that turns a corner of 90 degrees, in a master that turns with it; 2D."""
    slave = np.array([[1.0, 0], [0.5, 0], [0, 0], [0, 0.5], [0, 1]])
    master = np.array([[1.0, 0], [0.6, 0], [0.3, 0], [0, 0], [0, 0.4], [0, 0.7], [0, 1]])
    points = np.vstack([slave, master])
    a = np.column_stack([np.arange(1, 5), np.arange(4)])
    b = 5 + np.column_stack([np.arange(6), np.arange(1, 7)])
    return points, [("SEG2", a)], [("SEG2", b)]


def test_a_node_on_a_sharp_edge_has_a_normal_per_side() -> None:
    points, slave, master = corner()
    surface = surface_of(points, slave)
    assert list(surface.nodes).count(2) == 2
    np.testing.assert_allclose(sorted(np.abs(surface.normals[surface.nodes == 2]).tolist()), [[0, 1], [1, 0]])
    assert len(surface_of(points, slave, split=False).nodes) == 5
    pairs = mortar_pairs(points, slave, master)
    assert len(pairs.pairs) == 6
    np.testing.assert_allclose(np.abs(pairs.normals).sum(axis=1), 1.0)
    M = pairs.matrix(len(points))
    assert np.abs(M @ points).max() < 1e-13


def test_ties_of_a_sharp_edge_are_independent() -> None:
    points, slave, master = corner()
    for make in (mortar_pairs, node_facet_pairs):
        check_tie(make(points, slave, master), len(points), 2, NONE)


# -- ties --------------------------------------------------------------------------------------------------------------


def check_tie(pairs: ContactPairs, n_nodes: int, d: int, fixed) -> np.ndarray:
    """Every displacement is reached, and the relative displacements are those that were asked for."""
    Bv, Bw, B0, free = tie_contact(n_nodes * d, d, pairs, fixed)
    rng = np.random.default_rng(7)
    v, w, q = rng.normal(size=Bv.shape[1]), rng.normal(size=free.shape), rng.normal(size=len(fixed))
    U = Bv @ v + Bw @ w.ravel() + B0 @ q
    np.testing.assert_allclose(U[fixed], q, atol=1e-12)
    found = sp.kron(pairs.matrix(n_nodes), sp.eye_array(d)) @ U
    np.testing.assert_allclose(found.reshape(free.shape)[free], w[free], atol=1e-9)
    basis = np.hstack([Bv.toarray(), Bw.toarray()[:, free.ravel()], B0.toarray()])
    assert np.linalg.matrix_rank(basis) == n_nodes * d == basis.shape[1]
    return free


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("make", [mortar_pairs, node_facet_pairs, node_pairs])
def test_ties_reach_every_displacement(kind, make) -> None:
    points, slave, master = two(kind, 3, 3 if make is node_pairs else 2)
    assert check_tie(make(points, slave, master), len(points), 3, NONE).all()


def test_on_a_plane_of_symmetry_the_held_component_drops_out() -> None:
    points, slave, master = two("QUA4", 3, 2)
    fixed = 3 * np.flatnonzero(points[:, 0] == 0)
    free = check_tie(mortar_pairs(points, slave, master), len(points), 3, fixed)
    held = points[np.unique(slave[0][1]), 0] == 0
    np.testing.assert_array_equal(free[:, 0], ~held)
    assert free[:, 1:].all()


def test_a_held_slave_moves_the_master() -> None:
    points, slave, master = two("QUA4", 2, 5)
    fixed = (3 * np.unique(slave[0][1])[:, None] + np.arange(3)).ravel()
    assert check_tie(mortar_pairs(points, slave, master), len(points), 3, fixed).all()


def test_a_held_slave_finer_than_the_master_loses_conditions() -> None:
    points, slave, master = two("QUA4", 5, 2)
    fixed = (3 * np.unique(slave[0][1])[:, None] + np.arange(3)).ravel()
    for make in (mortar_pairs, node_facet_pairs):
        free = check_tie(make(points, slave, master), len(points), 3, fixed)
        assert free.sum() == 27  # as many as the master can follow


def test_a_node_that_is_slave_of_two_surfaces() -> None:
    """A block in a corner of floor and wall."""
    slave = np.array([[0.0, 0], [0.5, 0], [1, 0], [0, 0.5], [0, 1]])
    floor, wall = np.array([[-0.2, 0], [0.3, 0], [1.2, 0]]), np.array([[0, -0.1], [0, 0.4], [0, 1.1]])
    points = np.vstack([slave, floor, wall])
    below = [("SEG2", np.array([[0, 1], [1, 2]]))], [("SEG2", np.array([[6, 5], [7, 6]]))]
    aside = [("SEG2", np.array([[3, 0], [4, 3]]))], [("SEG2", np.array([[8, 9], [9, 10]]))]
    for make in (mortar_pairs, node_facet_pairs):
        both = joined([make(points, *below), make(points, *aside)])
        assert len(both.pairs) == 6
        assert check_tie(both, len(points), 2, NONE).all()


def test_plain_and_interpolated_pairs_together() -> None:
    """Three layers: node pairs between the first two, mortar between the last two."""
    a, up = grid("QUA4", 2, False)
    b, middle = grid("QUA4", 2, True, start=len(a))
    c, low = grid("QUA4", 3, True, start=len(a) + len(b))
    points = np.vstack([a, b, c])
    under = [("QUA4", middle[0][1][:, ::-1])]
    both = joined([node_pairs(points, up, middle), mortar_pairs(points, under, low)])
    assert check_tie(both, len(points), 3, NONE).all()


def test_middles_of_a_surface_come_once() -> None:
    _, slave, _ = two("QUA8", 2, 2)
    found = middles_of(slave)
    assert len(found) == 12
    assert len(np.unique(found[:, 0])) == 12


def test_nested_meshes_are_different_meshes() -> None:
    """All nodes of the coarse side coincide with nodes of the fine one, which has others before the coarse facets."""
    points, slave, master = two("QUA4", 4, 2)
    pairs = node_pairs(points, slave, master)
    assert len(pairs.pairs) == 9
    assert are_inside(points, pairs.unpaired_slave, slave, master)
    # a smaller block on a larger one: the others lie beside it
    points[: len(np.unique(slave[0][1])), :2] *= 2.0
    pairs = node_pairs(points, slave, master)
    assert len(pairs.pairs) == 9
    assert not are_inside(points, pairs.unpaired_slave, slave, master)


def test_a_corner_of_obstacles_shares_the_displacement() -> None:
    """A node before two rigid walls: one component each, and none where the walls lean."""
    normals = np.array([[0.0, -1.0], [-1.0, 0.0], [0.0, -1.0]])
    pairs = ContactPairs(
        np.array([[0, -1], [0, -1], [1, -1]]), normals, np.zeros(3), np.zeros((3, 2)), np.array([0, 1, 0]), *[NONE] * 4
    )
    free = check_tie(pairs, 2, 2, NONE)
    np.testing.assert_array_equal(free, [[False, True], [True, False], [True, True]])
    lean = np.array([[0.0, -1.0], [-0.8, -0.6], [0.0, -1.0]])
    with pytest.raises(BadValue):
        check_tie(replace(pairs, normals=lean), 2, 2, NONE)
