"""Lists are computed with: + - * / **, functions, comparison, sums, extremes, masks, bounds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend, operator
from gibiane.values import ENTIER, FLOTTANT, LISTENTI, LISTREEL, LOGIQUE
from gibiane_ops.kernels.functions import FUNCTIONS
from gibiane_ops.kernels.powers import real_power, undefined
from gibiane_ops.values.listes import ListEnti, ListReel

Numbers = ListReel | ListEnti
Array = NDArray[Any]
OPERAND = (LISTREEL, LISTENTI, ENTIER, FLOTTANT)
A, B = Arg("a", OPERAND, "list or number"), Arg("b", OPERAND, "list or number")
LIST_OF_NUMBERS = (LISTREEL, LISTENTI)


def _array(value: Any) -> Any:
    return value.values if isinstance(value, ListReel | ListEnti) else value


def _wrap(values: Array) -> Numbers:
    return ListEnti(values) if values.dtype.kind in "iu" else ListReel(values)


def _pair(ctx: Context, a: Any, b: Any) -> tuple[Any, Any]:
    """Return the two operands as arrays or numbers; lists must have the same length."""
    if isinstance(a, ListReel | ListEnti) and isinstance(b, ListReel | ListEnti) and len(a) != len(b):
        ctx.fail(217, "the lists have {left} and {right} values", at="b", left=len(a), right=len(b))
    return _array(a), _array(b)


def _arithmetic(name: str, compute: Callable[[Context, Any, Any], Array]) -> None:
    @extend(name).form(A, B, gives=["LISTREEL|LISTENTI"])
    def _termwise(ctx: Context, a: Any, b: Any) -> Numbers:
        left, right = _pair(ctx, a, b)
        with np.errstate(over="ignore", invalid="ignore"):
            result = compute(ctx, left, right)
        if result.dtype.kind == "f" and not np.all(np.isfinite(result)):
            _refuse_overflow(ctx, left, right, result)
        return _wrap(result)


def _refuse_overflow(ctx: Context, left: Any, right: Any, result: Array) -> None:
    """Fail for infinite values that neither operand had."""
    before = np.isfinite(np.asarray(left, dtype=np.float64)) & np.isfinite(np.asarray(right, dtype=np.float64))
    bad = np.flatnonzero(~np.isfinite(result) & before)
    if len(bad):
        ctx.fail(26, "value {number} of the result is too large for a FLOTTANT", at="a", number=int(bad[0]) + 1)


def _quotient(ctx: Context, a: Any, b: Any) -> Array:
    if np.any(np.asarray(b) == 0):
        number = int(np.flatnonzero(np.atleast_1d(b) == 0)[0]) + 1
        ctx.fail(26, "division by zero (value {number})", at="b", number=number)
    if np.asarray(a).dtype.kind == "i" and np.asarray(b).dtype.kind == "i":
        signs = np.sign(a) * np.sign(b)
        return np.asarray(signs * (np.abs(a) // np.abs(b)))
    return np.asarray(a / b)


def _power(ctx: Context, a: Any, b: Any) -> Array:
    base, exponent = np.broadcast_arrays(np.asarray(a), np.asarray(b))
    wrong = np.flatnonzero(undefined(base, exponent))
    if len(wrong):
        ctx.fail(
            213,
            "a real power of a negative number (value {number})",
            at="a",
            number=int(wrong[0]) + 1,
            hint="whole powers and odd roots of it exist: ** 2, ** (1./3.)",
        )
    if np.any((base == 0) & (exponent < 0)):
        ctx.fail(26, "zero to a negative power", at="a")
    if base.dtype.kind == "i" and exponent.dtype.kind == "i" and np.all(exponent >= 0):
        return np.asarray(base**exponent)
    return real_power(base, exponent)


_arithmetic("+", lambda _ctx, a, b: np.asarray(a + b))
_arithmetic("-", lambda _ctx, a, b: np.asarray(a - b))
_arithmetic("*", lambda _ctx, a, b: np.asarray(a * b))
_arithmetic("/", _quotient)
_arithmetic("**", _power)


def _function(name: str, function: Callable[[Array], Array], allowed: Callable[[Array], Array] | None) -> None:
    @extend(name).form(Arg("x", LIST_OF_NUMBERS, "list"), gives=[LISTREEL])
    def _apply(ctx: Context, x: Numbers) -> ListReel:
        values = x.values.astype(np.float64)
        if allowed is not None and not np.all(allowed(values)):
            worst = int(np.flatnonzero(~allowed(values))[0])
            ctx.fail(
                26,
                "{x} (value {number}) is outside the range of {name}",
                at="x",
                x=float(values[worst]),
                number=worst + 1,
                name=name,
            )
        return ListReel(function(values))


for _name, (_fn, _allowed) in FUNCTIONS.items():
    _function(_name, _fn, _allowed)


@extend("ATG").form(
    Arg("y", LIST_OF_NUMBERS, "ordinates"), Arg("x", LIST_OF_NUMBERS, "abscissae", optional=True), gives=[LISTREEL]
)
def _atg(ctx: Context, y: Numbers, x: Numbers | None) -> ListReel:
    above, beside = _pair(ctx, y, 1.0 if x is None else x)
    return ListReel(np.degrees(np.arctan2(above, beside)))


@extend("ABS").form(Arg("x", LIST_OF_NUMBERS, "list"), gives=["LISTREEL|LISTENTI"])
def _abs(ctx: Context, x: Numbers) -> Numbers:
    return _wrap(np.abs(x.values))


@extend("SIGN").form(Arg("x", LIST_OF_NUMBERS, "list"), gives=["LISTREEL|LISTENTI"])
def _sign(ctx: Context, x: Numbers) -> Numbers:
    return _wrap(np.sign(x.values))


@extend("FLOT").form(Arg("x", LIST_OF_NUMBERS, "list"), gives=[LISTREEL])
def _real(ctx: Context, x: Numbers) -> ListReel:
    return ListReel(x.values)


ROUNDING: dict[str | None, Callable[[Array], Array]] = {
    None: np.trunc,
    "TRONC": np.trunc,
    "INFE": np.floor,
    "SUPE": np.ceil,
    "PROC": lambda x: np.sign(x) * np.floor(np.abs(x) + 0.5),
}


@extend("ENTI").form(
    Arg("x", LIST_OF_NUMBERS, "list"), Key(("TRONC", "PROC", "INFE", "SUPE"), "rounding", name="how"), gives=[LISTENTI]
)
def _integer(ctx: Context, x: Numbers, how: str | None) -> ListEnti:
    rounded = ROUNDING[how](x.values.astype(np.float64))
    if not np.all(np.abs(rounded) < 2.0**62):
        number = int(np.flatnonzero(~(np.abs(rounded) < 2.0**62))[0]) + 1
        ctx.fail(26, "value {number} has no integer value", at="x", number=number)
    return ListEnti(rounded)


def _comparison(name: str, holds: Callable[[Any, Any], Any]) -> None:
    @extend(name).form(A, B, gives=[LOGIQUE])
    def _compare(ctx: Context, a: Any, b: Any) -> bool:
        left, right = _pair(ctx, a, b)
        return bool(np.all(holds(left, right)))


for _symbol, _holds in {"<": np.less, ">": np.greater, "<EG": np.less_equal, ">EG": np.greater_equal}.items():
    _comparison(_symbol, _holds)

SOMM = operator(
    "SOMME",
    topic="lists",
    summary="sum of the values of a list",
    notice="With 'CUMU' the list of the partial sums.",
    example="MESS (SOMM (LECT 1 2 3 4)) ;",
    see=["MAXIMUM", "RESULT"],
)


@SOMM.form(
    Arg("values", LIST_OF_NUMBERS, "list"), Key("CUMU", "partial sums"), gives=["FLOTTANT|ENTIER|LISTREEL|LISTENTI"]
)
def _sum(ctx: Context, values: Numbers, cumu: bool) -> Any:
    return _wrap(np.cumsum(values.values)) if cumu else values.values.sum().item()


def _extreme(name: str, choose: Callable[[Array], Any], merge: Callable[[Array, Array], Array]) -> None:
    @extend(name).form(
        Arg("values", LIST_OF_NUMBERS, "lists", many=True),
        Key("ABS", "of absolute values"),
        gives=["FLOTTANT|ENTIER|LISTREEL|LISTENTI"],
    )
    def _of_lists(ctx: Context, values: list[Numbers], abs: bool) -> Any:
        arrays = [np.abs(v.values) if abs else v.values for v in values]
        if len(arrays) == 1:
            if not len(arrays[0]):
                ctx.fail(21, "an empty list has no extreme value", at="values")
            return choose(arrays[0]).item()
        result = arrays[0]
        for other in arrays[1:]:
            if len(other) != len(result):
                ctx.fail(
                    217, "the lists have {left} and {right} values", at="values", left=len(result), right=len(other)
                )
            result = merge(result, other)
        return _wrap(result)


_extreme("MAXI", np.max, np.maximum)
_extreme("MINI", np.min, np.minimum)

MASQ = operator(
    "MASQUER",
    topic="lists",
    summary="1 where a condition holds, 0 elsewhere",
    notice="Compares each value with a number, or with its counterpart in a second object: 'SUPERIEUR', "
    "'EGSUPE', 'EGALE', 'EGINFE', 'INFERIEUR', 'DIFFERENT', or 'COMPRIS' between two (both "
    "included). 'SOMME' counts the ones.",
    example="L = (PROG 1. 2. 3.) MASQ 'EGSUPE' 2. ; LIST L ; MESS ((LECT 1 2 3) MASQ 'INFE' 'SOMME' 3) ;",
    see=["BORNER"],
)
COMPARE: dict[str, Callable[[Any, Any], Array]] = {
    "SUPERIEUR": np.greater,
    "EGSUPE": np.greater_equal,
    "EGALE": np.equal,
    "EGINFE": np.less_equal,
    "INFERIEUR": np.less,
    "DIFFERENT": np.not_equal,
}
SOMME = Key("SOMME", "count the ones")


def _masking(kind: str, item: str) -> None:
    one = Key(tuple(COMPARE), "comparison", name="how", required=True)

    @MASQ.form(
        Arg("values", kind, "list"), one, SOMME, Arg("x", (item, kind), "number or list"), gives=[f"{kind}|ENTIER"]
    )
    def _mask(ctx: Context, values: Numbers, how: str, somme: bool, x: Any) -> Any:
        left, right = _pair(ctx, values, x)
        return _mask_of(values, COMPARE[how](left, right), somme)

    @MASQ.form(
        Arg("values", kind, "list"),
        Key("COMPRIS", "between two", name="how", required=True),
        SOMME,
        Arg("low", (item, kind), "lower bound"),
        Arg("high", (item, kind), "upper bound"),
        gives=[f"{kind}|ENTIER"],
    )
    def _mask_between(ctx: Context, values: Numbers, how: bool, somme: bool, low: Any, high: Any) -> Any:
        below, above = _pair(ctx, values, low)[1], _pair(ctx, values, high)[1]
        return _mask_of(values, (values.values >= below) & (values.values <= above), somme)


def _mask_of(model: Numbers, hits: Array, count: bool) -> Any:
    return int(hits.sum()) if count else type(model)(hits)


_masking(LISTREEL, FLOTTANT)
_masking(LISTENTI, ENTIER)

BORN = operator(
    "BORNER",
    topic="lists",
    summary="keep values between bounds",
    notice="A value beyond 'MAXIMUM', below 'MINIMUM' or outside 'COMPRIS' becomes the bound.",
    example="L = BORN (PROG 1. 5. 9.) 'COMP' 2. 6. ; LIST L ;",
    see=["MASQUER"],
)


def _bounding(kind: str, item: str) -> None:
    @BORN.form(
        Arg("values", kind, "list"),
        Key("MAXIMUM", "upper bound", Arg("x", item)),
        Key("MINIMUM", "lower bound", Arg("x", item)),
        Key("COMPRIS", "both", Arg("a", item), Arg("b", item)),
        gives=[kind],
    )
    def _bound(ctx: Context, values: Numbers, maximum: Any, minimum: Any, compris: Any) -> Numbers:
        if maximum is None and minimum is None and compris is None:
            ctx.fail(7, "a keyword is missing: 'MAXI', 'MINI' or 'COMP'")
        low, high = compris if compris is not None else (minimum, maximum)
        if low is not None and high is not None and low > high:
            ctx.fail(21, "the lower bound {low} is above the upper bound {high}", at="values", low=low, high=high)
        return type(values)(np.clip(values.values, low, high))


_bounding(LISTREEL, FLOTTANT)
_bounding(LISTENTI, ENTIER)
