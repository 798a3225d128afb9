"""Read and write mesh files: through meshio, and universal files by ourselves.

meshio prints, warns and leaves the interpreter when it meets a file that it does not like: here every failure becomes
one exception.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import BY_MESHIO, shape
from gibiane_ops.kernels.errors import BadValue, MissingPackage, UnreadableFile
from gibiane_ops.kernels.exchange.meshfile import MeshFile, numbered_groups
from gibiane_ops.kernels.exchange.optistruct import read_fem
from gibiane_ops.kernels.exchange.unv import WRITTEN, read_unv, write_unv
from gibiane_ops.kernels.topology import group_by_nodes


@dataclass(frozen=True)
class Format:
    """A file format.

    Attributes
    ----------
    name : str
        What users call it.
    extension : str
    reader, writer : str
        Format of meshio, empty for our own.
    tag : str
        Cell data that numbers the groups, if the format has it.
    quadratic : bool
        Whether elements of second degree can be written.
    """

    name: str
    extension: str
    reader: str
    writer: str
    tag: str = ""
    quadratic: bool = True


FORMATS = {
    "MED": Format("MED", ".med", "med", "med", "cell_tags"),
    "UNV": Format("UNV", ".unv", "", ""),
    "NAS": Format("Nastran", ".bdf", "nastran", "nastran", "nastran:ref"),
    "FEM": Format("OptiStruct", ".fem", "", ""),
    "ABAQ": Format("Abaqus", ".inp", "abaqus", "abaqus"),
    "AVS": Format("AVS", ".avs", "avsucd", "avsucd", "avsucd:material"),
    "STL": Format("STL", ".stl", "stl", "stl", "", False),
    "GMSH": Format("gmsh", ".msh", "gmsh", "gmsh22", "gmsh:physical"),
    "VTK": Format("VTK", ".vtu", "vtu", "vtu"),
}
# Of one word, the extension tells the format.
BY_EXTENSION = {".vtk": "vtk", ".vtu": "vtu", ".vtp": "vtp", ".xdmf": "xdmf"}


def read_mesh(path: Path, word: str) -> MeshFile:
    """Read a mesh file.

    Parameters
    ----------
    path : Path
    word : str
        Key of FORMATS.

    Returns
    -------
    MeshFile
        Elements of one shape in one block; the types of elements that we do not have are in `skipped`.

    Raises
    ------
    UnreadableFile
        When the file is of another format or cut.
    MissingPackage
        When MED is wanted without h5py.
    """
    of = FORMATS[word]
    if not of.reader:
        text = path.read_bytes().decode("latin-1")
        found = read_fem(path.as_posix(), text) if word == "FEM" else read_unv(path.as_posix(), text)
        return found.checked(path.as_posix())
    _need_h5py(word)
    meshio = _meshio()
    reader = BY_EXTENSION.get(path.suffix.lower(), of.reader) if word == "VTK" else of.reader
    mesh = _guarded(path, of.name, lambda: meshio.read(path, file_format=reader))
    try:
        return _content(mesh, of).checked(path.as_posix())
    except (ValueError, IndexError, KeyError, TypeError) as failure:
        raise UnreadableFile(path.as_posix(), f"it is cut, or no {of.name} file ({failure})") from failure


def _need_h5py(word: str) -> None:
    if word == "MED" and find_spec("h5py") is None:
        raise MissingPackage("h5py", "pip install h5py")


def _meshio() -> Any:
    """Import meshio; version 5.3.5 forgets the dimension of two of its types of elements."""
    import meshio
    from meshio import _mesh

    for name in ("wedge15", "pyramid13"):
        _mesh.topological_dimension.setdefault(name, 3)
    return meshio


def _guarded(path: Path, name: str, call: Callable[[], Any]) -> Any:
    """Call meshio; what it prints is dropped, whatever it raises becomes UnreadableFile."""
    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return call()
    except (Exception, SystemExit) as failure:
        if isinstance(failure, OSError) and failure.errno is not None:
            raise
        raise UnreadableFile(path.as_posix(), f"it is cut, or no {name} file") from failure


def _content(mesh: Any, of: Format) -> MeshFile:
    """Gather the blocks of meshio by shape, with groups and fields."""
    kept = [i for i, block in enumerate(mesh.cells) if block.type in BY_MESHIO and len(block.data)]
    skipped = tuple(sorted({b.type for b in mesh.cells if b.type not in BY_MESHIO}))
    names = list(dict.fromkeys(BY_MESHIO[mesh.cells[i].type].name for i in kept))
    sources = [[i for i in kept if BY_MESHIO[mesh.cells[i].type].name == name] for name in names]
    cells = [np.concatenate([np.asarray(mesh.cells[i].data, np.int64) for i in own]) for own in sources]
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    found = MeshFile(points, list(zip(names, cells, strict=True)), skipped=skipped)
    offsets = {}
    for position, own in enumerate(sources):
        start = 0
        for i in own:
            offsets[i] = position, start
            start += len(mesh.cells[i].data)
    for name, sets in mesh.cell_sets.items():
        if name.startswith("gmsh:"):
            continue
        rows: dict[int, list[IntArray]] = {}
        for i, members in enumerate(sets):
            if i in offsets and members is not None and len(members):
                position, start = offsets[i]
                rows.setdefault(position, []).append(np.asarray(members, np.int64) + start)
        if rows:
            found.groups[name] = [(p, np.concatenate(r)) for p, r in sorted(rows.items())]
    found.node_groups = {name: np.asarray(nodes, np.int64) for name, nodes in mesh.point_sets.items()}
    _tags(mesh, of, found, sources)
    numbers = {of.tag, "gmsh:geometrical", "point_tags", "gmsh:dim_tags"}
    found.point_data = {n: np.asarray(v, np.float64) for n, v in mesh.point_data.items() if n not in numbers}
    for name, values in mesh.cell_data.items():
        if name not in numbers:
            found.cell_data[name] = [
                np.concatenate([np.asarray(values[i], np.float64) for i in own]) for own in sources
            ]
    return _without_repeats(found)


def _without_repeats(found: MeshFile) -> MeshFile:
    """Keep one of the elements that have the same nodes: gmsh writes an element once for each of its groups."""
    for position, (name, cells) in enumerate(found.blocks):
        row, first = group_by_nodes(cells)
        if len(first) == len(cells):
            continue
        found.blocks[position] = name, cells[first]
        for parts in found.groups.values():
            parts[:] = [(p, np.unique(row[rows]) if p == position else rows) for p, rows in parts]
        for values in found.cell_data.values():
            values[position] = values[position][first]
    return found


def _tags(mesh: Any, of: Format, found: MeshFile, sources: list[list[int]]) -> None:
    """Turn numbers of elements and nodes into groups."""
    if of.tag in mesh.cell_data:
        data = mesh.cell_data[of.tag]
        tags = [np.concatenate([np.asarray(data[i], np.int64) for i in own]) for own in sources]
        if of.tag == "cell_tags":
            for number, names in getattr(mesh, "cell_tags", {}).items():
                rows = [(p, np.flatnonzero(t == number)) for p, t in enumerate(tags)]
                for name in names:
                    found.groups.setdefault(name, []).extend((p, r) for p, r in rows if len(r))
        else:
            named = {int(v[0]): name for name, v in mesh.field_data.items()}
            found.groups.update(numbered_groups(tags, named, "REF"))
    if "point_tags" in mesh.point_data:
        tag = np.asarray(mesh.point_data["point_tags"], np.int64)
        for number, names in getattr(mesh, "point_tags", {}).items():
            for name in names:
                old = found.node_groups.get(name, np.zeros(0, np.int64))
                found.node_groups[name] = np.concatenate([old, np.flatnonzero(tag == number)])


def write_mesh_file(path: Path, word: str, mesh: MeshFile) -> None:
    """Write a mesh file.

    Parameters
    ----------
    path : Path
        Missing folders are made.
    word : str
        Key of FORMATS.
    mesh : MeshFile
        Groups are written by name where the format has names (MED, UNV, gmsh, Abaqus), by number elsewhere; an element
        in several groups bears the first of its numbers.

    Raises
    ------
    BadValue
        When the format has not the shape of an element.
    MissingPackage
        When MED is wanted without h5py.
    """
    of = FORMATS[word]
    path.parent.mkdir(parents=True, exist_ok=True)
    if word in ("UNV", "ABAQ"):
        mesh = _points_apart(mesh)
    if not of.writer:
        for name, _ in mesh.blocks:
            if name not in WRITTEN:
                raise BadValue("element", name, f"one of {', '.join(WRITTEN)} in a {of.name} file")
        path.write_text(write_unv(mesh), encoding="latin-1", errors="replace")
        return
    _need_h5py(word)
    if word == "STL":
        mesh = _triangles(mesh)
    meshio = _meshio()
    cells, data, named, sets = _tagged(mesh, of)
    file = meshio.Mesh(
        _rounded(mesh.points) if word == "NAS" else mesh.points,
        cells,
        point_data=dict(mesh.point_data) if word in ("MED", "AVS", "GMSH") else {},
        cell_data=data,
        field_data=named,
        cell_sets=sets,
        point_sets=dict(mesh.node_groups) if word == "ABAQ" else {},
    )
    if word == "MED":
        file.cell_tags, file.point_tags = _families(mesh, file), {}
    try:
        _guarded(path, of.name, lambda: file.write(path, file_format=of.writer))
    except UnreadableFile as failure:
        kinds = ", ".join(name for name, _ in mesh.blocks)
        raise BadValue("elements", kinds, f"elements that a {of.name} file can hold") from failure


def _points_apart(mesh: MeshFile) -> MeshFile:
    """Turn points that are elements (POI1) into groups of nodes, where a format has these and not those."""
    kept = [i for i, (name, _) in enumerate(mesh.blocks) if name != "POI1"]
    if len(kept) == len(mesh.blocks) or not kept:
        return mesh
    place = {old: new for new, old in enumerate(kept)}
    groups, nodes = {}, dict(mesh.node_groups)
    for name, parts in mesh.groups.items():
        if solid := [(place[p], rows) for p, rows in parts if p in place]:
            groups[name] = solid
        for p, rows in parts:
            if p not in place:
                nodes[name] = np.unique(np.concatenate([nodes.get(name, rows[:0]), mesh.blocks[p][1][rows].ravel()]))
    return replace(mesh, blocks=[mesh.blocks[i] for i in kept], groups=groups, node_groups=nodes)


def _rounded(points: FloatArray) -> FloatArray:
    """Keep the ten digits that the sixteen columns of a Nastran number hold, sign and exponent included."""
    return np.array([float(f"{x:.9e}") for x in points.ravel()]).reshape(points.shape)


def _tagged(mesh: MeshFile, of: Format) -> tuple[list[Any], dict[str, Any], dict[str, Any], dict[str, Any]]:
    """Return the cells, their group numbers, the names of the numbers, and the groups as sets."""
    cells = [(shape(name).meshio_name, block) for name, block in mesh.blocks]
    tags = [np.zeros(len(block), np.int64) for _, block in mesh.blocks]
    named: dict[str, Any] = {}
    sets: dict[str, Any] = {}
    for number, (name, parts) in enumerate(mesh.groups.items(), 1):
        dims = [shape(mesh.blocks[p][0]).dim for p, _ in parts]
        named[name] = np.array([number, max(dims, default=0)])
        sets[name] = [np.zeros(0, np.int64) for _ in mesh.blocks]
        for p, rows in parts:
            sets[name][p] = rows
            tags[p][rows] = np.where(tags[p][rows] == 0, number, tags[p][rows])
    if of.tag == "gmsh:physical":
        cells, tags = _repeated(mesh)
        return cells, {of.tag: tags, "gmsh:geometrical": [np.maximum(t, 1) for t in tags]}, named, {}
    data = {of.tag: tags} if of.tag and of.tag != "cell_tags" else {}
    return cells, data, named if of.tag == "gmsh:physical" else {}, sets if of.reader == "abaqus" else {}


def _repeated(mesh: MeshFile) -> tuple[list[Any], list[IntArray]]:
    """Return the cells of each group, repeated where groups overlap (as gmsh does), then those of none."""
    cells, tags = [], []
    free = [np.ones(len(block), bool) for _, block in mesh.blocks]
    for number, parts in enumerate(mesh.groups.values(), 1):
        for p, rows in parts:
            cells.append((shape(mesh.blocks[p][0]).meshio_name, mesh.blocks[p][1][rows]))
            tags.append(np.full(len(rows), number))
            free[p][rows] = False
    for p, (name, block) in enumerate(mesh.blocks):
        if free[p].any():
            cells.append((shape(name).meshio_name, block[free[p]]))
            tags.append(np.zeros(int(free[p].sum()), np.int64))
    return cells, tags


def _families(mesh: MeshFile, file: Any) -> dict[int, list[str]]:
    """Give numbers to the sets of groups that elements belong to (families of MED), and put them into the file."""
    member = [np.zeros((len(block), len(mesh.groups)), bool) for _, block in mesh.blocks]
    for column, parts in enumerate(mesh.groups.values()):
        for p, rows in parts:
            member[p][rows, column] = True
    names = list(mesh.groups)
    every = np.concatenate(member)
    kinds, family = np.unique(every, axis=0, return_inverse=True)
    family = family.reshape(-1)
    number = np.array([-(i + 1) if kind.any() else 0 for i, kind in enumerate(kinds)])
    tags = np.split(number[family], np.cumsum([len(m) for m in member])[:-1])
    file.cell_data["cell_tags"] = tags
    return {
        int(number[i]): [n for n, there in zip(names, kind, strict=True) if there]
        for i, kind in enumerate(kinds)
        if kind.any()
    }


def _triangles(mesh: MeshFile) -> MeshFile:
    """Keep surfaces, quadrangles cut in two."""
    wrong = [name for name, _ in mesh.blocks if name not in ("TRI3", "QUA4")]
    if wrong:
        raise BadValue("element", wrong[0], "TRI3 or QUA4 in an STL file, which holds the skin of a solid")
    parts = [c if n == "TRI3" else np.concatenate([c[:, [0, 1, 2]], c[:, [0, 2, 3]]]) for n, c in mesh.blocks]
    return MeshFile(mesh.points, [("TRI3", np.concatenate(parts))])
