"""Smoothings on elements of second degree: exactness on distorted meshes, rotation, thin and mixed meshes."""

import numpy as np
import pytest
from boxes import cut, grid, mesh, with_middles

from gibiane_ops.kernels import geometry, recovery
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.zz import solid_error
from gibiane_ops.kernels.recovery import StressBlock

NAMES = ["TRI6", "QUA8", "TE10", "PR15", "PY13", "CU20"]
RNG = np.random.default_rng(5)
VALUE, SLOPE, CURVATURE = RNG.normal(size=4), RNG.normal(size=(4, 3)), RNG.normal(size=(4, 3, 3))


def counts(name, n):
    return (n,) * shape(name).dim


def quadratic(x):
    dim = x.shape[-1]
    return VALUE + x @ SLOPE[:, :dim].T + np.einsum("...i,cij,...j->...c", x, CURVATURE[:, :dim, :dim], x)


def linear(x):
    return VALUE + x @ SLOPE[:, : x.shape[-1]].T


def block(name, points, cells, field):
    each = shape(name)
    return StressBlock(each, cells, field(geometry.positions(each, points[cells], each.gauss[0])))


@pytest.mark.parametrize("name", NAMES)
def test_patches_reproduce_quadratic_stress_to_the_corners(name):
    points, cells = mesh(name, *counts(name, 3 if name != "PY13" else 2))
    found = recovery.patch_recovery(points, [block(name, points, cells, quadratic)])
    np.testing.assert_allclose(found.nodal, quadratic(points), rtol=0, atol=1e-10)
    assert (found.fallbacks, found.flattened) == (0, 0)


