"""Explicit residuals and effectivity against values computed by hand."""

import numpy as np
import pytest
from boxes import mesh

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import stress_tensor, traction
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.effectivity import effectivity
from gibiane_ops.kernels.estimate.residual import residuals
from gibiane_ops.kernels.recovery import StressBlock
from gibiane_ops.kernels.topology import boundary

CUB8 = shape("CUB8")
POINTS = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0, 2.0)])
CELLS = np.array([[i, i + 1, i + 4, i + 3, i + 6, i + 7, i + 10, i + 9] for i in (0, 1)])


def found(stress, body=(0.0, 0.0, 0.0), held=False, young=(1.0, 1.0), traction=0.0):
    block = StressBlock(CUB8, CELLS, stress)
    facets = boundary([("CUB8", CELLS)])["QUA4"].nodes
    free = np.tile(np.eye(3) * held, (len(facets), 1, 1))
    given = np.full((len(facets), 4, 3), traction)
    return residuals(POINTS, [block], [np.array(young)], np.array(body), {"QUA4": given}, {"QUA4": free})


def test_jump_between_two_cubes():
    # sigma_xx = 1 and 3: a jump of 2 over a unit square of diagonal sqrt(2), half to each side; E is the mean.
    stress = np.zeros((2, 8, 6))
    stress[0, :, 0], stress[1, :, 0] = 1.0, 3.0
    part = found(stress, held=True, young=(1.0, 3.0))
    assert part.jumps[0] == pytest.approx([np.sqrt(2) * 4 / 2 / 2 / 24] * 2, rel=1e-13)
    assert part.interior[0] == pytest.approx([0, 0], abs=1e-14)
    assert part.boundary[0] == pytest.approx([0, 0], abs=1e-14)


def test_unbalanced_load_inside_and_on_the_boundary():
    # A body force of 2 on cubes of diagonal sqrt(3); tractions of 1 forgotten on five faces of each cube.
    part = found(np.zeros((2, 8, 6)), body=(0.0, 0.0, 2.0), traction=1.0)
    assert part.interior[0] == pytest.approx([3 * 4 / 24] * 2, rel=1e-13)
    assert part.boundary[0] == pytest.approx([np.sqrt(2) * 3 * 5 / 24] * 2, rel=1e-13)
    assert part.total[0] == pytest.approx(part.interior[0] + part.boundary[0], rel=1e-15)


def test_linear_stress_in_balance_with_a_body_force():
    # sigma_xx = x is balanced by f = (-1, 0, 0), without any jump.
    stress = np.zeros((2, 8, 6))
    stress[..., 0] = (CUB8.N(CUB8.gauss[0]) @ POINTS[CELLS])[..., 0]
    part = found(stress, body=(-1.0, 0.0, 0.0), held=True)
    assert max(each[0].max() for each in (part.interior, part.jumps, part.boundary)) < 1e-28


def test_effectivity_by_hand():
    # Local ratios 1 and 3: mean 2, deviations of a half; global sqrt((1 + 36) / (1 + 4)).
    quality = effectivity(np.array([1.0, 36.0]), np.array([1.0, 4.0]))
    assert quality.theta == pytest.approx(np.sqrt(37 / 5), rel=1e-14)
    assert quality.deviation == pytest.approx(0.5, rel=1e-14)
    assert np.isnan(effectivity(np.ones(2), np.zeros(2)).theta)


def sampled(name, points, cells, stress):
    of = shape(name)
    return StressBlock(of, cells, stress(geometry.positions(of, points[cells], of.gauss[0])))


def on_boundary(blocks, points, stress):
    """Tractions of a stress at the nodes of straight boundary facets."""
    given = {}
    for name, facets in boundary([(block.shape.name, block.cells) for block in blocks]).items():
        X = points[facets.nodes]
        given[name] = traction(stress(X), geometry.facet_normals(shape(name), X)[:, None])
    return given


def largest(points, blocks, body, given, **how):
    free = {name: np.zeros((len(t), *2 * points.shape[1:])) for name, t in given.items()}
    part = residuals(points, blocks, [np.ones(len(b.cells)) for b in blocks], body, given, free, **how)
    return max(each.max() for some in (part.interior, part.jumps, part.boundary) for each in some)


SPACE = ("TET4", "PRI6", "PYR5", "CUB8", "TE10", "PR15", "PY13", "CU20")
PLANE = ("TRI3", "QUA4", "TRI6", "QUA8")


