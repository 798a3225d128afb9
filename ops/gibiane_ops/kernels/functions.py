"""Functions of one variable, as the language has them: angles in degrees, exact where the exact value is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def _erf(x: Array) -> Array:
    from scipy.special import erf

    return np.asarray(erf(x))


def _erfc(x: Array) -> Array:
    from scipy.special import erfc

    return np.asarray(erfc(x))


def _degrees(function: Callable[[Array], Array], exact: Mapping[int, float], period: float) -> Callable[[Array], Array]:
    """Return a function of angles in degrees that is exact at the angles listed."""

    def at(x: Array) -> Array:
        result = function(np.radians(x))
        turned = np.mod(x, period)
        for angle, value in exact.items():
            result = np.where(turned == angle, value, result)
        return result

    return at


_SIN = {0: 0.0, 30: 0.5, 90: 1.0, 150: 0.5, 180: 0.0, 210: -0.5, 270: -1.0, 330: -0.5}
_COS = {0: 1.0, 60: 0.5, 90: 0.0, 120: -0.5, 180: -1.0, 240: -0.5, 270: 0.0, 300: 0.5}
# name: the function, and the test that its argument must pass (None: every number is allowed)
FUNCTIONS: dict[str, tuple[Callable[[Array], Array], Callable[[Array], Array] | None]] = {
    "SIN": (_degrees(np.sin, _SIN, 360.0), None),
    "COS": (_degrees(np.cos, _COS, 360.0), None),
    "TAN": (_degrees(np.tan, {0: 0.0, 45: 1.0, 135: -1.0}, 180.0), lambda x: np.mod(x, 180.0) != 90.0),
    "ASIN": (lambda x: np.degrees(np.arcsin(x)), lambda x: np.abs(x) <= 1),
    "ACOS": (lambda x: np.degrees(np.arccos(x)), lambda x: np.abs(x) <= 1),
    "EXP": (np.exp, lambda x: x < 709.78),
    "LOG": (np.log, lambda x: x > 0),
    "SINH": (np.sinh, lambda x: np.abs(x) < 710),
    "COSH": (np.cosh, lambda x: np.abs(x) < 710),
    "TANH": (np.tanh, None),
    "ASIH": (np.arcsinh, None),
    "ACOH": (np.arccosh, lambda x: x >= 1),
    "ATAH": (np.arctanh, lambda x: np.abs(x) < 1),
    "ERF": (_erf, None),
    "ERFC": (_erfc, None),
}
