"""How long the cases ahead will take: what was expected of each, corrected by those that are done."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

LEVEL, SLOPE, SPREAD = 1.5, 0.2, 0.5
"""How far expectations are off: in level (log), in how they grow with the size of a case, and from case to case."""


class Forecast:
    """Seconds of cases, from what was expected of them and from what others took.

    Parameters
    ----------
    expected : sequence of n float
        Seconds that each case is expected to take, positive.

    Notes
    -----
    What a case takes is ``expected * exp(a + b (log(expected) - m)) * noise``, with `m` the mean of the logarithms
    weighted by the times expected; `a` and `b` are normal with deviations `LEVEL` and `SLOPE`, the noise is log-normal
    with `SPREAD`. The cases done give the means of `a` and `b`; one factor then makes their sum right. The longest
    cases begin, so a plain ratio of seconds to expectations would carry what is wrong with those to all small ones.

    Source
    ------
    Linear regression with a normal prior: C. M. Bishop, Pattern recognition and machine learning, 2006, section 3.3.
    """

    def __init__(self, expected: Sequence[float]) -> None:
        self.expected = np.asarray(expected, np.float64)
        logs = np.log(self.expected)
        self.x = logs - np.average(logs, weights=self.expected)
        self.taken: dict[int, float] = {}

    def done(self, case: int, seconds: float) -> None:
        """Note what a case took; nothing is learned from one that took no time that can be measured."""
        if seconds > 0.0:
            self.taken[case] = seconds

    def of(self, cases: Iterable[int]) -> np.ndarray:
        """Predict cases.

        Parameters
        ----------
        cases : n int

        Returns
        -------
        (n,) float64, seconds

        Cost
        ----
        Linear in the cases done.
        """
        wanted = np.fromiter(cases, np.int64)
        if not self.taken:
            return self.expected[wanted]
        done = np.fromiter(self.taken, np.int64)
        seconds = np.fromiter(self.taken.values(), np.float64)
        A = np.column_stack([np.ones(len(done)), self.x[done]])
        H = A.T @ A / SPREAD**2 + np.diag([LEVEL**-2, SLOPE**-2])
        a, b = np.linalg.solve(H, A.T @ np.log(seconds / self.expected[done]) / SPREAD**2)
        model = self.expected * np.exp(a + b * self.x)
        share = model[wanted].mean() if len(wanted) else 0.0
        return np.asarray(model[wanted] * (seconds.sum() + share) / (model[done].sum() + share), np.float64)
