"""Lists are read (EXTR), measured (DIME), joined (ET) and copied (COPI)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gibiane.binding import Operands
from gibiane.forms import Arg
from gibiane.registry import Context, Refused, extend, operator
from gibiane.values import (
    ENTIER,
    FLOTTANT,
    LISTENTI,
    LISTMOTS,
    LISTREEL,
    MOT,
    Table,
    type_of,
)
from gibiane_ops.lists.positions import position, positions
from gibiane_ops.values.listes import AnyList, ListEnti, ListMots, ListReel, items_of, like

LISTS = (LISTREEL, LISTENTI, LISTMOTS)
NUMBERS = (ENTIER, FLOTTANT)
MAX_ITEMS = 50_000_000

EXTR = operator(
    "EXTRAIRE",
    topic="values",
    terminal=True,
    summary="part of an object: value of a list, letters of a word, component or support of a field",
    notice="A list with an ENTIER gives one value, with a LISTENTI the list of several; the first has number 1. A MOT "
    "with one ENTIER gives the letters from there on, with two those between (both included). A MOT alone gives a "
    "table of the objects of this type. Nothing can follow it in a chain: put it between parentheses.",
    example="L = PROG 2. 4. 6. ; MESS (EXTR L 2) (EXTR 'abcdef' 3 4) ;",
    see=["EXCO", "ENLEVER", "DIMENSION"],
)


@EXTR.form(Arg("values", LISTS, "list"), Arg("i", ENTIER, "number of the value"), gives=["FLOTTANT|ENTIER|MOT"])
def _item(ctx: Context, values: AnyList, i: int) -> Any:
    return values.item(position(ctx, i, len(values)))


@EXTR.form(Arg("values", (LISTREEL, LISTMOTS), "list"), Arg("i", LISTENTI, "numbers"), gives=["LISTREEL|LISTMOTS"])
@EXTR.form(Arg("values", LISTENTI, "list"), Arg("i", LISTENTI, "numbers of the values"), gives=[LISTENTI])
def _items(ctx: Context, values: AnyList, i: ListEnti) -> AnyList:
    items = items_of(values)
    return like(values, [items[k] for k in positions(ctx, i, len(values))])


@EXTR.stream(syntax="word:MOT (i:ENTIER (j:ENTIER) | i:LISTENTI)", gives=["MOT|TABLE"], last=True)
def _letters(ctx: Context, q: Operands) -> Any:
    if not q.values or any(type_of(v) not in (MOT, ENTIER, LISTENTI) for v in q.values):
        return Refused
    at = q.first_word()
    if at < 0:
        return Refused
    ctx.places["i"] = q.nodes[-1]
    word = q.values.pop(at)
    del q.nodes[at]
    numbers, first, last = q.read(LISTENTI), q.read(ENTIER), q.read(ENTIER)
    if numbers is not None:
        return "".join(word[k] for k in positions(ctx, numbers, len(word)))
    if first is None:
        return _named(ctx, word)
    start = position(ctx, first, len(word))
    return word[start:] if last is None else word[start : position(ctx, last, len(word)) + 1]


def _named(ctx: Context, kind: str) -> Table:
    found = Table()
    objects = [v for name, v in ctx.session.names().items() if type_of(v)[:8] == kind[:8].rstrip() and name[0] != "&"]
    for number, value in enumerate(objects, 1):
        found.set(number, value)
    return found


@extend("DIME").form(Arg("values", LISTS, "list"), gives=[ENTIER])
def _size(ctx: Context, values: AnyList) -> int:
    return len(values)


@extend("COPI").form(Arg("values", LISTS, "list"), gives=["LISTREEL|LISTENTI|LISTMOTS"])
def _copy(ctx: Context, values: AnyList) -> AnyList:
    return like(values, items_of(values))


# the types that two operands may have, and what they join to
JOINED: tuple[tuple[set[str], Callable[[Any], AnyList]], ...] = (
    ({LISTENTI, ENTIER}, ListEnti),
    ({LISTREEL, FLOTTANT, ENTIER}, ListReel),
    ({LISTMOTS, MOT}, ListMots),
)


@extend("ET").stream(
    syntax="a:LISTREEL|FLOTTANT b:LISTREEL|FLOTTANT | LISTENTI, ENTIER | LISTMOTS, MOT",
    gives=["LISTREEL|LISTENTI|LISTMOTS"],
)
def _join(ctx: Context, q: Operands) -> Any:
    """Join two lists, a list and a value, or two numbers, in the order in which they stand."""
    if len(q.values) < 2:
        return Refused
    a, b = q.values[:2]
    kinds = {type_of(a), type_of(b)}
    make = next((make for accepted, make in JOINED if kinds <= accepted and kinds != {MOT}), None)
    if make is None:
        return Refused
    del q.values[:2], q.nodes[:2]
    return make([*_several(a), *_several(b)])


def _several(value: Any) -> Any:
    return items_of(value) if isinstance(value, AnyList) else (value,)
