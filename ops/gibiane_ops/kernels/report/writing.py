"""From the blocks of a report to one HTML file: data, scripts and styles all inside."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.report.blocks import Block, Chart, Page, Picture, Table, Text, View, pareto_front
from gibiane_ops.kernels.report.words import FRENCH, said

NO_SCRIPT = "This report needs JavaScript, which is inside this file; nothing is fetched from a network."

SCRIPTS = ("base.js", "axis.js", "paint.js", "chart.js", "view.js")


def write_report(path: Path, title: str, subtitle: str, pages: Sequence[Page], language: str = "en") -> None:
    """Write a report.

    Parameters
    ----------
    path : Path
        Missing folders are made.
    title, subtitle : str
    pages : sequence of Page
        At least one.
    language : {'en', 'fr'}
        Of buttons and hints.

    Raises
    ------
    BadValue
        When there is no page, a row of a table has not as many cells as its heading, a curve has not as many abscissas
        as ordinates, a chart has no point, or two charts or views have the same name.
    OSError
        When the file cannot be written.

    Notes
    -----
    The numbers of views are put into the file as they are (float64), so that what is read under the pointer is what
    was computed.

    Cost
    ----
    About 120 bytes in the file for each point of the surface of a mesh, and 11 for each further field.
    """
    if not pages:
        raise BadValue("report", "without a page", "at least one page")
    _check_names(pages)
    data = {
        "title": title,
        "words": FRENCH if language == "fr" else {},
        "pages": [{"title": p.title, "blocks": [_plain(b, language) for b in p.blocks]} for p in pages],
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(_html(title, subtitle, data, language), encoding="utf-8")


def _html(title: str, subtitle: str, data: dict[str, Any], language: str) -> str:
    folder = resources.files("gibiane_ops.kernels.report") / "page"
    # "</script>" inside a text would end the data: no "<" is left in them
    content = json.dumps(data, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
    scripts = "\n".join(f"<script>\n{(folder / name).read_text(encoding='utf-8')}</script>" for name in SCRIPTS)
    return f"""<!DOCTYPE html>
