"""SORTIR 'HTML': a TABLE of pages into one file that a browser reads without a network."""

from __future__ import annotations

from typing import Any

from gibiane.binding import Operands
from gibiane.builtins.text import output_path
from gibiane.forms import Key
from gibiane.registry import Context, Refused, extend
from gibiane.values import MOT, TABLE, Table, type_of
from gibiane_ops.kernels.report import Page, environment_rows, said, write_report
from gibiane_ops.kernels.report import Table as Rows
from gibiane_ops.output.report_blocks import Place, block_of
from gibiane_ops.values.failures import worded

TOP = ("TITRE", "SOUSTITRE", "ENVIRONNEMENT", "SOUSTYPE")
PAGE = ("TITRE", "SOUSTYPE")


@extend("SORTIR").stream(
    Key("HTML", "a report that a browser reads without a network"),
    syntax="'HTML' t:TABLE",
)
def _sort_html(ctx: Context, q: Operands) -> Any:
    i = q.first_word()
    if i < 0 or str(q.values[i])[:4] != "HTML":
        return Refused
    del q.values[i], q.nodes[i]
    table, node = q.take((TABLE,))
    if node is None:
        raise q.missing(TABLE, "the pages of the report")
    ctx.places["t"] = node
    path = output_path(ctx, ".html")
    title = _text(ctx, table, "TITRE", "Gibiane")
    subtitle = _text(ctx, table, "SOUSTITRE", "")
    pages = _pages(ctx, table)
    language = ctx.session.lang
    if not table.has("ENVIRONNEMENT") or table.get("ENVIRONNEMENT") is not False:
        rows = Rows(
            head=[said("What", language), said("Value", language)],
            rows=environment_rows(language),
            caption=said("What this report was made with: measured times hold for this machine.", language),
        )
        pages.append(Page(title=said("Environment", language), blocks=[rows]))
    try:
        with worded(ctx, at="t"):
            write_report(path, title, subtitle, pages, language)
    except OSError as failure:
        ctx.cannot_write(path, failure)
    if ctx.option("ECHO") >= 1:
        ctx.write(f" SORTIR : {path.as_posix()}")
    return None


def _text(ctx: Context, table: Table, key: str, default: str) -> str:
    if not table.has(key):
        return default
    text = table.get(key)
    if not isinstance(text, str):
        ctx.fail(
            39, "index '{key}' of a report is a {type}, not a {wanted}", at="t", key=key, type=type_of(text), wanted=MOT
        )
    return text.strip()


def _pages(ctx: Context, table: Table) -> list[Page]:
    """Read the pages: the numbered entries of the table, in their order."""
    pages = []
    for index, value in table.entries.values():
        if isinstance(index, str):
            if index not in TOP:
                ctx.fail(
                    7,
                    "'{word}' is no index of a report",
                    at="t",
                    word=index,
                    known=" ".join(TOP[:-1]),
                    hint="the words are {known}; pages and their parts have numbers",
                )
            continue
        if not isinstance(value, Table):
            ctx.fail(
                39,
                "page {page} of a report is a {type}, not a {wanted}",
                at="t",
                page=index,
                type=type_of(value),
                wanted=TABLE,
            )
        title = _text(ctx, value, "TITRE", f"Page {index}")
        blocks = []
        for key, content in value.entries.values():
            if isinstance(key, str):
                if key not in PAGE:
                    ctx.fail(
                        7,
                        "'{word}' is no index of a page of a report",
                        at="t",
                        word=key,
                        known=PAGE[0],
                        hint="the words are {known}; pages and their parts have numbers",
                    )
                continue
            blocks.append(block_of(Place(ctx, f"{index}.{key}"), content))
        pages.append(Page(title=title, blocks=blocks))
    if not pages:
        ctx.fail(21, "the report has no page", at="t", hint="T . 1 = TABL ; T . 1 . 'TITRE' = 'first page' ;")
    return pages
