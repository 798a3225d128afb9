"""POINT and MAILLAGE: ids of nodes of the session, by blocks of one element type."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from gibiane.fortran import general
from gibiane.values import MAILLAGE, POINT, Value
from gibiane_ops.values.nodes import FloatArray, IntArray, NodeStore

COLOURS = (
    "DEFA",
    "BLEU",
    "ROUG",
    "ROSE",
    "VERT",
    "TURQ",
    "JAUN",
    "BLAN",
    "NOIR",
    "VIOL",
    "ORAN",
    "AZUR",
    "OCEA",
    "CYAN",
    "OLIV",
    "GRIS",
    "LIME",
)

# Order in which scripts give and see the nodes of elements of second degree: corners and mid-nodes in turn, as in
# Cast3M, layer after layer. Inside, corners come first.
IN_TURN: dict[str, tuple[int, ...]] = {
    "SEG3": (0, 2, 1),
    "TRI6": (0, 3, 1, 4, 2, 5),
    "QUA8": (0, 4, 1, 5, 2, 6, 3, 7),
    "TE10": (0, 4, 1, 5, 2, 6, 7, 8, 9, 3),
    "PY13": (0, 5, 1, 6, 2, 7, 3, 8, 9, 10, 11, 12, 4),
    "PR15": (0, 6, 1, 7, 2, 8, 12, 13, 14, 3, 9, 4, 10, 5, 11),
    "CU20": (0, 8, 1, 9, 2, 10, 3, 11, 16, 17, 18, 19, 4, 12, 5, 13, 6, 14, 7, 15),
}


def cells_in_turn(shape: str, cells: IntArray) -> IntArray:
    """Put the nodes of elements in the order that scripts see."""
    return cells[:, list(IN_TURN[shape])] if shape in IN_TURN else cells


def cells_from_turn(shape: str, cells: IntArray) -> IntArray:
    """Put the nodes of elements, in the order that scripts give, corners first."""
    return cells[:, np.argsort(IN_TURN[shape])] if shape in IN_TURN else cells


class Point(Value):
    """A node, also used as a vector."""

    type_name = POINT

    def __init__(self, store: NodeStore, node: int) -> None:
        self.store = store
        self._node = int(node)

    @property
    def node(self) -> int:
        """Its id (the one that stands for it after merges)."""
        return int(self.store.canonical(self._node))

    @property
    def coords(self) -> FloatArray:
        """Coordinates, (3,), length; a copy."""
        return np.array(self.store.coords[self.node])

    def same(self, other: Any) -> bool:
        """Say whether both are one node."""
        return isinstance(other, Point) and other.node == self.node

    def key(self) -> Any:
        """Return the node as table index."""
        return self.node

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the lines that LIST prints."""
        dim = max(int(session.options["DIME"]), 1)
        shown = "".join(f"{general(float(x)).strip():<11}" for x in self.coords[:dim]).rstrip()
        yield f" Point dont le numero est actuellement {self.node + 1}"
        yield f" Coordonnees: {shown}     Densite: {general(float(self.store.density[self.node])).strip()}"


class Block:
    """Elements of one type: `cells` (m, n_nodes) ids of nodes, `colours` (m,) indices into COLOURS."""

    __slots__ = ("cells", "colours", "shape")

    def __init__(self, shape: str, cells: IntArray, colours: IntArray | None = None) -> None:
        self.shape = shape
        self.cells = cells
        self.colours = np.zeros(len(cells), np.int64) if colours is None else colours


class Maillage(Value):
    """A mesh: blocks of elements on nodes of the session; never changed once made (nodes may move or merge).

    Parameters
    ----------
    store : NodeStore
    blocks : sequence of Block
        At most one per element type; empty ones are dropped.
    sides : dict of str to Maillage, optional
        References that later operators ask for: COTE 1..4 of a surface, FACE 1..3 of a volume (keys "1", "2", ...).
    """

    type_name = MAILLAGE

    def __init__(self, store: NodeStore, blocks: Sequence[Block], sides: dict[str, Maillage] | None = None) -> None:
        self.store = store
        self._blocks = tuple(b for b in blocks if len(b.cells))
        self._version = store.version
        self.sides = sides or {}

    @classmethod
    def of(cls, store: NodeStore, shape: str, cells: IntArray, sides: dict[str, Maillage] | None = None) -> Maillage:
        """Make a mesh of one element type."""
        return cls(store, [Block(shape, np.asarray(cells, np.int64))], sides)

    @classmethod
    def of_nodes(cls, store: NodeStore, nodes: IntArray) -> Maillage:
        """Make a mesh of points (POI1)."""
        return cls.of(store, "POI1", np.asarray(nodes, np.int64).reshape(-1, 1))

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks, with merged nodes replaced."""
        if self._version != self.store.version:
            self._blocks = tuple(Block(b.shape, self.store.canonical(b.cells), b.colours) for b in self._blocks)
            self._version = self.store.version
        return self._blocks

    @property
    def kernel_blocks(self) -> list[tuple[str, IntArray]]:
        """The blocks as kernels take them: (shape name, cells)."""
        return [(b.shape, b.cells) for b in self.blocks]

    @property
    def nodes(self) -> IntArray:
        """Distinct nodes, sorted."""
        # Marking is many times faster than sorting the nodes of all elements.
        marked = np.zeros(self.store.count, bool)
        for block in self.blocks:
            marked[block.cells] = True
        return np.flatnonzero(marked).astype(np.int64)

    def nodes_in_order(self) -> IntArray:
        """Return the distinct nodes in order of first appearance (the order along a line)."""
        if not self.blocks:
            return np.zeros(0, np.int64)
        flat = np.concatenate([cells_in_turn(b.shape, b.cells).ravel() for b in self.blocks])
        _, first = np.unique(flat, return_index=True)
        return flat[np.sort(first)]

    @property
    def n_cells(self) -> int:
        """Number of elements."""
        return sum(len(b.cells) for b in self.blocks)

    @property
    def shapes(self) -> list[str]:
        """Element types, in the order of the blocks."""
        return [b.shape for b in self.blocks]

    def cells(self, shape: str) -> IntArray:
        """Return the elements of one type, (m, n_nodes); (0, 0) when there are none."""
        return next((b.cells for b in self.blocks if b.shape == shape), np.zeros((0, 0), np.int64))

    def single(self) -> Block | None:
        """Return the only block, or None when there are several or none."""
        return self.blocks[0] if len(self.blocks) == 1 else None

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the lines that LIST prints."""
        number = session.ordinal(self)
        for block in self.blocks:
            yield f"MAILLAGE {number} : {len(block.cells)} element(s) de type {block.shape}"
            yield f"{len(self.sides)} sous-reference(s)"
            if brief:
                continue
            yield "1ere ligne  numero element : 2eme couleur : 3eme... noeud(s)"
            for start in range(0, len(block.cells), 15):
                rows = slice(start, start + 15)
                yield _row([str(i + 1) for i in range(start, min(start + 15, len(block.cells)))])
                yield _row([COLOURS[c] for c in block.colours[rows]])
                for local in cells_in_turn(block.shape, block.cells[rows]).T:
                    yield _row([str(n + 1) for n in local])


def _row(fields: Sequence[str]) -> str:
    first, *rest = fields
    return f"{first:>7}" + "".join(f"{f:>8}" for f in rest)
