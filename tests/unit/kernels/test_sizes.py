"""Optimal sizes: invariants of the formulas, transfer to the nodes, growth, bounds and counts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.adapt import orders as orders_of
from gibiane_ops.kernels.adapt import sizes
from gibiane_ops.kernels.adapt.ratios import ratios_by_order, uniform_order_ratios
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue

errors = arrays(np.float64, st.integers(1, 40), elements=st.floats(1e-6, 1.0))


def strip(n):
    """A row of n unit cubes cut in five tetrahedra would not match; six each, along x."""
    axis = np.arange(n + 1.0)
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    points = np.array([[x, y, z] for x in axis for y, z in corners])
    hexa = np.array(
        [[4 * i, 4 * i + 4, 4 * i + 5, 4 * i + 1, 4 * i + 3, 4 * i + 7, 4 * i + 6, 4 * i + 2] for i in range(n)]
    )
    paths = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
    return points, [("TET4", np.vstack([hexa[:, list(path)] for path in paths]))]


@given(errors, st.floats(0.3, 3), st.floats(0.001, 10), st.sampled_from([1, 2, 3]))
def test_uniform_order_meets_the_prescribed_error(error, order, target, dim):
    r = uniform_order_ratios(error**2, target, order, dim)
    assert (r ** (2 * order) * error**2).sum() == pytest.approx(target**2, rel=1e-12)


@settings(max_examples=50)
@given(errors, st.floats(0.001, 10), st.sampled_from([2, 3]), st.integers(0, 1000))
def test_orders_by_element_meet_the_prescribed_error(error, target, dim, seed):
    q = np.random.default_rng(seed).uniform(0.3, 3, len(error))
    r = ratios_by_order(error**2, target, q, dim)
    assert (r ** (2 * q) * error**2).sum() == pytest.approx(target**2, rel=1e-12)


@given(errors, st.floats(0.3, 3), st.floats(0.001, 10))
def test_equal_orders_give_the_uniform_formula(error, order, target):
    together = ratios_by_order(error**2, target, np.full(len(error), order), 3)
    np.testing.assert_allclose(together, uniform_order_ratios(error**2, target, order, 3), rtol=1e-11)


def test_no_other_sizes_meet_the_error_with_fewer_elements():
    rng = np.random.default_rng(0)
    error2, q = rng.uniform(0.1, 1, 30) ** 2, rng.uniform(0.5, 2, 30)
    best = ratios_by_order(error2, 0.3, q, 3)
    for _ in range(100):
        other = best * np.exp(0.1 * rng.normal(size=30))
        low, high = 0.1, 10.0  # scale the disturbed sizes back to the prescribed error
        for _ in range(80):
            middle = np.sqrt(low * high)
            low, high = (middle, high) if (((middle * other) ** (2 * q)) * error2).sum() < 0.09 else (low, middle)
        assert ((low * other) ** -3.0).sum() > (best**-3.0).sum()


def test_an_element_without_error_has_a_size():
    r = uniform_order_ratios(np.array([0.0, 1.0, 1.0]), 0.5, 1.0, 3)
    assert np.isfinite(r).all()
    assert r[0] > r[1]


def test_sizes_of_regular_elements():
    assert sizes.element_sizes(shape("TET4"), np.array([2.0**3 / (6 * np.sqrt(2))]))[0] == pytest.approx(2.0)
    assert sizes.element_sizes(shape("TRI3"), np.array([np.sqrt(3) / 4 * 9]))[0] == pytest.approx(3.0)
    assert sizes.element_sizes(shape("CUB8"), np.array([8.0]))[0] == pytest.approx(2.0)


def test_nodal_sizes_are_geometric_means_or_minima():
    blocks = [("SEG2", np.array([[0, 1], [1, 2]]))]
    mean = sizes.nodal_sizes(4, blocks, np.array([1.0, 4.0]))
    assert mean[:3] == pytest.approx([1.0, 2.0, 4.0])
    assert np.isinf(mean[3])
    assert sizes.nodal_sizes(3, blocks, np.array([1.0, 4.0]), smallest_of_star=True) == pytest.approx([1, 1, 4])
    assert sizes.nodal_sizes(3, blocks, np.array([1.0, 4.0]), pairs=np.array([[0, 2]])) == pytest.approx([2, 2, 2])


def test_growth_is_limited_along_the_mesh():
    points = np.arange(6.0)[:, None]
    edges = np.stack([np.arange(5), np.arange(1, 6)], 1)
    found = sizes.limit_growth(points, edges, np.array([9, 9, 0.5, 9, 9, 1.2]), 1.4)
    assert found == pytest.approx([1.3, 0.9, 0.5, 0.9, 1.3, 1.2])


def test_a_uniform_field_counts_regular_elements():
    points, blocks = strip(3)
    assert sizes.predicted_count(points, blocks, np.full(len(points), 0.5)) == pytest.approx(3 * 8 * 6 * np.sqrt(2))


def test_size_map_keeps_its_promises():
    points, blocks = strip(6)
    cells = blocks[0][1]
    error = np.exp(-points[cells].mean(axis=1)[:, 0])
    free = sizes.size_map(points, blocks, error, 0.1, growth=None)
    assert free.count == pytest.approx(free.optimum, rel=1e-12)
    assert sizes.predicted_count(points, blocks, free.nodal) == pytest.approx(free.count, rel=1e-12)
    capped = sizes.size_map(points, blocks, error, 0.1, growth=None, max_count=50)
    assert capped.count == 50
    np.testing.assert_allclose(capped.nodal / free.nodal, (free.count / 50) ** (1 / 3))
    assert sizes.size_map(points, blocks, error, 0.1, smallest=1e-9).reachable == 0.1
    even = np.full_like(error, error.mean())
    side = sizes.element_sizes(shape(blocks[0][0]), geometry.measures(shape(blocks[0][0]), points[blocks[0][1]]))
    most = sizes.size_map(points, blocks, even, 0.1, smallest=float(side.max())).reachable
    assert most == pytest.approx(np.sqrt((even**2 * (side.max() / side) ** 2).sum()), rel=1e-12)
    bounded = sizes.size_map(points, blocks, error, 0.1, smallest=0.3, largest=0.4)
    assert bounded.nodal.min() == 0.3
    assert bounded.nodal.max() == 0.4
    slow = sizes.size_map(points, blocks, error, 0.1, growth=1.05)
    i, j = np.array([[a, b] for cell in cells for a in cell for b in cell if a < b]).T
    distance = np.linalg.norm(points[i] - points[j], axis=1)
    assert (np.abs(slow.nodal[i] - slow.nodal[j]) <= 0.05 * distance * (1 + 1e-12)).all()
    assert slow.count > free.count


def test_a_prescribed_error_twice_smaller_halves_the_sizes():
    points, blocks = strip(4)
    error = np.linspace(1, 2, len(blocks[0][1]))
    one, two = (sizes.size_map(points, blocks, error, e, growth=None) for e in (0.2, 0.1))
    np.testing.assert_allclose(two.nodal, one.nodal / 2, rtol=1e-12)
    assert two.count == pytest.approx(8 * one.count)


def test_without_error_the_sizes_stay():
    points, blocks = strip(2)
    found = sizes.size_map(points, blocks, np.zeros(12), 0.05)
    assert (found.ratios == 1).all()
    assert found.count == pytest.approx(12)


def test_singular_nodes_lower_the_order_around_them():
    points, blocks = strip(10)
    cells = blocks[0][1]
    near = (cells < 4).any(axis=1)
    error2 = np.where(near, 1.0, 1e-6)  # the first cube carries nearly all the error

    def orders(error2, **more):
        return orders_of.singular_orders(len(points), blocks, error2, np.full(60, 1 / 6), 1.0, **more)

    assert (orders(error2)[near] == 0.5).all()
    assert (orders(error2)[(cells >= 12).all(axis=1)] == 1.0).all()
    for nowhere in (orders(error2, beta=100.0), orders(np.zeros(60)), orders(np.ones(60))):
        assert (nowhere == 1.0).all()


@pytest.mark.parametrize(
    "wrong",
    [{"target": 0.0}, {"order": -1.0}, {"smallest": 2.0, "largest": 1.0}, {"max_count": 0}, {"growth": 0.5}],
)
def test_impossible_requests_are_refused(wrong):
    points, blocks = strip(1)
    with pytest.raises(BadValue):
        sizes.size_map(points, blocks, np.ones(6), **({"target": 0.1} | wrong))


def test_mid_nodes_take_the_mean_of_their_edge():
    # Two TE10 on one face, sizes 1 and 2 times the old ones: mid-nodes lie between the corners, also where sizes grow.
    corners = np.vstack([np.zeros(3), np.eye(3), [1.0, 1.0, 1.0]])
    cells = np.array([[0, 1, 2, 3], [1, 2, 3, 4]])
    ends = np.sort(cells[:, np.array(shape("TET4").edges)], axis=2).reshape(-1, 2)
    unique, middle = np.unique(ends, axis=0, return_inverse=True)
    points = np.vstack([corners, corners[unique].mean(axis=1)])
    quadratic = np.hstack([cells, len(corners) + middle.reshape(2, -1)])
    for growth in (None, 1.2):
        found = sizes.size_map(points, [("TE10", quadratic)], np.array([0.1, 0.3]), 0.2, order=2.0, growth=growth)
        linear = sizes.size_map(corners, [("TET4", cells)], np.array([0.1, 0.3]), 0.2, order=2.0, growth=growth)
        np.testing.assert_allclose(found.nodal[:5], linear.nodal, rtol=1e-12)
        np.testing.assert_allclose(found.nodal[5:], found.nodal[unique].mean(axis=1), rtol=1e-12)
        assert found.count == pytest.approx(linear.count, rel=1e-12)


@pytest.mark.parametrize("exponent", [0.4, 0.5445, 0.75])
def test_the_order_of_a_singularity_is_read_from_the_error_around_it(exponent):
    n = 16
    line = np.linspace(0, 1, n + 1)
    points = np.stack(np.meshgrid(line, line, indexing="ij"), -1).reshape(-1, 2)
    index = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    cells = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], -1).reshape(-1, 4)
    area = np.full(len(cells), 1 / n**2)
    r = np.linalg.norm(points[cells].mean(axis=1), axis=1)
    error2 = area * (1 / n) ** 2 * r ** (2 * (exponent - 2))
    orders, found = orders_of.fitted_orders(points, [("QUA4", cells)], error2, area, 1.0, beta=5.0)
    assert len(found) == 1
    assert found[0] == pytest.approx(exponent, abs=0.05)
    assert orders[0] == found[0]
    assert orders[-1] == 1.0


def test_an_even_error_has_no_singularity():
    points = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    cells = np.array([[0, 1, 2], [0, 2, 3]])
    orders, found = orders_of.fitted_orders(points, [("TRI3", cells)], np.full(2, 0.1), np.full(2, 0.5), 1.0)
    assert found == []
    assert (orders == 1.0).all()


def test_equal_errors_are_equal_and_take_more_elements_where_orders_differ():
    rng = np.random.default_rng(4)
    error2 = rng.uniform(0.1, 1, 40)
    orders = np.where(np.arange(40) < 8, 0.5, 1.0)
    fewest = ratios_by_order(error2, 0.5, orders, 2)
    equal = ratios_by_order(error2, 0.5, orders, 2, equal=True)
    for ratios in (fewest, equal):
        assert (ratios ** (2 * orders) * error2).sum() == pytest.approx(0.25, rel=1e-12)
    each = equal ** (2 * orders + 2) * error2  # error of a new element: r^d of them share what an old one keeps
    assert np.ptp(each) <= 1e-12 * each.max()
    assert (equal**-2.0).sum() > (fewest**-2.0).sum()
    same = np.full(40, 1.0)
    assert np.allclose(ratios_by_order(error2, 0.5, same, 2, equal=True), ratios_by_order(error2, 0.5, same, 2))
