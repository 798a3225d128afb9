"""Which element holds a point, and interpolation there."""

import numpy as np
import pytest

from gibiane_ops.kernels.elements.table import SHAPES, shape
from gibiane_ops.kernels.mesh.hosts import find_hosts, hosted, interpolated


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


@pytest.mark.parametrize("name", [n for n in SHAPES if shape(n).dim >= 1])
def test_points_outside_get_the_nearest_place(name):
    of = shape(name)
    blocks = [(name, np.arange(of.n_nodes)[None])]
    random = np.random.default_rng(1)
    centre = of.ref_nodes[: of.n_corners].mean(axis=0)
    points = centre + 8 * random.uniform(-1, 1, (200, of.dim))
    hosts = find_hosts(points, of.ref_nodes, blocks, nearest=True)
    assert (hosts.cell == 0).all()
    image = interpolated(hosts, blocks, [of.ref_nodes[None]])
    assert (hosted(image, of.ref_nodes, blocks, 1e-9)[0] == np.arange(200)).all()
    lost = ~np.isfinite(hosts.out)
    np.testing.assert_allclose(image[~lost], points[~lost], atol=1e-9)
    # No corner of the element is nearer.
    gap = np.linalg.norm(image - points, axis=1)
    corner = np.linalg.norm(points[:, None] - of.ref_nodes[None, : of.n_corners], axis=2).min(axis=1)
    assert (gap <= 1.45 * corner + 1e-12).all()


def test_many_points_in_a_graded_mesh_are_all_found():
    x = np.concatenate([[0.0], np.cumsum(1.5 ** np.arange(12))])
    coords = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
    ids = np.arange(169).reshape(13, 13)
    quads = np.stack([ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]], axis=-1).reshape(-1, 4)
    blocks = [("QUA4", quads[::2]), ("TRI3", np.concatenate([quads[1::2][:, :3], quads[1::2][:, [0, 2, 3]]]))]
    points = np.random.default_rng(2).uniform(0, x[-1], (500, 2))
    hosts = find_hosts(points, coords, blocks)
    assert (hosts.cell >= 0).all()
    np.testing.assert_allclose(interpolated(hosts, blocks, [coords[c] for _, c in blocks]), points, atol=1e-9)


def test_a_curved_side_reaches_beyond_its_nodes():
    """The lowest point of a parabola between nodes at 0, -0.2 and -0.19 is below them all."""
    coords = np.array([[-1.0, 0], [1, -0.19], [1, 1], [-1, 1], [0, -0.2], [1, 0.4], [0, 1], [-1, 0.5]])
    xi = np.array([[0.45, -0.999]])
    point = shape("QUA8").N(xi) @ coords
    assert point[0, 1] < coords[:, 1].min() - 0.01
    hosts = find_hosts(point, coords, [("QUA8", np.arange(8)[None])])
    assert hosts.cell.tolist() == [0]
    assert hosts.xi[0, :2] == pytest.approx(xi[0], abs=1e-8)
