"""ARBRE: how a mesh that REMAILLER 'LOCA' made is divided, so that it can be coarsened again."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from gibiane.values import Value
from gibiane_ops.kernels.adapt.hierarchy import Hierarchy
from gibiane_ops.values.nodes import IntArray

ARBRE = "ARBRE"


class Arbre(Value):
    """The first mesh, its groups, and its divisions.

    Attributes
    ----------
    state : Hierarchy
    ids : (n,) int64
        Nodes of the session, in the order of ``state.mesh().points``.
    cells : (m, n_nodes) int64
        Corners of the elements of the mesh, by nodes of the session.
    """

    type_name: ClassVar[str] = ARBRE

    def __init__(self, state: Hierarchy, ids: IntArray, cells: IntArray) -> None:
        self.state = state
        self.ids = ids
        self.cells = cells

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the lines that LIST prints."""
        first, now = len(self.state.cells), len(self.cells)
        yield f" ARBRE de pointeur {session.ordinal(self)} : {first} -> {now} element(s) {self.state.name}"
