"""SORTIR 'VTK': meshes and fields for ParaView."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gibiane.binding import Operands
from gibiane.builtins.text import output_path
from gibiane.forms import Arg, Key
from gibiane.nodes import Name
from gibiane.registry import Context, Refused, extend
from gibiane.values import CHPOINT, FLOTTANT, MAILLAGE, MCHAML, MMODEL, MOT, TABLE, Table
from gibiane_ops.kernels.io import write_mesh
from gibiane_ops.kernels.topology import group_by_nodes, places_in, used_nodes
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.modele import DISPLACEMENTS, FORCES, Modele, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store

VECTORS = (*DISPLACEMENTS.values(), *FORCES.values())
CHOICES = ("TEMP", "BINA", "FORM", "AUTO", "NOUV", "SUIT", "NPVD")


@dataclass
class _Content:
    """What goes into a file."""

    meshes: list[Maillage] = field(default_factory=list)
    fields: list[tuple[str, ChPoint | MChaml]] = field(default_factory=list)
    time: float | None = None
    words: set[str] = field(default_factory=set)


@extend("SORTIR").stream(
    Key("VTK", "meshes and fields for a viewer"),
    Key("TEMP", "time of a series", Arg("t", FLOTTANT)),
    Key(("BINA", "FORM", "AUTO", "SUIT"), "accepted, change nothing", name="format"),
    Key("NOUV", "start the series again"),
    Key("NPVD", "no list of the series"),
    syntax="'VTK' g:MAILLAGE field:CHPOINT|MCHAML (name)... ('TEMP' t) ('NOUV') ('NPVD')",
)
def _sort_vtk(ctx: Context, q: Operands) -> Any:
    i = q.first_word()
    if i < 0 or str(q.values[i])[:4].strip() != "VTK":
        return Refused
    del q.values[i], q.nodes[i]
    content = _read(q)
    if not content.meshes and not content.fields:
        raise q.missing("MAILLAGE, CHPOINT or MCHAML", "the file")
    blocks = _blocks(ctx, content)
    points, local, at_points, in_cells = _data(ctx, content, blocks)
    target = output_path(ctx, ".vtu")
    path = target if content.time is None else _series(ctx, target, content)
    try:
        with worded(ctx):
            write_mesh(path, points, local, at_points, in_cells)
    except OSError as failure:
        ctx.cannot_write(path, failure)
    if ctx.option("ECHO") >= 1:
        ctx.write(f" SORTIR : {path.as_posix()}")
    return None


def _read(q: Operands) -> _Content:
    content = _Content()
    last = ""
    while q.values:
        value, node = q.take((MAILLAGE, CHPOINT, MCHAML, MMODEL, TABLE))
        if node is not None:
            last = _take(content, value, node.word if isinstance(node, Name) else "")
            continue
        i = q.first_word()
        if i < 0 or (q.is_operator_word(i) and str(q.values[i])[:4] not in CHOICES):
            break
        word = q.read_keyword(CHOICES)
        if word == "TEMP":
            content.time = float(q.need(FLOTTANT, "the time"))
        elif word is not None:
            content.words.add(word)
        else:
            name = str(q.need(MOT)).strip()
            if last == "field":
                content.fields[-1] = name, content.fields[-1][1]
    return content


def _take(content: _Content, value: Any, name: str) -> str:
    if isinstance(value, Maillage):
        content.meshes.append(value)
        return "mesh"
    if isinstance(value, Modele):
        content.meshes += [z.mesh for z in value.zones]
        return "mesh"
    if isinstance(value, Table):
        kind = ""
        for index, entry in value.entries.values():
            kind = _take(content, entry, str(index)) if isinstance(entry, Maillage | ChPoint | MChaml) else kind
        return kind
    content.fields.append((name or value.title or f"field{len(content.fields) + 1}", value))
    return "field"


def _blocks(ctx: Context, content: _Content) -> list[tuple[str, IntArray]]:
    """Return the cells of the file: the meshes given, else those of the element fields, else the nodes."""
    meshes = content.meshes or [
        z.zone.mesh
        for _, f in content.fields
        if isinstance(f, MChaml)
        for z in f.zones
        if isinstance(z.zone, ModelZone)
    ]
    if not meshes:
        nodes = np.unique(np.concatenate([f.nodes for _, f in content.fields if isinstance(f, ChPoint)]))
        return [("POI1", nodes[:, None])]
    found: dict[str, list[IntArray]] = {}
    for mesh in meshes:
        for name, cells in mesh.kernel_blocks:
            found.setdefault(name, []).append(cells)
    if not found:
        ctx.fail(21, "there is nothing to write: the mesh is empty")
    return [(name, np.concatenate(parts)) for name, parts in found.items()]


def _data(ctx: Context, content: _Content, blocks: list[tuple[str, IntArray]]) -> Any:
    """Return points, blocks, point data and cell data, nodes renumbered to those of the file."""
    nodes = used_nodes([cells for _, cells in blocks])
    points = node_store(ctx).coords[nodes]
    at_points: dict[str, FloatArray] = {}
    in_cells: dict[str, list[FloatArray]] = {}
    for name, values in content.fields:
        if isinstance(values, ChPoint):
            at_points |= _nodal(name, values, nodes)
        else:
            _element(name, values, blocks, nodes, at_points, in_cells)
    return points, [(name, places_in(nodes, cells)) for name, cells in blocks], at_points, in_cells


def _nodal(name: str, values: ChPoint, nodes: IntArray) -> dict[str, FloatArray]:
    """Return a nodal field as vectors (displacements, forces) and scalars."""
    found: dict[str, FloatArray] = {}
    # multipliers stand on nodes of their own, which are not in the file
    left = [n for n in values.names if len(np.intersect1d(values.parts[n][0], nodes))]
    for names in VECTORS:
        if set(names) <= set(left):
            found[name] = values.table(names, nodes)
            left = [n for n in left if n not in names]
            break
    for component in left:
        single = len(left) == 1 and not found
        found[name if single else f"{name}_{component}"] = values.at(component, nodes)
    return found


def _element(
    name: str,
    values: MChaml,
    blocks: Sequence[tuple[str, IntArray]],
    nodes: IntArray,
    at_points: dict[str, FloatArray],
    in_cells: dict[str, list[FloatArray]],
) -> None:
    """Add an element field: its mean in each cell; at the nodes as well when it stands there."""
    single = len(values.names) == 1
    for component in values.names:
        label = name if single else f"{name}_{component}"
        columns = [np.full(len(cells), np.nan) for _, cells in blocks]
        total, count = np.zeros(len(nodes)), np.zeros(len(nodes))
        for zone in values.zones:
            if not isinstance(zone.zone, ModelZone) or component not in zone.names:
                continue
            _fill(zone.zone, zone.component(component).mean(axis=1), blocks, columns)
            if values.support == "NOEUD":
                at = np.searchsorted(nodes, zone.zone.cells).ravel()
                kept = (at < len(nodes)) & (nodes[np.minimum(at, len(nodes) - 1)] == zone.zone.cells.ravel())
                corner = np.broadcast_to(zone.component(component), zone.zone.cells.shape).ravel()
                total += np.bincount(at[kept], corner[kept], minlength=len(nodes))
                count += np.bincount(at[kept], minlength=len(nodes))
        if values.support == "NOEUD":
            at_points[label] = np.where(count > 0, total / np.maximum(count, 1), np.nan)
        else:
            in_cells[label] = columns


def _fill(on: ModelZone, means: FloatArray, blocks: Sequence[tuple[str, IntArray]], columns: list[FloatArray]) -> None:
    """Put the values of a zone into the cells of the file that are its elements."""
    for (name, cells), column in zip(blocks, columns, strict=True):
        if name != on.shape:
            continue
        if cells is on.cells or np.array_equal(cells, on.cells):
            column[:] = means
            continue
        group, _ = group_by_nodes(np.concatenate([on.cells, cells]))
        value = np.full(int(group.max()) + 1, np.nan)
        value[group[: len(on.cells)]] = means
        found = value[group[len(on.cells) :]]
        column[:] = np.where(np.isnan(found), column, found)


def _series(ctx: Context, target: Path, content: _Content) -> Path:
    """Return the file of a time, and list it in the .pvd of its series."""
    series: dict[str, list[tuple[float, str]]] = ctx.state.setdefault("vtk series", {})
    key = target.with_suffix("").as_posix()
    steps = series.setdefault(key, [])
    if "NOUV" in content.words:
        steps.clear()
    path = target.with_name(f"{target.stem}_{len(steps) + 1:04d}{target.suffix}")
    steps.append((content.time or 0.0, path.name))
    if "NPVD" not in content.words:
        rows = "".join(f'    <DataSet timestep="{t!r}" part="0" file="{name}"/>\n' for t, name in steps)
        text = (
            '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
            f"{rows}  </Collection>\n</VTKFile>\n"
        )
        target.parent.mkdir(parents=True, exist_ok=True)
        target.with_suffix(".pvd").write_text(text, encoding="utf-8")
    return path
