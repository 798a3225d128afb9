"""Interpolation by straight lines and by splines; functions that are exact where the value is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.functions import FUNCTIONS
from gibiane_ops.kernels.interpolation import crossings, linear, spline

XS = np.array([0.0, 1.0, 3.0, 4.0])
YS = np.array([2.0, -1.0, 5.0, 5.0])


def test_linear_passes_through_its_points_and_keeps_its_ends() -> None:
    assert linear(XS, XS, YS).tolist() == YS.tolist()
    assert linear(np.array([-9.0, 2.0, 9.0]), XS, YS).tolist() == [2.0, 2.0, 5.0]


def test_linear_does_not_mind_the_direction() -> None:
    x = np.linspace(-1, 5, 25)
    assert np.array_equal(linear(x, XS, YS), linear(x, XS[::-1], YS[::-1]))


@given(st.floats(0, 4), st.floats(-3, 3), st.floats(-3, 3))
def test_linear_is_exact_for_a_straight_line(x: float, a: float, b: float) -> None:
    assert linear(np.array([x]), XS, a + b * XS)[0] == pytest.approx(a + b * x, abs=1e-12)


def test_spline_is_exact_for_a_cubic_with_its_end_slopes() -> None:
    def cubic(x: np.ndarray) -> np.ndarray:
        return x**3 - 2 * x + 1

    x = np.linspace(0, 4, 33)
    found = spline(x, XS, cubic(XS), left=-2.0, right=3 * 16.0 - 2)
    assert found == pytest.approx(cubic(x), abs=1e-12)


def test_natural_spline_by_hand() -> None:
    # second derivatives 0, -4.5, 0 at the three points
    assert spline(np.array([1.5]), np.array([0.0, 1, 2]), np.array([0.0, 5, 7]))[0] == pytest.approx(6.28125, abs=1e-14)


def test_abscissae_that_turn_back_are_refused() -> None:
    with pytest.raises(BadValue) as caught:
        linear(np.array([1.0]), np.array([0.0, 2.0, 1.0]), np.zeros(3))
    assert caught.value.value == 1.0
    with pytest.raises(BadValue):
        spline(np.array([1.0]), np.array([0.0, 1.0, 1.0]), np.zeros(3))
    with pytest.raises(BadValue):
        linear(np.array([1.0]), np.zeros(0), np.zeros(0))


def test_crossings_of_a_line_that_turns_back() -> None:
    xs, ys = np.array([0.0, 2.0, 0.0, 1.0]), np.array([0.0, 1.0, 2.0, 3.0])
    assert crossings(1.0, xs, ys).tolist() == [0.5, 1.5, 3.0]
    assert crossings(2.0, xs, ys).tolist() == [1.0]
    assert crossings(5.0, xs, ys).tolist() == []


@pytest.mark.parametrize("name", ["SIN", "COS", "TAN"])
def test_angles_are_degrees(name: str) -> None:
    function, _ = FUNCTIONS[name]
    x = np.array([-37.0, 11.0, 200.5])
    assert function(x) == pytest.approx(getattr(np, name.lower())(np.radians(x)), abs=1e-14)


def test_known_angles_are_exact() -> None:
    assert FUNCTIONS["SIN"][0](np.array([0.0, 30, 180, 390, -90])).tolist() == [0.0, 0.5, 0.0, 0.5, -1.0]
    assert FUNCTIONS["COS"][0](np.array([60.0, 90, 270])).tolist() == [0.5, 0.0, 0.0]


def test_the_domain_of_a_function_is_told() -> None:
    allowed = FUNCTIONS["TAN"][1]
    assert allowed is not None
    assert allowed(np.array([45.0, 90.0, -90.0])).tolist() == [True, False, False]
