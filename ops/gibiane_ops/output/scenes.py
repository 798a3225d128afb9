"""From objects of the language to the layers of a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gibiane_ops.kernels.connectivity import solids
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.plot.layers import (
    BODY_COLORS,
    Arrows,
    Dots,
    Labels,
    Layer,
    Lines,
    Surface,
    amplification,
    lifts,
    outline,
    placed,
    used,
)
from gibiane_ops.kernels.plot.scales import short
from gibiane_ops.kernels.plot.skin import skin
from gibiane_ops.kernels.recovery import nodal_mean
from gibiane_ops.kernels.supports import moved
from gibiane_ops.kernels.topology import places_in
from gibiane_ops.output.targets import COLOURS, ink
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.deformee import Shape, Vecteur
from gibiane_ops.values.maillage import COLOURS as COLOUR_NAMES
from gibiane_ops.values.maillage import Block, Maillage
from gibiane_ops.values.modele import DISPLACEMENTS, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray

KernelBlock = tuple[str, IntArray]
Plane = tuple[FloatArray, FloatArray]
MANY_PIECES = 40


@dataclass(frozen=True, eq=False)
class Look:
    """How a scene is shown.

    Attributes
    ----------
    plane : (point, normal towards the eye), optional
        What lies on the side of the normal is taken away.
    shrink : float, optional
        Factor by which each element is reduced.
    apart : float, optional
        How far the solids are moved from one another.
    edges : bool
        Show the edges of the elements.
    section : bool
        Show only what the plane crosses.
    """

    plane: Plane | None = None
    shrink: float | None = None
    apart: float | None = None
    edges: bool = True
    section: bool = False


@dataclass(frozen=True, eq=False)
class Values:
    """Values to show on cells: at the nodes (not-a-number where there is none), or one for each cell."""

    nodal: FloatArray | None = None
    flat: FloatArray | None = None


def displaced(points: FloatArray, item: Shape) -> tuple[FloatArray, float]:
    """Return the moved points of a DEFORME, and the factor used."""
    nodes = item.mesh.nodes
    dim = points.shape[1]
    u = np.zeros_like(points)
    family = "AXIS" if "UR" in item.displacement.names else "TRID"
    for axis, name in enumerate(DISPLACEMENTS[family][:dim]):
        u[nodes, axis] = item.displacement.at(name, nodes)
    factor = amplification(points[nodes], u[nodes]) if item.factor is None else item.factor
    return points + factor * u, factor


def of_chpoint(field: ChPoint, name: str) -> Values:
    """Return a component of a nodal field as values to show."""
    nodal = np.full(field.store.count, np.nan)
    nodes, values = field.parts[name]
    nodal[nodes] = values
    return Values(nodal=nodal)


def of_zone(field: MChaml, on: ModelZone, values: FloatArray, n_points: int) -> Values:
    """Return values (m, q) of an element field on a zone: by element, or averaged at the nodes of the zone."""
    if values.shape[1] == 1:
        return Values(flat=values[:, 0])
    at_nodes = moved(shape(on.shape), values[..., None], field.support, "NOEUD")
    nodal = np.full(n_points, np.nan)
    used = np.unique(on.cells)
    local = places_in(used, on.cells)
    nodal[used] = nodal_mean(len(used), [local], [at_nodes])[:, 0]
    return Values(nodal=nodal)


def cells_layers(
    points: FloatArray,
    blocks: Sequence[KernelBlock],
    look: Look,
    values: Values | None = None,
    colours: Sequence[str] | None = None,
    label: str = "",
    first: int = 0,
) -> list[Layer]:
    """Return the surfaces of the solids and surfaces among some blocks, one per piece and colour.

    `colours` has one word of colour per cell ("DEFA" takes the colour of the piece); `first` numbers the pieces.
    """
    blocks = [(name, cells) for name, cells in blocks if shape(name).dim >= 2]
    if not blocks:
        return []
    count, piece_of_node = solids(blocks, len(points))
    pieces = np.concatenate([piece_of_node[cells[:, 0]] for _, cells in blocks])
    if count > MANY_PIECES:
        pieces, count = np.zeros_like(pieces), 1
    nodes = [
        np.unique(np.concatenate([c[pieces[a : a + len(c)] == k].ravel() for a, c in _starts(blocks)]))
        for k in range(count)
    ]
    shifts = lifts([points[n] for n in nodes], look.apart) if look.apart is not None else [None] * count
    layers: list[Layer] = []
    for k in range(count):
        words = np.array(colours)[pieces == k] if colours is not None else np.array(["DEFA"])
        for word in np.unique(words):
            keep = pieces == k if colours is None else (pieces == k) & (np.array(colours) == word)
            seen = skin(points, blocks, plane=look.plane, shrink=look.shrink, keep=keep, section=look.section)
            if not seen.facets:
                continue
            nodal = seen.carry(values.nodal) if values is not None and values.nodal is not None else None
            flat = values.flat[seen.cell] if values is not None and values.flat is not None else None
            shade = COLOURS.get(str(word), "") or BODY_COLORS[(first + k) % len(BODY_COLORS)]
            layers.append(
                Surface(seen.points, seen.facets, nodal, flat, shade, look.edges, label=label, offset=shifts[k])
            )
            label = ""  # one entry of the legend for an object of several pieces
    return layers


def _starts(blocks: Sequence[KernelBlock]) -> list[tuple[int, IntArray]]:
    start, result = 0, []
    for _, cells in blocks:
        result.append((start, cells))
        start += len(cells)
    return result


def mesh_layers(
    points: FloatArray,
    mesh: Maillage,
    look: Look,
    *,
    colour: str = "",
    label: str = "",
    values: Values | None = None,
    first: int = 0,
) -> list[Layer]:
    """Return the layers of a mesh: solids and surfaces filled, lines, points."""
    solid = [b for b in mesh.blocks if shape(b.shape).dim >= 2]
    words = [colour or COLOUR_NAMES[c] for b in solid for c in b.colours]
    layers = cells_layers(points, [(b.shape, b.cells) for b in solid], look, values, words, label, first)
    for block in mesh.blocks:
        dim = shape(block.shape).dim
        if dim < 2:
            layers += _thin(points, block, dim, colour, "" if layers else label)
    return layers


def _thin(points: FloatArray, block: Block, dim: int, colour: str, label: str) -> list[Layer]:
    layers: list[Layer] = []
    for index in np.unique(block.colours):
        word = colour or COLOUR_NAMES[index]
        cells = block.cells[block.colours == index]
        if dim == 1:
            layers.append(Lines(points, cells[:, :2], ink(word) or "#20324a", 1.6, label=label))
        else:
            layers.append(Dots(points[cells[:, 0]], ink(word) or "#b3261e", label=label))
        label = ""
    return layers


def outline_layers(points: FloatArray, mesh: Maillage, colour: str = "") -> list[Layer]:
    """Return the sharp edges of a mesh, as lines."""
    blocks = [b for b in mesh.kernel_blocks if shape(b[0]).dim >= 2]
    layers = [
        layer
        for b in mesh.blocks
        if shape(b.shape).dim < 2
        for layer in _thin(points, b, shape(b.shape).dim, colour, "")
    ]
    if blocks:
        seen = skin(points, blocks)
        edges = outline(points, seen.facets) if points.shape[1] == 3 else _rim(seen.facets)
        layers.append(Lines(points, edges, ink(colour) or "#5f6b7a", 1.0, "--"))
    return layers


def _rim(facets: Sequence[IntArray]) -> IntArray:
    """Return the edges used by one facet only."""
    sides = np.concatenate([np.stack([f, np.roll(f, -1, axis=1)], axis=2).reshape(-1, 2) for f in facets])
    unique, count = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    return np.asarray(unique[count == 1], np.int64)


def arrow_layers(points: FloatArray, vectors: Vecteur, size: float) -> list[Arrows]:
    """Return the arrows of a VECTEUR; `size` is the diagonal of the scene."""
    layers: list[Arrows] = []
    dim = points.shape[1]
    for arrow in vectors.arrows:
        nodes = arrow.field.nodes
        values = np.zeros((len(nodes), dim))
        for axis, name in enumerate(arrow.names[:dim]):
            values[:, axis] = arrow.field.at(name, nodes)
        length = np.linalg.norm(values, axis=1)
        largest = float(length.max(initial=0.0))
        kept = length > 1e-12 * largest
        if not kept.any():
            continue
        longest = 0.12 if arrow.factor is None else abs(arrow.factor) * largest / size
        start = points[nodes[kept]]
        if arrow.factor is not None and arrow.factor < 0:
            start = start + arrow.factor * values[kept]
        label = " ".join(n for n in arrow.names if n in arrow.field.names)
        layers.append(Arrows(start, values[kept], longest, ink(arrow.colour) or "#111111", label))
    return layers


def diagonal(points: FloatArray, nodes: IntArray) -> float:
    """Return the diagonal of the box of some points, 1 when it is a point."""
    return float(np.linalg.norm(np.ptp(points[nodes], axis=0))) or 1.0 if len(nodes) else 1.0


def spread(parts: list[list[Layer]], look: Look) -> list[Layer]:
    """Return the layers of several objects in one list, the objects moved apart if the look asks for it."""
    parts = [part for part in parts if part]
    if look.apart is None or len(parts) < 2:
        return [layer for part in parts for layer in part]
    shifts = lifts([np.concatenate([placed(each)[used(each)] for each in part]) for part in parts], look.apart)
    return [replace(each, offset=shift) for part, shift in zip(parts, shifts, strict=True) for each in part]


def element_layers(
    shown: MChaml, points: FloatArray, look: Look, component: str | None, zones: list[ModelZone] | None
) -> list[Layer]:
    """Return the layers of a component of an element field, on some zones or all."""
    parts: list[list[Layer]] = []
    for zone in shown.zones:
        if not isinstance(zone.zone, ModelZone) or (zones is not None and zone.zone not in zones):
            continue
        if component is not None and component in zone.names:
            values = of_zone(shown, zone.zone, zone.component(component), len(points))
            parts.append(cells_layers(points, [(zone.zone.shape, zone.zone.cells)], look, values))
    return spread(parts, look)


def field_layers(
    shown: ChPoint | MChaml, mesh: Maillage, points: FloatArray, look: Look, component: str | None
) -> list[Layer]:
    """Return the layers of a component of a field shown on a displaced mesh."""
    if isinstance(shown, MChaml):
        return element_layers(shown, points, look, component, None)
    values = of_chpoint(shown, component) if component is not None else None
    return mesh_layers(points, mesh, look, values=values)


def of_colour(mesh: Maillage, word: str) -> Maillage:
    """Return the elements of one colour."""
    index = COLOUR_NAMES.index(word)
    chosen = [(b, b.colours == index) for b in mesh.blocks]
    return Maillage(mesh.store, [Block(b.shape, b.cells[k], b.colours[k]) for b, k in chosen])


def number_layers(
    points: FloatArray, meshes: Sequence[Maillage], look: Look, words: set[str], values: Values | None
) -> list[Layer]:
    """Return as text the numbers of nodes ('NOEU'), of elements in their block ('ELEM'), and the values ('CHAM')."""
    layers: list[Layer] = []
    nodes = np.unique(np.concatenate([m.nodes for m in meshes]))
    if look.plane is not None:
        nodes = nodes[(points[nodes] - look.plane[0]) @ look.plane[1] <= 0.0]
    if "ELEM" in words or ("CHAM" in words and values is not None and values.flat is not None):
        first = 0
        for block in (b for m in meshes for b in m.blocks):
            centres, cells = _facet_centres(points, block, look)
            if "ELEM" in words:
                layers.append(Labels(centres, [str(c + 1) for c in cells], "#a8324a"))
            else:
                assert values is not None
                assert values.flat is not None
                layers.append(Labels(centres, [short(float(values.flat[first + c]), 3) for c in cells]))
            first += len(block.cells)
    if "NOEU" in words:
        layers.append(Labels(points[nodes], [str(n + 1) for n in nodes], "#1f5fa8", aside=True))
    if "CHAM" in words and values is not None and values.nodal is not None:
        known = nodes[np.isfinite(values.nodal[nodes])]
        layers.append(Labels(points[known], [short(float(values.nodal[n]), 3) for n in known], aside=True))
    return layers


def _facet_centres(points: FloatArray, block: Block, look: Look) -> tuple[FloatArray, IntArray]:
    """Return where the number of an element can be read: the middle of each facet that it shows, or its own."""
    if shape(block.shape).dim < 2:
        return points[block.cells].mean(axis=1), np.arange(len(block.cells))
    seen = skin(points, [(block.shape, block.cells)], plane=look.plane, shrink=look.shrink, section=look.section)
    middles = [seen.points[f].mean(axis=1) for f in seen.facets]
    return np.concatenate(middles) if middles else points[:0], seen.cell
