"""Measures, normals and checks on cells computed by hand."""

import numpy as np
import pytest

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue, InvertedElement


def test_volume_of_a_frustum() -> None:
    # Square base of side 2, square top of side 1, height 3: h/3 (4 + 2 + 1) = 7.
    X = (shape("CUB8").ref_nodes * [1, 1, 1.5])[None].copy()
    X[0, 4:, :2] *= 0.5
    assert geometry.measures(shape("CUB8"), X) == pytest.approx([7.0], rel=1e-14)


def test_length_and_area_in_space() -> None:
    segment = np.array([[[0.0, 0, 0], [1, 2, 2]]])
    assert geometry.measures(shape("SEG2"), segment) == pytest.approx([3.0])
    triangle = np.array([[[0.0, 0, 0], [3, 0, 4], [0, 2, 0]]])
    assert geometry.measures(shape("TRI3"), triangle) == pytest.approx([5.0])
    assert geometry.measures(shape("POI1"), np.zeros((2, 1, 3))) == pytest.approx([1.0, 1.0])


def test_normals_by_hand() -> None:
    triangle = np.array([[[0.0, 0, 0], [3, 0, 4], [0, 2, 0]]])
    assert geometry.facet_normals(shape("TRI3"), triangle) == pytest.approx(np.array([[-0.8, 0, 0.6]]))
    # The bottom edge of a plane solid, which lies on its left.
    assert geometry.facet_normals(shape("SEG2"), np.array([[[0.0, 0], [2, 0]]])) == pytest.approx(np.array([[0.0, -1]]))


def test_gradient_of_a_linear_field() -> None:
    rng = np.random.default_rng(3)
    cube = shape("CUB8")
    X = cube.ref_nodes + 0.2 * rng.standard_normal((4, 8, 3))
    slope = np.array([2.0, -1, 0.5])
    gradient, _ = geometry.gradients(cube, X, cube.gauss[0])
    assert np.allclose(np.einsum("mqaj,ma->mqj", gradient, X @ slope), slope, rtol=1e-12)


def test_positions_and_centroids() -> None:
    square = np.array([[[0.0, 0], [4, 0], [4, 2], [0, 2]]])
    assert geometry.positions(shape("QUA4"), square, np.array([[0.5, -0.5]])) == pytest.approx(np.array([[[3.0, 0.5]]]))
    assert geometry.centroids(shape("QUA4"), square) == pytest.approx(np.array([[2.0, 1.0]]))


def test_inverted_cells_are_named_with_their_corners() -> None:
    good = shape("CUB8").ref_nodes
    X = np.stack([good, good[[4, 5, 6, 7, 0, 1, 2, 3]], good])
    with pytest.raises(InvertedElement) as caught:
        geometry.check_cells(shape("CUB8"), X)
    assert caught.value.shape == "CUB8"
    assert caught.value.ids.tolist() == [1]
    assert caught.value.volumes == pytest.approx([-1.0])
    assert np.array_equal(caught.value.corners, X[1:2])
    assert "elements 1" in str(caught.value)


def test_a_corner_pushed_inside_is_found_at_its_integration_point() -> None:
    X = shape("CUB8").ref_nodes[None].copy()
    X[0, 6] = -0.6
    assert geometry.measures(shape("CUB8"), X) > 0
    with pytest.raises(InvertedElement):
        geometry.check_cells(shape("CUB8"), X)


def test_flat_cells_are_found_in_spite_of_round_off() -> None:
    corners = np.random.default_rng(6).uniform(-1, 1, (50, 4, 3))
    corners[:, 3] = corners[:, :3].mean(axis=1)
    assert (geometry.measures(shape("TET4"), corners) > 0).any()
    with pytest.raises(InvertedElement) as caught:
        geometry.check_cells(shape("TET4"), corners)
    assert len(caught.value.ids) == 50
    thin = shape("CUB8").ref_nodes[None] * [1.0, 1.0, 1e-6]
    assert geometry.check_cells(shape("CUB8"), thin).min() > 0


def test_a_facet_without_area_has_no_normal() -> None:
    with pytest.raises(InvertedElement):
        geometry.facet_normals(shape("TRI3"), np.array([[[0.0, 0, 0], [1, 1, 1], [2, 2, 2]]]))


def test_unknown_shape() -> None:
    with pytest.raises(BadValue) as caught:
        shape("CUB9")
    assert caught.value.value == "CUB9"