@pytest.mark.parametrize("name", ["TRI6", "TE10"])
def test_patches_are_exact_on_curved_simplices(name):
    points, cells = mesh(name, *counts(name, 3))
    points = points + 0.04 * np.sin(4 * points[:, ::-1])
    found = recovery.patch_recovery(points, [block(name, points, cells, quadratic)])
    np.testing.assert_allclose(found.nodal, quadratic(points), rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", NAMES)
def test_linear_patches_on_request(name):
    points, cells = mesh(name, *counts(name, 3))
    found = recovery.recover(points, [block(name, points, cells, linear)], "SPR", 1)
    np.testing.assert_allclose(found.nodal, linear(points), rtol=0, atol=1e-10)
    bent = recovery.recover(points, [block(name, points, cells, quadratic)], "SPR", 1)
    assert np.abs(bent.nodal - quadratic(points)).max() > 1e-3


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("method", ["MOYE", "PROJ"])
def test_extrapolation_is_exact_for_linear_stress_at_every_node(name, method):
    points, cells = mesh(name, *counts(name, 2))
    nodal = recovery.recover(points, [block(name, points, cells, linear)], method).nodal
    np.testing.assert_allclose(nodal, linear(points), rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("method", recovery.METHODS)
def test_constant_stress_is_reproduced(name, method):
    points, cells = mesh(name, *counts(name, 2))
    constant = block(name, points, cells, lambda x: np.broadcast_to(VALUE, (*x.shape[:-1], 4)))
    nodal = recovery.recover(points, [constant], method).nodal
    np.testing.assert_allclose(nodal, np.tile(VALUE, (len(points), 1)), rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", ["QUA8", "CU20", "PY13"])
def test_extrapolation_is_exact_for_quadratic_stress_on_straight_elements(name):
    # Undistorted cells: a quadratic field is one of the shape's interpolations.
    points, cells = mesh(name, *counts(name, 2), distortion=0.0)
    nodal = recovery.recover(points, [block(name, points, cells, quadratic)], "MOYE").nodal
    np.testing.assert_allclose(nodal, quadratic(points), rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", NAMES)
def test_rotation_commutes_with_the_patches(name):
    # One layer: nothing tells the curvature over the thickness, in the axes of the layer or any others.
    points, cells = mesh(name, *((3,) * (shape(name).dim - 1) + (1,)))
    points = points * np.r_[np.ones(shape(name).dim - 1), 0.05]
    angle = 0.7
    turn = np.eye(shape(name).dim)
    turn[np.ix_([0, -1], [0, -1])] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    sampled = block(name, points, cells, lambda x: np.sin(3 * x @ SLOPE[:, : x.shape[-1]].T))
    still = recovery.patch_recovery(points, [sampled])
    turned = recovery.patch_recovery(points @ turn.T, [sampled])
    np.testing.assert_allclose(turned.nodal, still.nodal, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", [name for name in NAMES if name != "PY13"])  # its cells have inner corners
def test_one_layer_keeps_linear_stress_and_says_what_it_does_not_see(name):
    points, cells = mesh(name, *((3,) * (shape(name).dim - 1) + (1,)))
    found = recovery.patch_recovery(points, [block(name, points, cells, linear)])
    np.testing.assert_allclose(found.nodal, linear(points), rtol=0, atol=1e-9)
    assert found.fallbacks == 0
    assert found.flattened > 0


def test_stretched_meshes_are_fitted_like_others():
    points, cells = mesh("CU20", 2, 2, 2)
    points = points * [1.0, 0.03, 30.0]
    found = recovery.patch_recovery(points, [block("CU20", points, cells, quadratic)])
    exact = quadratic(points)
    np.testing.assert_allclose(found.nodal, exact, rtol=0, atol=1e-10 * np.abs(exact).max())
    assert found.flattened == 0


def test_quadratic_and_linear_elements_together():
    # Lower half QUA8, upper half QUA4, hanging mid-nodes between: a linear stress is exact everywhere.
    corners, boxes = grid(4, 4)
    low = points_below(corners, boxes)
    points, cells = with_middles("QUA4", corners, boxes[low])
    blocks = [block("QUA8", points, cells, linear), block("QUA4", points, boxes[~low], linear)]
    # The samples of QUA4 are centre values of the bilinear interpolation; a linear field is one.
    found = recovery.patch_recovery(points, blocks)
    np.testing.assert_allclose(found.nodal, linear(points), rtol=0, atol=1e-10)
    assert found.fallbacks == 0


def points_below(points, boxes):
    return points[boxes][:, :, 1].mean(axis=1) < 0.5


def test_triangles_and_quadrangles_together():
    corners, boxes = grid(4, 4)
    low = points_below(corners, boxes)
    triangles = cut("TRI3", corners, boxes[low])[1]
    points, quads = with_middles("QUA4", corners, boxes[~low])
    local = np.array(shape("QUA4").edges)
    known = {tuple(sorted(e)): m for e, m in zip(quads[:, local].reshape(-1, 2), quads[:, 4:].ravel(), strict=True)}
    new = []
    rows = []
    for triangle in triangles:
        middles = []
        for a, b in shape("TRI3").edges:
            key = tuple(sorted((triangle[a], triangle[b])))
            if key not in known:
                known[key] = len(points) + len(new)
                new.append(points[list(key)].mean(axis=0))
            middles.append(known[key])
        rows.append([*triangle, *middles])
    points = np.vstack([points, new])
    blocks = [block("QUA8", points, quads, quadratic), block("TRI6", points, np.array(rows), quadratic)]
    found = recovery.patch_recovery(points, blocks)
    np.testing.assert_allclose(found.nodal, quadratic(points), rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", NAMES)
def test_energy_of_the_difference_is_integrated_exactly(name):
    # s* = x^2 on one component and s_h = 0 on straight elements of the unit box: int x^4 = 1/5.
    points, cells = mesh(name, *counts(name, 2), distortion=0.0)
    each = shape(name)
    raw = np.zeros((len(cells), len(each.gauss[1]), 1))
    nodal = points[:, :1] ** 2
    found = solid_error(points, StressBlock(each, cells, raw), nodal, np.eye(1))
    assert found.error.sum() == pytest.approx(0.2, rel=1e-12)
    # s* = 0 and s_h = x: int x^2 = 1/3.
    found = solid_error(points, block(name, points, cells, lambda x: x[..., :1]), 0 * nodal, np.eye(1))
    assert [found.error.sum(), found.energy.sum()] == pytest.approx([1 / 3, 1 / 3], rel=1e-12)


@pytest.mark.parametrize("name", ["TRI3", "QUA4", "TRI6", "QUA8"])
def test_thin_parts_far_from_any_inner_corner(name):
    # a square of side 3 with a fin one element thick and 12 long: nothing inside the fin
    points, boxes = grid(15, 3, distortion=0.0)
    points = points * [15.0, 3.0]
    centre = points[boxes].mean(axis=1)
    low = name in ("TRI3", "QUA4")
    corner = name if low else {"TRI6": "TRI3", "QUA8": "QUA4"}[name]
    points, cells = cut(corner, points, boxes[(centre[:, 0] < 3) | (centre[:, 1] < 1)])
    if not low:
        points, cells = with_middles(corner, points, cells)

    def wave(x):
        return np.stack([np.sin(0.8 * x[..., 0]), np.cos(0.8 * x[..., 0])], axis=-1)

    of = shape(name)
    raw = wave(geometry.positions(of, points[cells], of.gauss[0]))
    if low:
        raw = np.repeat(wave(geometry.centroids(of, points[cells]))[:, None], raw.shape[1], axis=1)
    found = recovery.patch_recovery(points, [StressBlock(of, cells, raw)]).nodal
    used = np.unique(cells)
    # polynomials of the square would go off along the fin, as its length or the square of it: 11 and 51 were seen
    assert np.abs(found - wave(points))[used].max() < 1.2
