"""How far a study is, and how long it will take: told while it runs."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

from gibiane.diagnostics import Text
from gibiane.registry import Context
from gibiane_ops.assistants.forecast import Forecast

EVERY = 30.0  # seconds between two lines of a listing that is no terminal


class Progress:
    """The cases done and left of a study.

    Parameters
    ----------
    ctx : Context
    total : int
        Number of cases.
    expected : sequence of float or None
        Seconds that each case is expected to take, on one worker.
    workers : int
        Processes that share them, 0 for this one.
    """

    def __init__(self, ctx: Context, total: int, expected: Sequence[float] | None, workers: int) -> None:
        self.ctx = ctx
        self.total = total
        self.forecast = None if expected is None else Forecast(expected)
        self.workers = max(1, workers)
        self.missing: list[int] = []
        self.count = self.old = 0
        self.start = self.last = time.perf_counter()
        self.terminal = sys.stderr.isatty() and ctx.session.err is sys.stderr
        self.listed = int(ctx.option("ECHO")) >= 1
        self.slow = expected is not None and not self.terminal and not self.listed and ctx.session.err is sys.stderr

    def begin(self, missing: Sequence[int]) -> None:
        """Note which cases are to be done, in their order, and say how long they will take."""
        self.missing = list(missing)
        self.count = self.old = self.total - len(missing)
        if self.old:
            self._tell(Text("{old} of {total} cases were done before", {"old": self.old, "total": self.total}))
        if self.forecast is not None and missing:
            fields = {"count": len(missing), "time": span(self.left()), "workers": self.workers}
            self._tell(Text("{count} cases to do, about {time} on {workers} process(es)", fields))

    def left(self) -> float:
        """Return the seconds ahead: what was expected, corrected by what the finished cases took."""
        if self.count >= self.total:
            return 0.0
        if self.forecast is None:
            elapsed = time.perf_counter() - self.start
            return elapsed / max(1, self.count - self.old) * (self.total - self.count)
        ahead = self.forecast.of(self.missing)
        # when a case ends, the other workers are on their way through the next ones: half done, on the average
        begun = 0.5 * float(ahead[: self.workers - 1].sum()) if self.count > self.old else 0.0
        return max((float(ahead.sum()) - begun) / self.workers, 0.5 * float(ahead.max()))

    def done(self, number: int, seconds: float) -> None:
        """Note that a case is finished."""
        self.count += 1
        self.missing.remove(number)
        if self.forecast is not None:
            self.forecast.done(number, seconds)
        now = time.perf_counter()
        if self.slow and now - self.last < EVERY and self.count < self.total:
            return
        self.last = now
        times = {"elapsed": span(now - self.start), "left": span(self.left())}
        self._tell(
            Text(
                "{done} of {total} cases, {elapsed}, about {left} left",
                {"done": self.count, "total": self.total} | times,
            )
        )

    def _tell(self, sentence: Text) -> None:
        line = f" ASSI : {sentence.render(self.ctx.session.lang)}"
        if self.listed:
            self.ctx.write(line)
        elif self.terminal:
            self.ctx.session.err.write(line.ljust(70) + ("\n" if self.count == self.total else "\r"))
        elif self.slow:
            self.ctx.session.err.write(line + "\n")
        self.ctx.session.err.flush()


def span(seconds: float) -> str:
    """Write a length of time: 45 s, 3 min 20 s, 2 h 05 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole // 60 % 60:02d} min"
