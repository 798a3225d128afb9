"""CHPOINT (values at nodes) and MCHAML (values in elements)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gibiane.fortran import scientific
from gibiane.values import CHPOINT, MCHAML, Value
from gibiane_ops.values.modele import ContactZone, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray, NodeStore

INDETERMINE, DIFFUS, DISCRET = "INDETERMINE", "DIFFUS", "DISCRET"
Part = tuple[IntArray, FloatArray]


class ChPoint(Value):
    """A nodal field: for each component the nodes that have it (sorted ids) and their values.

    Parameters
    ----------
    store : NodeStore
    parts : mapping of component name to (nodes (k,), values (k,))
        Nodes need not be sorted; they must be distinct.
    nature : str
        DIFFUS (values of a function), DISCRET (forces, summed when nodes merge) or INDETERMINE.
    """

    type_name = CHPOINT

    def __init__(self, store: NodeStore, parts: Mapping[str, Part], nature: str = INDETERMINE, title: str = "") -> None:
        self.store = store
        self.nature = nature
        self.title = title
        self._parts = {name: _sorted(nodes, values) for name, (nodes, values) in parts.items()}
        self._version = store.version

    @property
    def parts(self) -> dict[str, Part]:
        """Component name to (nodes, values), nodes sorted, merged nodes replaced."""
        if self._version != self.store.version:
            self._parts = {name: self._merged(*part) for name, part in self._parts.items()}
            self._version = self.store.version
        return self._parts

    def _merged(self, nodes: IntArray, values: FloatArray) -> Part:
        ids = self.store.canonical(nodes)
        unique, inverse, counts = np.unique(ids, return_inverse=True, return_counts=True)
        total = np.asarray(np.bincount(inverse, values, minlength=len(unique)), np.float64)
        return unique, total if self.nature == DISCRET else total / counts

    @property
    def names(self) -> list[str]:
        """Component names."""
        return list(self.parts)

    @property
    def nodes(self) -> IntArray:
        """All nodes that have some component, sorted."""
        if not self.parts:
            return np.zeros(0, np.int64)
        return np.unique(np.concatenate([nodes for nodes, _ in self.parts.values()]))

    def at(self, name: str, nodes: IntArray) -> FloatArray:
        """Return the values of a component at given nodes; 0 where it has none."""
        own, values = self.parts.get(name, (nodes[:0], np.zeros(0)))
        if not len(own) or not len(nodes):
            return np.zeros(len(nodes))
        if len(nodes) >= len(own) and int(nodes.min()) >= 0:
            # Many nodes, repeated by their elements: a table of all nodes is read faster than a search.
            every = np.zeros(max(int(own[-1]), int(nodes.max())) + 1)
            every[own] = values
            return every[nodes]
        place = np.minimum(np.searchsorted(own, nodes), len(own) - 1)
        return np.where(own[place] == nodes, values[place], 0.0)

    def table(self, names: Sequence[str], nodes: IntArray) -> FloatArray:
        """Return several components at given nodes, (k, n_names)."""
        return np.column_stack([self.at(name, nodes) for name in names]) if names else np.zeros((len(nodes), 0))

    @classmethod
    def from_table(
        cls, store: NodeStore, names: Sequence[str], nodes: IntArray, values: FloatArray, nature: str = DIFFUS
    ) -> ChPoint:
        """Make a field whose components live on the same nodes, values (k, n_names)."""
        return cls(store, {name: (nodes, values[:, i]) for i, name in enumerate(names)}, nature)

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the lines that LIST prints."""
        yield f" CHPOINT de pointeur {session.ordinal(self)} de nature {self.nature}"
        for name, (nodes, values) in self.parts.items():
            yield f" composante {name:<4} : {len(nodes)} point(s)"
            if brief:
                continue
            for start in range(0, len(nodes), 5):
                yield "".join(
                    f"{n + 1:>8} {scientific(float(v))}"
                    for n, v in zip(nodes[start : start + 5], values[start : start + 5], strict=True)
                )


def _sorted(nodes: IntArray, values: FloatArray) -> Part:
    nodes = np.asarray(nodes, np.int64)
    values = np.asarray(values, np.float64)
    if len(nodes) > 1 and (np.diff(nodes) <= 0).any():
        order = np.argsort(nodes, kind="stable")
        return nodes[order], values[order]
    return nodes, values


class ChamZone:
    """Values on one zone of a model: `names` and `values` (m, q, c); q = 1 for one value per element."""

    __slots__ = ("names", "values", "zone")

    def __init__(self, zone: ModelZone | ContactZone, names: Sequence[str], values: FloatArray) -> None:
        self.zone = zone
        self.names = tuple(names)
        self.values = values

    def component(self, name: str) -> FloatArray:
        """Return one component, (m, q)."""
        return self.values[:, :, self.names.index(name)]


class MChaml(Value):
    """An element field: zones, a sub-type (CONTRAINTES, DEFORMATIONS, CARACTERISTIQUES, SCALAIRE...) and a support.

    `support` is NOEUD, GRAVITE, RIGIDITE, MASSE or STRESSES: where the q values of an element stand.
    """

    type_name = MCHAML

    def __init__(self, zones: Sequence[ChamZone], subtype: str, support: str, title: str = "") -> None:
        self.zones = list(zones)
        self.subtype = subtype
        self.support = support
        self.title = title

    @property
    def names(self) -> list[str]:
        """Component names over all zones, in order of appearance."""
        return list(dict.fromkeys(name for zone in self.zones for name in zone.names))

    def zone_of(self, zone: ModelZone | ContactZone) -> ChamZone | None:
        """Return the values on a zone of a model, or None."""
        return next((z for z in self.zones if z.zone is zone), None)

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the lines that LIST prints."""
        yield f" MCHAML de pointeur {session.ordinal(self)} de sous-type {self.subtype} aux points {self.support}"
        for number, zone in enumerate(self.zones, 1):
            m, q, _ = zone.values.shape
            where = zone.zone.shape if isinstance(zone.zone, ModelZone) else "de contact"
            yield f" zone {number} : {m} element(s) {where}, {q} point(s), composantes {' '.join(zone.names)}"
            if brief:
                continue
            for i in range(m):
                for j in range(q):
                    yield f"{i + 1:>8}{j + 1:>4}" + "".join(f" {scientific(float(v))}" for v in zone.values[i, j])
