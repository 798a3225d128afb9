"""Arithmetic and comparison of numbers; other types add their forms to the same operators."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from gibiane.forms import Arg, Key
from gibiane.registry import Context, Operator, infix, operator
from gibiane.values import ENTIER, FLOTTANT, LOGIQUE, MOT

NUMBER = (ENTIER, FLOTTANT)
A, B = Arg("a", NUMBER, "first number"), Arg("b", NUMBER, "second number")


def _number_infix(name: str, summary: str, example: str) -> Operator:
    return infix(
        name,
        topic="arithmetic",
        summary=summary,
        example=example,
        notice="Two ENTIER give an ENTIER, any other two numbers a FLOTTANT. There is no precedence: operations are "
        "done from left to right, and parentheses change that.",
    )


PLUS = _number_infix("+", "add", "MESS (1 + 2 * 3) ;")
MINUS = _number_infix("-", "subtract", "MESS (7 - 2) ;")
TIMES = _number_infix("*", "multiply", "MESS (2. * 3.) ;")
OVER = infix(
    "/",
    topic="arithmetic",
    summary="divide",
    example="MESS (7 / 2) ' ' (7. / 2) ;",
    notice="The quotient of two ENTIER is an ENTIER, truncated towards zero: 7/2 is 3, -7/2 is -3.",
)
POWER = infix(
    "**",
    topic="arithmetic",
    summary="raise to a power",
    example="MESS (2 ** 10) ' ' (2. ** -1) ;",
    notice="The power of a negative number needs an ENTIER exponent (error 213). An ENTIER to a "
    "negative ENTIER power is a FLOTTANT.",
)


def _in_range(ctx: Context, symbol: str, a: Any, b: Any, value: Any) -> Any:
    """Return a result; fail where it has left the range of a FLOTTANT."""
    if type(value) is float and not math.isfinite(value) and math.isfinite(a) and math.isfinite(b):
        ctx.fail(26, "the result of {a} {symbol} {b} is too large for a FLOTTANT", at="b", a=a, b=b, symbol=symbol)
    return value


@PLUS.form(A, B, gives=["ENTIER|FLOTTANT"])
def _plus(ctx: Context, a: Any, b: Any) -> Any:
    return _in_range(ctx, "+", a, b, a + b)


@MINUS.form(A, B, gives=["ENTIER|FLOTTANT"])
def _minus(ctx: Context, a: Any, b: Any) -> Any:
    return _in_range(ctx, "-", a, b, a - b)


@TIMES.form(A, B, gives=["ENTIER|FLOTTANT"])
def _times(ctx: Context, a: Any, b: Any) -> Any:
    return _in_range(ctx, "*", a, b, a * b)


def quotient(a: Any, b: Any) -> Any:
    """Divide two numbers by the language's rule; the caller has checked b."""
    if type(a) is int and type(b) is int:
        q = abs(a) // abs(b)
        return q if (a >= 0) == (b >= 0) else -q
    return a / b


@OVER.form(A, B, gives=["ENTIER|FLOTTANT"])
def _over(ctx: Context, a: Any, b: Any) -> Any:
    if b == 0:
        ctx.fail(26, "division by zero", at="b")
    return _in_range(ctx, "/", a, b, quotient(a, b))


@POWER.form(A, B, gives=["ENTIER|FLOTTANT"])
def _power(ctx: Context, a: Any, b: Any) -> Any:
    if a == 0 and b < 0:
        ctx.fail(26, "zero to a negative power", at="a")
    if type(b) is float and a < 0:
        hint = "an ENTIER exponent is allowed: {a} ** {whole}" if b == int(b) else "ABS gives the absolute value"
        ctx.fail(213, "a real power of a negative number ({a} ** {b})", at="a", a=a, b=b, hint=hint, whole=int(b))
    if type(a) is int and type(b) is int and b > 0 and abs(a) > 1 and b * math.log2(abs(a)) > 100_000:
        ctx.fail(26, "{a} ** {b} is too large", at="b", a=a, b=b)
    try:
        return a**b
    except OverflowError:
        ctx.fail(26, "the result of {a} {symbol} {b} is too large for a FLOTTANT", at="b", a=a, b=b, symbol="**")


