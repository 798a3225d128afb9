"""Arithmetic of nodal and element fields: + - * / ** ET, and the functions of one variable."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gibiane.forms import Arg
from gibiane.registry import Context, Operator, extend
from gibiane.values import CHPOINT, ENTIER, FLOTTANT, LISTMOTS, MCHAML
from gibiane_ops.kernels import functions
from gibiane_ops.kernels.powers import real_power, undefined
from gibiane_ops.values.algebra import Field, Incompatible, added, by_names, combined, joined, mapped, values_of
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.material import refused
from gibiane_ops.values.nodes import FloatArray

Number = int | float
OPERAND = (CHPOINT, MCHAML, ENTIER, FLOTTANT)
UFUNCS: dict[str, Callable[[FloatArray, Any], FloatArray]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
}


def _in_range(ctx: Context, compute: Callable[[], Field], *operands: Field | Number) -> Field:
    """Compute a field; fail where a value is too large though the operands are finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        found = compute()
    bad = int((~np.isfinite(values_of(found))).sum())
    if bad and all(np.isfinite(x if isinstance(x, Number) else values_of(x)).all() for x in operands):
        ctx.fail(26, "{count} values of the result are too large for a FLOTTANT", at="b", count=bad)
    return found


def _two_fields(ctx: Context, symbol: str, a: Field, b: Field, names: list[Any]) -> Field:
    if symbol == "/" and not len(values_of(b)):
        ctx.fail(26, "the divisor is an empty field", at="b")
    try:
        if symbol in "+-":
            return added(a, b, 1.0 if symbol == "+" else -1.0)
        if symbol == "/":
            _refuse_zeros(ctx, b, "b", [n for each in names[1:2] for n in each.words] or None)
        if not names:
            return combined(a, b, UFUNCS[symbol])
        if len(names) != 3 or len({len(each.words) for each in names}) != 1:
            ctx.fail(
                212,
                "three LISTMOTS of one length are wanted: components of the first field, of the second, of the result",
                at="names",
            )
        return by_names(a, b, UFUNCS[symbol], *(each.words for each in names))
    except Incompatible as failure:
        refused(ctx, failure, "b")


def _refuse_zeros(ctx: Context, field: Field, at: str, names: list[str] | None = None) -> None:
    zeros = int((values_of(field, names) == 0).sum())
    if zeros:
        ctx.fail(26, "division by zero: {zeros} values of the divisor are zero", at=at, zeros=zeros)


def _field_and_number(ctx: Context, symbol: str, a: Field | Number, b: Field | Number) -> Field:
    if isinstance(a, Number) == isinstance(b, Number):
        ctx.fail(
            196,
            "a nodal field and an element field cannot be put together",
            at="b",
            hint="CHAN makes one from the other",
        )
    if isinstance(b, ChPoint | MChaml):
        if symbol == "/":
            _refuse_zeros(ctx, b, "b")
        return mapped(b, lambda v: UFUNCS[symbol](np.full_like(v, float(a)), v))  # type: ignore[arg-type]
    if symbol == "/" and b == 0:
        ctx.fail(26, "division by zero", at="b")
    return mapped(a, lambda v: UFUNCS[symbol](v, float(b)))  # type: ignore[arg-type]


def _arithmetic(symbol: str) -> None:
    op = extend(symbol)
    names = (
        []
        if symbol in "+-"
        else [Arg("names", LISTMOTS, "components: of a, of b, of the result", many=True, optional=True)]
    )

    def of_fields(ctx: Context, a: Field, b: Field) -> Field:
        return _in_range(ctx, lambda: _two_fields(ctx, symbol, a, b, []), a, b)

    def by_components(ctx: Context, a: Field, b: Field, names: list[Any]) -> Field:
        return _in_range(ctx, lambda: _two_fields(ctx, symbol, a, b, names), a, b)

    for kind in (CHPOINT, MCHAML):
        declare = op.form(Arg("a", kind, "field"), Arg("b", kind, "field"), *names, gives=[kind])
        declare(by_components if names else of_fields)

    @op.form(Arg("a", OPERAND, "field or number"), Arg("b", OPERAND, "field or number"), gives=["CHPOINT|MCHAML"])
    def _with_number(ctx: Context, a: Field | Number, b: Field | Number) -> Field:
        return _in_range(ctx, lambda: _field_and_number(ctx, symbol, a, b), a, b)


