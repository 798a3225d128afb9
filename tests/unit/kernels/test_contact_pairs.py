"""Node pairs: who faces whom, along which normal, at what distance, and what is left over."""

import numpy as np
import pytest

from gibiane_ops.kernels.contact.node_pairs import node_pairs
from gibiane_ops.kernels.contact.outward import _distinct, facets_of_body, nodal_normals
from gibiane_ops.kernels.contact.pairs import joined
from gibiane_ops.kernels.errors import BadValue, EmptyContact

# two unit squares in one plane, four QUA4 each, nodes 0-8 (slave, normal -z) and 9-17 (master, normal +z)
GRID = np.array([[i, j, 0.0] for i in range(3) for j in range(3)])
FACES = np.array([[0, 3, 4, 1], [1, 4, 5, 2], [3, 6, 7, 4], [4, 7, 8, 5]])


def squares(gap=0.0, shift=0.0):
    points = np.vstack([GRID + [shift, 0, gap], GRID])
    return points, [("QUA4", FACES[:, ::-1])], [("QUA4", FACES + 9)]


def test_coincident_squares():
    found = node_pairs(*squares())
    np.testing.assert_array_equal(found.pairs, np.column_stack([np.arange(9), np.arange(9) + 9]))
    np.testing.assert_allclose(found.normals, [[0, 0, -1]] * 9, atol=1e-15)
    np.testing.assert_array_equal(found.gap, 0)
    for empty in (found.unpaired_slave, found.unpaired_master, found.not_facing, found.penetrating):
        assert len(empty) == 0


def test_gap_and_penetration_are_measured_along_the_normal():
    apart = node_pairs(*squares(gap=0.1), tolerance=0.2)
    np.testing.assert_allclose(apart.gap, 0.1)
    assert len(apart.penetrating) == 0
    inside = node_pairs(*squares(gap=-0.1), tolerance=0.2)
    np.testing.assert_allclose(inside.gap, -0.1)
    np.testing.assert_array_equal(inside.penetrating, np.arange(9))


def test_round_off_is_no_gap():
    np.testing.assert_array_equal(node_pairs(*squares(gap=1e-12)).gap, 0)


def test_partly_facing_surfaces():
    found = node_pairs(*squares(shift=1.0))
    np.testing.assert_array_equal(found.pairs, np.column_stack([np.arange(6), np.arange(3, 9) + 9]))
    np.testing.assert_array_equal(found.unpaired_slave, [6, 7, 8])
    np.testing.assert_array_equal(found.unpaired_master, [9, 10, 11])


def test_nothing_within_reach():
    with pytest.raises(EmptyContact, match=r"0\.5 apart"):
        node_pairs(*squares(gap=0.5))
    with pytest.raises(EmptyContact):
        node_pairs(GRID, [], [("QUA4", FACES)])


def test_surfaces_turned_the_same_way_do_not_face_each_other():
    points, slave, _ = squares()
    found = node_pairs(points, slave, [("QUA4", FACES[:, ::-1] + 9)])
    np.testing.assert_array_equal(found.not_facing, np.arange(9))


def test_a_master_node_serves_the_nearest_slave_only():
    points = np.array([[0, 0.0], [0.1, 0], [0, 0], [1, 0]])
    found = node_pairs(points, [("SEG2", np.array([[1, 0]]))], [("SEG2", np.array([[2, 3]]))], tolerance=0.5)
    np.testing.assert_array_equal(found.pairs, [[0, 2]])
    np.testing.assert_array_equal(found.unpaired_slave, [1])
    np.testing.assert_array_equal(found.unpaired_master, [3])
    np.testing.assert_array_equal(np.abs(found.normals), [[0, 1]])


def test_normals_are_weighted_by_area():
    # a roof: one facet of area 2 facing up, one of area 1 facing +x, sharing the edge x = 0
    points = np.array([[-2, 0, 0], [0, 0, 0], [0, 1, 0], [-2, 1, 0], [0, 0, -1], [0, 1, -1.0]])
    nodes, normals = nodal_normals(points, [("QUA4", np.array([[0, 1, 2, 3], [1, 4, 5, 2]]))])
    np.testing.assert_array_equal(nodes, np.arange(6))
    edge = np.array([1, 0, 2]) / np.sqrt(5)
    np.testing.assert_allclose(normals, [[0, 0, 1], edge, edge, [0, 0, 1], [1, 0, 0], [1, 0, 0]], atol=1e-15)


def test_folded_surface():
    with pytest.raises(BadValue):
        nodal_normals(GRID, [("QUA4", np.vstack([FACES[:1], FACES[:1, ::-1]]))])


def test_zones_keep_their_numbers():
    points, slave, master = squares(shift=1.0, gap=-0.1)
    one, two = node_pairs(points, slave, master, tolerance=0.2), node_pairs(*squares())
    both = joined([one, two])
    np.testing.assert_array_equal(both.zone, [0] * 6 + [1] * 9)
    np.testing.assert_array_equal(both.penetrating, np.arange(6))
    np.testing.assert_array_equal(both.unpaired_slave, [6, 7, 8])
    np.testing.assert_array_equal(joined([two, one]).penetrating, np.arange(9, 15))


def test_facets_are_turned_outwards():
    cube = np.array([[0, 1, 2, 3, 4, 5, 6, 7]])
    top = np.array([[4, 5, 6, 7]])
    for order in (top, top[:, ::-1], np.roll(top, 2, axis=1)):
        ((name, cells),) = facets_of_body([("CUB8", cube)], [("QUA4", order)])
        assert name == "QUA4"
        points = np.array([[i, j, k] for k in (0, 1.0) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))])
        np.testing.assert_allclose(nodal_normals(points, [(name, cells)])[1], [[0, 0, 1]] * 4)
    with pytest.raises(EmptyContact):
        facets_of_body([("CUB8", cube)], [("QUA4", np.array([[0, 2, 5, 7]]))])


def test_a_facet_between_two_cells_is_not_on_the_boundary():
    cells = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    ((_, turned),) = facets_of_body([("QUA4", cells)], [("SEG2", np.array([[1, 0], [2, 5]]))])
    assert turned.tolist() == [[0, 1], [2, 5]]
    with pytest.raises(EmptyContact, match="1 facets"):
        facets_of_body([("QUA4", cells)], [("SEG2", np.array([[0, 1], [1, 4]]))])


def test_a_surface_that_names_one_inner_facet_twice_is_refused():
    # As many facets as the cells have there, in the same order: only that they are the same one tells them apart.
    cells = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    with pytest.raises(EmptyContact, match="2 facets"):
        facets_of_body([("QUA4", cells)], [("SEG2", np.array([[1, 4], [4, 1]]))])


def test_equal_keys_are_found_among_many():
    keys = np.random.default_rng(0).integers(0, 2**64, 5000, dtype=np.uint64)
    assert _distinct(keys)
    for at in (0, 17, 4999):
        twice = np.append(keys, keys[at])
        assert not _distinct(twice)
    # all in one slot of the table
    near = np.arange(300, dtype=np.uint64)
    assert _distinct(near)
    near[299] = 4
    assert not _distinct(near)
