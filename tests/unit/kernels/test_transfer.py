"""Fitting nodal values to a function, element by element."""

import numpy as np
import pytest

from gibiane_ops.kernels.elements.table import SHAPES, shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.transfer import fitted, product_rule

SOLIDS = [name for name in SHAPES if shape(name).dim >= 1]


@pytest.mark.parametrize("name", SOLIDS)
def test_the_rule_has_the_measure_and_the_moments_of_the_shape(name):
    of = shape(name)
    points, weights = product_rule(of, 4)
    assert len(weights) == 4**of.dim
    own, given = of.mass_gauss
    assert weights.sum() == pytest.approx(given.sum(), rel=1e-12)
    np.testing.assert_allclose(weights @ points, given @ own, atol=1e-12)
    np.testing.assert_allclose((points.T * weights) @ points, (own.T * given) @ own, atol=1e-12)


@pytest.mark.parametrize("name", SOLIDS)
def test_a_function_of_the_degree_of_the_element_is_found_again(name):
    of = shape(name)
    random = np.random.default_rng(3)
    X = (of.ref_nodes @ (np.eye(of.dim) + 0.2 * random.uniform(-1, 1, (of.dim, of.dim))))[None]

    def sample(x):
        return np.stack([1 + x.sum(axis=1), (x**of.degree).sum(axis=1)], axis=1)

    np.testing.assert_allclose(fitted(of, X, sample, 4)[0], sample(X[0]), atol=1e-10)


def test_too_few_points_are_refused():
    with pytest.raises(BadValue):
        fitted(shape("CU20"), shape("CU20").ref_nodes[None], lambda x: x[:, :1], 2)
