"""Operators of lists on curves: arithmetic and functions of ordinates, ET, DIME, ORDO, extremes, INTG, BORN."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, Refused, extend
from gibiane.values import ENTIER, EVOLUTIO, FLOTTANT, LISTENTI, LISTREEL
from gibiane_ops.curves.reading import CURVES, kept, numeric, ordinates
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.functions import FUNCTIONS
from gibiane_ops.kernels.interpolation import integral
from gibiane_ops.kernels.powers import real_power, undefined
from gibiane_ops.values.evolution import Curve, Evolution
from gibiane_ops.values.listes import ListEnti, ListReel

NUMBERS = (ENTIER, FLOTTANT)


def _with_ordinates(ctx: Context, curves: Evolution, function: Callable[[Any], NDArray[Any]]) -> Evolution:
    return Evolution([replace(c, y=ListReel(function(y))) for c, y in ordinates(ctx, curves)])


UFUNCS: dict[str, Callable[[Any, Any], Any]] = {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide}


def _arithmetic(symbol: str) -> None:
    compute = UFUNCS[symbol]

    def check(ctx: Context, divisor: Any, at: str) -> None:
        if symbol == "/" and np.any(np.asarray(divisor) == 0):
            ctx.fail(26, "division by zero", at=at)

    @extend(symbol).form(
        Arg("a", (EVOLUTIO, *NUMBERS), "curves or number"),
        Arg("b", (EVOLUTIO, *NUMBERS), "curves or number"),
        gives=[EVOLUTIO],
    )
    def _apply(ctx: Context, a: Any, b: Any) -> Evolution:
        if isinstance(a, Evolution) and isinstance(b, Evolution):
            return _of_two(ctx, a, b, compute, check)
        if isinstance(a, Evolution):
            check(ctx, b, "b")
            return _with_ordinates(ctx, a, lambda y: np.asarray(compute(y, b)))
        for _, y in ordinates(ctx, b, "b"):
            check(ctx, y, "b")
        return _with_ordinates(ctx, b, lambda y: np.asarray(compute(a, y)))


def _powers(ctx: Context, base: Any, exponent: Any) -> FloatArray:
    if undefined(base, exponent).any():
        ctx.fail(213, "a real power of a negative ordinate", at="a")
    if np.any((np.asarray(base) == 0) & (np.asarray(exponent) < 0)):
        ctx.fail(26, "zero to a negative power", at="a")
    return real_power(base, exponent)


@extend("**").form(
    Arg("a", (EVOLUTIO, *NUMBERS), "curves or number"), Arg("b", (EVOLUTIO, *NUMBERS), "exponent"), gives=[EVOLUTIO]
)
def _power(ctx: Context, a: Any, b: Any) -> Evolution:
    if isinstance(a, Evolution) and isinstance(b, Evolution):
        ctx.fail(21, "curves and a number are wanted", at="b")
    if isinstance(a, Evolution):
        return _with_ordinates(ctx, a, lambda y: _powers(ctx, y, b))
    return _with_ordinates(ctx, b, lambda y: _powers(ctx, a, y))


def _of_two(
    ctx: Context,
    a: Evolution,
    b: Evolution,
    compute: Callable[[Any, Any], Any],
    check: Callable[[Context, Any, str], None],
) -> Evolution:
    if len(a.curves) != len(b.curves):
        ctx.fail(217, "{left} curves and {right} curves", at="b", left=len(a.curves), right=len(b.curves))
    found = []
    for (curve, x, y), (_, other_x, other_y) in zip(numeric(ctx, a, "a"), numeric(ctx, b, "b"), strict=True):
        if not np.array_equal(x, other_x):
            ctx.fail(
                21,
                "the curves do not have the same abscissae",
                at="b",
                hint="IPOL gives the ordinates of one at the abscissae of the other",
            )
        check(ctx, other_y, "b")
        found.append(replace(curve, y=ListReel(compute(y, other_y))))
    return Evolution(found)


for _symbol in UFUNCS:
    _arithmetic(_symbol)


def _function(name: str, function: Callable[[Any], Any], allowed: Callable[[Any], Any] | None) -> None:
    @extend(name).form(CURVES, gives=[EVOLUTIO])
    def _apply(ctx: Context, curves: Evolution) -> Evolution:
        for _, y in ordinates(ctx, curves):
            if allowed is not None and not np.all(allowed(y)):
                worst = float(y[int(np.flatnonzero(~allowed(y))[0])])
                ctx.fail(26, "{x} is outside the range of {name}", at="curves", x=worst, name=name)
        return _with_ordinates(ctx, curves, function)


for _name, (_fn, _allowed) in FUNCTIONS.items():
    _function(_name, _fn, _allowed)
_function("ABS", np.abs, None)
_function("SIGN", np.sign, None)
_function("ATG", lambda y: np.degrees(np.arctan(y)), None)


@extend("ET").form(Arg("a", EVOLUTIO, "curves"), Arg("b", EVOLUTIO, "curves"), gives=[EVOLUTIO])
def _joined(ctx: Context, a: Evolution, b: Evolution) -> Evolution:
    return Evolution([*a.curves, *b.curves])


@extend("DIME").form(CURVES, gives=[ENTIER])
def _count(ctx: Context, curves: Evolution) -> int:
    return len(curves.curves)


@extend("ORDO").form(
    CURVES,
    Key(("CROI", "DECR"), "increasing or decreasing", name="order"),
    Key("ABSO", "by absolute value"),
    gives=[EVOLUTIO],
)
def _sorted(ctx: Context, curves: Evolution, order: str | None, abso: bool) -> Evolution:
    found = []
    for curve, x, _ in numeric(ctx, curves):
        key = np.abs(x) if abso else x
        points = np.argsort(-key if order == "DECR" else key, kind="stable")
        found.append(kept(curve, points.tolist()))
    return Evolution(found)


def _extreme(name: str, pick: Callable[[Any], Any]) -> None:
    @extend(name).form(
        CURVES,
        Key("ABS", "largest absolute value"),
        gives=["ENTIER|LISTENTI", "FLOTTANT|LISTREEL", "FLOTTANT|LISTREEL"],
    )
    def _of_curves(ctx: Context, curves: Evolution, abs: bool) -> Any:
        at, xs, ys = [], [], []
        for _, x, y in numeric(ctx, curves):
            if not len(y):
                ctx.fail(21, "an empty list has no extreme value", at="curves")
            i = int(pick(np.abs(y) if abs else y))
            at.append(i + 1)
            xs.append(float(x[i]))
            ys.append(float(y[i]))
        return (at[0], xs[0], ys[0]) if len(at) == 1 else (ListEnti(at), ListReel(xs), ListReel(ys))


_extreme("MAXI", np.argmax)
_extreme("MINI", np.argmin)


# -- INTG and BORN --------------------------------------------------------------------------------------------

INTG = extend("INTG")
ABSOLUTE = Key("ABS", "of the absolute value")


def _bounded(doc: str, word: str, one: str, several: str) -> None:
    """Declare INTG between bounds, given as abscissae ('BORN') or as numbers of points ('INDI')."""
    kinds = (one, several)
    key = Key(word, doc, Arg("low", kinds), Arg("high", kinds), name="bounds", required=True)

    @INTG.form(CURVES, ABSOLUTE, key, gives=["FLOTTANT|LISTREEL"])
    def _between(ctx: Context, curves: Evolution, abs: bool, bounds: tuple[Any, Any]) -> Any:
        low, high = bounds
        if not isinstance(low, ListReel | ListEnti) and not isinstance(high, ListReel | ListEnti):
            return _result([_integrated(ctx, x, y, abs, word, low, high) for _, x, y in numeric(ctx, curves)])
        low, high = (each.values.tolist() if isinstance(each, ListReel | ListEnti) else [each] for each in bounds)
        if len(low) != len(high):
            ctx.fail(217, "{left} lower bounds and {right} upper bounds", at="bounds", left=len(low), right=len(high))
        if len(curves.curves) != 1:
            ctx.fail(
                25,
                "one curve is wanted for several intervals, and this object has {count}",
                at="curves",
                count=len(curves.curves),
                hint="EXTR E 'COUR' 1 takes the first",
            )
        _, x, y = next(numeric(ctx, curves))
        return ListReel([_integrated(ctx, x, y, abs, word, *pair) for pair in zip(low, high, strict=True)])


def _integrated(ctx: Context, x: Any, y: Any, absolute: bool, word: str, low: Any, high: Any) -> float:
    if word == "INDI":
        for number in (low, high):
            if not 1 <= number <= len(x):
                ctx.fail(
                    1068, "there is no number {number}: this object has {size}", at="bounds", number=number, size=len(x)
                )
        low, high = float(x[low - 1]), float(x[high - 1])
    try:
        return integral(x, y, low, high, absolute=absolute)
    except BadValue as failure:
        if failure.what == "bound":
            ctx.fail(
                210, "{value} is outside the abscissae of the curve ({limit})", at="bounds", value=failure.value,
                limit=failure.limit,
            )  # fmt: skip
        ctx.fail(
            249, "the abscissae of the function must be in order, and {value} is not", at="curves", value=failure.value
        )


def _result(found: list[float]) -> Any:
    return found[0] if len(found) == 1 else ListReel(found)


_bounded("between two abscissae", "BORN", FLOTTANT, LISTREEL)
_bounded("between two points of the curve, by their numbers", "INDI", ENTIER, LISTENTI)


@INTG.form(CURVES, ABSOLUTE, gives=["FLOTTANT|LISTREEL"])
def _whole(ctx: Context, curves: Evolution, abs: bool) -> Any:
    found = []
    for _, x, y in numeric(ctx, curves):
        if not len(x):
            ctx.fail(21, "a curve without points has no integral", at="curves")
        found.append(_integrated(ctx, x, y, abs, "", float(x[0]), float(x[-1])))
    return _result(found)


@extend("BORN").stream(
    Key("MAXIMUM", "upper bound", Arg("x", FLOTTANT)),
    Key("MINIMUM", "lower bound", Arg("x", FLOTTANT)),
    Key("COMPRIS", "both", Arg("a", FLOTTANT), Arg("b", FLOTTANT)),
    syntax="curves:EVOLUTIO (n:ENTIER) ('MAXI' x:FLOTTANT | 'MINI' x:FLOTTANT | 'COMP' a:FLOTTANT b:FLOTTANT)...",
    gives=[EVOLUTIO],
)
def _clipped(ctx: Context, q: Operands) -> Any:
    """Bound the curves named by their numbers; the others are left out."""
    if not q.values or not any(isinstance(v, Evolution) for v in q.values):
        return Refused
    ctx.places["curves"] = next(n for v, n in zip(q.values, q.nodes, strict=True) if isinstance(v, Evolution))
    given = list(numeric(ctx, q.need(EVOLUTIO)))
    found: list[Curve] = []
    while True:
        number = q.read(ENTIER)
        word = q.read_keyword(["MAXIMUM", "MINIMUM", "COMPRIS"])
        if word is None:
            if number is not None or not found:
                raise q.unknown_keyword(["MAXI", "MINI", "COMP"])
            return Evolution(found)
        if number is None and len(given) > 1:
            ctx.fail(37, "this object has {count} curves: the number of one is wanted", at="curves", count=len(given))
        chosen = 1 if number is None else number
        if not 1 <= chosen <= len(given):
            ctx.fail(
                1068, "there is no curve {number}: this object has {size}", at="curves", number=chosen, size=len(given)
            )
        curve, _, y = given[chosen - 1]
        low = None if word == "MAXIMUM" else q.need(FLOTTANT, "the lower bound")
        high = None if word == "MINIMUM" else q.need(FLOTTANT, "the upper bound")
        if low is not None and high is not None and low > high:
            ctx.fail(21, "the lower bound {low} is above the upper bound {high}", at="curves", low=low, high=high)
        found.append(replace(curve, y=ListReel(np.clip(y, low, high))))
