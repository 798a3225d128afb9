"""Lists of objects: SUIT, ENUM, and what other operators do with LISTCHPO and LISTOBJE."""

from __future__ import annotations

from typing import Any

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, Refused, extend, operator
from gibiane.values import (
    ANY,
    CHPOINT,
    ENTIER,
    FLOTTANT,
    LISTCHPO,
    LISTENTI,
    LISTOBJE,
    LOGIQUE,
    MOT,
    TABLE,
    Table,
    type_of,
)
from gibiane_ops.lists.positions import position, positions
from gibiane_ops.values.listes import ListEnti
from gibiane_ops.values.suites import ListChpo, ListObje, ObjectList

LISTS = (LISTCHPO, LISTOBJE)
VALUES = Arg("values", LISTS, "list of objects")

SUIT = operator(
    "SUITE",
    topic="lists",
    summary="make a list of nodal fields",
    notice="The fields in the order given. EXTR takes one (by its number from 1) or several out, ET joins, INSE, ENLE "
    "and REMP edit, EVOL 'TEMP' draws what happens at a point.",
    example="OPTI DIME 2 ; P = 0. 1. ; U = MANU 'CHPO' P 'T' 1. ; L = SUIT U (2. * U) ; MESS (DIME L) ;",
    see=["ENUMERER", "EVOLUTION", "EXTRAIRE"],
)


@SUIT.form(Arg("fields", CHPOINT, "fields", many=True, optional=True), gives=[LISTCHPO])
def _suit(ctx: Context, fields: list[Any]) -> ListChpo:
    return ListChpo(fields)


ENUM = operator(
    "ENUMERER",
    topic="lists",
    summary="make a list of objects of one type",
    notice="The objects in the order given; `n * x` repeats x n times; 'TABL' takes those of a table with integer "
    "indices, in their order. A LISTOBJE holds anything but words, reals and logicals.",
    example="OPTI DIME 2 ; P = 0. 1. ; Q = 2. 3. ; L = ENUM P Q ; MESS (COOR 1 (EXTR L 2)) ;",
    see=["SUITE", "EXTRAIRE"],
)
NOT_OBJECTS = (FLOTTANT, LOGIQUE, MOT)


def _alike(ctx: Context, objects: list[Any], at: str) -> ListObje:
    """Return the list of some objects, all of one type."""
    kinds = list(dict.fromkeys(type_of(each) for each in objects))
    if len(kinds) > 1:
        ctx.fail(
            21, "a LISTOBJE holds objects of one type: {first} and {second} differ", at=at, first=kinds[0],
            second=kinds[1],
        )  # fmt: skip
    if kinds and kinds[0] in NOT_OBJECTS:
        ctx.fail(
            39, "a {type} cannot stand in a LISTOBJE", at=at, type=kinds[0],
            hint="PROG, LECT and MOTS make lists of reals, integers and words",
        )  # fmt: skip
    return ListObje(objects)


@ENUM.form(Key("TABL", "objects of a table with integer indices", Arg("t", TABLE), required=True), gives=[LISTOBJE])
def _of_table(ctx: Context, tabl: Table) -> ListObje:
    numbered = [(i, v) for i, v in tabl.entries.values() if type(i) is int]
    return _alike(ctx, [v for _, v in sorted(numbered, key=lambda pair: pair[0])], "tabl")


@ENUM.stream(syntax="x... (n * x)", gives=[LISTOBJE], last=True)
def _enum(ctx: Context, q: Operands) -> ListObje:
    objects: list[Any] = []
    while q.values:
        value, node = q.values[0], q.nodes[0]
        ctx.places["x"] = node
        if value == "*" and objects and type(objects[-1]) is int:
            count = objects.pop()
            del q.values[0], q.nodes[0]
            if count < 0:
                ctx.fail(36, "{count} is not an acceptable number of values", at="x", count=count)
            repeated, _ = q.take((ANY,))
            objects.extend([repeated] * count)
            continue
        if isinstance(value, str) and q.is_operator_word(0):
            break
        del q.values[0], q.nodes[0]
        objects.append(value)
        if len(objects) > 1 and type_of(objects[0]) != type_of(value) and not (q.values and q.values[0] == "*"):
            _alike(ctx, objects, "x")
    return _alike(ctx, objects, "x")


