"""What EXTR takes from curves: lists, names, colours, some curves, some of their points."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend
from gibiane.values import ENTIER, EVOLUTIO, FLOTTANT, LISTENTI, LISTREEL, MOT
from gibiane_ops.curves.reading import CURVES, kept, numeric
from gibiane_ops.values.evolution import NAME_LENGTH, Curve, Evolution
from gibiane_ops.values.listes import AnyList, ListEnti, ListMots, ListReel, items_of

NUMBERS = (ENTIER, FLOTTANT)

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
    return Evolution([kept(c, list(range(0, len(c.x), pas))) for c in curves.curves])


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
    for curve, x, _ in numeric(ctx, curves):
        place = np.arange(1, len(x) + 1) if by_number else x
        part = kept(curve, np.flatnonzero((place >= low) & (place <= high)).tolist())
        if from_zero and len(part.x):
            part = replace(part, x=ListReel(items_of(part.x) - items_of(part.x)[0]))  # type: ignore[operator]
        found.append(part)
    return Evolution(found)


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