def _comparison(name: str, summary: str, holds: Callable[[Any, Any], bool]) -> Operator:
    op = infix(
        name,
        topic="logic",
        summary=summary,
        example=f"MESS (2 {name} 3.) ;",
        notice="Compares two numbers; the result is a LOGIQUE. With lists: does it hold for every value? "
        "MASQ tells for which ones.",
    )

    @op.form(A, B, gives=[LOGIQUE])
    def _compare(ctx: Context, a: Any, b: Any) -> bool:
        return holds(a, b)

    op.fast = holds
    return op


LESS = _comparison("<", "is less than", lambda a, b: a < b)
MORE = _comparison(">", "is greater than", lambda a, b: a > b)
LESS_EQUAL = _comparison("<EG", "is less than or equal to", lambda a, b: a <= b)
MORE_EQUAL = _comparison(">EG", "is greater than or equal to", lambda a, b: a >= b)

ENTI = operator(
    "ENTIER",
    topic="arithmetic",
    summary="make an ENTIER of a number or a word",
    notice="Truncates by default; 'PROC' rounds to the nearest (halves away from zero), 'INFE' down, "
    "'SUPE' up. A MOT is read as a number.",
    example="MESS (ENTI 'PROC' 2.5) (ENTI '12') ;",
    see=["FLOTTANT"],
)


def _parse(ctx: Context, word: str, kind: type) -> Any:
    try:
        return kind(word.strip().upper().replace("D", "E"))
    except ValueError:
        ctx.fail(26, "'{word}' is not a number", at="x", word=word)


@ENTI.form(Arg("x", NUMBER, "number"), Key(("TRONC", "PROC", "INFE", "SUPE"), "rounding", name="how"), gives=[ENTIER])
def _enti(ctx: Context, x: float, how: str | None) -> int:
    if not math.isfinite(x):
        ctx.fail(26, "{x} has no integer value", at="x", x=x)
    if how == "PROC":
        return math.floor(abs(x) + 0.5) * (1 if x >= 0 else -1)
    if how == "INFE":
        return math.floor(x)
    return math.ceil(x) if how == "SUPE" else int(x)


@ENTI.form(Arg("x", MOT, "text of a number"), gives=[ENTIER], last=True)
def _enti_word(ctx: Context, x: str) -> int:
    return int(_parse(ctx, x, float))


FLOT = operator(
    "FLOTTANT",
    topic="arithmetic",
    summary="make a FLOTTANT of a number or a word",
    notice="A MOT is read as a number.",
    example="MESS (FLOT 3) ;",
    see=["ENTIER"],
)


@FLOT.form(Arg("x", FLOTTANT, "number"), gives=[FLOTTANT])
def _flot(ctx: Context, x: float) -> float:
    return x


@FLOT.form(Arg("x", MOT, "text of a number"), gives=[FLOTTANT], last=True)
def _flot_word(ctx: Context, x: str) -> float:
    return float(_parse(ctx, x, float))


ABS = operator(
    "ABS",
    topic="arithmetic",
    summary="absolute value",
    notice="Keeps the type of its operand.",
    example="MESS (ABS -3) ;",
)


@ABS.form(Arg("x", NUMBER, "number"), gives=["ENTIER|FLOTTANT"])
def _abs(ctx: Context, x: Any) -> Any:
    return abs(x)


SIGN = operator(
    "SIGNE",
    topic="arithmetic",
    summary="sign of a number: -1, 0 or 1",
    notice="Keeps the type of its operand.",
    example="MESS (SIGN -3.5) ;",
)


@SIGN.form(Arg("x", NUMBER, "number"), gives=["ENTIER|FLOTTANT"])
def _sign(ctx: Context, x: Any) -> Any:
    return type(x)((x > 0) - (x < 0))


def _exact(function: Callable[[float], float], table: dict[float, float], period: float) -> Callable[[float], float]:
    def at_degrees(x: float) -> float:
        special = table.get(x % period)
        return special if special is not None else function(math.radians(x))

    return at_degrees


