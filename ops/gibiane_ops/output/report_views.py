"""Meshes and fields of the language as a view of a report: what is seen of them, with numbers of nodes and elements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels.connectivity import solids
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.plot import BODY_COLORS, amplification
from gibiane_ops.kernels.plot.camera import in_space
from gibiane_ops.kernels.plot.layers import edges_of
from gibiane_ops.kernels.plot.skin import skin
from gibiane_ops.kernels.report import Arrows, Body, Field, View
from gibiane_ops.output import scenes
from gibiane_ops.output.targets import COLOURS
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.deformee import Vecteur
from gibiane_ops.values.maillage import COLOURS as COLOUR_NAMES
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.modele import DISPLACEMENTS, Modele, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store

KernelBlock = tuple[str, IntArray]


@dataclass
class _Piece:
    """A part of a view that shares no point with the others."""

    nodes: IntArray  # (n,) nodes of the session
    facets: list[IntArray]  # local points
    cells: IntArray  # (n_facets,) number of the element of each facet, in the piece's blocks
    numbers: IntArray  # (n_facets,) number on screen
    color: str
    zone: ModelZone | None = None
    lines: IntArray = field(default_factory=lambda: np.zeros((0, 2), np.int64))


def view_of(
    ctx: Context,
    name: str,
    *,
    mesh: Maillage | None,
    model: Modele | None,
    fields: Sequence[tuple[str, ChPoint | MChaml]],
    displacement: ChPoint | None,
    factor: float | None,
    arrows: Vecteur | None,
    title: str,
    caption: str,
) -> View | None:
    """Make a view, or None when nothing of dimension one or more is to be seen.

    Element fields are shown on their own elements, averaged at the nodes of each zone, or by element when they have one
    value each; without element field the mesh is shown, else the zones of the model.
    """
    dim = 2 if int(ctx.option("DIME")) == 2 else 3
    points = node_store(ctx).coords[:, :dim]
    zones = _zones(fields, model, mesh)
    pieces = _of_zones(points, zones) if zones else _of_mesh(points, mesh) if mesh is not None else []
    if not pieces:
        return None
    nodes = np.concatenate([p.nodes for p in pieces])
    starts = np.cumsum([0, *(len(p.nodes) for p in pieces)])
    triangles, owner, edges, bodies, first = [], [], [], [], 0
    for piece, start in zip(pieces, starts, strict=False):
        corners, facet = _triangles(piece.facets)
        triangles.append(corners + start)
        owner.append(facet + first)
        sides, _ = edges_of(piece.facets)
        edges.append(np.unique(np.sort(sides, axis=1), axis=0) + start)
        bodies.append(Body(count=len(corners), color=piece.color))
        first += len(piece.cells)
    shift = _displacement(displacement, len(points), dim)
    moved = None if shift is None else in_space(shift[nodes])
    shown = in_space(points[nodes])
    if factor is None:
        factor = 1.0 if moved is None else amplification(shown, moved)
    return View(
        name=name,
        points=shown,
        nodes=nodes + 1,
        triangles=np.concatenate(triangles),
        owner=np.concatenate(owner),
        elements=np.concatenate([p.numbers for p in pieces]),
        edges=np.concatenate(edges),
        lines=np.concatenate([p.lines + s for p, s in zip(pieces, starts, strict=False)]),
        bodies=bodies,
        fields=[one for label, each in fields for one in _components(label, each, pieces, len(points))],
        arrows=_arrows(points, arrows, nodes, shift),
        moved=moved,
        factor=factor,
        flat=dim == 2,
        title=title,
        caption=caption,
    )


def _zones(
    fields: Sequence[tuple[str, ChPoint | MChaml]], model: Modele | None, mesh: Maillage | None
) -> list[ModelZone]:
    """Return the zones to show: those of the element fields, or of the model when there is no mesh."""
    of_fields = [z.zone for _, f in fields if isinstance(f, MChaml) for z in f.zones if isinstance(z.zone, ModelZone)]
    known = list({id(z): z for z in of_fields}.values())
    if model is not None and (known or mesh is None):
        known = [z for z in model.zones if not known or z in known] or known
    return known


def _of_zones(points: FloatArray, zones: Sequence[ModelZone]) -> list[_Piece]:
    pieces = []
    first = 0
    for k, zone in enumerate(zones):
        if shape(zone.shape).dim >= 2:
            piece = _piece(points, [(zone.shape, zone.cells)], None, first, BODY_COLORS[k % len(BODY_COLORS)])
            piece.zone = zone
            pieces.append(piece)
        first += len(zone.cells)
    return pieces


def _of_mesh(points: FloatArray, mesh: Maillage) -> list[_Piece]:
    """Return the solids of a mesh one by one, then its lines."""
    filled = [b for b in mesh.blocks if shape(b.shape).dim >= 2]
    blocks = [(b.shape, b.cells) for b in filled]
    pieces: list[_Piece] = []
    if blocks:
        count, of_node = solids(blocks, len(points))
        of_cell = np.concatenate([of_node[cells[:, 0]] for _, cells in blocks])
        words = np.concatenate([b.colours for b in filled])
        if count > scenes.MANY_PIECES:
            of_cell, count = np.zeros_like(of_cell), 1
        first = _first_number(mesh)
        for k in range(count):
            for word in np.unique(words[of_cell == k]):
                color = COLOURS.get(COLOUR_NAMES[word], "") or BODY_COLORS[k % len(BODY_COLORS)]
                piece = _piece(points, blocks, (of_cell == k) & (words == word), 0, color)
                piece.numbers = first[piece.cells]
                if len(piece.cells):
                    pieces.append(piece)
    lines = [b.cells[:, :2] for b in mesh.blocks if shape(b.shape).dim == 1]
    if lines:
        nodes, local = np.unique(np.concatenate(lines), return_inverse=True)
        none = np.zeros(0, np.int64)
        pieces.append(_Piece(nodes, [], none, none, "#20324a", lines=local.reshape(-1, 2)))
    return pieces


def _first_number(mesh: Maillage) -> IntArray:
    """Return the number on screen, from 1 through the whole mesh, of each element of dimension two or three."""
    numbers, start = [], 1
    for b in mesh.blocks:
        if shape(b.shape).dim >= 2:
            numbers.append(np.arange(start, start + len(b.cells)))
        start += len(b.cells)
    return np.concatenate(numbers)


def _piece(
    points: FloatArray, blocks: Sequence[KernelBlock], keep: np.ndarray | None, first: int, color: str
) -> _Piece:
    seen = skin(points, blocks, keep=keep)
    if not seen.facets:
        return _Piece(np.zeros(0, np.int64), [], seen.cell, seen.cell, color)
    nodes = np.unique(np.concatenate([f.ravel() for f in seen.facets]))
    facets = [np.searchsorted(nodes, f) for f in seen.facets]
    return _Piece(nodes, facets, seen.cell, seen.cell + first + 1, color)


def _triangles(facets: Sequence[IntArray]) -> tuple[IntArray, IntArray]:
    """Cut facets of three or four corners into triangles; return them with the facet of each."""
    corners, owner, first = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)], 0
    for block in facets:
        for k in range(1, block.shape[1] - 1):
            corners.append(block[:, [0, k, k + 1]])
            owner.append(np.arange(first, first + len(block)))
        first += len(block)
    return np.concatenate(corners), np.concatenate(owner)


def _displacement(displacement: ChPoint | None, n_points: int, dim: int) -> FloatArray | None:
    """Return a displacement at all nodes of the session, (n_points, dim)."""
    if displacement is None:
        return None
    moved = np.zeros((n_points, dim))
    for axis, name in enumerate(DISPLACEMENTS["AXIS" if "UR" in displacement.names else "TRID"][:dim]):
        moved[:, axis] = displacement.at(name, np.arange(n_points))
    return moved


def _components(label: str, shown: ChPoint | MChaml, pieces: Sequence[_Piece], n_points: int) -> list[Field]:
    """Return a field for each component that has a value on what is shown."""
    nodes = np.concatenate([p.nodes for p in pieces])
    found = []
    for component in shown.names:
        lone = len(shown.names) == 1
        name = label if lone and label else f"{label} {component}".strip()
        if isinstance(shown, ChPoint):
            values = np.full(n_points, np.nan)
            own, numbers = shown.parts[component]
            values[own] = numbers
            kept, at_nodes = values[nodes], True
        else:
            kept, at_nodes = _of_elements(shown, component, pieces, n_points)
        if np.isfinite(kept).any() or lone:
            found.append(Field(name=name, title=name, values=kept, at_nodes=at_nodes))
    return found


def _of_elements(shown: MChaml, component: str, pieces: Sequence[_Piece], n_points: int) -> tuple[FloatArray, bool]:
    """Return a component of an element field: at the points of each zone, or by element where it has one value each."""
    arrays = {id(z.zone): (z.zone, z.component(component)) for z in shown.zones if component in z.names}
    single = any(a.shape[1] == 1 for _, a in arrays.values())
    parts = []
    for piece in pieces:
        zone, array = arrays.get(id(piece.zone), (None, np.zeros((0, 0))))
        if not isinstance(zone, ModelZone):
            parts.append(np.full(len(piece.cells) if single else len(piece.nodes), np.nan))
        elif single:
            parts.append(array.mean(axis=1)[piece.cells])
        else:
            nodal = scenes.of_zone(shown, zone, array, n_points).nodal
            parts.append(np.full(len(piece.nodes), np.nan) if nodal is None else nodal[piece.nodes])
    return np.concatenate(parts), not single


def _arrows(points: FloatArray, vectors: Vecteur | None, nodes: IntArray, shift: FloatArray | None) -> list[Arrows]:
    """Return the arrows, with the displacement of their points where there is one (n_points, dim)."""
    if vectors is None:
        return []
    size = scenes.diagonal(points, nodes)
    still = scenes.arrow_layers(points, vectors, size)
    after = scenes.arrow_layers(points if shift is None else points + shift, vectors, size)
    result = []
    for layer, other in zip(still, after, strict=True):
        start, along = in_space(layer.points), in_space(layer.vectors)
        result.append(
            Arrows(
                points=start,
                vectors=along,
                scale=layer.longest * size / float(np.linalg.norm(along, axis=1).max()),
                label=layer.label,
                color=layer.color,
                moved=None if shift is None else in_space(other.points) - start,
            )
        )
    return result
