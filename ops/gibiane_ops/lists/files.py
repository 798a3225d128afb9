"""Numbers and words from files and to files: ACQU, OBTE, LIRE 'CSV', SORT 'EXCE'."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gibiane.binding import Operands
from gibiane.builtins.text import output_path, write_text
from gibiane.forms import Arg, Key
from gibiane.fortran import scientific
from gibiane.library import read_script
from gibiane.nodes import Name
from gibiane.procedures import import_file
from gibiane.registry import Context, extend, operator
from gibiane.source import decode
from gibiane.values import (
    ENTIER,
    EVOLUTIO,
    FLOTTANT,
    LISTENTI,
    LISTMOTS,
    LISTREEL,
    LOGIQUE,
    MOT,
    NOTHING,
    TABLE,
    Table,
    type_of,
)
from gibiane_ops.values.evolution import Evolution
from gibiane_ops.values.listes import AnyList, ListEnti, ListMots, ListReel, items_of

ITEM = re.compile(r"'(?:[^']|'')*'|[^\s,;]+")
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?$")
ITEM_OF = {LISTENTI: ENTIER, LISTREEL: FLOTTANT}
LONGEST_RECORD = 512


def _value(text: str, kind: str | None) -> Any:
    """Return an item of a file as a value of a type (its own when None), or None if it is of another type."""
    quoted = text.startswith("'")
    number = None
    if not quoted and NUMBER.match(text):
        plain = text.upper().replace("D", "E")
        number = int(plain) if plain.lstrip("+-").isdigit() else float(plain)
    if kind == ENTIER:
        return number if isinstance(number, int) else None
    if kind == FLOTTANT:
        return None if number is None else float(number)
    if kind == LOGIQUE or (kind is None and text.upper() in ("VRAI", "FAUX")):
        return {"VRAI": True, "FAUX": False}.get(text.upper())
    if kind is None and number is not None:
        return number
    return text[1:-1].replace("''", "'") if quoted else text


def _wanted(ctx: Context, q: Operands) -> Iterator[tuple[str, str | None]]:
    """Read `NAME*TYPE` after `NAME*TYPE` from the queue: the names as they are written, not their values."""
    while q.values:
        node = q.nodes[0]
        ctx.places["name"] = node
        if not isinstance(node, Name):
            ctx.fail(6, "the name of an object to read is wanted here", at="name", hint="ACQU N*ENTIER X*FLOTTANT ;")
        del q.values[0], q.nodes[0]
        kind = None
        if q.values and q.values[0] == "*":
            del q.values[0], q.nodes[0]
            kind = str(q.need(MOT, "the type to read")).strip()[:8]
            known = (ENTIER, FLOTTANT, MOT, LOGIQUE, LISTENTI, LISTREEL)
            kind = next(
                (k for k in known if k[:4] == kind[:4] and len(kind) >= len(k[:4]) and k.startswith(kind)), kind
            )
            if kind not in known:
                ctx.fail(
                    39, "a {type} cannot be read", at="name", type=kind, hint="types: {known}", known=", ".join(known)
                )
        yield node.name, kind


class _Records:
    """The file that OPTI 'ACQU' names, read line by line."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lines = decode(path.read_bytes()).split("\n")
        self.at = 0
        self.pending: list[str] = []

    def line(self, ctx: Context) -> str:
        """Return the next line."""
        if self.at >= len(self.lines) or (self.at == len(self.lines) - 1 and not self.lines[self.at]):
            ctx.fail(
                "G501", "the file {path} has no more lines (it has {count})", path=self.path.as_posix(), count=self.at
            )
        self.at += 1
        return self.lines[self.at - 1]

    def item(self, ctx: Context, kind: str | None) -> Any:
        """Return the next item, on this line or on those that follow."""
        while not self.pending:
            self.pending = ITEM.findall(self.line(ctx))
        text = self.pending.pop(0)
        value = _value(text, kind)
        if value is None:
            ctx.fail(
                "G501",
                "line {line} of {path}: {text} stands there where a {type} is wanted",
                line=self.at,
                path=self.path.as_posix(),
                type=kind,
                text=text,
            )
        return value


def _records(ctx: Context) -> _Records:
    name = ctx.session.options.get("ACQU")
    if not name:
        ctx.fail(19, "no file to read is set", hint="OPTI 'ACQU' 'name' ; first")
    found = ctx.state.get("acquired file")
    if found is None:
        path = Path(f"fort.{name}" if isinstance(name, int) else name)
        if not path.is_file():
            ctx.fail(1130, "the file {path} cannot be opened", path=path.as_posix())
        found = ctx.state["acquired file"] = _Records(path)
    return found