FUNCTIONS: dict[str, tuple[str, Callable[[float], float], Callable[[float], bool] | None]] = {
    "SIN": (
        "sine of an angle in degrees",
        _exact(math.sin, {0: 0.0, 30: 0.5, 90: 1.0, 150: 0.5, 180: 0.0, 210: -0.5, 270: -1.0, 330: -0.5}, 360.0),
        None,
    ),
    "COS": (
        "cosine of an angle in degrees",
        _exact(math.cos, {0: 1.0, 60: 0.5, 90: 0.0, 120: -0.5, 180: -1.0, 240: -0.5, 270: 0.0, 300: 0.5}, 360.0),
        None,
    ),
    "TAN": (
        "tangent of an angle in degrees",
        _exact(math.tan, {0: 0.0, 45: 1.0, 135: -1.0}, 180.0),
        lambda x: x % 180.0 != 90.0,
    ),
    "ASIN": ("angle in degrees whose sine is given", lambda x: math.degrees(math.asin(x)), lambda x: abs(x) <= 1),
    "ACOS": ("angle in degrees whose cosine is given", lambda x: math.degrees(math.acos(x)), lambda x: abs(x) <= 1),
    "EXP": ("exponential", math.exp, lambda x: x < 709.78),
    "LOG": ("natural logarithm", math.log, lambda x: x > 0),
    "SINH": ("hyperbolic sine", math.sinh, lambda x: abs(x) < 710),
    "COSH": ("hyperbolic cosine", math.cosh, lambda x: abs(x) < 710),
    "TANH": ("hyperbolic tangent", math.tanh, None),
    "ASIH": ("inverse of the hyperbolic sine", math.asinh, None),
    "ACOH": ("inverse of the hyperbolic cosine", math.acosh, lambda x: x >= 1),
    "ATAH": ("inverse of the hyperbolic tangent", math.atanh, lambda x: abs(x) < 1),
    "ERF": ("error function", math.erf, None),
    "ERFC": ("complementary error function", math.erfc, None),
}


def _function(
    name: str, summary: str, function: Callable[[float], float], allowed: Callable[[float], bool] | None
) -> Operator:
    op = operator(
        name,
        topic="arithmetic",
        summary=summary,
        notice=f"{summary[0].upper()}{summary[1:]}, for a number, term by term for lists and fields.",
        example=f"MESS ({name} {1.5 if name == 'ACOH' else 0.5}) ;",
    )

    @op.form(Arg("x", FLOTTANT, "number"), gives=[FLOTTANT])
    def _apply(ctx: Context, x: float) -> float:
        if allowed is not None and not allowed(x):
            ctx.fail(26, "{x} is outside the range of {name}", at="x", x=x, name=name)
        return function(x)

    return op


for _name, (_summary, _fn, _allowed) in FUNCTIONS.items():
    _function(_name, _summary, _fn, _allowed)

ATG = operator(
    "ATG",
    topic="arithmetic",
    summary="arc tangent in degrees",
    notice="`ATG y x` is the angle of the direction (x, y), `ATG y` that of (1, y).",
    example="MESS (ATG 1. 1.) ;",
)


@ATG.form(Arg("y", FLOTTANT, "ordinate"), Arg("x", FLOTTANT, "abscissa", optional=True), gives=[FLOTTANT])
def _atg(ctx: Context, y: float, x: float | None) -> float:
    return math.degrees(math.atan2(y, 1.0 if x is None else x))


def _extreme(name: str, summary: str, choose: Callable[..., Any]) -> Operator:
    op = operator(
        name,
        topic="arithmetic",
        summary=summary,
        example=f"MESS ({name[:4]} 3 7 5) ;",
        notice=(
            "Of numbers, lists (their values) or fields (their values); with 'ABS' absolute values are compared. "
            "'AVEC' and 'SANS' with a LISTMOTS keep or drop components of a field."
        ),
    )

    @op.form(Arg("x", NUMBER, "numbers", many=True), Key("ABS", "compare absolute values"), gives=["ENTIER|FLOTTANT"])
    def _of_numbers(ctx: Context, x: list[Any], abs: bool) -> Any:
        values = [-v if abs and v < 0 else v for v in x]
        return choose(values) if all(type(v) is int for v in values) else float(choose(values))

    return op


MAXI = _extreme("MAXIMUM", "largest value", max)
MINI = _extreme("MINIMUM", "smallest value", min)
