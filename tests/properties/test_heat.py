"""Properties of conduction matrices that hold on every shape."""

import numpy as np
import pytest

from gibiane_ops.kernels import geometry, heat
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import SHAPES
from gibiane_ops.kernels.errors import InvertedElement

SOLIDS = [each for each in SHAPES.values() if each.dim >= 2]


def bent(each: Shape, seed: int = 3) -> np.ndarray:
    """Return a few elements out of shape; those of second degree keep their mid-nodes in the middle."""
    X = np.repeat(each.ref_nodes[None], 4, axis=0)
    corners = each.n_corners
    X[:, :corners] += 0.08 * np.random.default_rng(seed).uniform(-1, 1, X[:, :corners].shape)
    if each.degree == 2:
        for a, b, middle in each.edges:
            X[:, middle] = (X[:, a] + X[:, b]) / 2
    return X


@pytest.mark.parametrize("each", SOLIDS, ids=lambda each: each.name)
def test_energy_of_a_linear_temperature_and_constants(each: Shape) -> None:
    X, k = bent(each), np.array([1.0, 2.0, 3.0, 4.0])
    K = heat.element_conduction(each, X, k)
    assert np.allclose(K, K.transpose(0, 2, 1), atol=1e-13)
    assert np.abs(K.sum(axis=2)).max() < 1e-12
    slope = np.array([1.3, -0.7, 0.4])[: each.dim]
    T = X @ slope
    energy = np.einsum("ma,mab,mb->m", T, K, T)
    assert energy == pytest.approx(k * (slope @ slope) * geometry.measures(each, X))
    values = np.linalg.eigvalsh(K)
    assert (values[:, 1] > 1e-6 * values[:, -1]).all()


@pytest.mark.parametrize("each", [s for s in SOLIDS if s.dim == 2], ids=lambda each: each.name)
def test_radial_flow_round_the_axis(each: Shape) -> None:
    """Of T = z the energy is the conductivity times the volume of the ring."""
    X = bent(each) + [5.0, 0.0]
    K = heat.element_conduction(each, X, 2.0, axisymmetric=True)
    T = X[:, :, 1]
    ones = np.ones(X.shape[:2])
    volume = heat.scalar_load(each, X, ones, axisymmetric=True).sum(axis=1)
    assert np.einsum("ma,mab,mb->m", T, K, T) == pytest.approx(2.0 * volume, rel=1e-12)


def test_inverted_elements_are_refused() -> None:
    each = SHAPES["QUA4"]
    with pytest.raises(InvertedElement):
        heat.element_conduction(each, each.ref_nodes[None, ::-1], 1.0)