@extend("EXTR").form(VALUES, Arg("i", ENTIER, "number of the object"), gives=["CHPOINT|object"])
def _item(ctx: Context, values: ObjectList, i: int) -> Any:
    return values.objects[position(ctx, i, len(values))]


@extend("EXTR").form(VALUES, Arg("i", LISTENTI, "numbers of the objects"), gives=["LISTCHPO|LISTOBJE"])
def _items(ctx: Context, values: ObjectList, i: ListEnti) -> ObjectList:
    return type(values)([values.objects[k] for k in positions(ctx, i, len(values))])


@extend("DIME").form(VALUES, gives=[ENTIER])
def _size(ctx: Context, values: ObjectList) -> int:
    return len(values)


@extend("COPI").form(VALUES, gives=["LISTCHPO|LISTOBJE"])
def _copy(ctx: Context, values: ObjectList) -> ObjectList:
    return type(values)(values.objects)


@extend("VIDE").form(VALUES, gives=[LOGIQUE])
def _is_empty(ctx: Context, values: ObjectList) -> bool:
    return not len(values)


@extend("ET").stream(syntax="a:LISTCHPO b:LISTCHPO|CHPOINT | a:LISTOBJE b:LISTOBJE|object", gives=["LISTCHPO|LISTOBJE"])
def _join(ctx: Context, q: Operands) -> Any:
    """Join two lists, or a list and an object, in the order in which they stand."""
    if len(q.values) < 2 or not any(isinstance(v, ObjectList) for v in q.values[:2]):
        return Refused
    a, b = q.values[:2]
    ctx.places["a"], ctx.places["b"] = q.nodes[:2]
    model = a if isinstance(a, ObjectList) else b
    objects = [*_several(model, a), *_several(model, b)]
    expected = model.kind or (type_of(objects[0]) if objects else None)
    wrong = next((each for each in objects if type_of(each) != expected), None)
    if wrong is not None:
        ctx.fail(
            39,
            "this list holds objects of type {kind}, not {type}",
            at="b" if model is a else "a",
            kind=expected,
            type=type_of(wrong),
        )
    del q.values[:2], q.nodes[:2]
    return type(model)(objects)


def _several(model: ObjectList, value: Any) -> tuple[Any, ...]:
    return value.objects if type(value) is type(model) else (value,)


INSE, REMP, ENLE = extend("INSE"), extend("REMP"), extend("ENLE")


def _fits(ctx: Context, values: ObjectList, x: Any) -> None:
    if values.kind not in (None, type_of(x)):
        ctx.fail(39, "this list holds objects of type {kind}, not {type}", at="x", kind=values.kind, type=type_of(x))


@INSE.form(VALUES, Arg("i", ENTIER, "its position"), Arg("x", ANY, "new object"), gives=["LISTCHPO|LISTOBJE"])
def _insert(ctx: Context, values: ObjectList, i: int, x: Any) -> ObjectList:
    _fits(ctx, values, x)
    at = position(ctx, i, len(values) + 1)
    return type(values)([*values.objects[:at], x, *values.objects[at:]])


@REMP.form(VALUES, Arg("i", (ENTIER, LISTENTI), "position, or positions"), Arg("x", ANY, "new object, or their list"))
def _replace(ctx: Context, values: ObjectList, i: int | ListEnti, x: Any) -> None:
    at = [position(ctx, i, len(values))] if isinstance(i, int) else positions(ctx, i, len(values))
    new = list(x.objects) if type(x) is type(values) and isinstance(i, ListEnti) else [x] * len(at)
    if len(new) != len(at):
        ctx.fail(217, "{positions} positions and {values} values", at="x", positions=len(at), values=len(new))
    content = list(values.objects)
    for k, each in zip(at, new, strict=True):
        _fits(ctx, values, each)
        content[k] = each
    values.replace(content)


@ENLE.form(VALUES, Arg("i", (ENTIER, LISTENTI), "position, or positions"), gives=["LISTCHPO|LISTOBJE"])
def _remove(ctx: Context, values: ObjectList, i: int | ListEnti) -> ObjectList:
    dropped = {position(ctx, i, len(values))} if isinstance(i, int) else set(positions(ctx, i, len(values)))
    return type(values)([x for k, x in enumerate(values.objects) if k not in dropped])
