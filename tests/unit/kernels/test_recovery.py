"""Exactness of the smoothings on constant and linear stresses, and independence of the numbering."""

import numpy as np
import pytest

from gibiane_ops.kernels import geometry, recovery
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.recovery import StressBlock


def brick(n):
    """n^3 CUB8 on [0, 1]^3, the inner nodes moved at random, and the corners of each."""
    axis = np.linspace(0, 1, n + 1)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], 1)
    inside = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    points[inside] += np.random.default_rng(4).uniform(-0.15, 0.15, (inside.sum(), 3)) / n
    k, j, i = np.meshgrid(np.arange(n), np.arange(n), np.arange(n), indexing="ij")
    s = n + 1
    a = ((k * s + j) * s + i).ravel()
    return points, np.stack([a, a + 1, a + 1 + s, a + s, a + s * s, a + 1 + s * s, a + 1 + s + s * s, a + s + s * s], 1)


def kuhn(n):
    """The same nodes with six TET4 to the brick."""
    points, hexes = brick(n)
    paths = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
    return points, np.vstack([hexes[:, list(path)] for path in paths])


def block(name, points, cells, field, centre=False):
    """Sample a field at the stress points of the cells, or give each cell its value at the centre."""
    each = shape(name)
    X = points[cells]
    if centre:
        at = np.repeat(geometry.centroids(each, X)[:, None], len(each.gauss[1]), axis=1)
    else:
        at = geometry.positions(each, X, each.gauss[0])
    return StressBlock(each, cells, field(at))


SLOPE = np.random.default_rng(1).normal(size=(6, 3))
VALUE = np.random.default_rng(2).normal(size=6)


def linear(x):
    return VALUE + x @ SLOPE.T


def constant(x):
    return np.broadcast_to(VALUE, (*x.shape[:-1], 6))


@pytest.mark.parametrize("method", recovery.METHODS)
@pytest.mark.parametrize(("name", "mesh"), [("CUB8", brick), ("TET4", kuhn)])
def test_constant_stress_is_reproduced(name, mesh, method):
    points, cells = mesh(3)
    nodal = recovery.recover(points, [block(name, points, cells, constant)], method).nodal
    np.testing.assert_allclose(nodal, np.tile(VALUE, (len(points), 1)), rtol=0, atol=1e-11)


@pytest.mark.parametrize("method", ["MOYE", "PROJ", "SPR", "FULL"])
def test_linear_stress_is_reproduced_on_bricks(method):
    points, cells = brick(4)
    centre = method in ("SPR", "FULL")
    found = recovery.recover(points, [block("CUB8", points, cells, linear, centre=centre)], method)
    np.testing.assert_allclose(found.nodal, linear(points), rtol=0, atol=1e-10)
    assert found.fallbacks == 0


def test_full_patches_reproduce_products_of_coordinates():
    points, cells = brick(4)

    def multilinear(x):
        xyz = x[..., 0] * x[..., 1] * x[..., 2]
        return (
            linear(x)
            + np.stack([x[..., 0] * x[..., 1], x[..., 1] * x[..., 2], x[..., 0] * x[..., 2]] * 2, -1)
            + (xyz[..., None] * VALUE)
        )

    sampled = block("CUB8", points, cells, multilinear, centre=True)
    found = recovery.patch_recovery(points, [sampled], full=True)
    np.testing.assert_allclose(found.nodal, multilinear(points), rtol=0, atol=1e-10)
    assert found.flattened == 0
    assert np.abs(recovery.patch_recovery(points, [sampled]).nodal - multilinear(points)).max() > 0.1


def test_full_patches_of_three_quadrangles_are_linear():
    turn = np.arange(6) * np.pi / 3
    points = np.vstack([[0.0, 0.0], np.stack([np.cos(turn), np.sin(turn)], 1)])
    cells = np.array([[0, 1, 2, 3], [0, 3, 4, 5], [0, 5, 6, 1]])
    quad = shape("QUA4")

    def field(x):
        return np.stack([1 + x[..., 0], x[..., 1], 2 * x[..., 0] - x[..., 1], 0 * x[..., 0]], -1)

    at = np.repeat(geometry.centroids(quad, points[cells])[:, None], len(quad.gauss[1]), axis=1)
    found = recovery.patch_recovery(points, [StressBlock(quad, cells, field(at))], full=True)
    np.testing.assert_allclose(found.nodal, field(points), rtol=0, atol=1e-12)
    assert found.flattened == 1


@pytest.mark.parametrize("n", [2, 3])
def test_patches_reproduce_linear_stress_on_tetrahedra_to_the_corners(n):
    # With n = 2 a single inner node serves all 26 nodes of the surface, some of them through the second ring.
    points, cells = kuhn(n)
    found = recovery.patch_recovery(points, [block("TET4", points, cells, linear)])
    np.testing.assert_allclose(found.nodal, linear(points), rtol=0, atol=1e-10)


def test_piece_without_inner_node_falls_back_on_its_own_elements():
    points, cells = kuhn(1)
    found = recovery.patch_recovery(points, [block("TET4", points, cells, linear)])
    assert np.isfinite(found.nodal).all()
    assert found.fallbacks > 0


def test_projection_is_nearest_in_the_mean():
    points, cells = kuhn(3)
    rough = block("TET4", points, cells, lambda x: np.sin(7 * x @ SLOPE.T))
    X = points[cells]
    tet = shape("TET4")
    xi, weights = tet.mass_gauss
    density = geometry.measure_densities(tet, X, xi) * weights

    def distance(method):
        nodal = recovery.recover(points, [rough], method).nodal
        difference = np.matmul(tet.N(xi), nodal[cells]) - rough.stress
        return (density * (difference**2).sum(axis=2)).sum()

    best = distance("PROJ")
    assert all(distance(method) > best for method in ("MOYE", "LUMP", "SPR"))


@pytest.mark.parametrize("method", recovery.METHODS)
def test_numbering_does_not_matter(method):
    points, cells = kuhn(3)
    rng = np.random.default_rng(3)
    sampled = block("TET4", points, cells, lambda x: np.sin(7 * x @ SLOPE.T))
    nodal = recovery.recover(points, [sampled], method).nodal
    new = rng.permutation(len(points))
    order = rng.permutation(len(cells))
    moved = np.empty_like(points)
    moved[new] = points
    other = recovery.recover(moved, [StressBlock(sampled.shape, new[cells][order], sampled.stress[order])], method)
    np.testing.assert_allclose(other.nodal[new], nodal, rtol=0, atol=1e-11)


def test_points_outside_the_solid_stay_zero():
    points, cells = kuhn(2)
    points = np.vstack([points, [[5.0, 5.0, 5.0]]])
    for method in recovery.METHODS:
        assert not recovery.recover(points, [block("TET4", points, cells, constant)], method).nodal[-1].any()


def test_unknown_method_is_refused():
    points, cells = kuhn(1)
    with pytest.raises(BadValue, match="MOYE"):
        recovery.recover(points, [block("TET4", points, cells, constant)], "MEAN")