ACQU = operator(
    "ACQUERIR",
    topic="files",
    summary="read values from the file that OPTI 'ACQU' names",
    notice="Directive: `ACQU N*ENTIER X*FLOTTANT T*MOT L*LISTREEL 5` gives these names the next values of the "
    "file; a list is followed by how many to read; without type a name gets what stands there. Each "
    "call begins on a new line. A word with blanks stands between apostrophes in the file. "
    "Operator: `ACQU 'BRUT'` gives the next line as a MOT.",
    example="OPTI 'SORT' 'numbers.txt' ; SORT 'CHAI' 3 4 ; OPTI 'ACQU' 'numbers.txt' ; ACQU I*ENTIER J ; MESS I J ;",
    see=["OBTENIR", "LIRE", "SORTIR"],
)


@ACQU.form(Key("BRUT", "the next line", required=True), gives=[MOT])
def _raw_line(ctx: Context, brut: bool) -> str:
    records = _records(ctx)
    records.pending = []
    return records.line(ctx)[:LONGEST_RECORD]


@ACQU.stream(syntax="name(*TYPE) (n:ENTIER)...")
def _acquire(ctx: Context, q: Operands) -> None:
    if not q.values:
        ctx.fail(533, "the names of the objects to read are missing", hint="ACQU N*ENTIER X*FLOTTANT ;")
    records = _records(ctx)
    records.pending = []
    for name, kind in _wanted(ctx, q):
        if kind in ITEM_OF:
            count = q.read(ENTIER)
            if count is None or count < 0:
                ctx.fail(
                    8,
                    "how many values {name} has must follow it",
                    at="name",
                    name=name,
                    hint="{name}*{type} 5 reads five",
                    type=kind,
                )
            items = [records.item(ctx, ITEM_OF[kind]) for _ in range(count)]
            ctx.session.assign(name, ListEnti(items) if kind == LISTENTI else ListReel(items))
        else:
            ctx.session.assign(name, records.item(ctx, kind))


OBTE = operator(
    "OBTENIR",
    topic="files",
    summary="read values from the keyboard",
    notice="Asks for a line for each name and gives it the value typed: a number, a word, VRAI or FAUX; a "
    "LISTENTI or LISTREEL takes all numbers of the line. What is not given is ANNULE.",
    example="OBTE N*ENTIER ; MESS (EXIS N) ;",
    see=["ACQUERIR", "ARGUMENT"],
)


@OBTE.stream(syntax="name(*TYPE)...")
def _obtain(ctx: Context, q: Operands) -> None:
    for name, kind in _wanted(ctx, q):
        items = ITEM.findall(ctx.session.ask(f"{name} ({kind}) ? " if kind else f"{name} ? "))
        values = [v for v in (_value(text, ITEM_OF.get(kind or "", kind)) for text in items) if v is not None]
        if kind == LISTENTI:
            ctx.session.assign(name, ListEnti(values))
        elif kind == LISTREEL:
            ctx.session.assign(name, ListReel(values))
        else:
            ctx.session.assign(name, values[0] if values else NOTHING)


LIRE = operator(
    "LIRE",
    topic="files",
    summary="read a file: a table of numbers, meshes, procedures",
    notice="'MED' (needs h5py), 'UNV', 'GMSH', 'ABAQ' (Abaqus), 'NAS' (Nastran), 'FEM' (OptiStruct, by "
    "HyperMesh: components and sets), 'AVS', 'VTK' (.vtu .vtk): a TABLE "
    "whose indices are the names of the groups of elements and nodes, and of the fields; 'MAILLAGE' is the whole mesh. "
    "Groups that have only a number are REF1, REF2 ... 'STL': a MAILLAGE of triangles. "
    "'CSV': a TABLE of LISTREEL, one per column ('COLO', the usual) or per line ('LIGN'). 'SEPA' is "
    "the separator (a semicolon), 'DEBU' and 'FIN' the first and last line read. When the first line "
    "holds no numbers, its words are the indices of the columns; for lines they are a LISTMOTS at "
    "index 1. 'PROC' defines the procedures of a file, or the one that is named; a file without DEBP becomes the "
    "procedure of this name.",
    example="OPTI 'SORT' 'curve' ; T = TABL ; T.'X' = PROG 1. 2. ; SORT 'EXCE' T ; "
    "U = LIRE 'CSV' 'curve.csv' ; LIST (U.'X') ;",
    see=["ACQUERIR", "SORTIR"],
)


@LIRE.form(
    Key(
        "PROC",
        "procedures of a file",
        Arg("file", MOT, "its name"),
        Arg("name", MOT, "name of one of them", optional=True),
        required=True,
    )
)
def _procedures(ctx: Context, proc: tuple[str, str | None]) -> None:
    path, name = proc
    import_file(ctx.session.evaluator, read_script(Path(path)), None if name is None else name.strip().upper())


