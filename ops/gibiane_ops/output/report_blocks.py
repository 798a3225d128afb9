"""The parts of a report, read from objects of the language."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from gibiane.registry import Context
from gibiane.values import EVOLUTIO, LOGIQUE, MAILLAGE, MOT, TABLE, Table, type_of
from gibiane_ops.kernels.report import Block, Chart, Curve, Picture, Text
from gibiane_ops.kernels.report import Table as Rows
from gibiane_ops.output.report_views import view_of
from gibiane_ops.output.targets import colour
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.deformee import Vecteur
from gibiane_ops.values.evolution import Evolution
from gibiane_ops.values.listes import ListEnti, ListMots, ListReel
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.modele import Modele

KINDS = {".png": "png", ".svg": "svg+xml", ".jpg": "jpeg", ".jpeg": "jpeg", ".gif": "gif"}
COMMON = ("TITRE", "LEGENDE")
INDICES = {
    "TEXTE": (),
    "COURBES": ("TITX", "TITY", "LOGX", "LOGY", "XBOR", "YBOR", "PARETO", "POINTS", "NOTES", "NOM"),
    "LIGNES": ("ENTETES",),
    "COLONNES": (),
    "FICHIER": (),
    "MAILLAGE": ("CHAMP", "MODELE", "DEPLACEMENT", "FACTEUR", "VECTEUR", "NOM"),
    "CHAMP": ("MAILLAGE", "MODELE", "DEPLACEMENT", "FACTEUR", "VECTEUR", "NOM"),
}
"""What a part may hold, by the index that tells its kind."""


@dataclass(frozen=True)
class Place:
    """Where in the table of a report something is read, for messages and for names.

    Attributes
    ----------
    ctx : Context
    path : str
        Page and part, e.g. ``2.3``.
    """

    ctx: Context
    path: str

    def fail(self, code: int, sentence: str, **fields: Any) -> NoReturn:
        """Raise a diagnostic about this part."""
        self.ctx.fail(code, sentence, at="t", label="part {part} of the report", part=self.path, **fields)

    def want(self, table: Table, key: str, kinds: tuple[type, ...], wanted: str) -> Any:
        """Return an entry of a given type, None when there is none."""
        if not table.has(key):
            return None
        value = table.get(key)
        if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
            self.fail(39, "index '{key}' is a {type}, not a {wanted}", key=key, type=type_of(value), wanted=wanted)
        return value


def block_of(place: Place, value: Any) -> Block:
    """Make a part of a report: a text, curves, a mesh, or what a table describes."""
    if isinstance(value, str):
        return Text(text=value)
    if isinstance(value, Evolution):
        value = _alone("COURBES", value)
    elif isinstance(value, Maillage):
        value = _alone("MAILLAGE", value)
    if not isinstance(value, Table):
        wanted = f"{MOT}, {EVOLUTIO}, {MAILLAGE} or {TABLE}"
        place.fail(39, "a {type} cannot be shown, wanted: {wanted}", type=type_of(value), wanted=wanted)
    kind = next((k for k in INDICES if value.has(k)), None)
    if kind is None:
        place.fail(21, "no index tells what the part shows", known=", ".join(INDICES), hint="one of {known}")
    _check_indices(place, value, kind)
    title = place.want(value, "TITRE", (str,), MOT) or ""
    caption = place.want(value, "LEGENDE", (str,), MOT) or ""
    makers: dict[str, Callable[[Place, Table, str, str], Block]] = {
        "TEXTE": _text,
        "COURBES": _chart,
        "LIGNES": _lines,
        "COLONNES": _columns,
        "FICHIER": _picture,
    }
    return makers.get(kind, _view)(place, value, title.strip(), caption.strip())


def _alone(key: str, value: Any) -> Table:
    table = Table()
    table.set(key, value)
    return table


def _check_indices(place: Place, value: Table, kind: str) -> None:
    known = (kind, *COMMON, *INDICES[kind])
    for index, _ in value.entries.values():
        if index not in known:
            shown = f"'{index}'" if isinstance(index, str) else str(index)
            place.fail(
                7,
                "the part has an index {index}, which '{kind}' does not know",
                index=shown,
                kind=kind,
                known=" ".join(known),
                hint="known indices: {known}",
            )


def _text(place: Place, table: Table, title: str, caption: str) -> Text:
    return Text(text=place.want(table, "TEXTE", (str,), MOT), title=title, caption=caption)


def _picture(place: Place, table: Table, title: str, caption: str) -> Picture:
    path = Path(place.want(table, "FICHIER", (str,), MOT).strip())
    kind = KINDS.get(path.suffix.lower())
    if kind is None:
        known = " ".join(KINDS)
        place.fail(
            21, "{path} is no picture that a browser shows", path=path.as_posix(), known=known, hint="known: {known}"
        )
    try:
        return Picture(data=path.read_bytes(), kind=kind, title=title, caption=caption)
    except OSError as failure:
        place.fail(
            424,
            "the picture {path} cannot be read ({reason})",
            path=path.as_posix(),
            reason=(failure.strerror or "unknown reason").lower(),
        )


# ---- tables


def _cells(place: Place, value: Any) -> list[Any]:
    """Return a list, or the values of a table, as cells."""
    match value:
        case ListReel() | ListEnti():
            return list(value.values.tolist())
        case ListMots():
            return list(value.words)
        case Table():
            return [_cell(place, v) for i, v in value.entries.values() if i != "SOUSTYPE"]
    return [_cell(place, value)]


def _cell(place: Place, value: Any) -> Any:
    if isinstance(value, bool):
        return "VRAI" if value else "FAUX"
    if not isinstance(value, str | int | float):
        place.fail(39, "a {type} cannot stand in a cell", type=type_of(value))
    return value.rstrip() if isinstance(value, str) else value


def _lines(place: Place, table: Table, title: str, caption: str) -> Rows:
    lines = place.want(table, "LIGNES", (Table,), TABLE)
    rows = [_cells(place, line) for i, line in lines.entries.values() if i != "SOUSTYPE"]
    head = [str(c) for c in _cells(place, table.get("ENTETES"))] if table.has("ENTETES") else []
    head = head or [""] * max(map(len, rows), default=0)
    for number, row in enumerate(rows, 1):
        if len(row) != len(head):
            place.fail(
                21,
                "row {row} of the table has {count} cells, the others {width}",
                row=number,
                count=len(row),
                width=len(head),
            )
    return Rows(head=head, rows=rows, title=title, caption=caption)


def _columns(place: Place, table: Table, title: str, caption: str) -> Rows:
    columns = place.want(table, "COLONNES", (Table,), TABLE)
    read = {str(i): _cells(place, column) for i, column in columns.entries.values() if i != "SOUSTYPE"}
    lengths = {name: len(column) for name, column in read.items()}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{name}: {n}" for name, n in lengths.items())
        place.fail(21, "the columns have not the same length ({lengths})", lengths=shown)
    rows = [list(row) for row in zip(*read.values(), strict=True)]
    return Rows(head=list(read), rows=rows, title=title, caption=caption)


# ---- charts


def _chart(place: Place, table: Table, title: str, caption: str) -> Chart:
    evolution = place.want(table, "COURBES", (Evolution,), EVOLUTIO)
    switches = {k: bool(place.want(table, k, (bool,), LOGIQUE)) for k in ("LOGX", "LOGY", "PARETO", "POINTS")}
    notes = place.want(table, "NOTES", (Table,), TABLE) or Table()
    curves = []
    for number, each in enumerate(evolution.curves, 1):
        values = each.numbers()
        if values is None:
            place.fail(19, "curve {number} has a list of words: it cannot be drawn", number=number)
        own = notes.get(number) if notes.has(number) else None
        curves.append(
            Curve(
                x=values[0],
                y=values[1],
                name=each.title.strip() or each.y_name or f"curve {number}",
                color=colour(each.colour),
                line=not switches["POINTS"],
                notes=[_record(place, own, j) for j in range(1, len(values[0]) + 1)] if own is not None else (),
            )
        )
    if not any(_is_seen(c, switches["LOGX"], switches["LOGY"]) for c in curves):
        place.fail(21, "no curve has a point to draw", hint="on logarithmic axes, a point has to be positive")
    first = evolution.curves[0]
    return Chart(
        name=_name(place, table),
        curves=curves,
        x_title=place.want(table, "TITX", (str,), MOT) or first.x_name,
        y_title=place.want(table, "TITY", (str,), MOT) or first.y_name,
        x_log=switches["LOGX"],
        y_log=switches["LOGY"],
        x_bounds=_bounds(place, table, "XBOR"),
        y_bounds=_bounds(place, table, "YBOR"),
        pareto=switches["PARETO"],
        title=title,
        caption=caption,
    )


def _is_seen(curve: Curve, x_log: bool, y_log: bool) -> bool:
    """Say whether a curve has a point that its axes can show."""
    seen = np.isfinite(curve.x) & np.isfinite(curve.y)
    return bool((seen & ((curve.x > 0) | (not x_log)) & ((curve.y > 0) | (not y_log))).any())


def _record(place: Place, own: Any, point: int) -> list[tuple[str, str]]:
    """Return what is known of a point: the notes of its curve by number, or one for all its points."""
    if isinstance(own, ListMots):
        return [("", own.words[point - 1])] if point <= len(own.words) else []
    if not isinstance(own, Table):
        return [("", str(_cell(place, own)))]
    if not own.has(point):
        return []
    note = own.get(point)
    if isinstance(note, Table):
        return [(str(i), str(_cell(place, v))) for i, v in note.entries.values() if i != "SOUSTYPE"]
    return [("", str(_cell(place, note)))]


def _bounds(place: Place, table: Table, key: str) -> tuple[float, float] | None:
    found = place.want(table, key, (ListReel,), "LISTREEL")
    if found is None:
        return None
    if len(found) != 2 or not found.values[0] < found.values[1]:
        place.fail(21, "index '{key}' wants two increasing numbers", key=key)
    return float(found.values[0]), float(found.values[1])


def _name(place: Place, table: Table) -> str:
    """Return the name under which scripts of the page find a part: its own, else its place."""
    return str(place.want(table, "NOM", (str,), MOT) or place.path).strip()


# ---- views


def _view(place: Place, table: Table, title: str, caption: str) -> Block:
    fields = table.get("CHAMP") if table.has("CHAMP") else Table()
    if isinstance(fields, ChPoint | MChaml):
        fields = _alone(fields.title.strip(), fields)
    if not isinstance(fields, Table):
        place.fail(
            39, "index 'CHAMP' is a {type}, not a {wanted}", type=type_of(fields), wanted="CHPOINT, MCHAML or TABLE"
        )
    named = [(str(i).strip(), f) for i, f in fields.entries.values() if i != "SOUSTYPE"]
    for name, each in named:
        if not isinstance(each, ChPoint | MChaml):
            place.fail(
                39,
                "field {name} is a {type}, not a {wanted}",
                name=name,
                type=type_of(each),
                wanted="CHPOINT or MCHAML",
            )
    factor = place.want(table, "FACTEUR", (int, float), "FLOTTANT")
    view = view_of(
        place.ctx,
        _name(place, table),
        mesh=place.want(table, "MAILLAGE", (Maillage,), MAILLAGE),
        model=place.want(table, "MODELE", (Modele,), "MMODEL"),
        fields=named,
        displacement=place.want(table, "DEPLACEMENT", (ChPoint,), "CHPOINT"),
        factor=None if factor is None else float(factor),
        arrows=place.want(table, "VECTEUR", (Vecteur,), "VECTEUR"),
        title=title,
        caption=caption,
    )
    if view is None:
        place.fail(
            21,
            "there is nothing to show: no mesh of surfaces, solids or lines under the field",
            hint="'MAILLAGE' gives the mesh under a nodal field",
        )
    for each in view.fields:
        if not np.isfinite(each.values).any():
            place.fail(21, "field {name} has no value on what is shown", name=each.name)
    return view
