"""Which element holds a point, and interpolation there."""

import numpy as np
import pytest

from gibiane_ops.kernels.elements.table import SHAPES, shape
from gibiane_ops.kernels.mesh.hosts import hosted


@pytest.mark.parametrize("name", [n for n in SHAPES if shape(n).dim >= 1])
def test_a_linear_field_is_interpolated_exactly(name):
    of = shape(name)
    random = np.random.default_rng(0)
    stretch = np.eye(of.dim) + 0.2 * random.uniform(-1, 1, (of.dim, of.dim))
    coords = of.ref_nodes @ stretch
    weights = random.dirichlet(np.ones(of.n_corners), 20)
    points = weights @ coords[: of.n_corners]
    inside, found = hosted(points, coords, [(name, np.arange(of.n_nodes)[None])])
    np.testing.assert_array_equal(inside, np.arange(20))
    np.testing.assert_allclose(found @ coords, points, atol=1e-10)
    np.testing.assert_allclose(found.sum(axis=1), 1, atol=1e-12)


def test_points_outside_are_left_out_and_the_tolerance_is_relative():
    coords = 100.0 * np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    points = np.array([[50.0, 50], [100.004, 50], [103.0, 50], [-20.0, -20]])
    block = [("QUA4", np.arange(4)[None])]
    np.testing.assert_array_equal(hosted(points, coords, block, 1e-5)[0], [0])
    np.testing.assert_array_equal(hosted(points, coords, block, 1e-3)[0], [0, 1])
    np.testing.assert_array_equal(hosted(points, coords, block, 0.1)[0], [0, 1, 2])


def test_of_two_elements_the_one_less_overshot_is_taken():
    coords = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1]])
    blocks = [("QUA4", np.array([[0, 1, 2, 3]])), ("TRI3", np.array([[1, 4, 5], [1, 5, 2]]))]
    inside, weights = hosted(np.array([[1.05, 0.2], [0.95, 0.2]]), coords, blocks, 0.2)
    np.testing.assert_array_equal(inside, [0, 1])
    assert weights[[0]].indices.max() == 5
    assert set(weights[[1]].indices) <= {0, 1, 2, 3}
    np.testing.assert_allclose(weights.sum(axis=1), 1)


def test_no_points_and_no_elements():
    inside, weights = hosted(np.zeros((0, 2)), np.zeros((3, 2)), [("TRI3", np.array([[0, 1, 2]]))])
    assert len(inside) == 0
    assert weights.shape == (0, 3)
    assert len(hosted(np.zeros((2, 2)), np.zeros((3, 2)), [])[0]) == 0
