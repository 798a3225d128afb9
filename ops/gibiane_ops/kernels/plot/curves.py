"""Curves against an abscissa."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.plot.camera import FloatArray
from gibiane_ops.kernels.plot.canvas import MUTED, header, sheet

if TYPE_CHECKING:
    from matplotlib.axis import Axis

PALETTE = ("#1f5fa8", "#d1662a", "#2e8b57", "#a8324a", "#6f55a5", "#8a6d1f", "#1b8a9a", "#5f6b7a")
"""Colours of the curves, in order."""


@dataclass(frozen=True)
class Curve:
    """One curve.

    Attributes
    ----------
    x, y : (n,) float64
    label : str
        Text of the legend.
    color : str
        Empty for the next of the palette.
    style : str
        As matplotlib's ``-``, ``--``, ``:``; empty for marks alone.
    marker : str, optional
        As matplotlib's ``o``, ``s``; none by default beyond 25 points.
    """

    x: FloatArray
    y: FloatArray
    label: str = ""
    color: str = ""
    style: str = "-"
    marker: str | None = None


def draw_curves(
    path: Path | str,
    curves: Sequence[Curve],
    *,
    title: str = "",
    caption: str = "",
    x_title: str = "",
    y_title: str = "",
    x_log: bool = False,
    y_log: bool = False,
    x_bounds: tuple[float, float] | None = None,
    y_bounds: tuple[float, float] | None = None,
    grid: bool = True,
    square: bool = False,
    size: tuple[int, int] = (1200, 800),
) -> None:
    """Draw curves into a file.

    Parameters
    ----------
    path : Path or str
        Extension .png, .svg or .pdf; missing folders are made.
    curves : sequence of Curve
        At least one point in all.
    title, caption : str
        Text at the top, and the smaller line below it.
    x_title, y_title : str
        Names of the axes.
    x_log, y_log : bool
        Logarithmic axes; all values have to be positive.
    x_bounds, y_bounds : (float, float), optional
        Ends of the axes.
    grid : bool
        Draw lines across at the graduations.
    square : bool
        One unit of x as long as one of y.
    size : (int, int)
        Width and height in pixels.

    Raises
    ------
    BadValue
        When there is no point, when x and y differ in length, or when a value is not positive on a logarithmic axis.
    MissingPackage
        When matplotlib is not installed.
    """
    for curve in curves:
        if len(curve.x) != len(curve.y):
            raise BadValue(
                f"curve {curve.label}".strip(), f"{len(curve.x)} abscissas, {len(curve.y)} ordinates", "as many"
            )
    if not sum(len(curve.x) for curve in curves):
        raise BadValue("drawing of curves", "without a point", "at least one point")
    _check_positive("abscissa on a logarithmic axis", x_log, [c.x for c in curves], x_bounds)
    _check_positive("ordinate on a logarithmic axis", y_log, [c.y for c in curves], y_bounds)
    with sheet(path, size) as figure:
        header(figure, title, caption)
        top = 0.88 if title or caption else 0.95
        axes = figure.add_axes((0.11, 0.12, 0.85, top - 0.12))
        axes.spines[["top", "right"]].set_visible(False)
        for index, curve in enumerate(curves):
            axes.plot(
                curve.x,
                curve.y,
                curve.style or "none",
                color=curve.color or PALETTE[index % len(PALETTE)],
                marker=_marker(curve),
                ms=5.0,
                mec="white",
                mew=0.6,
                lw=1.7,
                label=curve.label or None,
                clip_on=x_bounds is not None or y_bounds is not None,
            )
        axes.set_xlabel(x_title, fontsize=10)
        axes.set_ylabel(y_title, fontsize=10)
        if x_log:
            axes.set_xscale("log")
            _graduate_log(axes.xaxis, [c.x for c in curves])
        if y_log:
            axes.set_yscale("log")
            _graduate_log(axes.yaxis, [c.y for c in curves])
        if x_bounds is not None:
            axes.set_xlim(*x_bounds)
        if y_bounds is not None:
            axes.set_ylim(*y_bounds)
        if square:
            axes.set_aspect("equal", adjustable="datalim")
        if grid:
            axes.set_axisbelow(True)
            axes.grid(True, color=MUTED, alpha=0.25, lw=0.6)
            if x_log or y_log:
                axes.grid(True, which="minor", color=MUTED, alpha=0.12, lw=0.4)
        if any(curve.label for curve in curves):
            axes.legend(fontsize=9.5, frameon=True, framealpha=0.85, edgecolor="none", loc="best")


def _check_positive(what: str, log: bool, values: Sequence[FloatArray], bounds: tuple[float, float] | None) -> None:
    """Refuse what a logarithmic axis cannot show."""
    if not log:
        return
    lowest = min([float(np.min(v)) for v in values if len(v)] + list(bounds or ()))
    if lowest <= 0.0:
        raise BadValue(what, lowest, "> 0")


def _graduate_log(axis: Axis, values: Sequence[FloatArray]) -> None:
    """Write 1, 2, 5, 10 ... on a logarithmic axis of few decades: powers of ten alone would leave it almost bare."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    lowest = min(float(np.min(v)) for v in values if len(v))
    highest = max(float(np.max(v)) for v in values if len(v))
    if highest <= 1000.0 * lowest:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.6g}"))
        axis.set_minor_formatter(NullFormatter())


def _marker(curve: Curve) -> str:
    if curve.marker is not None:
        return curve.marker
    return "o" if len(curve.x) <= 25 else ""
