"""Overlapping parts of a mesh, each small enough that its tractions are improved all together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.estimate.simplices import Simplices

WHOLE, CORE = 2000, 1500
"""Tetrahedra of a mesh that is one part; those of a part of a larger one, before it grows over its neighbours: a factor
costs 0.4 ms a tetrahedron for 600 of them, 0.6 for 1500, 0.9 for 6000. A plane is always one part."""

LAYERS = 2
"""Layers of cells, side by side, that a part takes from its neighbours."""


def regions(mesh: Simplices, turn: int = 0, cells: IntArray | None = None) -> list[IntArray]:
    """Cut a mesh, or some of its cells, into overlapping parts.

    Parameters
    ----------
    mesh : Simplices
    turn : int
        The cuts of odd turns fall between those of even ones.
    cells : (k,) int64, optional

    Returns
    -------
    list of (k,) int64
        Cells of each part.

    Notes
    -----
    Bisection of the centres along the longest direction, into parts of nearly equal numbers of cells.

    Source
    ------
    Berger and Bokhari 1987.

    Cost
    ----
    One sort for each level of the bisection.
    """
    cells = np.arange(len(mesh.cells)) if cells is None else cells
    if mesh.dim == 2 or len(cells) <= WHOLE:
        return [cells]
    centres = mesh.points[mesh.cells].mean(axis=1)
    first = 0.5 * np.ceil(len(cells) / CORE) ** (-1.0 / mesh.dim) if turn % 2 else None
    return [np.intersect1d(grown(mesh, part, LAYERS), cells) for part in _halves(centres, cells, first)]


def _halves(centres: FloatArray, cells: IntArray, first: float | None = None) -> list[IntArray]:
    """Cut until parts are small; the first cut leaves the share `first` on its left."""
    if len(cells) <= CORE:
        return [cells]
    count = -(-len(cells) // CORE)
    share = (count // 2) / count if first is None else first
    axis = int(np.ptp(centres[cells], axis=0).argmax())
    order = cells[np.argsort(centres[cells, axis], kind="stable")]
    cut = round(share * len(cells))
    return _halves(centres, order[:cut]) + _halves(centres, order[cut:])


def grown(mesh: Simplices, cells: IntArray | NDArray[np.bool_], layers: int) -> IntArray:
    """Add the cells that share a side, layer after layer.

    Parameters
    ----------
    mesh : Simplices
    cells : (k,) int64 or (m,) bool
    layers : int

    Returns
    -------
    (n,) int64
    """
    inside = np.zeros(len(mesh.cells), bool)
    inside[cells] = True
    for _ in range(layers):
        near = mesh.cell[mesh.side[inside]]
        inside[near[near >= 0]] = True
    return np.flatnonzero(inside)
