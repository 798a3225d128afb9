"""What a picture is made of, and the small geometry that prepares it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.plot.camera import FloatArray, in_space
from gibiane_ops.kernels.plot.raster import BoolArray, IntArray

BODY_COLORS = ("#8fb3d9", "#e8b87a", "#9ecfa0", "#d99aa5", "#b7a6d6", "#cfc58a")
"""Colours of the solids of a picture, in order."""


@dataclass(frozen=True)
class Surface:
    """Facets to fill.

    Attributes
    ----------
    points : (n_points, dim) float64, length
        Already displaced when the picture is that of a deformed shape.
    facets : sequence of (n, 3) or (n, 4) int64
        Nodes of triangles and quadrangles.
    nodal : (n_points,) float64, optional
        Values at the nodes, drawn as bands; not-a-number is drawn grey.
    flat : (n_facets,) float64, optional
        A value for each facet, in the order of `facets`; not-a-number is drawn grey.
    color : str
        Colour of the facets without values.
    edges : bool
        Draw the edges of the elements.
    alpha : float
        Opacity; below 1 what lies behind shows through.
    label : str
        Text of the legend.
    offset : (3,) float64, optional, length
        Shift in the picture, see `lifts`.
    """

    points: FloatArray
    facets: Sequence[IntArray]
    nodal: FloatArray | None = None
    flat: FloatArray | None = None
    color: str = BODY_COLORS[0]
    edges: bool = True
    alpha: float = 1.0
    label: str = ""
    offset: FloatArray | None = None


@dataclass(frozen=True)
class Lines:
    """Segments, cut where a surface hides them.

    Attributes
    ----------
    points : (n_points, dim) float64, length
    cells : (n, 2) int64
    color, width, style : str, float, str
        Width in typographic points; style as matplotlib's ``-``, ``--``, ``:``.
    on_top : bool
        Show also what surfaces hide.
    label, offset
        As in `Surface`.
    """

    points: FloatArray
    cells: IntArray
    color: str = "#20324a"
    width: float = 1.2
    style: str = "-"
    on_top: bool = False
    label: str = ""
    offset: FloatArray | None = None


@dataclass(frozen=True)
class Dots:
    """Points, drawn over the surfaces.

    Attributes
    ----------
    points : (n, dim) float64, length
    color, size : str, float
        Diameter in typographic points.
    label, offset
        As in `Surface`.
    """

    points: FloatArray
    color: str = "#b3261e"
    size: float = 4.0
    label: str = ""
    offset: FloatArray | None = None


@dataclass(frozen=True)
class Arrows:
    """Vectors, drawn over the surfaces with a legend of their scale.

    Attributes
    ----------
    points : (n, dim) float64, length
        Where the arrows start.
    vectors : (n, dim) float64
    longest : float
        Length of the longest arrow, as a part of the diagonal of the scene.
    color : str
    label, offset
        As in `Surface`; the label is followed by the length of reference.
    """

    points: FloatArray
    vectors: FloatArray
    longest: float = 0.12
    color: str = "#111111"
    label: str = ""
    offset: FloatArray | None = None


@dataclass(frozen=True)
class Labels:
    """Short texts at points, left out where a surface hides the point.

    Attributes
    ----------
    points : (n, dim) float64, length
    texts : sequence of n str
    color, size : str, float
        Height in typographic points.
    aside : bool
        Beside the point, above and to the right, instead of over it.
    label, offset
        As in `Surface`.
    """

    points: FloatArray
    texts: Sequence[str]
    color: str = "#1b1f24"
    size: float = 7.0
    aside: bool = False
    label: str = ""
    offset: FloatArray | None = None


Layer = Surface | Lines | Dots | Arrows | Labels


def placed(layer: Layer) -> FloatArray:
    """Give the points of a layer in space, its shift included.

    Parameters
    ----------
    layer : Layer

    Returns
    -------
    (n_points, 3) float64, length

    Raises
    ------
    BadValue
        When a coordinate is not finite.
    """
    points = in_space(layer.points)
    if not np.isfinite(points).all():
        raise BadValue("coordinate of a picture", float(points[~np.isfinite(points)][0]), "a finite number")
    return points if layer.offset is None else points + layer.offset


def used(layer: Layer) -> IntArray:
    """List the points that a layer shows.

    Parameters
    ----------
    layer : Layer

    Returns
    -------
    (n,) int64
        Sorted.
    """
    if isinstance(layer, Surface):
        cells = [np.asarray(f, np.int64).ravel() for f in layer.facets]
        return np.unique(np.concatenate(cells)) if cells else np.zeros(0, np.int64)
    if isinstance(layer, Lines):
        return np.unique(np.asarray(layer.cells, np.int64))
    return np.arange(len(layer.points))


def edges_of(facets: Sequence[IntArray]) -> tuple[IntArray, IntArray]:
    """List the sides of facets.

    Parameters
    ----------
    facets : sequence of (n, 3) or (n, 4) int64

    Returns
    -------
    (n_sides, 2) int64, (n_sides,) int64
        Nodes of each side in the order of its facet, and the facet; sides of a facet follow one another.
    """
    sides, owners, first = [], [], 0
    for block in facets:
        block = np.asarray(block, np.int64)
        pairs = np.stack([block, np.roll(block, -1, axis=1)], axis=2)
        sides.append(pairs.reshape(-1, 2))
        owners.append(np.repeat(np.arange(first, first + len(block)), block.shape[1]))
        first += len(block)
    if not sides:
        return np.zeros((0, 2), np.int64), np.zeros(0, np.int64)
    return np.concatenate(sides), np.concatenate(owners)


def facet_normals(points: FloatArray, facets: Sequence[IntArray]) -> FloatArray:
    """Compute unit normals of triangles and quadrangles.

    Parameters
    ----------
    points : (n_points, 3) float64, length
    facets : sequence of (n, 3) or (n, 4) int64

    Returns
    -------
    (n_facets, 3) float64
        Zero for a facet without area.
    """
    normals = [np.zeros((0, 3))]
    for block in facets:
        corners = points[np.asarray(block, np.int64)]
        # half the cross product of the diagonals; for a triangle, of two sides
        normals.append(np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1]))
    normal = np.concatenate(normals)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    unit: FloatArray = normal / np.where(length > 0.0, length, 1.0)
    return unit


def sharp_sides(points: FloatArray, facets: Sequence[IntArray], angle: float = 30.0) -> BoolArray:
    """Find the sides that outline a surface: on its rim, or where it bends.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    facets : sequence of (n, 3) or (n, 4) int64
    angle : float, degrees
        Smallest bend that counts.

    Returns
    -------
    (n_sides,) bool
        For each side of `edges_of`.

    Cost
    ----
    One sort of the sides.
    """
    sides, owner = edges_of(facets)
    if not len(sides):
        return np.zeros(0, np.bool_)
    normal = facet_normals(in_space(points), facets)
    # one number for each pair of nodes: far faster to sort than rows
    pair = sides.min(axis=1) * (int(sides.max()) + 1) + sides.max(axis=1)
    _, group, count = np.unique(pair, return_inverse=True, return_counts=True)
    order = np.argsort(group, kind="stable")
    first = np.cumsum(count) - count
    mate = owner[order[first]]
    other = owner[order[first + np.minimum(1, count - 1)]]
    # the turn of neighbouring facets may differ on an open surface, hence the absolute value
    aligned = np.abs(np.einsum("ij,ij->i", normal[mate], normal[other])) >= np.cos(np.radians(angle))
    sharp: BoolArray = ~((count == 2) & aligned)
    return sharp[group]


def outline(points: FloatArray, facets: Sequence[IntArray], angle: float = 30.0) -> IntArray:
    """List the edges that outline a surface, to draw an undeformed shape with few lines.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    facets : sequence of (n, 3) or (n, 4) int64
    angle : float, degrees

    Returns
    -------
    (n, 2) int64
        Each edge once.
    """
    sides, _ = edges_of(facets)
    return np.unique(np.sort(sides[sharp_sides(points, facets, angle)], axis=1), axis=0)


def amplification(points: FloatArray, displacement: FloatArray, part: float = 0.08) -> float:
    """Choose a round factor that makes a displacement visible.

    Parameters
    ----------
    points, displacement : (n_points, dim) float64, length
    part : float
        Wanted largest displacement, as a part of the diagonal.

    Returns
    -------
    float
        1, 2 or 5 times a power of ten; 1 when nothing moves.
    """
    largest = float(np.max(np.linalg.norm(displacement, axis=1), initial=0.0))
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    if largest == 0.0 or diagonal == 0.0:
        return 1.0
    return round_below(part * diagonal / largest)


def round_below(value: float) -> float:
    """Give the largest of 1, 2, 5 times a power of ten that does not exceed a positive value."""
    power = 10.0 ** np.floor(np.log10(value))
    mantissa = value / power
    return float(power * (5.0 if mantissa >= 5.0 else 2.0 if mantissa >= 2.0 else 1.0))


def lifts(parts: Sequence[FloatArray], factor: float = 0.6) -> list[FloatArray]:
    """Move the parts of an assembly apart, so that the faces between them are seen.

    Parameters
    ----------
    parts : sequence of (n, dim) float64, length
        Points of each part.
    factor : float
        0 leaves all in place; 1 doubles the distances between centres.

    Returns
    -------
    list of (3,) float64, length
        A shift for each part, for the `offset` of its layers.
    """
    centres = [0.5 * (in_space(p).min(axis=0) + in_space(p).max(axis=0)) for p in parts]
    return [factor * (centre - centres[0]) for centre in centres]


def beyond(points: FloatArray, cells: IntArray, origin: FloatArray, normal: FloatArray) -> BoolArray:
    """Select the cells whose centre lies on the side of a plane that its normal shows.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    cells : (n_cells, n_nodes) int64
    origin, normal : (dim,) float64
        A point of the plane, and its normal.

    Returns
    -------
    (n_cells,) bool
        To be left out of a picture that shows the inside: draw the skin of the others.
    """
    beyond_plane: BoolArray = (points[cells].mean(axis=1) - origin) @ normal > 0.0
    return beyond_plane
