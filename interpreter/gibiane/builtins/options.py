"""OPTI and VALE: the options of a session. Operator packages listen to the ones they care about."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gibiane.binding import Operands
from gibiane.diagnostics import nearest
from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ANY, ENTIER, FLOTTANT, LOGIQUE, MOT, POINT, type_of

KEYBOARD, FIRST_FILE = 5, 3
Reader = Callable[[Context, Operands], Any]


def _word(q: Operands) -> str:
    return str(q.need(MOT)).strip()


def _one_of(*choices: str) -> Reader:
    def read(ctx: Context, q: Operands) -> str:
        return q.need_keyword(choices)

    return read


def _integer(low: int, high: int) -> Reader:
    def read(ctx: Context, q: Operands) -> int:
        node = q.nodes[0] if q.nodes else ctx.node
        value = int(q.need(ENTIER))
        if not low <= value <= high:
            ctx.places["value"] = node
            ctx.fail(
                42, "{value} is out of bounds: {low} to {high} is accepted", at="value", value=value, low=low, high=high
            )
        return value

    return read


def _real(ctx: Context, q: Operands) -> float:
    return float(q.need(FLOTTANT))


def _density(ctx: Context, q: Operands) -> float:
    node = q.nodes[0] if q.nodes else ctx.node
    value = float(q.need(FLOTTANT))
    if value < 0 or value != value:
        ctx.places["value"] = node
        ctx.fail(17, "a density is a length: {value} cannot be one", at="value", value=value)
    return value


SUBMODES = {"PLAN": ("CONT", "DEFO", "GENE"), "UNID": ("PLAN", "AXIS", "SPHE")}
DEFAULT_SUBMODES = {"PLAN": "DEFO", "UNID": "PLAN"}


def _mode(ctx: Context, q: Operands) -> str:
    i = q.first_word()
    given = str(q.values[i]).strip() if i >= 0 else ""
    word = q.need_keyword(("PLAN", "AXIS", "TRID", "FOUR", "UNID"))
    if word in SUBMODES:
        choices = SUBMODES[word]
        whole = next((choice for choice in choices if given[4:8] == choice), None)  # PLANCONT, as VALE gives it
        return f"{word} {whole or q.read_keyword(choices) or DEFAULT_SUBMODES[word]}"
    if word == "FOUR":
        return f"FOUR {q.need(ENTIER)}"
    return word


def _anything(ctx: Context, q: Operands) -> Any:
    value = q.read((LOGIQUE, ENTIER, FLOTTANT, POINT))
    if value is None:
        value = q.read(MOT)
    if value is None:
        raise q.missing("value")
    return value


def _names(ctx: Context, q: Operands) -> Any:
    """Read names of unknowns and, if they follow, of their duals."""
    first = q.need("LISTMOTS", "names of unknowns")
    second = q.read("LISTMOTS")
    return first if second is None else (first, second)


def _switch(ctx: Context, q: Operands) -> bool:
    return bool(q.need(LOGIQUE))


def _file(ctx: Context, q: Operands) -> Any:
    unit = q.read(ENTIER)
    return unit if unit is not None else _word(q)


def _acquired(ctx: Context, q: Operands) -> Any:
    ctx.state.pop("acquired file", None)  # ACQU starts at its first line, also if it is the same file again
    return _file(ctx, q)


def _language(ctx: Context, q: Operands) -> str:
    return q.need_keyword(("FRAN", "ANGL"))


def _input(ctx: Context, q: Operands) -> Any:
    """Read another file here and now, hand over to the keyboard (5), or go back to what was being read (3)."""
    unit = q.read(ENTIER)
    if unit is None:
        name = _word(q)
        ctx.session.pending.append(name)
        return name
    if unit not in (KEYBOARD, FIRST_FILE):
        ctx.fail(
            42,
            "{value} is out of bounds: {low} or {high} is accepted",
            at="value",
            value=unit,
            low=FIRST_FILE,
            high=KEYBOARD,
            hint="OPTI DONN 'name' ; reads a file",
        )
    ctx.session.pending.append(unit)
    return unit


OPTIONS: dict[str, Reader] = {
    "DIME": _integer(1, 3),
    "MODE": _mode,
    "ELEM": lambda ctx, q: _word(q),
    "DENS": _density,
    "ECHO": _integer(-1, 2),
    "ERRE": _one_of("FATA", "NORM", "CONT", "IGNO"),
    "LANG": _language,
    "SORT": _file,
    "SAUV": _file,
    "REST": _file,
    "ACQU": _acquired,
    "LECT": _file,
    "DONN": _input,
    "IMPR": _file,
    "TRAC": _anything,
    "FTRA": _file,
    "EPTR": _anything,
    "ISOV": _anything,
    "COUL": _anything,
    "COSC": _anything,
    "OEIL": _anything,
    "TITR": _anything,
    "RESO": _anything,
    "NORM": _anything,
    "PREC": _real,
    "PETI": _real,
    "GRAN": _real,
    "ZERO": _real,
    "VERI": _anything,
    "IMPI": _anything,
    "DEBU": _integer(0, 1),
    "LOCA": _switch,
    "EPSI": _anything,
    "INCO": _names,
    "ASSI": _integer(0, 1024),
}
IGNORED = ("POTR", "POLI", "CADR", "SURV", "ATTE", "PARA", "PLAC", "NGMA", "NAVI", "LAGR", "ACCE", "OMEG")
for _old in IGNORED:
    OPTIONS[_old] = _anything

DOCS: dict[str, str] = {
    "DIME": "dimension of space: 1, 2 or 3",
    "MODE": "PLAN CONT, PLAN DEFO, PLAN GENE, AXIS, TRID, FOUR n, UNID",
    "ELEM": "type of the elements that mesh operators make",
    "DENS": "density (size of elements) of the points made from now on",
    "ECHO": "-1 errors only, 0 notes and warnings too, 1 instructions, 2 lines of procedures",
    "ERRE": "FATAL, NORMAL, CONTROLE or IGNORE: what an error does",
    "LANG": "FRAN or ANGL: language of listings and messages",
    "ASSI": "worker processes of ASSI 'TOUS', 0 for none (gibiane --workers N)",
    "SORT": "file that SORT writes",
    "SAUV": "file that SAUV writes",
    "REST": "file that REST reads",
    "ACQU": "file that ACQU reads",
    "DONN": "file to read now; 5 the keyboard, 3 back to the script",
    "TRAC": "format of pictures",
    "FTRA": "file of the pictures",
    "COUL": "colour of what is made from now on",
    "TITR": "title of pictures",
    "RESO": "solver: DIRECTE or ITERATIVE",
    "DEBU": "1: an error in a procedure shows its objects, and at the prompt stays in it until DEBU 0",
    "LOCA": "VRAI: the objects of a procedure are kept in the table &NAME",
}
NO_EFFECT = "accepted, changes nothing"

OPTI = operator(
    "OPTION",
    topic="language",
    summary="set options of the session",
    notice="Pairs of a word and its value, as many as wanted; `VALE` reads them. Options of Cast3M without a meaning "
    "here are accepted, and change nothing.",
    example="OPTI DIME 3 ELEM CUB8 MODE TRID ;",
    see=["VALEUR"],
)


@OPTI.stream(
    *(Key(word, DOCS.get(word, NO_EFFECT), Arg("value", ANY)) for word in OPTIONS), syntax="word value (word value)..."
)
def _opti(ctx: Context, q: Operands) -> None:
    if not q.values:
        ctx.fail(533, "an option is wanted", hint="OPTI DIME 3 ELEM CUB8 ;")
    while q.values:
        i = q.first_word()
        if i != 0:
            ctx.places["value"] = q.nodes[0]
            ctx.fail(
                7,
                "the name of an option is wanted before this {type}",
                type=type_of(q.values[0]),
                at="value",
                hint="options come in pairs: OPTI DIME 3 ;",
            )
        word, node = q.values[0], q.nodes[0]
        name = str(word)[:4] if isinstance(word, str) else ""
        if name not in OPTIONS:
            close = nearest(str(word)[:8], sorted(OPTIONS))
            ctx.places["word"] = node
            ctx.fail(
                7,
                "unknown option '{word}'",
                at="word",
                word=word,
                close=close,
                hint="did you mean '{close}'?" if close else "INFO OPTI ; lists the options",
            )
        del q.values[0], q.nodes[0]
        ctx.places["value"] = q.nodes[0] if q.nodes else node
        value = OPTIONS[name](ctx, q)
        for listener in ctx.session.listeners.get(name, []):
            value = listener(ctx, value)
        ctx.session.options[name] = value
    while ctx.session.pending:
        ctx.session.switch_input(ctx.session.pending.pop(0), ctx.operands.span(ctx.node))


VALE = operator(
    "VALEUR",
    topic="language",
    summary="value of an option",
    terminal=True,
    notice="Reads an option: what OPTI set, else what holds without it (an error when nothing does: DIME comes before "
    "MODE). MODE is one word, PLANCONT or TRID; `VALE 'MODE' 'FOUR'` the harmonic. LANG is the language "
    "of listings, `VALE 'LANG' 'DIRE'` that of messages (both what OPTI or --lang set, else FRAN and ANGL). "
    "PREC, PETI and GRAN are the "
    "precision, the smallest and the largest FLOTTANT. 'SOUC' is the number of the last warning, 'ERMA' the highest "
    "error level so far, 'EXEC' says whether commands of the system are allowed. What VALE gives, OPTI takes back.",
    example="OPTI DIME 2 ; MESS (VALE DIME) ;",
    see=["OPTION"],
)


# what VALE says of an option that nobody has set: the units of files, and the habits of pictures
UNSET: dict[str, Any] = {
    "SORT": 2,
    "SAUV": 8,
    "REST": 7,
    "ACQU": 9,
    "LECT": 4,
    "DONN": 5,
    "IMPR": 6,
    "EPTR": 1,
    "ISOV": "SURFACE",
    "COSC": "BLAN",
    "RESO": "DIRECTE",
    "LANG": "FRAN",
    "TITR": "",
    "VERI": 0,
    "IMPI": 0,
    "ASSI": 0,
    "PARA": False,
}


@VALE.stream(
    *(Key(word, DOCS.get(word, NO_EFFECT)) for word in OPTIONS),
    Key("SOUC", "number of the last warning, 0 when there is none"),
    Key("ERMA", "highest error level so far"),
    Key("EXEC", "commands of the system are allowed (EXTE)"),
    syntax="option:MOT",
)
def _vale(ctx: Context, q: Operands) -> Any:
    word = q.need_keyword([*OPTIONS, "SOUC", "ERMA", "EXEC"])
    if word == "ERMA":
        return ctx.session.worst
    if word == "SOUC":
        return ctx.session.concern
    if word == "EXEC":
        return bool(ctx.option("EXEC"))
    value = ctx.session.options.get(word)
    if word == "LANG" and q.read_keyword(["DIRE"]) is not None:
        return "FRAN" if ctx.session.lang == "fr" else "ANGL"
    if word == "MODE":
        mode = str(value or {2: "PLAN DEFO", 3: "TRID"}.get(ctx.session.options["DIME"], ""))
        if q.read_keyword(["FOUR"]) is not None:
            return int(mode[4:]) if mode.startswith("FOUR") else 0
        value = "FOUR" if mode.startswith("FOUR") else mode.replace(" ", "") or None
    if value is None:
        value = UNSET.get(word)
    if value is None:
        ctx.fail(19, "the option {word} has no value yet", word=word)
    return value


TITR = operator(
    "TITRE",
    topic="output",
    summary="title of the pictures that follow",
    notice="Joins its operands as MESS does; TRAC and DESS write it over their pictures.",
    example="TITRE 'two blocks, mu = ' 0.2 ;",
    see=["OPTION"],
)


@TITR.stream(syntax="x...")
def _titre(ctx: Context, q: Operands) -> None:
    from gibiane.builtins.text import compose

    ctx.session.options["TITR"] = compose(ctx, q).strip()


INFO = operator(
    "INFO",
    topic="language",
    summary="describe an operator, a procedure or the code of a message",
    terminal=True,
    notice="Prints the forms, operands, keywords and an example of an operator, or the comment at the head of a "
    "procedure file: of the script's folder, of the current one, or shipped (INFO ADAPTER ;), or what the code of a "
    "message means (INFO G405 ;).",
    example="INFO MESS ;",
)


@INFO.stream(syntax="name")
def _info(ctx: Context, q: Operands) -> None:
    from gibiane.notice import notice

    node = q.nodes[0] if q.nodes else None
    if node is None:
        ctx.fail(533, "the name of an operator is wanted", hint="INFO MESS ;")
    value, _ = q.take((ANY,))
    word = getattr(node, "word", None) or (value if isinstance(value, str) else "")
    ctx.session.page(notice(ctx, word, node))
