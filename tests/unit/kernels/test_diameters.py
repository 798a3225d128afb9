"""Smallest lengths of cells known by hand."""

import numpy as np
import pytest

from gibiane_ops.kernels.adapt.diameters import smallest_lengths
from gibiane_ops.kernels.elements.table import shape


def test_a_box_has_its_shortest_edge():
    of = shape("CUB8")
    X = ((of.ref_nodes + 1) / 2 * np.array([3.0, 0.5, 2.0]))[None]
    assert smallest_lengths(of, X)[0] == pytest.approx(0.5)


def test_a_flat_tetrahedron_has_its_height():
    of = shape("TET4")
    X = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 0.1]]])
    assert smallest_lengths(of, X)[0] == pytest.approx(0.1)


def test_a_right_triangle_has_its_height_over_the_hypotenuse():
    of = shape("TRI3")
    X = np.array([[[0.0, 0], [3, 0], [0, 4]], [[0.0, 0], [1, 0], [0, 1]]])
    np.testing.assert_allclose(smallest_lengths(of, X), [12 / 5, np.sqrt(0.5)])


def test_a_slanted_quadrangle():
    of = shape("QUA4")
    X = np.array([[[0.0, 0], [1, 0], [2, 1], [1, 1]]])
    # the short diagonal has length 1, the slanted sides are sqrt(1/2) apart
    assert smallest_lengths(of, X)[0] == pytest.approx(np.sqrt(0.5))
