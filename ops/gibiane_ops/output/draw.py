"""DESSIN: curves into a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, EVOLUTIO, FLOTTANT, MOT, TABLE, Table
from gibiane_ops.kernels.plot import Curve, draw_curves
from gibiane_ops.output.targets import draw, ink, title
from gibiane_ops.values.evolution import Evolution

SWITCHES = ("LOGX", "LOGY", "CARR", "MIMA", "GRIL", "GRIS", "AXES", "SEPA", "NCLK", "DATE", "LOGO")
LINES = {"NOLI": "", "TIRR": "--", "TIRC": ":", "TIRL": "--", "TIRM": "-.", "POIN": ":", "LIGN": "-"}
MARKS = {
    "CROI": "x",
    "PLUS": "+",
    "MOIN": "_",
    "BARR": "|",
    "ETOI": "*",
    "CARR": "s",
    "LOSA": "D",
    "ROND": "o",
    "TRID": "v",
    "TRIU": "^",
    "TRIL": "<",
    "TRIR": ">",
}
PLACES = ("NO", "NE", "SO", "SE", "EXT", "XY", "CENT", "EXCE")

DESS = operator(
    "DESSIN",
    topic="output",
    summary="draw curves into a file",
    notice="The curves of an EVOLUTIO. 'TITR' 'TITX' 'TITY' give titles, 'XBOR' 'YBOR' the ends of the axes, 'LOGX' "
    "'LOGY' logarithmic axes, 'CARR' equal scales, 'LEGE' a legend (titles of the curves, or those of"
    " TAB . 'TITRE' . i), 'MIMA' the extreme values, 'CHOI' the numbers of the curves to show. TAB . i describes "
    "curve i: 'TIRR' 'TIRC' 'NOLI' (line), 'MARQ CROI' (marks). Files as for TRACER.",
    example="X = PROG 0. 1. 2. ; Y = PROG 0. 1. 4. ; E = EVOL 'MANU' X Y ; DESS E 'TITR' 'a parabola' ;",
    see=["EVOLUTION", "TRACER"],
)


@DESS.stream(
    *(Key(w, "style") for w in SWITCHES),
    Key("TITR", "title", Arg("t", MOT)),
    Key("TITX", "name of the abscissa", Arg("t", MOT)),
    Key("TITY", "name of the ordinate", Arg("t", MOT)),
    Key("XBOR", "ends of the axis", Arg("a", FLOTTANT), Arg("b", FLOTTANT)),
    Key("YBOR", "ends of the axis", Arg("a", FLOTTANT), Arg("b", FLOTTANT)),
    Key("XGRA", "accepted, changes nothing", Arg("dx", FLOTTANT)),
    Key("YGRA", "accepted, changes nothing", Arg("dy", FLOTTANT)),
    Key(("POSX", "POSY", "XFMT", "YFMT"), "accepted, changes nothing", Arg("m", MOT), name="place"),
    Key("LEGE", "legend", Arg("place", MOT, optional=True)),
    Key("CHOI", "curves to show", Arg("n", ENTIER, many=True)),
    syntax="e:EVOLUTIO (tab:TABLE) ('TITR' t) ('TITX' t) ('TITY' t) ('XBOR' a b) ('YBOR' a b) ('LOGX') ('LOGY') "
    "('CARR') ('LEGE' (place)) ('MIMA') ('CHOI' n...) ('GRIL')",
)
def _dess(ctx: Context, q: Operands) -> None:
    evolution: Evolution | None = None
    table = Table()
    words: dict[str, Any] = {}
    known = [
        *SWITCHES,
        "TITR",
        "TITX",
        "TITY",
        "XBOR",
        "YBOR",
        "XGRA",
        "YGRA",
        "POSX",
        "POSY",
        "XFMT",
        "YFMT",
        "LEGE",
        "CHOI",
    ]
    while q.values:
        value, node = q.take((EVOLUTIO, TABLE))
        if node is not None:
            ctx.places.setdefault("e", node)
            if isinstance(value, Table):
                table = value
            else:
                evolution = value if evolution is None else Evolution([*evolution.curves, *value.curves])
            continue
        word = q.read_keyword(known)
        if word is None:
            if q.is_operator_word(max(q.first_word(), 0)) or q.first_word() < 0:
                break
            raise q.unknown_keyword(known)
        words[word] = _operands(q, word)
    if evolution is None:
        raise q.missing(EVOLUTIO, "the curves")
    _draw(ctx, evolution, table, words)


def _operands(q: Operands, word: str) -> Any:
    if word in ("TITR", "TITX", "TITY", "POSX", "POSY", "XFMT", "YFMT"):
        return str(q.need(MOT, f"'{word}'"))
    if word in ("XBOR", "YBOR"):
        return q.need(FLOTTANT, f"'{word}'"), q.need(FLOTTANT, f"'{word}'")
    if word in ("XGRA", "YGRA"):
        return q.need(FLOTTANT, f"'{word}'")
    if word == "GRIL":
        q.read_keyword(list(LINES))
    if word == "LEGE" and (place := q.read_keyword(PLACES, width=3)) == "XY":
        return place, q.need(FLOTTANT, "the place of the legend"), q.need(FLOTTANT, "the place of the legend")
    if word == "CHOI":
        numbers = []
        while (n := q.read(ENTIER)) is not None:
            numbers.append(n)
        return numbers
    return True


def _draw(ctx: Context, evolution: Evolution, table: Table, words: dict[str, Any]) -> None:
    curves = []
    labels = table.get("TITRE") if table.has("TITRE") else None
    for number, each in enumerate(evolution.curves, 1):
        if words.get("CHOI") and number not in words["CHOI"]:
            continue
        values = each.numbers()
        if values is None:
            ctx.fail(19, "curve {number} has a list of words: it cannot be drawn", at="e", number=number)
        label = each.title if len(evolution.curves) > 1 or "LEGE" in words else ""
        if isinstance(labels, Table) and labels.has(number):
            label = str(labels.get(number))
        style, marker = _style(table.get(number) if table.has(number) else "")
        curves.append(Curve(*values, label, ink(each.colour), style, marker))
    if not curves:
        ctx.fail(21, "no curve to draw", at="e")
    first = evolution.curves[0]
    name = title(ctx, words.get("TITR")) or (first.title if len(evolution.curves) == 1 else "")
    caption = ""
    if "MIMA" in words:
        y = np.concatenate([c.y for c in curves])
        caption = f"min {y.min():.4g}, max {y.max():.4g}"

    def paint(path: Path) -> None:
        draw_curves(
            path,
            curves,
            title=name,
            caption=caption,
            x_title=words.get("TITX", first.x_name),
            y_title=words.get("TITY", first.y_name),
            x_log="LOGX" in words,
            y_log="LOGY" in words,
            x_bounds=words.get("XBOR"),
            y_bounds=words.get("YBOR"),
            square="CARR" in words,
        )

    draw(ctx, paint, "e", wait="NCLK" not in words)


def _style(text: Any) -> tuple[str, str | None]:
    """Read the style of a curve: type of line, and mark."""
    line, mark = "-", None
    for word in str(text).split():
        line = LINES.get(word[:4], line)
        mark = MARKS.get(word[:4], mark)
    return line, mark