<html lang="{language}">
<head>
<meta charset="utf-8">
<meta name="color-scheme" content="light dark">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>{escape(title)}</title>
<style>
{(folder / "report.css").read_text(encoding="utf-8")}</style>
</head>
<body>
<header><h1>{escape(title)}</h1><p>{escape(subtitle)}</p><nav role="tablist"></nav></header>
<noscript>{escape(said(NO_SCRIPT, language))}</noscript>
<main></main>
<script type="application/json" id="data">{content}</script>
{scripts}
</body>
</html>
"""


def _check_names(pages: Sequence[Page]) -> None:
    seen: set[tuple[type, str]] = set()
    for page in pages:
        for block in page.blocks:
            if isinstance(block, Chart | View):
                if (type(block), block.name) in seen:
                    raise BadValue("name of a chart or view", block.name, "names that differ")
                seen.add((type(block), block.name))


def _plain(block: Block, language: str) -> dict[str, Any]:
    """Turn a block into what JSON can hold."""
    common = {"title": block.title, "caption": block.caption}
    match block:
        case Text():
            return common | {"kind": "text", "text": block.text}
        case Table():
            return common | {"kind": "table", "head": list(block.head), "rows": _rows(block)}
        case Picture():
            source = f"data:image/{block.kind};base64,{base64.b64encode(block.data).decode('ascii')}"
            return common | {"kind": "picture", "source": source}
        case Chart():
            return common | _chart(block, language)
        case View():
            return common | _view(block)


def _rows(table: Table) -> list[list[Any]]:
    for row in table.rows:
        if len(row) != len(table.head):
            raise BadValue(f"table {table.title}".strip(), f"a row of {len(row)} cells", f"{len(table.head)} cells")
    return [[_number(c) if isinstance(c, float) else c for c in row] for row in table.rows]


def _number(value: float) -> float | None:
    """Return a number that JSON can hold."""
    return float(value) if np.isfinite(value) else None


def _chart(chart: Chart, language: str) -> dict[str, Any]:
    for curve in chart.curves:
        if len(curve.x) != len(curve.y):
            raise BadValue(
                f"curve {curve.name}".strip(), f"{len(curve.x)} abscissas, {len(curve.y)} ordinates", "as many"
            )
    kept = [np.isfinite(c.x) & np.isfinite(c.y) & ~(chart.x_log & (c.x <= 0)) & ~(chart.y_log & (c.y <= 0))
            for c in chart.curves]  # fmt: skip
    if not sum(int(k.sum()) for k in kept):
        limit = "at least one point, positive on logarithmic axes"
        raise BadValue(f"chart {chart.title or chart.name}", "without a point to draw", limit)
    front = _front(chart, kept) if chart.pareto else None
    names = list(dict.fromkeys(chart.curves[k].name for k, _ in front or []))
    caption = chart.caption
    if names:
        caption = f"{caption}\n" if caption else ""
        caption += said("Pareto front (dashed), by increasing abscissa:", language) + " " + " – ".join(names)
    return {
        "kind": "chart",
        "id": chart.name,
        "caption": caption,
        "xtitle": chart.x_title,
        "ytitle": chart.y_title,
        "xlog": chart.x_log,
        "ylog": chart.y_log,
        "xbounds": chart.x_bounds,
        "ybounds": chart.y_bounds,
        "pareto": front,
        "curves": [
            {
                "name": c.name,
                "color": c.color,
                "line": c.line,
                "dash": c.dash,
                "x": [_number(v) for v in c.x.tolist()],
                "y": [_number(v) for v in c.y.tolist()],
                "notes": [[list(pair) for pair in note] for note in c.notes],
            }
            for c in chart.curves
        ],
    }


def _front(chart: Chart, kept: Sequence[Any]) -> list[tuple[int, int]]:
    """Return the front as curve and point of each."""
    x = np.concatenate([np.where(k, c.x, np.nan) for c, k in zip(chart.curves, kept, strict=True)])
    y = np.concatenate([c.y for c in chart.curves])
    curve = np.concatenate([np.full(len(c.x), k) for k, c in enumerate(chart.curves)])
    point = np.concatenate([np.arange(len(c.x)) for c in chart.curves])
    return [(int(curve[i]), int(point[i])) for i in pareto_front(x, y)]


def _view(view: View) -> dict[str, Any]:
    return {
        "kind": "view",
        "id": view.name,
        "flat": view.flat,
        "points": _reals(view.points),
        "nodes": _integers(view.nodes),
        "triangles": _integers(view.triangles),
        "owner": _integers(view.owner),
        "elements": _integers(view.elements),
        "edges": _integers(view.edges),
        "lines": _integers(view.lines),
        "bodies": [{"count": b.count, "color": b.color} for b in view.bodies],
        "fields": [
            {
                "name": f.name,
                "title": f.title,
                "where": "node" if f.at_nodes else "element",
                "values": _reals(f.values),
            }
            for f in view.fields
        ],
        "arrows": [
            {
                "label": a.label,
                "color": a.color,
                "scale": a.scale,
                "points": _reals(a.points),
                "vectors": _reals(a.vectors),
                "moved": None if a.moved is None else _reals(a.moved),
            }
            for a in view.arrows
        ],
        "moved": None if view.moved is None else _reals(view.moved),
        "factor": view.factor,
    }


def _reals(values: FloatArray) -> dict[str, str]:
    return {"kind": "f8", "data": base64.b64encode(np.ascontiguousarray(values, "<f8").tobytes()).decode("ascii")}


def _integers(values: IntArray) -> dict[str, str]:
    return {"kind": "i4", "data": base64.b64encode(np.ascontiguousarray(values, "<i4").tobytes()).decode("ascii")}
