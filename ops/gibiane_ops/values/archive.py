"""Objects into a file and back: a zip archive of one JSON text and plain arrays; reading runs no code of the file.

An object is written as its class and its attributes, once, however many others hold it; a file can only name classes
of this package's values. Nodes are written with their numbers, which shift when the session that reads has nodes.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
import zlib
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import scipy.sparse as sp

from gibiane.values import NOTHING, Objet, Procedure, Table, Texte, Value, type_of
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.maillage import Block, Maillage
from gibiane_ops.values.middles import middles_of
from gibiane_ops.values.nodes import NodeStore

FORMAT = "gibiane session 1"
OWN = ("gibiane_ops.values.", "gibiane_ops.kernels.contact.")
# Attributes that hold nodes of the session (-1 is none).
NODES = {
    "Point": ("_node",),
    "Block": ("cells",),
    "MatrixPart": ("nodes",),
    "ConditionPart": ("node", "multipliers"),
    "ContactPart": ("multipliers", "vectors"),
    "ContactPairs": ("pairs", "unpaired_slave", "unpaired_master", "node"),
}
# Language objects rebuilt from their text.
TEXTS = {"Texte": Texte, "Procedure": Procedure}
Rebuild = Callable[[str, str], Value]


class NotSaveable(Exception):
    """An object of a type that an archive cannot hold."""

    def __init__(self, type_name: str) -> None:
        super().__init__(type_name)
        self.type_name = type_name


class BadArchive(Exception):
    """A file that is no archive, or one that was cut."""


# -- writing ---------------------------------------------------------------------------------------------------------


class _Writer:
    """Turns objects into JSON; arrays, and objects met before, become references."""

    def __init__(self, store: NodeStore) -> None:
        self.store = store
        self.objects: list[Any] = []
        self.arrays: list[Any] = []
        self.first = store.count  # no object has a node before this one
        self._known: dict[int, int] = {}
        self._alive: list[Any] = []

    def encode(self, value: Any) -> Any:
        """Return the JSON form of a value."""
        if value is None or isinstance(value, bool | int | float | str):
            return value
        if isinstance(value, np.generic):
            return value.item()
        if isinstance(value, np.ndarray):
            self.arrays.append(value)
            return {"array": len(self.arrays) - 1}
        if isinstance(value, sp.csr_array):
            return {"csr": [self.encode(a) for a in (value.data, value.indices, value.indptr)], "shape": value.shape}
        if isinstance(value, list):
            return {"list": [self.encode(v) for v in value]}
        if isinstance(value, tuple):
            return {"tuple": [self.encode(v) for v in value]}
        if isinstance(value, dict):
            return {"dict": [[self.encode(k), self.encode(v)] for k, v in value.items()]}
        if value is self.store:
            return {"store": True}
        if value is NOTHING:
            return {"nothing": True}
        return {"object": self._number(value)}

    def _number(self, value: Any) -> int:
        found = self._known.get(id(value))
        if found is None:
            found = self._known[id(value)] = len(self.objects)
            self._alive.append(value)
            self.objects.append(None)
            self.objects[found] = self._state(value)
        return found

    def _state(self, value: Any) -> Any:
        if isinstance(value, Table):
            return {"class": "Table", "entries": [[self.encode(k), self.encode(v)] for k, v in value.entries.values()]}
        if isinstance(value, Objet):
            methods = {name: self.encode(method) for name, method in value.methods.items()}
            attributes = self.encode(value.attributes)
            return {"class": "Objet", "name": value.class_name, "attributes": attributes, "methods": methods}
        if isinstance(value, Texte):
            return {"class": "Texte", "text": value.text}
        if isinstance(value, Procedure):
            first, last = value.program[value.start - 1], value.program[value.end]
            return {"class": "Procedure", "text": first.source.text[first.start : last.end]}
        kind = type(value)
        if not kind.__module__.startswith(OWN) or isinstance(value, NodeStore):
            raise NotSaveable(type_of(value) if isinstance(value, Value) else kind.__name__)
        if isinstance(value, ChPoint | Maillage):
            _ = value.parts if isinstance(value, ChPoint) else value.blocks  # merged nodes are replaced
        state = {name: self.encode(attribute) for name, attribute in _attributes(value).items()}
        self._note_nodes(value)
        return {"class": f"{kind.__module__}:{kind.__qualname__}", "state": state}

    def _note_nodes(self, value: Any) -> None:
        """Keep the lowest node that an object holds."""
        held: list[Any] = [getattr(value, name, None) for name in NODES.get(type(value).__name__, ())]
        if isinstance(value, ChPoint):
            held.extend(nodes for nodes, _ in value.parts.values())
        for nodes in held:
            if isinstance(nodes, int | np.ndarray):
                found = np.asarray(nodes)
                self.first = min(self.first, int(found[found >= 0].min(initial=self.first)))


def _attributes(value: Any) -> dict[str, Any]:
    slots = [name for kind in type(value).__mro__ for name in getattr(kind, "__slots__", ())]
    return {name: getattr(value, name) for name in slots if hasattr(value, name)} | getattr(value, "__dict__", {})


def write_archive(
    file: Path | BinaryIO, names: Mapping[str, Any], store: NodeStore, options: Mapping[str, Any], label: str
) -> None:
    """Write named objects, the nodes of the session and a few options to a file, a path or an open one.

    Raises
    ------
    NotSaveable
        When an object, or one that it holds, is of a type that an archive cannot hold.
    OSError
        When the file cannot be written.
    """
    writer = _Writer(store)
    named = [[name, writer.encode(value)] for name, value in names.items()]
    first = writer.first
    own = np.arange(store.count - first)
    alias = store.canonical(np.arange(first, store.count)) - first
    nodes = [store.coords[first:], store.density[first:], np.where(alias < 0, own, alias)]
    content = {
        "format": FORMAT,
        "label": label,
        "options": dict(options),
        "first": first,
        "nodes": [writer.encode(a) for a in nodes],
        "names": named,
        "objects": writer.objects,
    }
    if isinstance(file, Path):
        file.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("session.json", json.dumps(content, ensure_ascii=False))
        for number, array in enumerate(writer.arrays):
            buffer = io.BytesIO()
            np.save(buffer, array, allow_pickle=False)
            archive.writestr(f"arrays/{number}.npy", buffer.getvalue())


# -- reading ---------------------------------------------------------------------------------------------------------


class Archive:
    """What a file holds; `restore` puts its nodes into a session and makes its objects.

    Attributes
    ----------
    names : list of str
        The objects named in it.
    options : dict
    label : str
    """

    def __init__(self, file: Path | BinaryIO) -> None:
        try:
            with zipfile.ZipFile(file) as archive:
                content = json.loads(archive.read("session.json"))
                if content["format"] != FORMAT:
                    raise BadArchive(f"its format is {str(content['format'])[:40]!r}")
                self._arrays = [
                    np.load(io.BytesIO(archive.read(f"arrays/{i}.npy")), allow_pickle=False)
                    for i in range(sum(name.startswith("arrays/") for name in archive.namelist()))
                ]
            self.names = [str(name) for name, _ in content["names"]]
            self.options: dict[str, Any] = dict(content["options"])
            self.label = str(content["label"])
            self._content = content
        except (zipfile.BadZipFile, zlib.error, EOFError) as failure:
            raise BadArchive("it is cut, or no archive") from failure
        except (ValueError, KeyError, TypeError, NotImplementedError, RuntimeError) as failure:
            raise BadArchive(f"its content is damaged ({type(failure).__name__})") from failure

    def digest(self) -> bytes:
        """Return bytes that are the same for the same content, whenever it was written.

        How many nodes the session had before is no content.
        """
        content = {name: value for name, value in self._content.items() if name != "first"}
        found = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
        for array in self._arrays:
            found.update(f"{array.dtype}{array.shape}".encode())
            found.update(np.ascontiguousarray(array).tobytes())
        return found.digest()

    def restore(self, session: Any, store: NodeStore, rebuild: Rebuild) -> dict[str, Any]:
        """Add the nodes to a session and return the objects by name.

        Parameters
        ----------
        session : Session or Context
        store : NodeStore
            That of the session.
        rebuild : callable
            Makes a TEXTE or a procedure from (class name, text).

        Raises
        ------
        BadArchive
            When the content is not what this package writes.
        """
        try:
            offset = store.count - int(self._content.get("first", 0))
            reader = _Reader(self._content["objects"], self._arrays, store, offset, rebuild)
            coords, density, alias = (np.asarray(reader.decode(a)) for a in self._content["nodes"])
            start = store.count
            store.add(coords.reshape(-1, 3), density)
            moved = np.flatnonzero(alias != np.arange(len(alias)))
            if len(moved):
                store.merge(alias[moved] + start, moved + start)
            found = {name: reader.decode(value) for name, value in self._content["names"]}
        except (ValueError, KeyError, TypeError, IndexError, AttributeError, ImportError) as failure:
            raise BadArchive(f"its content is damaged ({type(failure).__name__})") from failure
        for block in reader.blocks:
            of = shape(block.shape)
            if of.n_nodes > of.n_corners:
                for a, b, middle in of.edges:
                    middles_of(session).record(block.cells[:, [a, b]], block.cells[:, middle])
        return found


class _Reader:
    """Makes objects from JSON, each once; holders of an object being made get it before it is complete."""

    def __init__(self, objects: list[Any], arrays: list[Any], store: NodeStore, offset: int, rebuild: Rebuild) -> None:
        self._states = objects
        self._arrays = arrays
        self._store = store
        self._offset = offset
        self._rebuild = rebuild
        self._made: dict[int, Any] = {}
        self.blocks: list[Block] = []

    def decode(self, form: Any) -> Any:
        """Return the value of a JSON form."""
        if not isinstance(form, dict):
            return form
        ((kind, content), *more) = form.items()
        match kind:
            case "array":
                return self._arrays[content]
            case "csr":
                data, indices, indptr = (self.decode(c) for c in content)
                return sp.csr_array((data, indices, indptr), shape=tuple(more[0][1]))
            case "list":
                return [self.decode(c) for c in content]
            case "tuple":
                return tuple(self.decode(c) for c in content)
            case "dict":
                return {self.decode(k): self.decode(v) for k, v in content}
            case "store":
                return self._store
            case "nothing":
                return NOTHING
            case "object":
                return self._object(content)
            case _:
                raise KeyError(kind)

    def _object(self, number: int) -> Any:
        if number in self._made:
            return self._made[number]
        state = self._states[number]
        name = state["class"]
        if name in TEXTS:
            made: Any = self._rebuild(name, str(state["text"]))
            self._made[number] = made
        elif name == "Table":
            made = self._made[number] = Table()
            for key, value in state["entries"]:
                made.set(self.decode(key), self.decode(value))
        elif name == "Objet":
            made = self._made[number] = Objet(str(state["name"]))
            made.attributes = self.decode(state["attributes"])
            made.methods = {method: self.decode(form) for method, form in state["methods"].items()}
        else:
            kind = _class(name)
            made = self._made[number] = object.__new__(kind)
            for attribute, form in state["state"].items():
                object.__setattr__(made, attribute, self._shifted(kind.__name__, attribute, self.decode(form)))
            if isinstance(made, Block):
                self.blocks.append(made)
        return made

    def _shifted(self, kind: str, attribute: str, value: Any) -> Any:
        """Move nodes behind those that the session had."""
        if kind == "ChPoint" and attribute == "_parts":
            return {name: (nodes + self._offset, values) for name, (nodes, values) in value.items()}
        if attribute == "_version":
            # Nodes were written after all merges.
            return self._store.version
        if attribute not in NODES.get(kind, ()):
            return value
        if isinstance(value, int):
            return value + self._offset
        return np.where(value < 0, value, value + self._offset)


def _class(name: str) -> type:
    """Return a class of this package that an archive may name."""
    module, _, qualified = name.partition(":")
    if not module.startswith(OWN) or not qualified.isidentifier():
        raise KeyError(name)
    found = getattr(import_module(module), qualified)
    if not isinstance(found, type) or found.__module__ != module:
        raise KeyError(name)
    return found
