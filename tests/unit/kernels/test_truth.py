"""Error against an exact stress: singular fields integrated in every shape of first and second degree."""

import numpy as np
import pytest
from scipy.integrate import quad

from gibiane_ops.kernels.elements.quadratic import LINEAR
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.truth import exact_error
from gibiane_ops.kernels.estimate.zz import true_error
from gibiane_ops.kernels.mesh.simplices import tetrahedra
from gibiane_ops.kernels.recovery import StressBlock

# int over the unit square of r^-0.9, and over the unit cube with r the distance to an edge: the same.
SINGULAR = 2 / 1.1 * quad(lambda t: np.cos(t) ** -1.1, 0, np.pi / 4)[0]


def unit(name):
    """The unit square or cube as cells of a shape, one corner or edge at the origin; uniform edges keep maps affine."""
    of = shape(name)
    box = shape("QUA4" if of.dim == 2 else "CUB8")
    corners = (box.ref_nodes + 1) / 2
    first = LINEAR.get(name, name)
    if first == box.name:
        cells = np.arange(len(corners))[None]
    elif first == "TRI3":
        cells = np.array([[0, 1, 2], [0, 2, 3]])
    elif first == "TET4":
        cells = tetrahedra("CUB8", np.arange(8)[None])[0]
    else:
        cells = np.array([[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]])
    X = corners[cells]
    X = np.matmul(shape(first).N(of.ref_nodes), X)
    return of, X.reshape(-1, of.dim), np.arange(X.shape[0] * X.shape[1]).reshape(X.shape[:2])


@pytest.mark.parametrize("name", ["TRI3", "QUA4", "TET4", "PRI6", "CUB8", "TRI6", "QUA8", "TE10", "PR15", "CU20"])
def test_singular_stress(name):
    of, points, cells = unit(name)
    c = 4 if of.dim == 2 else 6
    block = StressBlock(of, cells, np.zeros((len(cells), len(of.stiffness_rule.weights), c)))
    asked = []

    def exact(x):
        asked.append(len(x))
        s = np.zeros((len(x), c))
        s[:, 1] = np.hypot(x[:, 0], x[:, 1]) ** -0.45
        return s

    found = exact_error(points, block, exact, np.eye(c))
    assert found.error.sum() == pytest.approx(SINGULAR, rel=2e-3)
    assert found.sum_energy.sum() == pytest.approx(SINGULAR, rel=2e-3)
    assert found.energy.sum() == 0
    assert sum(asked) < 200_000


@pytest.mark.parametrize("name", ["TRI3", "QUA4", "TET4", "PRI6", "CUB8", "QUA8", "CU20", "PYR5"])
def test_linear_stress_as_by_the_rule(name):
    if name == "PYR5":
        of = shape(name)
        points, cells = of.ref_nodes.copy(), np.arange(5)[None]
    else:
        of, points, cells = unit(name)
    c = 4 if of.dim == 2 else 6
    rng = np.random.default_rng(0)
    block = StressBlock(of, cells, rng.normal(size=(len(cells), 1, c)).repeat(len(of.stiffness_rule.weights), axis=1))
    slope = rng.normal(size=(of.dim, c))
    law = np.diag(np.arange(1.0, c + 1))
    found = exact_error(points, block, lambda x: x @ slope, law)
    at = np.matmul(of.N(of.mass_rule.points), points[cells]) @ slope
    known = true_error(points, block, at, of.mass_rule, law)
    for column in ("error", "energy", "sum_energy"):
        assert getattr(found, column) == pytest.approx(getattr(known, column), rel=1e-12)


def test_round_an_axis():
    of, points, cells = unit("QUA4")
    block = StressBlock(of, cells, np.zeros((1, 4, 4)))
    found = exact_error(points, block, lambda x: np.ones((len(x), 4)), np.eye(4), axisymmetric=True)
    assert found.error.sum() == pytest.approx(4 * np.pi, rel=1e-12)
