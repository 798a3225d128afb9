"""LIRE of mesh files: a TABLE of meshes by the names of their groups, and of fields."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend
from gibiane.values import MAILLAGE, MOT, TABLE, Table
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.exchange.formats import FORMATS, read_mesh
from gibiane_ops.kernels.exchange.meshfile import MeshFile
from gibiane_ops.kernels.topology import Block as KernelBlock
from gibiane_ops.values.champs import DIFFUS, INDETERMINE, ChamZone, ChPoint, MChaml
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import Block, Maillage
from gibiane_ops.values.middles import middles_of
from gibiane_ops.values.modele import DISPLACEMENTS, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store

LIRE = extend("LIRE")
WORDS = tuple(word for word in FORMATS if word != "STL")


@LIRE.form(Key(WORDS, "mesh file", Arg("file", MOT, "its name"), name="of", required=True), gives=[TABLE])
def _lire(ctx: Context, of: tuple[str, str]) -> Table:
    word, name = of
    mesh, nodes = _read(ctx, name, word)
    table = Table()
    whole = _mesh(ctx, mesh.blocks, nodes)
    table.set("MAILLAGE", whole)
    for group in mesh.groups:
        table.set(group, _mesh(ctx, mesh.group_blocks(group), nodes))
    for group, members in mesh.node_groups.items():
        if group not in mesh.groups:
            table.set(group, Maillage.of_nodes(node_store(ctx), nodes[members]))
    for field, values in mesh.point_data.items():
        if not table.has(field):
            table.set(field, _nodal(ctx, nodes, values, field))
    for field, parts in mesh.cell_data.items():
        if not table.has(field):
            table.set(field, _by_element(ctx, whole, parts, field))
    return table


@LIRE.form(Key("STL", "surface of triangles", Arg("file", MOT, "its name"), required=True), gives=[MAILLAGE])
def _stl(ctx: Context, stl: str) -> Maillage:
    mesh, nodes = _read(ctx, stl, "STL")
    return _mesh(ctx, mesh.blocks, nodes)


def _read(ctx: Context, name: str, word: str) -> tuple[MeshFile, IntArray]:
    """Read a file, put its nodes into the session and return their numbers."""
    path = Path(name)
    if not path.suffix and not path.is_file():
        path = path.with_name(path.name + FORMATS[word].extension)
    if not path.is_file():
        ctx.fail(1130, "the file {path} cannot be opened", path=path.as_posix())
    with worded(ctx):
        mesh = read_mesh(path, word)
    if mesh.skipped:
        ctx.warn(
            29,
            "elements of {path} are left out: {types} are not available here",
            path=path.as_posix(),
            types=", ".join(mesh.skipped),
        )
    dim = int(ctx.option("DIME"))
    if dim == 0:
        ctx.fail(14, "the dimension of space is not set", hint="OPTI DIME 3 ;")
    beyond = np.abs(mesh.points[:, dim:]).max(initial=0.0)
    if beyond > 0:
        ctx.fail(
            12,
            "the points of {path} have a coordinate beyond the dimension {dim}",
            path=path.as_posix(),
            dim=dim,
            hint="OPTI DIME 3 ; before the first point",
        )
    return mesh, node_store(ctx).add(mesh.points, float(ctx.option("DENS")))


def _mesh(ctx: Context, blocks: list[KernelBlock], nodes: IntArray) -> Maillage:
    """Make a mesh of blocks of a file."""
    found = []
    for name, local in blocks:
        cells = nodes[local]
        of = shape(name)
        if of.n_nodes > of.n_corners:
            for a, b, middle in of.edges:
                middles_of(ctx).record(cells[:, [a, b]], cells[:, middle])
        found.append(Block(name, cells))
    return Maillage(node_store(ctx), found)


def _components(ctx: Context, count: int, field: str) -> list[str]:
    """Name the components of a field of a file: one is SCAL, as many as displacements are these, else V1 V2 ..."""
    if count == 1:
        return ["SCAL"]
    displacements = DISPLACEMENTS.get(str(ctx.option("MODE"))[:4], ())
    if field.upper().startswith(("U", "DEP")) and 2 <= count <= 3 and len(displacements) <= count:
        return list(displacements)
    return [f"V{i}" for i in range(1, count + 1)]


def _nodal(ctx: Context, nodes: IntArray, values: FloatArray, field: str) -> ChPoint:
    table = values.reshape(len(nodes), -1)
    names = _components(ctx, table.shape[1], field)
    nature = DIFFUS if names != ["SCAL"] else INDETERMINE
    parts = {}
    for i, name in enumerate(names):
        known = np.isfinite(table[:, i])
        parts[name] = nodes[known], table[known, i]
    return ChPoint(node_store(ctx), parts, nature, field)


def _by_element(ctx: Context, whole: Maillage, parts: list[FloatArray], field: str) -> MChaml:
    """Make an element field of one value per element of the whole mesh."""
    zones = []
    for block, values in zip(whole.blocks, parts, strict=True):
        table = values.reshape(len(values), 1, -1)
        zone = ModelZone(Maillage(whole.store, [block]), "", (), str(ctx.option("MODE")))
        zones.append(ChamZone(zone, _components(ctx, table.shape[2], ""), table))
    return MChaml(zones, "SCALAIRE", "GRAVITE", field)
