"""Values of lists and parts of words are inserted, removed, replaced: INSE, ENLE, REMP."""

from __future__ import annotations

from typing import Any

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ANY, ENTIER, FLOTTANT, LISTENTI, LISTMOTS, LISTREEL, MOT, TABLE, Table, type_of
from gibiane_ops.lists.positions import position, positions
from gibiane_ops.values.listes import AnyList, ListEnti, ListMots, items_of, like

LISTS = (LISTREEL, LISTENTI, LISTMOTS)
ITEM_TYPES = {LISTREEL: FLOTTANT, LISTENTI: ENTIER, LISTMOTS: MOT}
EPSILON = 2.0**-50

NOCA = Key("NOCA", "capital and small letters are the same")


INSE = operator(
    "INSERER",
    topic="lists",
    summary="insert a value into a list",
    notice="The new list has the value at the position given; what stood there and behind moves on by one.",
    example="L = INSE (PROG 1. 3.) 2 2. ; LIST L ;",
    see=["ENLEVER", "REMPLACER", "ET"],
)
ENLE = operator(
    "ENLEVER",
    topic="lists",
    summary="a list without some of its values, a table without an index",
    notice="The positions, an ENTIER or a LISTENTI, count in the list as it is before. A TABLE with an index "
    "gives a copy without this entry.",
    example="L = ENLE (PROG 1. 2. 3.) 2 ; LIST L ;",
    see=["INSERER", "REMPLACER", "OUBLIER"],
)
REMP = operator(
    "REMPLACER",
    topic="lists",
    summary="replace values of a list, or parts of a word",
    notice="Directive: the list itself changes, under all its names. With a LISTENTI of positions every one "
    "gets the same value, or its own from a list of the same length. With words it is an operator: "
    "`REMP text old new` gives the text with every `old` replaced; two LISTMOTS replace several.",
    example="L = PROG 1. 2. 3. ; REMP L 2 5. ; LIST L ; MESS (REMP 'a-b' '-' '+') ;",
    see=["INSERER", "ENLEVER"],
)


def _editing(kind: str) -> None:
    """Declare INSE and REMP for one type of list."""
    values, item = Arg("values", kind, "list"), Arg("x", ITEM_TYPES[kind], "new value")

    @INSE.form(values, Arg("i", ENTIER, "its position"), item, gives=[kind])
    def _insert(ctx: Context, values: AnyList, i: int, x: Any) -> AnyList:
        at = position(ctx, i, len(values) + 1)
        items = list(items_of(values))
        return like(values, [*items[:at], x, *items[at:]])

    @REMP.form(values, Arg("i", ENTIER, "position"), item)
    def _replace(ctx: Context, values: AnyList, i: int, x: Any) -> None:
        _put(values, [position(ctx, i, len(values))], [x])

    if kind != LISTENTI:

        @REMP.form(values, Arg("i", LISTENTI, "positions"), item)
        def _replace_all(ctx: Context, values: AnyList, i: ListEnti, x: Any) -> None:
            _put(values, positions(ctx, i, len(values)), [x] * len(i))

        @REMP.form(values, Arg("i", LISTENTI, "positions"), Arg("x", kind, "new values"))
        def _replace_each(ctx: Context, values: AnyList, i: ListEnti, x: AnyList) -> None:
            _put_each(ctx, values, i, x)


@REMP.form(Arg("values", LISTENTI, "list"), Arg("i", LISTENTI, "positions"), Arg("x", LISTENTI, "new values"))
def _replace_integers(ctx: Context, values: ListEnti, i: ListEnti, x: ListEnti) -> None:
    _put_each(ctx, values, i, x)


@REMP.form(Arg("values", LISTENTI, "list"), Arg("i", LISTENTI, "positions"), Arg("x", ENTIER, "new value"))
def _replace_all_integers(ctx: Context, values: ListEnti, i: ListEnti, x: int) -> None:
    _put(values, positions(ctx, i, len(values)), [x] * len(i))


for _kind in LISTS:
    _editing(_kind)


def _put_each(ctx: Context, values: AnyList, i: ListEnti, x: AnyList) -> None:
    if len(i) != len(x):
        ctx.fail(217, "{positions} positions and {values} values", at="x", positions=len(i), values=len(x))
    _put(values, positions(ctx, i, len(values)), list(items_of(x)))


def _put(values: AnyList, at: list[int], items: list[Any]) -> None:
    """Give a list its new content; the object stays the same for all who hold it."""
    content = list(items_of(values))
    for k, item in zip(at, items, strict=True):
        content[k] = item
    values.replace(content)


@REMP.form(
    Arg("text", MOT, "text"), Arg("old", MOT, "what to replace"), Arg("new", MOT, "by what"), gives=[MOT], last=True
)
def _replace_letters(ctx: Context, text: str, old: str, new: str) -> str:
    return text.replace(old, new) if old else text


@REMP.form(
    Arg("text", MOT, "text"),
    Arg("old", LISTMOTS, "what to replace"),
    Arg("new", LISTMOTS, "by what"),
    gives=[MOT],
    last=True,
)
def _replace_words(ctx: Context, text: str, old: ListMots, new: ListMots) -> str:
    if len(old) != len(new):
        ctx.fail(
            217, "{positions} words to replace and {values} replacements", at="new", positions=len(old), values=len(new)
        )
    for before, after in zip(old.words, new.words, strict=True):
        text = text.replace(before, after) if before else text
    return text


@ENLE.form(Arg("values", LISTS, "list"), Arg("i", ENTIER, "position"), gives=["LISTREEL|LISTENTI|LISTMOTS"])
def _remove(ctx: Context, values: AnyList, i: int) -> AnyList:
    return _without(values, {position(ctx, i, len(values))})


@ENLE.form(Arg("values", (LISTREEL, LISTMOTS), "list"), Arg("i", LISTENTI, "positions"), gives=["LISTREEL|LISTMOTS"])
@ENLE.form(Arg("values", LISTENTI, "list"), Arg("i", LISTENTI, "positions"), gives=[LISTENTI])
def _remove_several(ctx: Context, values: AnyList, i: ListEnti) -> AnyList:
    return _without(values, set(positions(ctx, i, len(values))))


def _without(values: AnyList, dropped: set[int]) -> AnyList:
    return like(values, [x for k, x in enumerate(items_of(values)) if k not in dropped])


@ENLE.form(Arg("t", TABLE, "table"), Arg("index", ANY, "index"), gives=[TABLE])
def _removeposition(ctx: Context, t: Table, index: Any) -> Table:
    if not t.has(index):
        shown = index if isinstance(index, str | int | float) else type_of(index)
        ctx.fail(171, "the table has no index {index}", at="index", index=shown)
    other = t.copy()
    other.remove(index)
    return other
