"""Elements put in order: lines end to end, others from neighbour to neighbour; integrals of broken lines."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.interpolation import integral
from gibiane_ops.kernels.mesh.chains import follow, is_chain
from gibiane_ops.kernels.mesh.neighbours import by_vicinity


@given(st.integers(1, 12), st.booleans(), st.randoms(use_true_random=False))
def test_follow_puts_any_line_end_to_end(count: int, closed: bool, random: object) -> None:
    nodes = np.arange(count + 1)
    if closed and count > 2:
        nodes[-1] = 0
    cells = np.stack([nodes[:-1], nodes[1:]], axis=1)
    rows = list(range(count))
    random.shuffle(rows)  # type: ignore[attr-defined]
    flips = np.array([random.random() < 0.5 for _ in rows])  # type: ignore[attr-defined]
    shuffled = cells[rows]
    shuffled[flips] = shuffled[flips, ::-1]
    order, turned = follow(shuffled)
    assert sorted(order.tolist()) == list(range(count))
    found = shuffled[order]
    found[turned] = found[turned, ::-1]
    assert is_chain(found)
    assert not turned[order.tolist().index(0)]  # the first element keeps its direction


def test_follow_keeps_the_pieces_apart() -> None:
    order, turned = follow(np.array([[5, 6], [0, 1], [7, 6]]))
    assert order.tolist() == [0, 2, 1]
    assert turned.tolist() == [False, True, False]


def test_by_vicinity_touches_what_came_before() -> None:
    strip = np.array([[i, i + 1, i + 11, i + 10] for i in (0, 3, 1, 2, 4)])
    order = by_vicinity(strip, 2)
    assert strip[order, 0].tolist() == [0, 1, 2, 3, 4]
    assert by_vicinity(strip[[0, 1]], 2).tolist() == [0, 1]  # two pieces


XS, YS = np.array([0.0, 1.0, 3.0]), np.array([-1.0, 1.0, 3.0])


@pytest.mark.parametrize(
    ("low", "high", "absolute", "value"),
    [
        (0, 3, False, 4.0),
        (3, 0, False, -4.0),
        (0, 1, False, 0.0),
        (0, 1, True, 0.5),
        (0.5, 2.0, False, 1.75),
        (1, 1, True, 0.0),
    ],
)
def test_integral_of_a_broken_line(low: float, high: float, absolute: bool, value: float) -> None:
    assert integral(XS, YS, low, high, absolute=absolute) == pytest.approx(value, abs=1e-15)
    assert integral(XS[::-1], YS[::-1], low, high, absolute=absolute) == pytest.approx(value, abs=1e-15)


@given(st.floats(0, 3), st.floats(0, 3), st.floats(0, 3))
def test_integral_is_additive(a: float, b: float, c: float) -> None:
    total = integral(XS, YS, a, b) + integral(XS, YS, b, c)
    assert total == pytest.approx(integral(XS, YS, a, c), abs=1e-12)


def test_integral_beyond_the_line_is_refused() -> None:
    with pytest.raises(BadValue):
        integral(XS, YS, 0.0, 3.5)
