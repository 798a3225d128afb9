"""What a mesh file holds, whatever its format."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import UnreadableFile
from gibiane_ops.kernels.topology import Block


@dataclass(eq=False)
class MeshFile:
    """Points, elements, named groups and fields.

    Attributes
    ----------
    points : (n, 3) float64, length
    blocks : list of (str, (m, n_nodes) int64)
        Name of the shape and elements.
    groups : dict of str to list of (int, (k,) int64)
        For each group of elements the positions of its blocks and the rows in them.
    node_groups : dict of str to (k,) int64
    point_data : dict of str to (n,) or (n, c) float64
    cell_data : dict of str to one (m,) or (m, c) float64 per block
    skipped : tuple of str
        Types of elements that were left out.
    """

    points: FloatArray
    blocks: list[Block]
    groups: dict[str, list[tuple[int, IntArray]]] = field(default_factory=dict)
    node_groups: dict[str, IntArray] = field(default_factory=dict)
    point_data: dict[str, FloatArray] = field(default_factory=dict)
    cell_data: dict[str, list[FloatArray]] = field(default_factory=dict)
    skipped: tuple[str, ...] = ()

    def checked(self, path: str) -> MeshFile:
        """Return this content if it makes sense.

        Raises
        ------
        UnreadableFile
            No element, nodes that are not there, coordinates that are no numbers: the mark of a damaged file.
        """
        if not sum(len(cells) for _, cells in self.blocks):
            types = f" of a known type (it has {', '.join(self.skipped)})" if self.skipped else ""
            raise UnreadableFile(path, f"it holds no element{types}")
        if not np.isfinite(self.points).all():
            raise UnreadableFile(path, "coordinates in it are no finite numbers")
        for name, cells in self.blocks:
            if cells.size and not 0 <= int(cells.min()) <= int(cells.max()) < len(self.points):
                raise UnreadableFile(path, f"a {name} in it has a node that does not exist")
        return self

    def group_blocks(self, name: str) -> list[Block]:
        """Return the elements of a group, by block."""
        return [(self.blocks[i][0], self.blocks[i][1][rows]) for i, rows in self.groups[name]]


def numbered_groups(
    tags: list[IntArray], names: Mapping[int, str] | None, prefix: str
) -> dict[str, list[tuple[int, IntArray]]]:
    """Make groups of the number that each element bears; zero is none.

    Parameters
    ----------
    tags : list of (m,) int64
        One array per block.
    names : mapping of int to str, or None
        Names of some numbers; the others are called after `prefix`.
    """
    groups: dict[str, list[tuple[int, IntArray]]] = {}
    for position, numbers in enumerate(tags):
        for number in np.unique(numbers):
            if number == 0:
                continue
            name = (names or {}).get(int(number), f"{prefix}{abs(int(number))}")
            groups.setdefault(name, []).append((position, np.flatnonzero(numbers == number)))
    return groups
