"""Values of elements moved between nodes, centre and integration points; integrals."""

import numpy as np
import pytest

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.elements.table import SHAPES, shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.supports import SUPPORTS, integrals, moved, support_points

FILLED = [name for name, each in SHAPES.items() if each.dim >= 2]


def cell(name):
    """One cell, stretched and turned."""
    of = shape(name)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(of.dim, of.dim)))[0]
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    return of, (of.ref_nodes @ np.diag([2.0, 1.5, 0.7][: of.dim]) @ turn.T + 0.3)[None]


@pytest.mark.parametrize("name", FILLED)
@pytest.mark.parametrize("target", SUPPORTS)
def test_a_linear_field_at_the_nodes_is_the_same_everywhere(name, target):
    of, X = cell(name)
    slope = np.array([1.0, -2.0, 0.5][: of.dim])
    nodal = (X @ slope)[..., None]
    expected = geometry.positions(of, X, support_points(of, target)) @ slope
    np.testing.assert_allclose(moved(of, nodal, "NOEUD", target)[..., 0], expected, atol=1e-12)


@pytest.mark.parametrize("name", FILLED)
@pytest.mark.parametrize("source", ["RIGIDITE", "MASSE"])
def test_a_linear_field_at_the_points_of_a_rule_reaches_every_node(name, source):
    # One point tells a constant only.
    of, X = cell(name)
    here = support_points(of, source)
    slope = np.array([1.0, -2.0, 0.5][: of.dim])
    expected = X @ slope if len(here) > 1 else np.full((1, of.n_nodes), (X.mean(axis=1) @ slope)[0])
    values = (geometry.positions(of, X, here) @ slope)[..., None]
    np.testing.assert_allclose(moved(of, values, source, "NOEUD")[..., 0], expected, atol=1e-12)


@pytest.mark.parametrize("name", ["QUA4", "CUB8", "TRI6", "TE10", "PR15"])
def test_there_and_back_from_the_integration_points(name):
    of = shape(name)
    values = np.random.default_rng(1).normal(size=(1, len(of.gauss[1]), 2))
    at_nodes = moved(of, values, "STRESSES", "NOEUD")
    np.testing.assert_allclose(moved(of, at_nodes, "NOEUD", "RIGIDITE"), values, atol=1e-12)


def test_one_value_goes_anywhere_as_it_is():
    of = shape("TET4")
    assert (moved(of, np.full((3, 1, 1), 7.0), "STRESSES", "NOEUD") == 7.0).all()


def test_an_unknown_support_is_refused():
    with pytest.raises(BadValue):
        support_points(shape("TRI3"), "COINS")


@pytest.mark.parametrize("name", FILLED)
@pytest.mark.parametrize("support", SUPPORTS)
def test_the_integral_of_one_is_the_measure(name, support):
    of, X = cell(name)
    ones = np.ones((1, len(support_points(of, support)), 1))
    np.testing.assert_allclose(integrals(of, X, ones, support)[:, 0], geometry.measures(of, X), rtol=1e-12)


def test_the_integral_of_a_linear_field_on_a_unit_cube():
    of = shape("CUB8")
    X = ((of.ref_nodes + 1) / 2)[None]
    nodal = X[..., 2:]
    assert integrals(of, X, nodal, "NOEUD")[0, 0] == pytest.approx(0.5, rel=1e-14)
    assert integrals(of, X, moved(of, nodal, "NOEUD", "STRESSES"), "STRESSES")[0, 0] == pytest.approx(0.5, rel=1e-14)