@LIRE.form(
    Key("CSV", "numbers between separators", Arg("file", MOT, "its name"), required=True),
    Key("DEBU", "first line", Arg("n", ENTIER)),
    Key("FIN", "last line", Arg("n", ENTIER)),
    Key("SEPA", "separator", Arg("letter", MOT)),
    Key(("COLO", "LIGN"), "lists by column or by line", name="by"),
    gives=[TABLE],
)
def _csv(ctx: Context, csv: str, debu: int | None, fin: int | None, sepa: str | None, by: str | None) -> Table:
    path = Path(csv)
    if not path.is_file():
        ctx.fail(1130, "the file {path} cannot be opened", path=path.as_posix())
    first = 1 if debu is None else debu
    lines = decode(path.read_bytes()).split("\n")[first - 1 : fin]
    rows = [(first + i, _cells(line, sepa or ";")) for i, line in enumerate(lines) if line.strip()]
    heads: list[str] = []
    if rows and not any(NUMBER.match(cell) for cell in rows[0][1] if cell):
        heads = rows.pop(0)[1]
    numbers = [[_cell(ctx, path, line, cell) for cell in cells] for line, cells in rows]
    found = Table()
    if by == "LIGN":
        if heads:
            found.set(1, ListMots(heads))
        for i, row in enumerate(numbers, 2 if heads else 1):
            found.set(i, ListReel([x for x in row if x is not None]))
        return found
    for i in range(max([len(heads), *map(len, numbers)], default=0)):
        column = [row[i] for row in numbers if i < len(row) and row[i] is not None]
        found.set(heads[i] if i < len(heads) and heads[i] else i + 1, ListReel(column))
    return found


def _cells(line: str, separator: str) -> list[str]:
    cells = [cell.strip().strip("\"'").strip() for cell in line.split(separator)]
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def _cell(ctx: Context, path: Path, line: int, cell: str) -> float | None:
    if not cell:
        return None
    value = _value(cell, FLOTTANT)
    if value is None:
        # a three-digit exponent is written without its letter: 1.0000+101
        value = _value(re.sub(r"(?<=\d)([+-]\d{3})$", r"E\1", cell), FLOTTANT)
    if value is None:
        ctx.fail(
            "G501",
            "line {line} of {path}: '{text}' is no number",
            line=line,
            path=path.as_posix(),
            text=cell,
            hint="'SEPA' says what separates the numbers, 'DEBU' on which line they begin",
        )
    return float(value)


SEPARATORS = {"PVIR": ";", "VIRG": ",", "ESPA": " ", "TABU": "\t", "OBLI": "/"}
COLUMN, DIGITS, LINES_BETWEEN = 12, 4, 3


@extend("SORT").form(
    Key("EXCE", "lists as the columns of a table (.csv)", required=True),
    Arg("x", (LISTENTI, LISTREEL, LISTMOTS, EVOLUTIO, TABLE), "lists, curves, tables of lists", many=True),
    Key("NCOL", "columns side by side", Arg("n", ENTIER)),
    Key("SEPA", "separator", Arg("name", MOT)),
    Key("DIGI", "decimals of the reals", Arg("n", ENTIER)),
)
def _export(ctx: Context, exce: bool, x: list[Any], ncol: int | None, sepa: str | None, digi: int | None) -> None:
    if sepa is not None and sepa[:4] not in SEPARATORS:
        ctx.fail(
            7, "unknown keyword '{word}'; accepted: {accepted}", at="sepa", word=sepa, accepted=", ".join(SEPARATORS)
        )
    if ncol is not None and ncol < 1:
        ctx.fail(36, "{count} is not an acceptable number of columns", at="ncol", count=ncol)
    mark = SEPARATORS[(sepa or "PVIR")[:4]]
    columns = [column for value in x for column in _columns(ctx, value)]
    step = ncol or max(len(columns), 1)
    parts = [
        "\n".join(_lines(columns[i : i + step], mark, DIGITS if digi is None else digi))
        for i in range(0, len(columns), step)
    ]
    write_text(ctx, output_path(ctx, ".csv"), ("\n" * (LINES_BETWEEN + 1)).join(parts) + "\n")


def _columns(ctx: Context, value: Any) -> list[tuple[str, AnyList]]:
    if isinstance(value, Evolution):
        return [pair for c in value.curves for pair in ((c.x_name, c.x), (c.y_name, c.y))]
    if not isinstance(value, Table):
        return [("", value)]
    found = []
    for index, content in value.entries.values():
        if isinstance(content, Evolution):
            found.extend(_columns(ctx, content))
        elif isinstance(content, AnyList):
            found.append((index if isinstance(index, str) else "", content))
        elif index != "SOUSTYPE":
            ctx.fail(39, "a {type} of this table cannot stand in a column", at="x", type=type_of(content))
    return found


def _lines(columns: list[tuple[str, AnyList]], mark: str, digits: int) -> Iterator[str]:
    width = max(COLUMN, digits + 8)
    texts = [[_image(item, width, digits) for item in _plain(values)] for _, values in columns]
    if any(title for title, _ in columns):
        yield mark.join(title[:COLUMN].ljust(width) for title, _ in columns) + mark
    for row in range(max(map(len, texts), default=0)):
        yield mark.join(text[row] if row < len(text) else " " * width for text in texts) + mark


def _plain(values: AnyList) -> list[Any]:
    items = items_of(values)
    return items.tolist() if isinstance(items, np.ndarray) else list(items)


def _image(item: Any, width: int, digits: int) -> str:
    return scientific(item, width, digits) if isinstance(item, float) else str(item).rjust(width)
