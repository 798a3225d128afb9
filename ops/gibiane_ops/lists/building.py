"""Lists are built: PROG, LECT, MOTS."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibiane.binding import ABSENT, Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import (
    ENTIER,
    FLOTTANT,
    LISTENTI,
    LISTMOTS,
    LISTREEL,
    MOT,
    TABLE,
    Table,
)
from gibiane_ops.kernels.functions import FUNCTIONS
from gibiane_ops.values.listes import ListEnti, ListMots, ListReel

NUMBERS = (ENTIER, FLOTTANT)
MAX_ITEMS = 50_000_000

PROG = operator(
    "PROGRESSION",
    topic="lists",
    summary="make a list of reals",
    notice="Reals one by one. `n * x` repeats x n times. `PAS dx xn` after a value goes on by steps up to xn (the "
    "nearest step that divides the interval is used), `PAS dx NPAS n` for n steps; `PAS dx GEOM r` multiplies each "
    "step by r. 'SINU' f, 'LINE', 'EXPO' and 'LOGA' give a function of the values that follow; 'TABL' reads a table "
    "with integer indices.",
    example="L = PROG 0. PAS 0.25 1. 2*3. ; LIST L ;",
    see=["LECTURE", "MOTS", "EXTRAIRE"],
)
STEP = Key("PAS", "step, then the last value or 'NPAS'", Arg("dx", FLOTTANT, "step"))
COUNT = Key("NPAS", "number of steps", Arg("n", ENTIER, "steps"))


class _Builder:
    """Reads the values of PROG or LECT from the queue: numbers, repetitions, steps."""

    def __init__(self, ctx: Context, q: Operands, kind: str) -> None:
        self.ctx = ctx
        self.q = q
        self.types = (FLOTTANT,) if kind == FLOTTANT else (ENTIER,)
        self.kind = kind
        self.items: list[Any] = []

    def run(self) -> list[Any]:
        """Read everything there is."""
        numeric = (int, float) if self.kind == FLOTTANT else (int,)
        while True:
            values = self.q.values
            ready = next((i for i, v in enumerate(values) if type(v) not in numeric), len(values))
            self.items.extend(values[:ready])
            del values[:ready], self.q.nodes[:ready]
            head = values[0] if values else None
            if head == "*" and self.items:
                self._repeat()
            elif isinstance(head, str) and head[:4] == "PAS":
                self._step()
            else:
                value, _ = self.q.take(self.types)
                if value is ABSENT:
                    return self.items
                self.items.append(value)

    def _number(self, what: str) -> Any:
        value, node = self.q.take(self.types)
        if value is ABSENT:
            raise self.q.missing(self.kind, what)
        self.ctx.places["value"] = node
        return value

    def _count(self, value: float) -> int:
        count = int(value)
        if count < 0 or count + len(self.items) > MAX_ITEMS:
            self.ctx.fail(36, "{count} is not an acceptable number of values", at="value", count=count)
        return count

    def _repeat(self) -> None:
        del self.q.values[0], self.q.nodes[0]
        count = self._count(self.items.pop())
        self.items.extend([self._number("the value to repeat")] * count)

    def _step(self) -> None:
        word = self.q.nodes[0]
        if not self.items:
            self.ctx.places["value"] = word
            self.ctx.fail(37, "PAS needs a value before it", at="value", hint="PROG 0. PAS 0.5 2. ;")
        del self.q.values[0], self.q.nodes[0]
        step = self._number("the step")
        ratio = 1.0
        if self.kind == FLOTTANT and self._word("GEOM"):
            ratio = self._number("the ratio of the steps")
        first = self.items[-1]
        if self._word("NPAS"):
            value, node = self.q.take((ENTIER,))
            if value is ABSENT:
                raise self.q.missing(ENTIER, "the number of steps")
            self.ctx.places["value"] = node
            steps = self._count(value)
            self.items.extend(first + step * _reach(ratio, k) for k in range(1, steps + 1))
            return
        last, repeated = self._number("the last value"), 1
        if self.q.values and self.q.values[0] == "*":  # `PAS d n*x` reaches x, and repeats it
            del self.q.values[0], self.q.nodes[0]
            repeated = self._count(last)
            last = self._number("the value to repeat")
        if self.kind == ENTIER:
            self._exact_steps(first, step, last)
        elif ratio == 1.0:
            self._fitted_steps(first, step, last)
        else:
            self._geometric_steps(first, step, ratio, last)
        self.items.extend([last] * (repeated - 1))

    def _word(self, word: str) -> bool:
        """Read a keyword if it is what comes next."""
        if self.q.values and isinstance(self.q.values[0], str) and self.q.values[0][:4] == word:
            del self.q.values[0], self.q.nodes[0]
            return True
        return False

    def _exact_steps(self, first: int, step: int, last: int) -> None:
        if step == 0 or (last - first) % step or (last - first) // step < 1:
            self.ctx.fail(
                21,
                "steps of {step} do not lead from {first} to {last}",
                at="value",
                step=step,
                first=first,
                last=last,
            )
        self._count((last - first) // step)
        self.items.extend(range(first + step, last + (1 if step > 0 else -1), step))

    def _fitted_steps(self, first: float, step: float, last: float) -> None:
        exact = (last - first) / step if step else 0.0
        steps = self._count(math.floor(exact + 0.5) if math.isfinite(exact) else MAX_ITEMS + 1) if exact > 0 else 0
        if steps == 0:
            self.ctx.warn(
                21,
                "steps of {step:g} do not lead from {first:g} to {last:g}: {last:g} just follows",
                level=0,
                at="value",
                step=step,
                first=first,
                last=last,
            )
        elif abs(steps - exact) > 1e-6 * steps:
            self.ctx.warn(
                21,
                "the step {step:g} does not divide the interval from {first:g} to {last:g}: {used:g} is used",
                level=0,
                at="value",
                step=step,
                first=first,
                last=last,
                used=(last - first) / steps,
            )
        self.items.extend(first + (last - first) * (k / steps) for k in range(1, steps))
        self.items.append(last)

    def _geometric_steps(self, first: float, step: float, ratio: float, last: float) -> None:
        reach = 1 + (last - first) * (ratio - 1) / step if step else 0.0
        exact = math.log(reach) / math.log(ratio) if ratio > 0 and reach > 0 else 0.0
        steps = self._count(max(1, math.floor(exact + 1e-6)))
        used = (last - first) / _reach(ratio, steps)
        self.items.extend(first + used * _reach(ratio, k) for k in range(1, steps))
        self.items.append(last)


def _reach(ratio: float, count: int) -> float:
    """Return the sum of `count` steps that start at 1 and are multiplied by `ratio`."""
    return count if ratio == 1.0 else (ratio**count - 1) / (ratio - 1)


@PROG.form(
    Key(("LINE", "EXPO", "LOGA"), "a x + b, exp(a x + b), log(a x + b)", name="how", required=True),
    Key("A", "factor a (1)", Arg("value", FLOTTANT)),
    Key("B", "shift b (0)", Arg("value", FLOTTANT)),
    Key("PROG", "values of x", Arg("x", FLOTTANT, many=True), name="values"),
    Arg("x", LISTREEL, "values of x", optional=True),
    gives=[LISTREEL],
)
def _function(
    ctx: Context, how: str, a: float | None, b: float | None, values: list[float] | None, x: ListReel | None
) -> ListReel:
    argument = (1.0 if a is None else a) * _abscissae(ctx, values, x) + (0.0 if b is None else b)
    if how == "LINE":
        return ListReel(argument)
    if how == "LOGA" and not np.all(argument > 0):
        ctx.fail(26, "the logarithm of a number that is not positive", at="x")
    return ListReel(np.log(argument) if how == "LOGA" else np.exp(argument))


@PROG.form(
    Key("SINU", "sine of the values that follow, of this frequency", Arg("f", FLOTTANT), required=True),
    Key("PHAS", "phase in degrees (0)", Arg("value", FLOTTANT)),
    Key("AMPL", "amplitude (1)", Arg("value", FLOTTANT)),
    Key("PROG", "values of x", Arg("x", FLOTTANT, many=True), name="values"),
    Arg("x", LISTREEL, "values of x", optional=True),
    gives=[LISTREEL],
)
def _sine(
    ctx: Context,
    sinu: float,
    phas: float | None,
    ampl: float | None,
    values: list[float] | None,
    x: ListReel | None,
) -> ListReel:
    degrees = 360.0 * sinu * _abscissae(ctx, values, x) + (phas or 0.0)
    return ListReel((1.0 if ampl is None else ampl) * FUNCTIONS["SIN"][0](degrees))


def _abscissae(ctx: Context, values: list[float] | None, x: ListReel | None) -> NDArray[np.float64]:
    if x is None and values is None:
        ctx.fail(37, "no LISTREEL among its operands", hint="write the values after 'PROG', or give a LISTREEL")
    return x.values if x is not None else np.array(values, dtype=np.float64)


@PROG.form(Key("TABL", "values of a table with integer indices", Arg("t", TABLE), required=True), gives=[LISTREEL])
def _of_table(ctx: Context, tabl: Table) -> ListReel:
    found = sorted((i, v) for i, v in tabl.entries.values() if type(i) is int and type(v) in (int, float))
    return ListReel([v for _, v in found])


@PROG.stream(
    STEP,
    COUNT,
    Key("GEOM", "ratio of the steps", Arg("r", FLOTTANT)),
    gives=[LISTREEL],
    last=True,
    syntax="x... (n * x) (PAS dx xn | PAS dx NPAS n | PAS dx GEOM r xn)",
)
def _prog(ctx: Context, q: Operands) -> ListReel:
    return ListReel(_Builder(ctx, q, FLOTTANT).run())


LECT = operator(
    "LECTURE",
    topic="lists",
    summary="make a list of integers",
    notice="Integers one by one. `n * i` repeats i n times. `PAS d in` after a value goes on by steps up to in, which "
    "they must reach exactly; `PAS d NPAS n` for n steps.",
    example="L = LECT 1 PAS 2 9 3*7 ; LIST L ;",
    see=["PROGRESSION", "MOTS", "EXTRAIRE"],
)


@LECT.stream(
    Key("PAS", "step, then the last value or 'NPAS'", Arg("d", ENTIER)),
    COUNT,
    gives=[LISTENTI],
    syntax="i... (n * i) (PAS d in | PAS d NPAS n)",
)
def _lect(ctx: Context, q: Operands) -> ListEnti:
    try:
        return ListEnti(_Builder(ctx, q, ENTIER).run())
    except OverflowError:
        ctx.fail(26, "an ENTIER of a list has at most 19 digits")


MOTS = operator(
    "MOTS",
    topic="lists",
    summary="make a list of words",
    notice="Words of at most 8 characters, one by one. `n * 'word'` repeats it n times. The operator stands before "
    "its words.",
    example="L = MOTS 2*'BLEU' 'ROUG' ; LIST L ;",
    see=["PROGRESSION", "LECTURE", "EXTRAIRE"],
)


@MOTS.stream(gives=[LISTMOTS], syntax="word... (n * word)")
def _mots(ctx: Context, q: Operands) -> ListMots:
    words: list[str] = []
    while True:
        count = 1
        if len(q.values) > 2 and type(q.values[0]) is int and q.values[1] == "*":
            count, ctx.places["count"] = q.values[0], q.nodes[0]
            if not 0 <= count <= MAX_ITEMS:
                ctx.fail(36, "{count} is not an acceptable number of values", at="count", count=count)
            del q.values[:2], q.nodes[:2]
        word, _ = q.take((MOT,))
        if word is ABSENT:
            return ListMots(words)
        words.extend([word] * count)
