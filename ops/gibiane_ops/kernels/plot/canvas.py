"""The sheet that a picture is drawn on: formats, fonts, files. The only place that knows how matplotlib is set up."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gibiane_ops.kernels.errors import BadValue, MissingPackage

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 150
INK = "#1b1f24"
MUTED = "#5f6b7a"

# typed loosely: matplotlib's own type of these names is a list of all of them
_STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "text.color": INK,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "svg.hashsalt": "gibiane",
    "pdf.fonttype": 42,
}

# No date in the file: the same picture gives the same bytes.
_METADATA: dict[str, dict[str, None]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}


@contextmanager
def sheet(path: Path | str, size: tuple[int, int]) -> Iterator[Figure]:
    """Give a blank figure; write it when the block ends without an exception.

    Parameters
    ----------
    path : Path or str
        The extension chooses the format: .png, .svg or .pdf. Missing folders are made.
    size : (int, int)
        Width and height in pixels, at 150 pixels an inch.

    Yields
    ------
    matplotlib.figure.Figure

    Raises
    ------
    MissingPackage
        When matplotlib is not installed.
    BadValue
        When the extension is not one of the three.
    """
    path = Path(path)
    extension = path.suffix.lower()
    if extension not in _METADATA:
        raise BadValue("name of a picture", path.name, "an extension .png, .svg or .pdf")
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingPackage("matplotlib", 'pip install "gibiane[viz]"') from error
    with rc_context(_STYLE):
        figure = Figure(figsize=(size[0] / DPI, size[1] / DPI), dpi=DPI, facecolor="white")
        yield figure
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=DPI, metadata=_METADATA[extension])


def header(figure: Figure, title: str, caption: str) -> None:
    """Write the title and the line below it, at the upper left.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    title, caption : str
        Empty for none.
    """
    height = figure.get_figheight()
    line = 0.30 / height
    figure.text(0.03, 1.0 - 0.16 / height, title, fontsize=12.5, fontweight="bold", va="top")
    figure.text(0.03, 1.0 - 0.16 / height - (line if title else 0.0), caption, fontsize=9, color=MUTED, va="top")
