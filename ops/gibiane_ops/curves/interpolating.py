"""IPOL: the value of a function given by points, by a curve or by a table of results."""

from __future__ import annotations

from bisect import bisect_left
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, LISTREEL, MCHAML, TABLE, Table
from gibiane_ops.curves.reading import CURVES, numeric
from gibiane_ops.kernels import interpolation
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.values.algebra import Field, added, mapped
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.evolution import Evolution
from gibiane_ops.values.listes import ListReel

IPOL = operator(
    "IPOL",
    topic="lists",
    summary="value of a function given by points",
    notice="The function is an EVOLUTIO of one curve, or two LISTREEL (abscissae in order, ordinates): "
    "straight lines between its points, or with 'SPLI' a cubic spline, whose slopes at the ends "
    "'DGAU' and 'DDRO' may fix. Beyond the ends the end values hold. 'TOUS' gives all values of a "
    "line that turns back. A FLOTTANT gives a FLOTTANT, a LISTREEL a LISTREEL, a field the field of the values of the "
    "function. `IPOL T x`: the field at the time x of a table of subtype RESULTAT, whose indices are times and whose "
    "values are fields.",
    example="MESS (IPOL 1.5 (PROG 0. 1. 2.) (PROG 0. 10. 40.)) ;",
    see=["EVOLUTION"],
)
SPLI = Key("SPLI", "cubic spline")
DGAU = Key("DGAU", "slope at the left end", Arg("slope", FLOTTANT))
DDRO = Key("DDRO", "slope at the right end", Arg("slope", FLOTTANT))
ALL = Key("TOUS", "all values of a line that turns back")


def _interpolated(
    ctx: Context, x: Any, xs: Any, ys: Any, spli: bool, dgau: float | None, ddro: float | None, tous: bool
) -> Any:
    if len(xs) != len(ys):
        ctx.fail(217, "{left} abscissae and {right} ordinates", left=len(xs), right=len(ys))
    if tous:
        if not isinstance(x, float):
            ctx.fail(37, "'TOUS' wants a FLOTTANT to interpolate at", at="tous")
        return ListReel(interpolation.crossings(x, xs, ys))
    if len(xs) < 1 + spli:
        ctx.fail(21, "a function of {count} points cannot be interpolated", count=len(xs))

    def at(values: FloatArray) -> FloatArray:
        wanted = values.ravel()
        found = interpolation.spline(wanted, xs, ys, dgau, ddro) if spli else interpolation.linear(wanted, xs, ys)
        return found.reshape(values.shape)

    try:
        if isinstance(x, ChPoint | MChaml):
            return mapped(x, at)
        return ListReel(at(x.values)) if isinstance(x, ListReel) else float(at(np.array([x], np.float64))[0])
    except BadValue as failure:
        ctx.fail(
            249,
            "the abscissae of the function must be in order, and {value} is not",
            value=failure.value,
            hint="'TOUS' gives all values of a line that turns back",
        )


def _interpolating(kind: str) -> None:
    @IPOL.form(
        Arg("x", kind, "where"),
        Arg("xs", LISTREEL, "abscissae"),
        Arg("ys", LISTREEL, "ordinates"),
        SPLI,
        DGAU,
        DDRO,
        ALL,
        gives=[kind],
    )
    def _of_lists(
        ctx: Context, x: Any, xs: ListReel, ys: ListReel, spli: bool, dgau: float | None, ddro: float | None, tous: bool
    ) -> Any:
        return _interpolated(ctx, x, xs.values, ys.values, spli, dgau, ddro, tous)

    @IPOL.form(Arg("x", kind, "where"), CURVES, SPLI, DGAU, DDRO, ALL, gives=[kind])
    def _of_curve(
        ctx: Context, x: Any, curves: Evolution, spli: bool, dgau: float | None, ddro: float | None, tous: bool
    ) -> Any:
        if len(curves.curves) != 1:
            ctx.fail(
                25,
                "one curve is wanted, and this object has {count}",
                at="curves",
                count=len(curves.curves),
                hint="EXTR E 'COUR' 1 takes the first",
            )
        _, xs, ys = next(numeric(ctx, curves))
        return _interpolated(ctx, x, xs, ys, spli, dgau, ddro, tous)


for _kind in (FLOTTANT, LISTREEL, CHPOINT, MCHAML):
    _interpolating(_kind)


@IPOL.form(Arg("t", TABLE, "fields by their times"), Arg("x", FLOTTANT, "time"), gives=["CHPOINT|MCHAML"])
def _of_table(ctx: Context, t: Table, x: float) -> Any:
    states = sorted(((float(i), v) for i, v in t.entries.values() if type(i) is float), key=lambda pair: pair[0])
    if not states or any(not isinstance(v, ChPoint | MChaml) or type(v) is not type(states[0][1]) for _, v in states):
        ctx.fail(
            21,
            "the table must hold fields of one type, at indices that are FLOTTANT",
            at="t",
            hint="T = TABL 'RESULTAT' ; T . 0. = U0 ; T . 1.5 = U1 ;",
        )
    times = [time for time, _ in states]
    after = bisect_left(times, x)
    if after == 0 or after == len(states):
        return states[min(after, len(states) - 1)][1]
    share = (x - times[after - 1]) / (times[after] - times[after - 1])
    before, later = _scaled(states[after - 1][1], 1 - share), _scaled(states[after][1], share)
    return added(before, later)


def _scaled(field: Field, factor: float) -> Field:
    return mapped(field, lambda values: np.asarray(factor * values, np.float64))
