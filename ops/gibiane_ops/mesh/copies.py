"""Copies of objects on moved nodes: nodes shared before are shared after."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.mesh import orientation
from gibiane_ops.kernels.mesh.transforms import Affine
from gibiane_ops.mesh.building import DIMENSION, nodes_of
from gibiane_ops.values.champs import ChamZone, ChPoint, MChaml
from gibiane_ops.values.maillage import Block, Maillage, Point
from gibiane_ops.values.modele import ContactZone, Modele, ModelZone

VECTORS = (("UX", "UY", "UZ"), ("FX", "FY", "FZ"), ("RX", "RY", "RZ"), ("MX", "MY", "MZ"))


def with_sides(mesh: Maillage) -> IntArray:
    """Return the nodes of a mesh and of its recorded sides, sorted."""
    marked = np.zeros(mesh.store.count, bool)
    for part in (mesh, *mesh.sides.values()):
        marked[part.nodes] = True
    return np.flatnonzero(marked).astype(np.int64)


class Copier:
    """Copies objects with all their nodes moved.

    Parameters
    ----------
    ctx : Context
    objects : sequence
        POINT, MAILLAGE, CHPOINT, MMODEL or MCHAML.
    move : callable
        ``move(coords (k, 3), nodes (k,)) -> (k, 3)``.
    motion : Affine, optional
        The same as a linear map: elements turn over and vector components turn with it.
    """

    def __init__(
        self,
        ctx: Context,
        objects: Sequence[Any],
        move: Callable[[FloatArray, Any], FloatArray],
        motion: Affine | None = None,
    ) -> None:
        self.ctx = ctx
        self.objects = objects
        self.motion = motion
        self.over = motion is not None and motion.turns_over
        self.store = nodes_of(ctx)
        self.solids: dict[int, ModelZone] = {}
        self.pairs: dict[int, ContactZone] = {}
        self.nodes = np.unique(np.concatenate([self._nodes(x) for x in objects]))
        moved = move(self.store.coords[self.nodes], self.nodes)
        copies = self.store.add(moved, self.store.density[self.nodes])
        self.place = np.empty(self.store.count, np.int64)
        self.place[self.nodes] = copies

    def results(self) -> tuple[Any, ...]:
        """Return the copies, in the order of the objects."""
        return tuple(self._copy(x) for x in self.objects)

    def _nodes(self, x: Any) -> IntArray:
        if isinstance(x, Point):
            return np.array([x.node], np.int64)
        if isinstance(x, Maillage):
            return with_sides(x)
        if isinstance(x, ChPoint):
            return x.nodes
        if isinstance(x, Modele):
            zones: list[ModelZone | ContactZone] = [*x.zones, *x.contacts]
            return np.concatenate([_zone_nodes(zone) for zone in zones])
        if isinstance(x, MChaml):
            return np.concatenate([_zone_nodes(zone.zone) for zone in x.zones])
        self.ctx.fail(39, "a {type} cannot be moved", type=getattr(x, "type_name", type(x).__name__))

    def _map(self, ids: IntArray) -> IntArray:
        return self.place[ids]

    def _copy(self, x: Any) -> Any:
        if isinstance(x, Point):
            return Point(self.store, int(self._map(np.array([x.node]))[0]))
        if isinstance(x, Maillage):
            return self._mesh(x)
        if isinstance(x, ChPoint):
            return self._field(x)
        if isinstance(x, Modele):
            return Modele(
                [self._solid(zone) for zone in x.zones],
                [self._pair(z) for z in x.contacts],
                [self._solid(z) for z in x.loads],
                [self._solid(z) for z in x.heated],
            )
        zones = [ChamZone(self._zone(z.zone), z.names, z.values) for z in x.zones]
        return MChaml(zones, x.subtype, x.support, x.title)

    def _mesh(self, mesh: Maillage) -> Maillage:
        blocks = []
        for block in mesh.blocks:
            cells = self._map(block.cells)
            if self.over and DIMENSION[block.shape] >= 2:
                cells = orientation.reversed_cells(block.shape, cells)
            blocks.append(Block(block.shape, cells, block.colours))
        return Maillage(self.store, blocks, {name: self._mesh(side) for name, side in mesh.sides.items()})

    def _zone(self, zone: ModelZone | ContactZone) -> ModelZone | ContactZone:
        return self._solid(zone) if isinstance(zone, ModelZone) else self._pair(zone)

    def _solid(self, zone: ModelZone) -> ModelZone:
        found = self.solids.get(id(zone))
        if found is None:
            found = self.solids[id(zone)] = ModelZone(self._mesh(zone.mesh), zone.formulation, zone.law, zone.mode)
        return found

    def _pair(self, zone: ContactZone) -> ContactZone:
        found = self.pairs.get(id(zone))
        if found is None:
            master, slave = self._mesh(zone.master), self._mesh(zone.slave)
            found = self.pairs[id(zone)] = ContactZone(master, slave, zone.law, zone.kinematics)
        return found

    def _field(self, field: ChPoint) -> ChPoint:
        parts = {name: (self._map(nodes), values) for name, (nodes, values) in field.parts.items()}
        copy = ChPoint(self.store, parts, field.nature, field.title)
        if self.motion is None:
            return copy
        for names in VECTORS:
            present = [name for name in names if name in parts]
            if present:
                nodes = np.unique(np.concatenate([parts[name][0] for name in present]))
                turned = copy.table(names, nodes) @ _isometry(self.motion).T
                dim = int(self.ctx.option("DIME"))
                parts.update(
                    {name: (nodes, turned[:, i]) for i, name in enumerate(names) if name in present or i < dim}
                )
        return ChPoint(self.store, parts, field.nature, field.title)


def _zone_nodes(zone: ModelZone | ContactZone) -> IntArray:
    if isinstance(zone, ModelZone):
        return with_sides(zone.mesh)
    return np.concatenate([with_sides(zone.master), with_sides(zone.slave)])


def _isometry(motion: Affine) -> FloatArray:
    """Return the rotation or reflection in a map, without its scale."""
    u, _, v = np.linalg.svd(motion.matrix)
    return np.asarray(u @ v, np.float64)
