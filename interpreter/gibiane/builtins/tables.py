"""Tables: TABL, DIME, INDE, OUBL, COPI."""

from __future__ import annotations

from typing import Any

from gibiane.binding import Operands
from gibiane.diagnostics import nearest
from gibiane.forms import Arg, Key
from gibiane.registry import Context, Refused, operator
from gibiane.values import ANY, ENTIER, MOT, PREDEFINED, TABLE, Table, type_of

TABL = operator(
    "TABLE",
    topic="tables",
    summary="make a table",
    notice="An empty table, with its subtype if given (entry 'SOUSTYPE'). `TABL T` gives the table T "
    "another name. Elements are read and written as T . index; an index is a value of any type.",
    example="T = TABL ; T . 'A' = 3 ; MESS (T . 'A') ;",
    see=["DIME", "INDEX", "COPIER"],
)


@TABL.form(Arg("t", TABLE, "table"), gives=[TABLE])
def _same(ctx: Context, t: Table) -> Table:
    return t


@TABL.form(Arg("subtype", MOT, "subtype", optional=True), gives=[TABLE], last=True)
def _table(ctx: Context, subtype: str | None) -> Table:
    return Table(subtype)


DIME = operator(
    "DIMENSION",
    topic="values",
    summary="number of entries of a table or list, length of a word",
    notice="TABLE: entries, SOUSTYPE included. LISTxxxx: values. MOT: characters.",
    example="MESS (DIME 'abcd') ;",
    see=["TABLE"],
)


@DIME.form(Arg("t", TABLE, "table"), gives=[ENTIER])
def _dime(ctx: Context, t: Table) -> int:
    return len(t.entries)


@DIME.form(Arg("word", MOT, "word"), gives=[ENTIER], last=True)
def _dime_word(ctx: Context, word: str) -> int:
    return len(word)


INDE = operator(
    "INDEX",
    topic="tables",
    summary="indices of a table",
    notice="A table of the indices, numbered from 1, in order of insertion. `INDE *'TYPE'` gives the objects "
    "of a type, by their names.",
    example="T = TABL ; T . 'A' = 3 ; I = INDE T ; MESS (I . 1) ;",
    see=["TABLE"],
)


@INDE.form(Arg("t", TABLE, "table"), gives=[TABLE])
def _inde(ctx: Context, t: Table) -> Table:
    found = Table("INDEX")
    for number, (index, _) in enumerate(t.entries.values(), 1):
        found.set(number, index)
    return found


@INDE.stream(syntax="*'TYPE'", gives=[TABLE], last=True)
def _named(ctx: Context, q: Operands) -> Any:
    if not q.values or q.values[0] != "*":
        return Refused
    del q.values[0], q.nodes[0]
    wanted = str(q.need(MOT, "the type of the objects")).strip()[:8]
    found = Table()
    for name, value in sorted(ctx.session.names().items()):
        if type_of(value)[:8] == wanted and PREDEFINED.get(name) is not value and name[0] != "&":
            found.set(name, value)
    return found


OUBL = operator(
    "OUBLIER",
    topic="values",
    summary="forget an entry of a table, or a name",
    notice="`OUBL T index` removes the entry; `OUBL name` makes the name an ordinary word again.",
    example="T = TABL ; T.1 = 5 ; OUBL T 1 ; MESS (DIME T) ;",
    see=["TABLE"],
)


@OUBL.form(Arg("t", TABLE, "table"), Arg("index", ANY, "index"))
def _forget(ctx: Context, t: Table, index: Any) -> None:
    if not t.has(index):
        ctx.fail(171, "the table has no index {index}", at="index", index=index if isinstance(index, str | int) else "")
    t.remove(index)


@OUBL.stream(syntax="name", last=True)
def _forget_name(ctx: Context, q: Any) -> None:
    node = q.nodes[0] if q.nodes else None
    name = getattr(node, "name", None)
    if name is None or name not in ctx.session.evaluator.frame.names:
        if node is not None:
            ctx.places["name"] = node
        close = nearest(name or "", list(ctx.session.names()))
        ctx.fail(
            9,
            "no object {name} to forget here",
            name=name or "",
            at="name",
            close=close,
            hint="did you mean {close}?" if close else None,
        )
    q.take((ANY,))
    del ctx.session.evaluator.frame.names[name]


DETR = operator(
    "DETRUIRE",
    topic="values",
    summary="do nothing: an object nobody names any more is freed by itself",
    notice="`DETR x` reads the object, and the word 'ELEM' of Cast3M, and leaves the object as it is.",
    example="L = 3 ; DETR L ; MESS L ;",
    see=["OUBLIER", "MENAGE"],
)


@DETR.form(Arg("x", ANY, "object"), Key("ELEM", "with its elements"))
def _destroy(ctx: Context, x: Any, elem: bool) -> None:
    return


MENA = operator(
    "MENAGE",
    topic="values",
    summary="do nothing: memory is freed by itself",
    notice="Kept so that scripts of Cast3M run.",
    example="MENAGE ;",
    see=["DETRUIRE"],
)


@MENA.form(Key("OBLI", "at once"))
def _tidy(ctx: Context, obli: bool) -> None:
    return


COPI = operator(
    "COPIER",
    topic="values",
    summary="copy an object",
    notice="A TABLE is copied one level deep.",
    example="T = TABL ; U = COPI T ; U.1 = 2 ; MESS (DIME T) ;",
    see=["TABLE"],
)


@COPI.form(Arg("t", TABLE, "table"), gives=[TABLE])
def _copy(ctx: Context, t: Table) -> Table:
    return t.copy()
