"""Explicit residuals and effectivity against values computed by hand."""

import numpy as np
import pytest

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
