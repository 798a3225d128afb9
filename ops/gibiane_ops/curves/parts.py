"""Curves: EVOL 'MANU', what EXTR takes from an EVOLUTIO, IPOL, and the operators of lists on ordinates."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, Refused, extend, operator
from gibiane.values import ENTIER, EVOLUTIO, FLOTTANT, LISTENTI, LISTMOTS, LISTREEL, LOGIQUE, MOT
from gibiane_ops.kernels import interpolation
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.functions import FUNCTIONS
from gibiane_ops.values.evolution import NAME_LENGTH, Curve, Evolution
from gibiane_ops.values.listes import AnyList, ListEnti, ListMots, ListReel, items_of, like
from gibiane_ops.values.maillage import COLOURS

LISTS = (LISTREEL, LISTENTI, LISTMOTS)
KINDS = {LISTREEL: "REEL", LISTENTI: "ENTI", LISTMOTS: "MOTS"}
NUMBERS = (ENTIER, FLOTTANT)
CURVES = Arg("curves", EVOLUTIO, "curves")

EVOL = operator(
    "EVOLUTION",
    topic="lists",
    summary="a curve from two lists, or from a field along a line",
    notice="'MANU': abscissae and ordinates, two lists of the same length, each with a name before it if "
    "wanted; 'LEGE' gives a title, a colour may stand first. 'CHPO': a component along a line.",
    example="E = EVOL 'ROUG' 'MANU' 'TIME' (PROG 0. 1. 2.) 'LOAD' (PROG 0. 5. 7.) ; LIST E ;",
    see=["DESSIN", "EXTRAIRE", "IPOL"],
)


@EVOL.stream(
    Key("MANU", "from two lists"),
    Key("TYPE", "type of the curve", Arg("type", MOT)),
    Key("LEGE", "title", Arg("title", MOT)),
    gives=[EVOLUTIO],
    syntax="(colour:MOT) 'MANU' ('TYPE' type:MOT) ('LEGE' title:MOT) (namex:MOT) x:LIST (namey:MOT) y:LIST",
)
def _manual(ctx: Context, q: Operands) -> Any:
    words = [v for v in q.values if isinstance(v, str)]
    if words[:1] != ["MANU"] and words[1:2] != ["MANU"]:
        return Refused
    colour = (q.read_keyword(COLOURS) or "") if words[0] != "MANU" else _current_colour(ctx)
    q.need_keyword(["MANU"])
    kind, title = None, ""
    while word := q.read_keyword(["TYPE", "LEGENDE"]):
        if word == "TYPE":
            kind = q.need(MOT, "the type of the curve")
        else:
            title = q.need(MOT, "the title")
    x_name, x = _axis(q, "the abscissae")
    y_name, y = _axis(q, "the ordinates")
    if len(x) != len(y):
        ctx.fail(217, "{left} abscissae and {right} ordinates", left=len(x), right=len(y))
    return Evolution([Curve(x, y, x_name, y_name, title, colour, kind or KINDS[y.type_name])])


def _current_colour(ctx: Context) -> str:
    return str(ctx.session.options.get("COUL") or "DEFA")[:4]


def _axis(q: Operands, what: str) -> tuple[str, AnyList]:
    name = q.read(MOT) if q.values and isinstance(q.values[0], str) else None
    values = q.need(LISTS, what)
    return (name or "")[:NAME_LENGTH].rstrip(), values


# -- EXTR ---------------------------------------------------------------------------------------------------

EXTR = extend("EXTR")
NUMBER = Arg("n", ENTIER, "number of the curve", optional=True)


def _curve(ctx: Context, curves: Evolution, n: int | None) -> Curve:
    number = 1 if n is None else n
    if not 1 <= number <= len(curves.curves):
        ctx.fail(
            1068,
            "there is no curve {number}: this object has {size}",
            at="curves",
            number=number,
            size=len(curves.curves),
        )
    return curves.curves[number - 1]


@EXTR.form(
    CURVES,
    Key(("ABSC", "ORDO", "LEGX", "LEGY", "LEGE"), "what to take", NUMBER, name="what", required=True),
    gives=["LISTREEL|MOT"],
)
def _part(ctx: Context, curves: Evolution, what: tuple[str, int | None]) -> Any:
    curve = _curve(ctx, curves, what[1])
    return {"ABSC": curve.x, "ORDO": curve.y, "LEGX": curve.x_name, "LEGY": curve.y_name, "LEGE": curve.title}[what[0]]


@EXTR.form(CURVES, Key("COUL", "their colours", required=True), NUMBER, gives=["LISTMOTS|MOT"])
def _colours(ctx: Context, curves: Evolution, coul: bool, n: int | None) -> Any:
    return ListMots([c.colour for c in curves.curves]) if n is None else _curve(ctx, curves, n).colour


@EXTR.form(
    CURVES, Key("COUR", "some of the curves", Arg("which", (ENTIER, LISTENTI, MOT)), required=True), gives=[EVOLUTIO]
)
def _some(ctx: Context, curves: Evolution, cour: int | ListEnti | str) -> Evolution:
    if isinstance(cour, str):
        name = cour[:NAME_LENGTH].rstrip()
        found = [c for c in curves.curves if name in (c.x_name, c.y_name)]
        if not found:
            ctx.fail(21, "no curve has an axis named '{name}'", at="cour", name=name)
        return Evolution(found)
    return Evolution([_curve(ctx, curves, n) for n in ([cour] if isinstance(cour, int) else cour.values.tolist())])


@EXTR.form(CURVES, Key("PAS", "one point in so many", Arg("step", ENTIER), required=True), gives=[EVOLUTIO])
def _thinned(ctx: Context, curves: Evolution, pas: int) -> Evolution:
    if pas < 1:
        ctx.fail(36, "{count} is not an acceptable step", at="pas", count=pas)
    return Evolution([_kept(c, list(range(0, len(c.x), pas))) for c in curves.curves])


INDI = Key("INDI", "bounds are numbers of points")
ZERO = Key("ZERO", "abscissae start at 0 again")


@EXTR.form(
    CURVES,
    Key(("AVAN", "APRE"), "points up to, or from", name="side", required=True),
    INDI,
    ZERO,
    Arg("bound", NUMBERS, "abscissa, or number of the point"),
    gives=[EVOLUTIO],
)
def _side(ctx: Context, curves: Evolution, side: str, indi: bool, zero: bool, bound: Any) -> Evolution:
    low, high = (-np.inf, bound) if side == "AVAN" else (bound, np.inf)
    return _window(ctx, curves, low, high, indi, zero and side == "APRE")


@EXTR.form(
    CURVES,
    Key("COMP", "points between two bounds", required=True),
    INDI,
    ZERO,
    Arg("low", NUMBERS, "first"),
    Arg("high", NUMBERS, "last"),
    gives=[EVOLUTIO],
)
def _between(ctx: Context, curves: Evolution, comp: bool, indi: bool, zero: bool, low: Any, high: Any) -> Evolution:
    return _window(ctx, curves, low, high, indi, zero)


def _window(ctx: Context, curves: Evolution, low: float, high: float, by_number: bool, from_zero: bool) -> Evolution:
    found = []
    for curve, x, _ in _numeric(ctx, curves):
        place = np.arange(1, len(x) + 1) if by_number else x
        part = _kept(curve, np.flatnonzero((place >= low) & (place <= high)).tolist())
        if from_zero and len(part.x):
            part = replace(part, x=ListReel(items_of(part.x) - items_of(part.x)[0]))  # type: ignore[operator]
        found.append(part)
    return Evolution(found)


def _kept(curve: Curve, points: list[int]) -> Curve:
    x, y = items_of(curve.x), items_of(curve.y)
    return replace(curve, x=like(curve.x, [x[i] for i in points]), y=like(curve.y, [y[i] for i in points]))


def _numeric(ctx: Context, curves: Evolution, at: str = "curves") -> Iterator[tuple[Curve, Any, Any]]:
    """Yield each curve with its abscissae and ordinates as float64; fail for lists of words."""
    for number, curve in enumerate(curves.curves, 1):
        if isinstance(curve.x, ListMots) or isinstance(curve.y, ListMots):
            ctx.fail(21, "curve {number} is not made of numbers", at=at, number=number)
        yield curve, curve.x.values.astype(np.float64), curve.y.values.astype(np.float64)


@EXTR.form(CURVES, Arg("name", MOT, "name of an axis"), gives=[LISTREEL])
def _named(ctx: Context, curves: Evolution, name: str) -> AnyList:
    wanted = name[:NAME_LENGTH].rstrip()
    for curve in curves.curves:
        for label, values in ((curve.x_name, curve.x), (curve.y_name, curve.y)):
            if label == wanted:
                return values
    known = sorted({n for c in curves.curves for n in (c.x_name, c.y_name) if n})
    ctx.fail(
        7,
        "no axis is named '{name}'",
        at="name",
        name=wanted,
        known=", ".join(known),
        hint="the axes of these curves: {known}" if known else "'ABSC' and 'ORDO' take the lists of any curve",
    )


# -- IPOL ---------------------------------------------------------------------------------------------------

IPOL = operator(
    "IPOL",
    topic="lists",
    summary="value of a function given by points",
    notice="The function is an EVOLUTIO of one curve, or two LISTREEL (abscissae in order, ordinates): "
    "straight lines between its points, or with 'SPLI' a cubic spline, whose slopes at the ends "
    "'DGAU' and 'DDRO' may fix. Beyond the ends the end values hold. 'TOUS' gives all values of a "
    "line that turns back. A FLOTTANT gives a FLOTTANT, a LISTREEL a LISTREEL.",
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
    wanted = np.atleast_1d(np.asarray(x.values if isinstance(x, ListReel) else x, dtype=np.float64))
    try:
        found = interpolation.spline(wanted, xs, ys, dgau, ddro) if spli else interpolation.linear(wanted, xs, ys)
    except BadValue as failure:
        ctx.fail(
            249,
            "the abscissae of the function must be in order, and {value} is not",
            value=failure.value,
            hint="'TOUS' gives all values of a line that turns back",
        )
    return ListReel(found) if isinstance(x, ListReel) else float(found[0])


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
        _, xs, ys = next(_numeric(ctx, curves))
        return _interpolated(ctx, x, xs, ys, spli, dgau, ddro, tous)


_interpolating(FLOTTANT)
_interpolating(LISTREEL)

# -- operators of lists, on the ordinates ----------------------------------------------------------------------


def _with_ordinates(ctx: Context, curves: Evolution, function: Callable[[Any], NDArray[Any]]) -> Evolution:
    return Evolution([replace(c, y=ListReel(function(y))) for c, _, y in _numeric(ctx, curves)])


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
        for _, _, y in _numeric(ctx, b, "b"):
            check(ctx, y, "b")
        return _with_ordinates(ctx, b, lambda y: np.asarray(compute(a, y)))


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
    for (curve, x, y), (_, other_x, other_y) in zip(_numeric(ctx, a, "a"), _numeric(ctx, b, "b"), strict=True):
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
        for _, _, y in _numeric(ctx, curves):
            if allowed is not None and not np.all(allowed(y)):
                worst = float(y[int(np.flatnonzero(~allowed(y))[0])])
                ctx.fail(26, "{x} is outside the range of {name}", at="curves", x=worst, name=name)
        return _with_ordinates(ctx, curves, function)


for _name, (_fn, _allowed) in FUNCTIONS.items():
    _function(_name, _fn, _allowed)
_function("ABS", np.abs, None)


@extend("ET").form(Arg("a", EVOLUTIO, "curves"), Arg("b", EVOLUTIO, "curves"), gives=[EVOLUTIO])
def _joined(ctx: Context, a: Evolution, b: Evolution) -> Evolution:
    return Evolution([*a.curves, *b.curves])


@extend("VIDE").form(CURVES, gives=[LOGIQUE])
def _is_empty(ctx: Context, curves: Evolution) -> bool:
    return not curves.curves


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
    for curve, x, _ in _numeric(ctx, curves):
        key = np.abs(x) if abso else x
        points = np.argsort(-key if order == "DECR" else key, kind="stable")
        found.append(_kept(curve, points.tolist()))
    return Evolution(found)


def _extreme(name: str, pick: Callable[[Any], Any]) -> None:
    @extend(name).form(
        CURVES,
        Key("ABS", "largest absolute value"),
        gives=["ENTIER|LISTENTI", "FLOTTANT|LISTREEL", "FLOTTANT|LISTREEL"],
    )
    def _of_curves(ctx: Context, curves: Evolution, abs: bool) -> Any:
        at, xs, ys = [], [], []
        for _, x, y in _numeric(ctx, curves):
            if not len(y):
                ctx.fail(21, "an empty list has no extreme value", at="curves")
            i = int(pick(np.abs(y) if abs else y))
            at.append(i + 1)
            xs.append(float(x[i]))
            ys.append(float(y[i]))
        return (at[0], xs[0], ys[0]) if len(at) == 1 else (ListEnti(at), ListReel(xs), ListReel(ys))


_extreme("MAXI", np.argmax)
_extreme("MINI", np.argmin)
