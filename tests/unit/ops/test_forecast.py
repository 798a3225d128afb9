"""The time ahead of a study: what was expected, corrected by what the finished cases took."""

import io
from types import SimpleNamespace

import numpy as np
import pytest

from gibiane_ops.assistants.forecast import Forecast
from gibiane_ops.assistants.progress import Progress, span


def study(count, power, factor, seed):
    """Return expectations and what the cases really take: another level, another growth, and noise."""
    random = np.random.default_rng(seed)
    expected = np.sort(10 ** random.uniform(-1, 2, count))[::-1]
    taken = factor * expected**power * np.exp(0.3 * random.standard_normal(count))
    return expected, taken


def test_without_a_finished_case_expectations_stand():
    forecast = Forecast([4.0, 2.0, 1.0])
    np.testing.assert_array_equal(forecast.of([0, 2]), [4.0, 1.0])
    forecast.done(0, 0.0)
    np.testing.assert_array_equal(forecast.of([1]), [2.0])


def test_a_machine_that_is_slower_throughout_is_found_out():
    expected = [16.0, 8.0, 4.0, 2.0, 1.0, 0.5]
    forecast = Forecast(expected)
    for case in range(4):
        forecast.done(case, 3.0 * expected[case])
    np.testing.assert_allclose(forecast.of([4, 5]), [3.0, 1.5], rtol=0.1)


@pytest.mark.parametrize("power", [0.75, 1.0, 1.25])
@pytest.mark.parametrize("factor", [0.2, 1.0, 6.0])
def test_the_rest_is_foretold_when_the_longest_quarter_of_the_time_is_over(power, factor):
    """Expectations wrong in level and in growth; the longest cases begin, as in ASSI."""
    found, plain = [], []
    for seed in range(20):
        expected, taken = study(80, power, factor, seed)
        forecast, n = Forecast(expected), 0
        while taken[:n].sum() < 0.25 * taken.sum():
            forecast.done(n, taken[n])
            n += 1
        rest = taken[n:].sum()
        found.append(forecast.of(range(n, 80)).sum() / rest)
        plain.append(taken[:n].sum() / expected[:n].sum() * expected[n:].sum() / rest)
    assert np.abs(np.log(found)).mean() < 0.35
    assert np.abs(np.log(found)).mean() < np.abs(np.log(plain)).mean() + 0.05


class Context:
    """What Progress asks of the place that it runs in."""

    def __init__(self, lang="en"):
        self.lines = []
        self.session = SimpleNamespace(err=io.StringIO(), lang=lang)

    def option(self, name):
        return 1

    def write(self, line):
        self.lines.append(line)


def test_workers_share_what_is_left_and_the_last_case_counts_for_itself():
    progress = Progress(Context(), 5, [8.0, 4.0, 2.0, 1.0, 1.0], 2)
    progress.begin([0, 1, 2, 3, 4])
    assert progress.left() == pytest.approx(8.0)
    progress.done(1, 4.0)
    # 12 s are left, of which the other worker has done half of the first case
    assert progress.left() == pytest.approx((12.0 - 4.0) / 2, rel=0.05)
    for case, seconds in ((0, 8.0), (2, 2.0), (3, 1.0), (4, 1.0)):
        progress.done(case, seconds)
    assert progress.left() == 0.0
    assert progress.ctx.lines[0] == " ASSI : 5 cases to do, about 8 s on 2 process(es)"


def test_cases_kept_from_before_are_not_counted_as_measured():
    progress = Progress(Context(), 4, [1.0, 1.0, 1.0, 1.0], 0)
    progress.begin([2, 3])
    assert progress.ctx.lines[0] == " ASSI : 2 of 4 cases were done before"
    assert progress.left() == pytest.approx(2.0)


def test_the_lines_speak_the_language_of_the_session():
    progress = Progress(Context("fr"), 3, [8.0, 4.0, 2.0], 0)
    progress.begin([1, 2])
    progress.done(1, 0.0)
    before, ahead, now = progress.ctx.lines
    assert before == " ASSI : 1 cas sur 3 déjà faits"
    assert ahead == " ASSI : 2 cas à faire, environ 6 s sur 1 processus"
    assert now == " ASSI : 2 cas sur 3, 0 s, encore 2 s environ"


def test_lengths_of_time_are_written_as_one_says_them():
    assert [span(x) for x in (0.4, 59.4, 61.0, 7384.0)] == ["0 s", "59 s", "1 min 01 s", "2 h 03 min"]