for _symbol in UFUNCS:
    _arithmetic(_symbol)


@extend("**").form(
    Arg("a", OPERAND, "field or number"), Arg("b", OPERAND, "exponent, field or number"), gives=["CHPOINT|MCHAML"]
)
def _power(ctx: Context, a: Field | Number, b: Field | Number) -> Field:
    if isinstance(a, ChPoint | MChaml) and isinstance(b, int | float):
        _check_power(ctx, values_of(a), b)
        return _in_range(ctx, lambda: mapped(a, lambda v: real_power(v, b)), a, b)
    if isinstance(b, ChPoint | MChaml) and isinstance(a, int | float):
        _check_power(ctx, a, values_of(b))
        return _in_range(ctx, lambda: mapped(b, lambda v: real_power(a, v)), a, b)
    ctx.fail(21, "a field and a number are wanted", at="b")


def _check_power(ctx: Context, base: FloatArray | Number, exponent: FloatArray | Number) -> None:
    negative = int(undefined(base, exponent).sum())
    if negative:
        ctx.fail(
            213,
            "a real power of {count} negative values",
            at="a",
            count=negative,
            hint="whole powers and odd roots of it exist: ** 2, ** (1./3.)",
        )
    zeros = int(np.sum((np.asarray(base) == 0) & (np.asarray(exponent) < 0)))
    if zeros:
        ctx.fail(26, "zero to a negative power", at="a")


UNION = extend("ET")


@UNION.form(
    Arg("a", CHPOINT, "field"),
    Arg("b", CHPOINT, "field"),
    Arg("more", CHPOINT, "fields", many=True, optional=True),
    gives=[CHPOINT],
)
def _union(ctx: Context, a: Field, b: Field, more: list[Field]) -> Field:
    total = added(a, b)
    for each in more:
        total = added(total, each)
    return total


@UNION.form(
    Arg("a", MCHAML, "field"),
    Arg("b", MCHAML, "field"),
    Arg("more", MCHAML, "fields", many=True, optional=True),
    gives=[MCHAML],
)
def _union_of_elements(ctx: Context, a: MChaml, b: MChaml, more: list[MChaml]) -> MChaml:
    try:
        total = joined(a, b)
        for each in more:
            total = joined(total, each)
    except Incompatible as failure:
        refused(ctx, failure, "b")
    return total


@extend("ATG").form(Arg("y", CHPOINT, "ordinates"), Arg("x", CHPOINT, "abscissae"), gives=[CHPOINT])
def _angle(ctx: Context, y: ChPoint, x: ChPoint) -> Field:
    return _angles(ctx, y, x)


@extend("ATG").form(Arg("y", MCHAML, "ordinates"), Arg("x", MCHAML, "abscissae"), gives=[MCHAML])
def _angle_of_elements(ctx: Context, y: MChaml, x: MChaml) -> Field:
    return _angles(ctx, y, x)


def _angles(ctx: Context, y: Field, x: Field) -> Field:
    """Return the angles of directions, in degrees."""
    try:
        return combined(y, x, lambda a, b: np.degrees(np.arctan2(a, b)))
    except Incompatible as failure:
        refused(ctx, failure, "x")


FUNCTIONS: dict[str, tuple[Callable[[FloatArray], FloatArray], Callable[[FloatArray], Any] | None]] = {
    "ABS": (np.abs, None),
    "SIGNE": (np.sign, None),
    "ATG": (lambda v: np.degrees(np.arctan(v)), None),
    **functions.FUNCTIONS,
}


def _function(
    op: Operator, function: Callable[[FloatArray], FloatArray], allowed: Callable[[FloatArray], Any] | None
) -> None:
    @op.form(Arg("x", (CHPOINT, MCHAML), "field"), gives=["CHPOINT|MCHAML"])
    def _apply(ctx: Context, x: Field) -> Field:
        if allowed is not None:
            outside = int((~allowed(values_of(x))).sum())
            if outside:
                ctx.fail(
                    26,
                    "{count} values of the field are outside the range of {name}",
                    at="x",
                    count=outside,
                    name=op.name,
                )
        return mapped(x, function)


for _name, (_fn, _allowed) in FUNCTIONS.items():
    _function(extend(_name), _fn, _allowed)
