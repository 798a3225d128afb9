"""Words and output: MESS, CHAI, LIST, MOT, TEXTE, SAUT, COMM, SORT 'CHAI'."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gibiane.binding import ABSENT, Operands
from gibiane.diagnostics import GibianeError
from gibiane.forms import Arg, Key
from gibiane.fortran import DEFAULT, BadFormat, Format, general
from gibiane.nodes import Literal
from gibiane.registry import Context, operator
from gibiane.source import SourceText
from gibiane.syntax import parse
from gibiane.values import ANY, ENTIER, FLOTTANT, LOGIQUE, MOT, PREDEFINED, PROCEDUR, TEXTE, Texte, type_of

MARKS = frozenset("*/<>")
FORMAT_KEY = Key("FORMAT", "Fortran format of the reals that follow", Arg("format", MOT, "descriptor"))


def compose(ctx: Context, q: Operands) -> str:
    """Read everything left in the queue and join the images of the values, with formats and column marks."""
    text = ""
    image = DEFAULT
    while q.values:
        start, node = q.values[0], q.nodes[0]
        value, _ = q.take((ANY,))
        if value is ABSENT:
            break
        if (
            isinstance(value, str)
            and value[:6] == "FORMAT"[: max(4, len(value))]
            and value[:4] == "FORM"
            and (q.values and isinstance(q.values[0], str))
        ):
            descriptor, place = q.values.pop(0), q.nodes.pop(0)
            try:
                image = Format(descriptor)
            except BadFormat as failure:
                ctx.places["format"] = place
                ctx.fail(
                    1094,
                    "the format {format} is not understood",
                    at="format",
                    format=descriptor,
                    label="here",
                    hint=failure.template,
                    **failure.fields,
                )
            continue
        if value in MARKS and not (isinstance(node, Literal) and node.quoted) and text_ready(q):
            continue
        try:
            piece = _image(value, image)
        except BadFormat as failure:
            ctx.places["value"] = node
            ctx.fail(
                1094,
                "this format does not suit a {type}",
                at="value",
                type=type_of(value),
                hint=failure.template,
                **failure.fields,
            )
        if piece is None:
            ctx.places["value"] = node
            ctx.fail(39, "a {type} has no text image", at="value", type=type_of(start), hint="LIST prints any object")
        text = _placed(text, piece, q)
    return text


def text_ready(q: Operands) -> bool:
    """Drop a column mark that stands where no text precedes it, with its number."""
    if q.values and type(q.values[0]) is int:
        del q.values[0], q.nodes[0]
        return True
    return False


def _image(value: Any, image: Format) -> str | None:
    kind = type_of(value)
    if kind == MOT:
        return image.word(value)
    if kind == ENTIER:
        return image.integer(value)
    if kind == FLOTTANT:
        return image.image(value)
    if kind == LOGIQUE:
        return "VRAI" if value else "FAUX"
    return str(value.name) if kind == PROCEDUR else None


def _placed(text: str, piece: str, q: Operands) -> str:
    """Append a piece where the column mark that follows it says (`*N`, `/N`, `>N`, `<N`)."""
    if (
        len(q.values) < 2
        or q.values[0] not in MARKS
        or type(q.values[1]) is not int
        or (isinstance(q.nodes[0], Literal) and q.nodes[0].quoted)
    ):
        return text + piece
    mark, column = q.values[0], q.values[1]
    del q.values[:2], q.nodes[:2]
    if mark == "*":
        start = column - len(piece)
    elif mark == "/":
        start = column - 1
    elif mark == ">":
        start = len(text) + column - 1
    else:
        start = len(text) + column - len(piece)
    start = max(start, 0)
    if start >= len(text):
        return text.ljust(start) + piece
    return text[:start] + piece + text[start + len(piece) :]


MESS = operator(
    "MESSAGE",
    topic="output",
    summary="write a line",
    notice="Writes the images of its operands, joined with nothing between them. A real has the format "
    "(1PE12.5), or the one that 'FORMAT' gives. After an item `*N` ends it at column N, `/N` starts "
    "it there; `<N` and `>N` count from the end of the text so far.",
    example="MESS ' n=' 5 ' x=' 0.25 ;",
    see=["CHAINE", "LISTER"],
)


@MESS.stream(FORMAT_KEY, syntax="x... ('FORMAT' format:MOT)")
def _mess(ctx: Context, q: Operands) -> None:
    ctx.write(compose(ctx, q).rstrip() or " ")


CHAI = operator(
    "CHAINE",
    topic="values",
    summary="make a word of the images of several values",
    terminal=True,
    notice="Joins images as MESS does, blanks kept. At most 512 characters.",
    example="T = CHAI 'n=' 5 ; MESS T ;",
    see=["MESSAGE", "MOT"],
)


@CHAI.stream(FORMAT_KEY, syntax="x... ('FORMAT' format:MOT)", gives=[MOT])
def _chai(ctx: Context, q: Operands) -> str:
    text = compose(ctx, q)
    if len(text) > 512:
        ctx.fail(1110, "the text has {length} characters; 512 is the limit", length=len(text))
    return text


WORD = operator(
    "MOT",
    topic="values",
    summary="a word that is not run as an operator",
    terminal=True,
    notice="Keeps the word as a value, also when it is the name of an operator.",
    example="OP = MOT 'PROG' ; MESS OP ;",
    see=["TEXTE"],
)


@WORD.stream(syntax="word:MOT", gives=[MOT])
def _word(ctx: Context, q: Operands) -> str:
    value = q.need(MOT)
    if len(value) > 512:
        ctx.fail(1114, "the word has {length} characters; 512 is the limit", length=len(value))
    return str(value)


TEXT = operator(
    "TEXTE",
    topic="values",
    summary="keep an instruction as text, run where it is read",
    terminal=True,
    notice="The text of one elementary instruction, joined of words and numbers; naming the object puts its "
    "content there, and so runs it.",
    example="T = TEXTE 'MESS 1' ; T ;",
    see=["MOT"],
)


@TEXT.stream(syntax="x:MOT|ENTIER|FLOTTANT|TEXTE...", gives=[TEXTE])
def _text(ctx: Context, q: Operands) -> Texte:
    if len(q.values) == 1 and isinstance(q.values[0], Texte):
        found: Texte = q.values.pop()
        q.nodes.pop()
        return found
    parts: list[str] = []
    while q.values:
        ctx.places["x"] = q.nodes[0]
        value, _ = q.take((ANY,))
        if value is ABSENT:  # a separator that belongs to nothing
            raise q.missing(MOT)
        piece = value.text if isinstance(value, Texte) else _image(value, DEFAULT)
        if piece is None:
            ctx.fail(39, "a {type} has no text image", at="x", type=type_of(value))
        parts.append(piece.strip() if len(parts) or q.values else piece)
    text = " ".join(parts)
    source = SourceText("<TEXTE>", text.rstrip().rstrip(";"))
    instructions = parse(SourceText("<TEXTE>", source.text + " ;"))
    if len(instructions) != 1 or instructions[0].targets:
        ctx.fail(21, "a TEXTE holds one elementary instruction, without = and ;", at="x")
    if instructions[0].bad is not None:
        raise GibianeError(instructions[0].bad)
    return Texte(text, instructions[0].items, instructions[0].source)


LIST = operator(
    "LISTER",
    topic="output",
    summary="print an object",
    terminal=True,
    notice="Prints any object. 'RESU' abridges. An ENTIER after a list is the number of values a line. "
    "Without operand: every named object, by type; `LIST *'TYPE'` those of a type.",
    example="LIST 5 ; LIST 3.14 ;",
    see=["MESSAGE"],
)


def _scalar_listing(ctx: Context, value: Any) -> str:
    kind = type_of(value)
    if kind == ENTIER:
        template, fields = " Entier valant: {x}", {"x": value}
    elif kind == FLOTTANT:
        template, fields = " Reel valant: {x}", {"x": general(value).strip()}
    elif kind == LOGIQUE:
        template, fields = " Logique valant: {x}", {"x": "VRAI" if value else "FAUX"}
    else:
        template, fields = " Chaine de {n} caracteres de contenu : {x}", {"n": len(value), "x": value}
    return str(ctx.session.listed(template, **fields))


@LIST.stream(Key("RESU", "abridged"), syntax="x (n:ENTIER) | 'RESU' x | (*'TYPE')")
def _list(ctx: Context, q: Operands) -> None:
    brief = q.read_keyword(["RESUME"]) is not None
    wanted = None
    if q.values and q.values[0] == "*":
        del q.values[0], q.nodes[0]
        wanted = str(q.need(MOT)).strip()
    if not q.values:
        _list_names(ctx, wanted)
        return
    value, _ = q.take((ANY,))
    width = q.read(ENTIER) if type_of(value).startswith("LIST") else None
    if type(value) in (int, float, bool, str):
        ctx.write(_scalar_listing(ctx, value))
        return
    for line in ctx.session.listing(value, brief=brief, width=width):
        ctx.write(line)


def _list_names(ctx: Context, wanted: str | None) -> None:
    by_type: dict[str, list[str]] = {}
    for name, value in ctx.session.names().items():
        if PREDEFINED.get(name) is not value and not name.startswith("&"):
            by_type.setdefault(type_of(value), []).append(name)
    for kind in sorted(by_type):
        if wanted is None or kind[:8] == wanted[:8]:
            ctx.write(f" {kind:<8} : {' '.join(by_type[kind])}")


SAUT = operator(
    "SAUTER",
    topic="output",
    summary="write blank lines",
    notice="`SAUT N 'LIGN'` writes N blank lines (one without N); `SAUT 'PAGE'` one.",
    example="SAUT 2 'LIGN' ;",
    see=["MESSAGE"],
)


@SAUT.form(Arg("n", ENTIER, "number of lines", optional=True), Key(("LIGNE", "PAGE"), "what to skip", name="what"))
def _saut(ctx: Context, n: int | None, what: str | None) -> None:
    for _ in range(1 if n is None or what == "PAGE" else n):
        ctx.write(" ")


COMM = operator(
    "COMMENTAIRE",
    topic="language",
    summary="a comment: its operands are discarded",
    notice="Whatever follows is read and dropped. Parentheses are still evaluated.",
    example="COMM 'nothing happens' ;",
)


@COMM.stream(syntax="anything")
def _comm(ctx: Context, q: Operands) -> None:
    q.values.clear()
    q.nodes.clear()


SORT = operator(
    "SORTIR",
    topic="output",
    summary="write results to a file",
    notice="`SORT 'CHAI' x...` writes one line to the file that OPTI 'SORT' names: words as they are, "
    "integers in 5 columns and 3 blanks, reals as 1PG12.5 between one and three blanks. 'VTK' "
    "writes meshes and fields for a viewer; 'HTML' T one file that a browser reads without a network: T . 'TITRE', "
    "and pages T . 1, T . 2 ..., TABLEs with a 'TITRE' and parts 1, 2 ...: a MOT, an EVOLUTIO, a MAILLAGE, or a TABLE "
    "with 'COURBES', 'LIGNES', 'COLONNES', 'MAILLAGE', 'CHAMP', 'TEXTE' or 'FICHIER' (docs/report.md).",
    example="OPTI 'SORT' 'resultats.txt' ; SORT 'CHAI' 'n' 4 0.5 ;",
    see=["OPTION"],
)


def output_path(ctx: Context, extension: str) -> Path:
    """Return the file that OPTI 'SORT' names, with an extension if it has none."""
    name = ctx.session.options.get("SORT")
    if not name:
        ctx.fail(19, "no output file is set", hint="OPTI 'SORT' 'name' ; first")
    path = Path(name)
    return path if path.suffix else path.with_suffix(extension)


def write_text(ctx: Context, path: Path, text: str) -> None:
    """Write text to a file: the first time in a session afresh, then at its end."""
    opened = ctx.state.setdefault("written files", set())
    key = str(path.resolve())
    try:
        with path.open("a" if key in opened else "w", encoding="utf-8") as stream:
            stream.write(text)
    except OSError as failure:
        ctx.cannot_write(path, failure)
    opened.add(key)


@SORT.form(
    Key("CHAINE", "a line of text", Arg("x", (MOT, ENTIER, FLOTTANT, LOGIQUE), "values", many=True), required=True)
)
def _sort_text(ctx: Context, chaine: list[Any]) -> None:
    pieces = []
    for value in chaine:
        kind = type_of(value)
        if kind == ENTIER:
            pieces.append(f"{value:5d}   ")
        elif kind == FLOTTANT:
            pieces.append(f" {general(value)}   ")
        else:
            pieces.append(value if kind == MOT else "VRAI" if value else "FAUX")
    write_text(ctx, output_path(ctx, ".txt"), "".join(pieces) + "\n")
