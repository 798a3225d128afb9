"""Groups of a table: named parts of a mesh that are found again on the next one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gibiane.registry import Context
from gibiane.values import Table, type_of
from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.mesh import unions
from gibiane_ops.mesh.building import join, new_mesh
from gibiane_ops.mesh.degree import finished, is_quadratic, linear_mesh
from gibiane_ops.values.maillage import Maillage, Point

SIMPLEX = {1: "POI1", 2: "SEG2", 3: "TRI3", 4: "TET4"}


class Groups:
    """The groups of a table as kernels take them: names and elements by ranks of nodes.

    A contact face that is not one of the groups is added under a name of its own. Numbers and texts are copied.
    """

    def __init__(self, ctx: Context, table: Table, nodes: IntArray, shapes: dict[int, str] = SIMPLEX) -> None:
        self.ctx = ctx
        self.shapes = shapes
        self.nodes = nodes
        self.keys: dict[str, Any] = {}
        self.cells: dict[str, IntArray] = {}
        self.points: set[str] = set()
        self.quadratic: set[str] = set()
        self.pairs: list[tuple[str, str]] = []
        self.pair_keys: list[Any] = []
        self.others: list[tuple[Any, Any]] = []
        values: dict[int, str] = {}
        for index, value in table.entries.values():
            if index in ("PAIRES", "SOUSTYPE", "ARBRE"):
                continue
            if isinstance(value, bool | int | float | str):
                self.others.append((index, value))
                continue
            name = f"{index!r}"
            self._add(name, index, value)
            values[id(value)] = name
        if table.has("PAIRES"):
            self._read_pairs(table.get("PAIRES"), values)

    def _add(self, name: str, index: Any, value: Any) -> None:
        if isinstance(value, Point):
            self.points.add(name)
            cells = np.array([[value.node]])
        elif isinstance(value, Maillage):
            if is_quadratic(value):
                self.quadratic.add(name)
            blocks = linear_mesh(self.ctx, value).blocks
            kinds = {block.shape for block in blocks}
            if len(kinds) != 1 or not kinds <= set(self.shapes.values()):
                self.ctx.fail(
                    16,
                    "the group {index} holds {shapes}: one of {wanted} is wanted",
                    at="grou",
                    index=index,
                    wanted=", ".join(self.shapes.values()),
                    shapes=" ".join(value.shapes) or "no element",
                )
            cells = np.concatenate([block.cells for block in blocks])
        else:
            self.ctx.fail(
                39, "the group {index} is a {type}, not a MAILLAGE", at="grou", index=index, type=type_of(value)
            )
        place = np.searchsorted(self.nodes, cells)
        place[place == len(self.nodes)] = 0
        if (self.nodes[place] != cells).any():
            self.ctx.fail(
                21,
                "the group {index} is not a part of the mesh: {count} of its nodes are elsewhere",
                at="grou",
                index=index,
                count=len(np.setdiff1d(cells, self.nodes)),
                hint="a group made of other nodes at the same places is another mesh: ELIM makes them one",
            )
        self.keys[name] = index
        self.cells[name] = place

    def _read_pairs(self, pairs: Any, values: dict[int, str]) -> None:
        if not isinstance(pairs, Table):
            self.ctx.fail(37, "PAIRES is a {type}: a TABLE of TABLE is wanted", at="grou", type=type_of(pairs))
        for index, pair in pairs.entries.values():
            names = []
            for side in (1, 2):
                face = pair.get(side) if isinstance(pair, Table) and pair.has(side) else None
                if not isinstance(face, Maillage):
                    self.ctx.fail(
                        37, "the pair {index} has no MAILLAGE at index {side}", at="grou", index=index, side=side
                    )
                if id(face) not in values:
                    name = values[id(face)] = f"PAIRES . {index} . {side}"
                    self._add(name, name, face)
                names.append(values[id(face)])
            self.pairs.append((names[0], names[1]))
            self.pair_keys.append(index)

    def renewed(
        self, groups: dict[str, IntArray], ids: IntArray, quadratic: Mapping[int, IntArray] | None = None
    ) -> Table:
        """Return the table of the same groups on the new nodes.

        Parameters
        ----------
        groups : dict of str to (k, c) int64
            Ranks in `ids`.
        ids : (n,) int64
        quadratic : dict of int to (k, c) int64, optional
            By number of corners, the parts (nodes of the session) that have mid-nodes; if absent groups that had
            mid-nodes have them again, entirely.
        """
        table = Table()
        made: dict[str, Maillage] = {}
        for name, ranks in groups.items():
            cells = ids[ranks]
            kind = self.shapes[cells.shape[1]]
            if quadratic is None:
                made[name] = finished(self.ctx, new_mesh(self.ctx, [(kind, cells)]), name in self.quadratic)
                continue
            high = unions.is_in(cells, quadratic.get(cells.shape[1], cells[:0]))
            parts = [(new_mesh(self.ctx, [(kind, cells[high == which])]), which) for which in (False, True)]
            made[name] = join([finished(self.ctx, part, which) for part, which in parts])
        for name, index in self.keys.items():
            if name.startswith("PAIRES . "):
                continue
            group = made[name]
            table.set(index, Point(group.store, int(group.nodes[0])) if name in self.points else group)
        for index, value in self.others:
            table.set(index, value)
        if self.pairs:
            pairs = Table()
            for index, (first, second) in zip(self.pair_keys, self.pairs, strict=True):
                pair = Table()
                pair.set(1, made[first])
                pair.set(2, made[second])
                pairs.set(index, pair)
            table.set("PAIRES", pairs)
        return table
