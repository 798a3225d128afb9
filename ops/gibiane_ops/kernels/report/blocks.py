"""What a report is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray

Cell = str | float | int | None


@dataclass(frozen=True, kw_only=True)
class Text:
    """A paragraph; empty lines part it.

    Attributes
    ----------
    title, caption : str
        Above and below, empty for none, as in every block.
    text : str
    """

    text: str
    title: str = ""
    caption: str = ""


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows under a heading; a click on the heading sorts them.

    Attributes
    ----------
    head : sequence of str
    rows : sequence of sequences of str or number
        As many cells as the heading; not-a-number is shown as a dash.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    title: str = ""
    caption: str = ""


@dataclass(frozen=True, kw_only=True)
class Picture:
    """An image put whole into the file.

    Attributes
    ----------
    data : bytes
    kind : str
        ``png``, ``jpeg``, ``gif`` or ``svg+xml``.
    """

    data: bytes
    kind: str
    title: str = ""
    caption: str = ""


@dataclass(frozen=True, kw_only=True)
class Curve:
    """One curve of a chart.

    Attributes
    ----------
    x, y : (n,) float64
    name, color : str
        Colour empty for the next of the palette.
    line, dash : bool
        Join the points; with dashes.
    notes : sequence of n sequences of (str, str)
        The record of each point, shown under the pointer: names (or empty) and values.
    """

    x: FloatArray
    y: FloatArray
    name: str = ""
    color: str = ""
    line: bool = True
    dash: bool = False
    notes: Sequence[Sequence[tuple[str, str]]] = ()


@dataclass(frozen=True, kw_only=True)
class Chart:
    """Curves that can be read and zoomed.

    Attributes
    ----------
    name : str
        Under which scripts of the page find it.
    curves : sequence of Curve
    x_title, y_title : str
    x_log, y_log : bool
        Points that are not positive are left out.
    x_bounds, y_bounds : (float, float), optional
    pareto : bool
        Draw the front of the points that no other point beats in both coordinates, and name its curves.
    """

    name: str
    curves: Sequence[Curve]
    x_title: str = ""
    y_title: str = ""
    x_log: bool = False
    y_log: bool = False
    x_bounds: tuple[float, float] | None = None
    y_bounds: tuple[float, float] | None = None
    pareto: bool = False
    title: str = ""
    caption: str = ""


@dataclass(frozen=True, kw_only=True)
class Body:
    """Triangles of one colour, in a row: a solid of a view."""

    count: int
    color: str


@dataclass(frozen=True, kw_only=True)
class Field:
    """Values shown on a view.

    Attributes
    ----------
    name, title : str
        Short for the menu, long above the colours.
    values : (n_points,) or (n_facets,) float64
        At the points, or one for each facet; not-a-number where there is none.
    at_nodes : bool
    """

    name: str
    title: str
    values: FloatArray
    at_nodes: bool


@dataclass(frozen=True, kw_only=True)
class Arrows:
    """Vectors of a view.

    Attributes
    ----------
    points, vectors : (n, 3) float64
    scale : float
        Length drawn of a vector of length one.
    label, color : str
    moved : (n, 3) float64, optional, length
        Displacement of the points, as that of the view.
    """

    points: FloatArray
    vectors: FloatArray
    scale: float
    label: str = ""
    color: str = "#111111"
    moved: FloatArray | None = None


@dataclass(frozen=True, kw_only=True)
class View:
    """A mesh that can be turned, with its fields.

    Attributes
    ----------
    name : str
        Under which scripts of the page find it.
    points : (n_points, 3) float64, length
    nodes : (n_points,) int64
        Number of each point on screen, from 1.
    triangles : (n_triangles, 3) int64
        Bodies one after the other.
    owner : (n_triangles,) int64
        Facet of each triangle.
    elements : (n_facets,) int64
        Number on screen, from 1, of the element behind each facet.
    edges, lines : (k, 2) int64
        Edges of elements, which the reader can hide; lines, which stay.
    bodies : sequence of Body
    fields : sequence of Field
    arrows : sequence of Arrows
    moved : (n_points, 3) float64, optional, length
        Displacement, shown `factor` times.
    flat : bool
        A plane mesh: seen from above at first.
    """

    name: str
    points: FloatArray
    nodes: IntArray
    triangles: IntArray
    owner: IntArray
    elements: IntArray
    edges: IntArray
    lines: IntArray
    bodies: Sequence[Body]
    fields: Sequence[Field] = ()
    arrows: Sequence[Arrows] = ()
    moved: FloatArray | None = None
    factor: float = 1.0
    flat: bool = False
    title: str = ""
    caption: str = ""


Block = Text | Table | Picture | Chart | View


@dataclass(frozen=True, kw_only=True)
class Page:
    """One tab of a report."""

    title: str
    blocks: Sequence[Block] = field(default_factory=list)


def pareto_front(x: FloatArray, y: FloatArray) -> IntArray:
    """Find the points that no other point beats: none is at most as large in both coordinates and smaller in one.

    Parameters
    ----------
    x, y : (n,) float64
        Points with a coordinate that is not finite are never on the front.

    Returns
    -------
    (k,) int64
        By increasing x, hence by decreasing y; the first of equal points only.

    Cost
    ----
    One sort.
    """
    kept = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    order = kept[np.lexsort((y[kept], x[kept]))]
    lowest = np.minimum.accumulate(y[order])
    before = np.concatenate([[np.inf], lowest[:-1]]) if len(order) else lowest
    return np.asarray(order[y[order] < before], np.int64)
