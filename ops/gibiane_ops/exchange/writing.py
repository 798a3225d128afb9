"""SORTIR of meshes in the formats of other programs, with the names of the objects as groups."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gibiane.binding import Operands
from gibiane.builtins.text import output_path
from gibiane.forms import Key
from gibiane.nodes import Name
from gibiane.registry import Context, Refused, extend
from gibiane.values import CHPOINT, MAILLAGE, MOT, TABLE, Table
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.exchange.formats import FORMATS, write_mesh_file
from gibiane_ops.kernels.exchange.meshfile import MeshFile
from gibiane_ops.kernels.topology import group_by_nodes, places_in, used_nodes
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.nodes import IntArray, node_store

WORDS = tuple(word for word in FORMATS if word not in ("VTK", "FEM"))


@extend("SORTIR").stream(
    Key(WORDS, "meshes for another program", name="of"),
    syntax="'MED'|'UNV'|'NAS'|'ABAQ'|'AVS'|'STL'|'GMSH' g:MAILLAGE|TABLE... (name:MOT)... (field:CHPOINT)...",
)
def _sort(ctx: Context, q: Operands) -> Any:
    i = q.first_word()
    word = str(q.values[i])[:4].strip() if i >= 0 else ""
    if word not in WORDS:
        return Refused
    del q.values[i], q.nodes[i]
    meshes, fields = _read(q)
    if not meshes:
        raise q.missing(MAILLAGE, "the file")
    path = output_path(ctx, FORMATS[word].extension)
    content = _content(ctx, meshes, fields)
    try:
        _write(ctx, path, word, content)
    except OSError as failure:
        ctx.cannot_write(path, failure)
    if ctx.option("ECHO") >= 1:
        ctx.write(f" SORTIR : {path.as_posix()}")
    return None


def _write(ctx: Context, path: Path, word: str, content: MeshFile) -> None:
    """Write the file; error 16 when the format has not the type of an element."""
    with worded(ctx):
        try:
            write_mesh_file(path, word, content)
        except BadValue as failure:
            ctx.fail(
                16,
                "{shapes} do not go into a {name} file: {limit}",
                shapes=failure.value,
                name=FORMATS[word].name,
                limit=failure.limit,
                hint="CHAN changes elements, ELEM chooses some; 'MED' and 'GMSH' hold every type",
            )


def _read(q: Operands) -> tuple[list[tuple[str, Maillage]], list[tuple[str, ChPoint]]]:
    """Read meshes and fields with their names: the word after one, the index in a table, or the name of the object."""
    meshes: list[tuple[str, Maillage]] = []
    fields: list[tuple[str, ChPoint]] = []
    last: list[Any] = []
    while q.values:
        value, node = q.take((MAILLAGE, CHPOINT, TABLE))
        if node is None:
            i = q.first_word()
            if i < 0 or q.is_operator_word(i) or not last:
                break
            name = str(q.need(MOT)).strip()
            last[-1] = name, last[-1][1]
            continue
        name = node.word if isinstance(node, Name) else ""
        if isinstance(value, Table):
            entries = [(str(k).strip(), v) for k, v in value.entries.values()]
            meshes += [("" if k == "MAILLAGE" else k, v) for k, v in entries if isinstance(v, Maillage)]
            fields += [(k, v) for k, v in entries if isinstance(v, ChPoint)]
        elif isinstance(value, Maillage):
            meshes.append((name, value))
            last = meshes
        else:
            fields.append((name, value))
            last = fields
    return meshes, fields


def _content(ctx: Context, meshes: list[tuple[str, Maillage]], fields: list[tuple[str, ChPoint]]) -> MeshFile:
    """Put every element of the meshes into the file once, and the meshes as groups of elements."""
    store = node_store(ctx)
    shapes = list(dict.fromkeys(name for _, mesh in meshes for name in mesh.shapes))
    groups: dict[str, list[tuple[int, IntArray]]] = {}
    blocks = []
    for position, shape_name in enumerate(shapes):
        owners = [(name, mesh.cells(shape_name)) for name, mesh in meshes if shape_name in mesh.shapes]
        every = np.concatenate([cells for _, cells in owners])
        row, first = group_by_nodes(every)
        blocks.append((shape_name, every[first]))
        start = 0
        for name, cells in owners:
            if name:
                groups.setdefault(name, []).append((position, np.unique(row[start : start + len(cells)])))
            start += len(cells)
    if not blocks:
        ctx.fail(21, "there is nothing to write: the mesh is empty")
    nodes = used_nodes([cells for _, cells in blocks])
    local = [(name, places_in(nodes, cells)) for name, cells in blocks]
    data = {}
    for number, (name, field) in enumerate(fields, 1):
        # multipliers stand on nodes of their own, which are not in the file
        known = [n for n in field.names if len(np.intersect1d(field.parts[n][0], nodes))]
        values = field.table(known, nodes)
        data[name or field.title or f"field{number}"] = values[:, 0] if len(known) == 1 else values
    return MeshFile(store.coords[nodes], local, groups, point_data=data)
