"""Facets and neighbourhoods of small meshes counted by hand."""

import numpy as np
import pytest

from gibiane_ops.kernels import connectivity, geometry, topology
from gibiane_ops.kernels.elements.table import shape

# Two unit cubes side by side along x; node numbers i + 3 j + 6 k.
POINTS = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1, 2)], float)
CUBES = np.array([[0, 1, 4, 3, 6, 7, 10, 9], [1, 2, 5, 4, 7, 8, 11, 10]])
TWO_CUBES = [("CUB8", CUBES)]


def test_two_cubes() -> None:
    every = topology.faces_of(TWO_CUBES)["QUA4"]
    assert len(every.nodes) == 12
    assert every.cell.tolist() == [0] * 6 + [1] * 6
    skin = topology.boundary(TWO_CUBES)["QUA4"]
    assert len(skin.nodes) == 10
    assert {1, 4, 7, 10} not in [set(face) for face in skin.nodes.tolist()]
    assert topology.neighbours(TWO_CUBES).tolist() == [[0, 1]]
    assert len(topology.edges(TWO_CUBES)) == 20
    assert connectivity.solids(TWO_CUBES, 12)[0] == 1


def test_boundary_normals_leave_the_solid() -> None:
    skin = topology.boundary(TWO_CUBES)["QUA4"]
    X = POINTS[skin.nodes]
    normals = geometry.facet_normals(shape("QUA4"), X)
    outward = X.mean(axis=1) - POINTS[CUBES].mean(axis=1)[skin.cell]
    assert np.all((normals * outward).sum(axis=1) > 0.4)
    # Divergence theorem on the position: 3 V.
    flux = geometry.normal_densities(shape("QUA4"), X, np.zeros((1, 2)))[:, 0]
    assert 4 * (flux * X.mean(axis=1)).sum() == pytest.approx(3 * 2.0)


def test_cube_and_prism_share_a_face() -> None:
    blocks = [("CUB8", CUBES[:1]), ("PRI6", np.array([[1, 2, 4, 7, 8, 10]]))]
    skin = topology.boundary(blocks)
    assert {name: len(facets.nodes) for name, facets in skin.items()} == {"QUA4": 7, "TRI3": 2}
    assert skin["TRI3"].cell.tolist() == [1, 1]
    assert topology.neighbours(blocks).tolist() == [[0, 1]]


def test_cells_of_both_degrees_share_a_facet() -> None:
    blocks = [("TRI3", np.array([[0, 1, 2]])), ("TRI6", np.array([[0, 2, 3, 4, 5, 6]]))]
    assert topology.neighbours(blocks).tolist() == [[0, 1]]
    assert {name: len(facets.nodes) for name, facets in topology.boundary(blocks).items()} == {"SEG2": 2, "SEG3": 2}


def test_plane_mesh_has_edges_for_boundary() -> None:
    blocks = [("TRI3", np.array([[0, 1, 2], [0, 2, 3]]))]
    skin = topology.boundary(blocks)["SEG2"]
    assert skin.nodes.tolist() == [[0, 1], [1, 2], [2, 3], [3, 0]]
    assert skin.local.tolist() == [0, 1, 1, 2]
    assert topology.edges(blocks).tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]]


def test_lines_have_points_for_boundary() -> None:
    skin = topology.boundary([("SEG2", np.array([[4, 2], [2, 7]]))])["POI1"]
    assert skin.nodes.ravel().tolist() == [4, 7]


def test_closed_surface_has_no_boundary() -> None:
    faces = topology.boundary(TWO_CUBES)["QUA4"].nodes
    assert topology.boundary([("QUA4", faces)]) == {}


def test_cells_around_nodes() -> None:
    blocks = [("TRI3", np.array([[0, 1, 2], [0, 2, 3]])), ("SEG2", np.array([[3, 5]]))]
    indptr, cells = connectivity.node_to_cells(blocks, 6)
    around = [cells[indptr[i] : indptr[i + 1]].tolist() for i in range(6)]
    assert around == [[0, 1], [0], [0, 1], [1, 2], [], [2]]
    graph = connectivity.node_graph(blocks, 6).toarray()
    assert graph[0].tolist() == [2, 1, 2, 1, 0, 0]
    assert graph[5].tolist() == [0, 0, 0, 1, 0, 1]


def test_solids_are_numbered_by_their_first_node() -> None:
    blocks = [("SEG2", np.array([[5, 6], [1, 2]])), ("SEG2", np.array([[2, 3]]))]
    count, solid = connectivity.solids(blocks, 8)
    assert count == 2
    assert solid.tolist() == [-1, 0, 0, 0, -1, 1, 1, -1]


def test_groups_ignore_the_order_of_nodes() -> None:
    group, first = topology.group_by_nodes(np.array([[3, 1, 2], [9, 8, 7], [2, 3, 1], [1, 2, 4]]))
    assert group.tolist() == [0, 1, 0, 2]
    assert first.tolist() == [0, 1, 3]


def test_empty_mesh() -> None:
    assert topology.boundary([]) == {}
    assert connectivity.solids([], 3)[0] == 0
    assert topology.edges([]).shape == (0, 2)
    assert topology.neighbours([]).shape == (0, 2)


@pytest.mark.parametrize("scale", [1, 10**6, 10**15, 2**61])
@pytest.mark.parametrize("offset", [0, -(2**40), 7])
def test_rows_of_the_same_nodes_are_grouped_whatever_their_size(scale, offset):
    rows = (
        np.array([[0, 1, 2, 3], [3, 2, 1, 0], [0, 1, 2, 2], [1, 0, 3, 2], [2, 2, 1, 0], [0, 0, 0, 0]]) * scale + offset
    )
    group, first = topology.group_by_nodes(rows)
    assert group.tolist() == [0, 0, 1, 0, 1, 2]
    assert first.tolist() == [0, 2, 5]


def test_used_nodes():
    assert topology.used_nodes([np.array([[5, 2], [2, 9]]), np.zeros((0, 3), np.int64), np.array([[0]])]).tolist() == [
        0,
        2,
        5,
        9,
    ]
    assert topology.used_nodes([]).tolist() == []


def test_places_of_nodes_in_a_list() -> None:
    nodes = np.array([9, 2, 5, 7])
    cells = np.array([[2, 5, 9], [7, 9, 2]])
    assert topology.places_in(nodes, cells).tolist() == [[1, 2, 0], [3, 0, 1]]
    assert topology.places_in(nodes[:0], cells[:0]).shape == (0, 3)


def test_a_linear_and_a_quadratic_cell_share_a_facet():
    # TRI3 (0 1 2) and TRI6 (1 3 2): the side 1-2 is inside, with a middle or without
    blocks = [("TRI3", np.array([[0, 1, 2]])), ("TRI6", np.array([[1, 3, 2, 4, 5, 6]]))]
    found = topology.boundary(blocks)
    assert found["SEG2"].nodes.tolist() == [[0, 1], [2, 0]]
    assert found["SEG3"].nodes.tolist() == [[1, 3, 4], [3, 2, 5]]
    assert found["SEG3"].cell.tolist() == [1, 1]
