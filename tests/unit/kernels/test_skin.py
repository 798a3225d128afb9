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


def polygon_areas(seen):
    total = 0.0
    for f in seen.facets:
        corners = seen.points[f]
        for k in range(1, f.shape[1] - 1):
            cross = np.cross(corners[:, k] - corners[:, 0], corners[:, k + 1] - corners[:, 0])
            total += 0.5 * float(np.linalg.norm(cross, axis=1).sum())
    return total


def test_a_cut_goes_through_cells_and_is_closed_by_its_section():
    points, blocks = bricks(3)
    plane = (np.array([1.9, 0, 0]), np.array([1.0, 0, 0]))
    seen = skin(points, blocks, plane=plane)
    assert polygon_areas(seen) == pytest.approx(2 + 4 * 1.9)
    assert set(seen.cell.tolist()) == {0, 1}
    assert seen.points[np.unique(np.concatenate([f.ravel() for f in seen.facets])), 0].max() == pytest.approx(1.9)
    alone = skin(points, blocks, plane=plane, section=True)
    assert polygon_areas(alone) == pytest.approx(1.0)
    assert alone.cell.tolist() == [1]


def test_the_section_of_a_cube_across_its_diagonal_is_a_regular_hexagon():
    points, blocks = bricks(1)
    seen = skin(points, blocks, plane=(np.full(3, 0.5), np.ones(3)), section=True)
    assert [f.shape[1] for f in seen.facets] == [6]
    assert polygon_areas(seen) == pytest.approx(0.75 * np.sqrt(3.0))


@pytest.mark.parametrize("name", ["TET4", "PYR5", "PRI6", "CUB8", "TE10", "PY13", "PR15", "CU20"])
def test_sections_of_every_solid_are_convex_and_carry_linear_fields_exactly(name):
    of = shape(name)
    points = np.column_stack([of.ref_nodes, np.zeros((of.n_nodes, 3 - of.ref_nodes.shape[1]))])
    blocks = [(name, np.arange(of.n_nodes)[None])]
    centre = points[: of.n_corners].mean(axis=0)
    for normal in np.random.default_rng(3).normal(size=(20, 3)):
        for section in (True, False):
            seen = skin(points, blocks, plane=(centre, normal), section=section)
            np.testing.assert_allclose(
                seen.carry(points @ [1.0, -2.0, 0.5]), seen.points @ [1.0, -2.0, 0.5], atol=1e-12
            )
            for f in seen.facets:
                corners = seen.points[f]
                assert ((corners - centre) @ normal).max() < 1e-9
                if section:
                    sides = np.roll(corners, -1, axis=1) - corners
                    turns = np.cross(sides, np.roll(sides, -1, axis=1)) @ normal
                    assert (turns > -1e-12).all() or (turns < 1e-12).all()


def test_a_plane_along_a_face_leaves_all_or_nothing():
    points, blocks = bricks(2)
    for x, area in ((0.0, 0.0), (1.0, 6.0), (2.0, 10.0)):
        seen = skin(points, blocks, plane=(np.array([x, 0, 0]), np.array([1.0, 0, 0])))
        assert polygon_areas(seen) == pytest.approx(area, abs=1e-6), x


def test_reduced_cells_are_left_out_whole():
    points, blocks = bricks(3)
    seen = skin(points, blocks, shrink=0.5, plane=(np.array([1.6, 0, 0]), np.array([1.0, 0, 0])))
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
