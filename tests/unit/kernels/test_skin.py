"""What is seen of a mesh: its boundary, a cut, cells drawn apart."""

import numpy as np
import pytest

from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.plot.layers import facet_normals
from gibiane_ops.kernels.plot.skin import skin


def bricks(n):
    """A row of n unit cubes along x."""
    of = shape("CUB8")
    unit = (of.ref_nodes + 1) / 2
    points, cells = np.unique(
        np.concatenate([unit + np.array([i, 0, 0]) for i in range(n)]), axis=0, return_inverse=True
    )
    return points, [("CUB8", cells.reshape(n, 8))]


def areas(seen):
    corners = [seen.points[f] for f in seen.facets]
    return sum(float(np.linalg.norm(np.cross(c[:, 1] - c[:, 0], c[:, 3] - c[:, 0]), axis=1).sum()) for c in corners)


def test_the_skin_is_the_boundary():
    points, blocks = bricks(3)
    seen = skin(points, blocks)
    assert areas(seen) == pytest.approx(2 + 4 * 3)
    assert np.bincount(seen.cell).tolist() == [5, 4, 5]
    outward = facet_normals(seen.points, seen.facets)
    centres = np.concatenate([seen.points[f].mean(axis=1) for f in seen.facets])
    assert (np.einsum("ij,ij->i", outward, centres - np.array([1.5, 0.5, 0.5])) > 0).all()


def test_a_cut_leaves_out_whole_cells_and_opens_the_inside():
    points, blocks = bricks(3)
    seen = skin(points, blocks, plane=(np.array([1.9, 0, 0]), np.array([1.0, 0, 0])))
    assert areas(seen) == pytest.approx(2 + 4 * 2)
    assert set(seen.cell.tolist()) == {0, 1}


def test_cells_drawn_apart_keep_their_nodes_and_shrink():
    points, blocks = bricks(2)
    seen = skin(points, blocks, shrink=0.5)
    assert len(seen.points) == 16
    assert areas(seen) == pytest.approx(2 * 6 * 0.25)
    np.testing.assert_array_equal(seen.node, blocks[0][1].ravel())


def test_surfaces_are_their_own_facets_and_lines_show_nothing():
    points = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    seen = skin(points, [("SEG2", np.array([[0, 1]])), ("QUA4", np.array([[0, 1, 2, 3]]))])
    assert [f.tolist() for f in seen.facets] == [[[0, 1, 2, 3]]]
    assert seen.cell.tolist() == [1]


def test_chosen_cells_only():
    points, blocks = bricks(3)
    seen = skin(points, blocks, keep=np.array([False, True, False]))
    assert areas(seen) == pytest.approx(6.0)
    assert set(seen.cell.tolist()) == {1}
