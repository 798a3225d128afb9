"""Sizes inside coarse envelopes; mid-nodes of solids on their geometry; the same data, the same mesh."""

import numpy as np
import pytest

from gibiane_ops.kernels import topology
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.mesh.simplices import triangles_of_quadrangles
from gibiane_ops.kernels.remesh import mesh_volume
from gibiane_ops.kernels.remesh.solids import Solid, mesh_solid

pytest.importorskip("gmsh")


def coarse_cube():
    grid = np.linspace(0, 1, 4)
    points = np.stack(np.meshgrid(grid, grid, grid, indexing="ij"), axis=-1).reshape(-1, 3)
    ids = np.arange(64).reshape(4, 4, 4)
    cube = shape("CUB8").ref_nodes.astype(int) // 2 + 1
    cells = np.stack([ids[a : a + 3, b : b + 3, c : c + 3] for a, b, c in np.clip(cube, 0, 1)], axis=-1).reshape(-1, 8)
    return points, triangles_of_quadrangles(topology.boundary([("CUB8", cells)])["QUA4"].nodes)


def test_a_coarse_envelope_does_not_hide_the_size_inside():
    points, facets = coarse_cube()
    counts = [len(mesh_volume(points, facets, size).cells) for size in (0.3, 0.1, 0.07)]
    assert counts[1] > 2 * counts[0]
    assert counts[2] > 1.5 * counts[1]


def test_the_same_data_give_the_same_mesh():
    points, facets = coarse_cube()
    sizes = np.full(len(points), 0.08)
    first, second = (mesh_volume(points, facets, sizes) for _ in range(2))
    np.testing.assert_array_equal(first.points, second.points)
    np.testing.assert_array_equal(first.cells, second.cells)


@pytest.mark.parametrize("dim", [2, 3])
def test_mid_nodes_of_a_ball_lie_on_it(dim):
    centre = np.array([1.0, 2.0, 0.0])
    ball = mesh_solid([Solid("SPHE", (centre,), 2.0)], 0.9, dim, 2)
    edges = topology.edges([(shape({2: "TRI3", 3: "TET4"}[dim]).name, ball.cells)])
    np.testing.assert_array_equal(ball.edges, edges)
    skin = np.concatenate(ball.faces)
    outer = np.unique(np.sort(skin[:, [[0, 1], [1, 2], [2, 0]][: 1 if dim == 2 else 3]].reshape(-1, 2), axis=1), axis=0)
    on = (ball.edges[:, None] == outer[None]).all(axis=2).any(axis=1)
    assert on.sum() == len(outer)
    np.testing.assert_allclose(np.linalg.norm(ball.middles[on] - centre, axis=1), 2.0, atol=1e-6)
    straight = ball.points[ball.edges].mean(axis=1)
    assert np.linalg.norm(ball.middles - straight, axis=1).max() < 0.2
