"""Metrics: what they ask of known fields, their growth and intersection, meshes made to them."""

import numpy as np
import pytest

from gibiane_ops.kernels.adapt import metric
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.geometry import measures
from gibiane_ops.kernels.remesh import remesh

CUT = {
    2: [[0, 1, 2], [0, 2, 3]],
    3: [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]],
}
NAME = {2: "TRI3", 3: "TET4"}
LAYER = 0.03


def grid(n, dim):
    line = np.linspace(0, 1, n + 1)
    points = np.stack(np.meshgrid(*[line] * dim, indexing="ij"), -1).reshape(-1, dim)
    index = np.arange((n + 1) ** dim).reshape((n + 1,) * dim)
    offsets = np.round((shape({2: "QUA4", 3: "CUB8"}[dim]).ref_nodes + 1) / 2).astype(int)
    cells = np.stack([index[tuple(slice(o, n + o) for o in offset)] for offset in offsets], -1).reshape(-1, 2**dim)
    return points, cells[:, CUT[dim]].reshape(-1, dim + 1)


def layer(points):
    return np.exp(-points[:, :1] / LAYER)


def interpolation_error(points, cells):
    """Integrate the squared distance of the layer to its interpolation."""
    of = shape(NAME[points.shape[1]])
    xi, weights = shape({2: "TRI6", 3: "TE10"}[of.dim]).mass_gauss
    at = np.einsum("qn,mnd->mqd", of.N(xi), points[cells])
    values = np.einsum("qn,mn->mq", of.N(xi), layer(points)[cells][..., 0])
    share = np.abs(measures(of, points[cells]))[:, None] * weights / weights.sum()
    return float(np.sqrt((share * (layer(at.reshape(-1, of.dim)).reshape(values.shape) - values) ** 2).sum()))


@pytest.mark.parametrize("dim", [2, 3])
def test_the_second_derivatives_of_a_parabola_are_exact(dim):
    points, cells = grid(5, dim)
    H = np.array([[2.0, 0.5, 0.0], [0.5, -1.0, 0.3], [0.0, 0.3, 4.0]])[:dim, :dim]
    values = 0.5 * np.einsum("ni,ij,nj->n", points, H, points)[:, None]
    found = metric.hessians(points, [(NAME[dim], cells)], values)
    inside = ((points > 0.25) & (points < 0.75)).all(axis=1)
    assert found[inside, 0] == pytest.approx(np.broadcast_to(H, (int(inside.sum()), dim, dim)), abs=1e-10)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_uniform_bend_gives_one_metric_of_the_wanted_number_of_elements(dim):
    points, cells = grid(4, dim)
    H = np.diag([100.0, 1.0, 1.0][:dim])
    M = metric.metric_map(points, [(NAME[dim], cells)], np.broadcast_to(H, (len(points), 1, dim, dim)), 1000.0)
    assert metric.metric_count(points, [(NAME[dim], cells)], M) == pytest.approx(1000.0, rel=0.01)
    sizes = np.diagonal(M, axis1=1, axis2=2) ** -0.5
    assert sizes[:, 1] / sizes[:, 0] == pytest.approx(np.full(len(points), 10.0))
    limited = metric.metric_map(
        points, [(NAME[dim], cells)], np.broadcast_to(H, (len(points), 1, dim, dim)), 1000.0, stretch=3.0
    )
    sizes = np.diagonal(limited, axis1=1, axis2=2) ** -0.5
    assert sizes[:, 1] / sizes[:, 0] == pytest.approx(np.full(len(points), 3.0))


def test_the_metric_turns_with_the_field():
    points, cells = grid(4, 2)
    c, s = np.cos(0.4), np.sin(0.4)
    Q = np.array([[c, -s], [s, c]])
    H = np.broadcast_to(np.diag([50.0, 2.0]), (len(points), 1, 2, 2))
    one = metric.metric_map(points, [("TRI3", cells)], H, 500.0, growth=None)
    two = metric.metric_map(points @ Q.T, [("TRI3", cells)], Q @ H @ Q.T, 500.0, growth=None)
    assert two == pytest.approx(Q @ one @ Q.T, rel=1e-6)


def test_bounds_hold_and_growth_only_shortens():
    points, cells = grid(8, 2)
    H = metric.hessians(points, [("TRI3", cells)], layer(points))
    M = metric.metric_map(points, [("TRI3", cells)], H, 500.0, smallest=0.02, largest=0.3, growth=None)
    sizes = np.linalg.eigvalsh(M) ** -0.5
    assert sizes.min() >= 0.02 * (1 - 1e-9)
    assert sizes.max() <= 0.3 * (1 + 1e-9)
    edges = np.stack([cells[:, :2], cells[:, 1:]], 1).reshape(-1, 2)
    grown = metric.limit_metric_growth(points, edges, M, 1.3)
    assert (np.linalg.eigvalsh(grown - M) >= -1e-6 * M.max()).all()
    assert (grown != M).any()


def test_the_intersection_is_above_both_and_touches_them():
    rng = np.random.default_rng(0)
    A, B = (each @ each.swapaxes(1, 2) + 0.1 * np.eye(3) for each in rng.normal(size=(2, 20, 3, 3)))
    both = metric.intersection(A, B)
    for each in (A, B):
        assert np.linalg.eigvalsh(both - each).min() >= -1e-9
    assert np.linalg.det(both) == pytest.approx(np.linalg.det(metric.intersection(B, A)))
    assert metric.intersection(A, 0.5 * A) == pytest.approx(A)


@pytest.mark.parametrize("bad", [{"count": 0.0}, {"stretch": 0.5}, {"growth": 1.0}, {"smallest": 2.0, "largest": 1.0}])
def test_impossible_wishes_are_refused(bad):
    points, cells = grid(3, 2)
    wish = {"count": 100.0} | bad
    with pytest.raises(BadValue):
        metric.metric_map(points, [("TRI3", cells)], np.ones((len(points), 1, 2, 2)), **wish)
    with pytest.raises(BadValue):
        metric.metric_map(points, [("TRI3", cells)], np.zeros((len(points), 1, 2, 2)), 100.0)


def adapted(count, stretch):
    points, cells = grid(16, 2)
    blocks = [("TRI3", cells)]
    H = metric.hessians(points, blocks, layer(points))
    new = remesh(points, cells, metric.metric_map(points, blocks, H, count, smallest=0.002, stretch=stretch))
    return new.points, new.cells


def test_a_layer_costs_less_with_long_elements_in_the_plane():
    long_points, long_cells = adapted(300, 50.0)
    points, cells = adapted(300, 1.0)
    assert abs(len(long_points) / len(points) - 1) < 0.2
    assert measures(shape("TRI3"), long_points[long_cells]).sum() == pytest.approx(1.0)
    assert interpolation_error(long_points, long_cells) < 0.1 * interpolation_error(points, cells)