@pytest.mark.parametrize("name", PLANE + SPACE)
def test_stress_in_balance_has_no_residual(name):
    d = shape(name).dim
    points, cells = mesh(name, *(2,) * d)
    c = {2: 4, 3: 6}[d]
    value, slope = np.random.default_rng(1).normal(size=c), np.random.default_rng(2).normal(size=(c, d))
    # what one point of a linear simplex cannot carry is left out: a pyramid's points lie near its faces
    slope *= name not in ("TRI3", "TET4", "PRI6", "PYR5")

    def stress(x):
        return value + x @ slope.T

    body = -sum(stress_tensor(slope[:, k])[:d, k] for k in range(d))
    blocks = [sampled(name, points, cells, stress)]
    given = on_boundary(blocks, points, stress)
    assert largest(points, blocks, body, given) < 1e-24
    # each of the three parts sees what is wrong
    assert largest(points, blocks, body + 9, given) > 1e-3
    assert largest(points, blocks, body, {each: t + 1 for each, t in given.items()}) > 1e-3


@pytest.mark.parametrize("name", ["QUA4", "TRI6", "QUA8"])
def test_stress_in_balance_round_an_axis(name):
    points, cells = mesh(name, 3, 2)
    points = points + [0.5, 0.0]

    def stress(x):
        r, z = x[..., 0], x[..., 1]
        return np.stack([1 + 2 * r + 3 * z, 4 - r + 5 * z, 1 - 6 * r + 3 * z, 7 * r], axis=-1)

    # div: 2 + (2 + 6), and 7 + 5 + 7 r / r
    blocks = [sampled(name, points, cells, stress)]
    given = on_boundary(blocks, points, stress)
    assert largest(points, blocks, np.array([-10.0, -19.0]), given, axisymmetric=True) < 1e-24
    assert largest(points, blocks, np.array([-2.0, -12.0]), given, axisymmetric=True) > 0.1
    assert largest(points, blocks, np.array([-2.0, -12.0]), given) < 1e-24


@pytest.mark.parametrize(("kinds", "degree"), [(("QUA4", "QUA4"), 1), (("QUA4", "QUA8"), 2), (("QUA8", "QUA8"), 2)])
@pytest.mark.parametrize("axis", [False, True])
def test_jump_across_a_side(kinds, degree, axis):
    # Two squares of side 2; sigma_xx is y - 1 on the right, 0 on the left: int (y - 1)^2 = 2 / 3, times 2 pi 3.
    corners = np.array([[1.0, 0], [3, 0], [3, 2], [1, 2], [5, 0], [5, 2]])
    middles = np.array([[2.0, 0], [3, 1], [2, 2], [1, 1], [4, 0], [5, 1], [4, 2]])
    points = np.vstack([corners, middles])
    # the right one starts at its upper corner: the order along the side differs
    cells = {"QUA4": ([0, 1, 2, 3], [5, 2, 1, 4]), "QUA8": ([0, 1, 2, 3, 6, 7, 8, 9], [5, 2, 1, 4, 12, 7, 10, 11])}
    blocks = []
    for i, name in enumerate(kinds):
        block = sampled(
            name, points, np.array([cells[name][i]]), lambda x: np.stack([x[..., 1] - 1] + [0 * x[..., 1]] * 3, axis=-1)
        )
        blocks.append(StressBlock(block.shape, block.cells, i * block.stress))
    if kinds[0] == kinds[1]:
        cells, values = (np.concatenate(each) for each in zip(*[(b.cells, b.stress) for b in blocks], strict=True))
        blocks = [StressBlock(blocks[0].shape, cells, values)]
    edge = boundary([(block.shape.name, block.cells) for block in blocks])
    given = {name: np.zeros((*f.nodes.shape, 2)) for name, f in edge.items()}
    free = {name: np.tile(np.eye(2), (len(f.nodes), 1, 1)) for name, f in edge.items()}
    young = [np.ones(len(b.cells)) for b in blocks]
    part = residuals(points, blocks, young, np.zeros(2), given, free, axisymmetric=axis)
    wanted = 2 / degree / 24 * (2 / 3) / 2 * (6 * np.pi if axis else 1)
    assert np.concatenate(part.jumps) == pytest.approx([wanted] * 2, rel=1e-13)
    assert np.concatenate(part.boundary) == pytest.approx([0, 0], abs=1e-14)


def test_normals_turn_along_a_bent_side():
    # A pressure of 1 everywhere against none imposed: |sigma n| = 1, so the integral is the length of the sides.
    points = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [0.5, -0.2], [1, 0.5], [0.5, 1], [0, 0.5]])
    block = StressBlock(shape("QUA8"), np.arange(8)[None], np.tile([-1.0, -1, 0, 0], (1, 9, 1)))
    given, free = {"SEG3": np.zeros((4, 3, 2))}, {"SEG3": np.zeros((4, 2, 2))}
    part = residuals(points, [block], [np.ones(1)], np.zeros(2), given, free)
    xi, w = np.polynomial.legendre.leggauss(3)
    # y = -0.2 (1 - s^2) with x = (1 + s) / 2
    length = 3 + np.sqrt(0.25 + (0.4 * xi) ** 2) @ w
    # sides have h = 1 all of them: corners count
    assert part.boundary[0] == pytest.approx([length / 48], rel=1e-13)
