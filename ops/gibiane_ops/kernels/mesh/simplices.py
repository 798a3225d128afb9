"""Cutting elements into simplices so that neighbours fit, by the numbers of their nodes alone."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.errors import BadValue

# The rotations of a hexahedron that bring each corner to place 0, and the turns about the diagonal 0-6 that follow.
_TO_FIRST = np.array(
    [
        [0, 1, 2, 3, 4, 5, 6, 7],
        [1, 0, 4, 5, 2, 3, 7, 6],
        [2, 1, 5, 6, 3, 0, 4, 7],
        [3, 0, 1, 2, 7, 4, 5, 6],
        [4, 0, 3, 7, 5, 1, 2, 6],
        [5, 1, 0, 4, 6, 2, 3, 7],
        [6, 2, 1, 5, 7, 3, 0, 4],
        [7, 3, 2, 6, 4, 0, 1, 5],
    ]
)
_TURN = np.array([[0, 1, 2, 3, 4, 5, 6, 7], [0, 4, 5, 1, 3, 7, 6, 2], [0, 3, 7, 4, 1, 2, 6, 5]])
# Tetrahedra of a hexahedron whose three faces at corner 0 are cut from corner 0, by the number of the three faces at
# corner 6 that are cut from corner 6.
_HEXAHEDRON = (
    [[0, 1, 2, 5], [0, 2, 7, 5], [0, 2, 3, 7], [0, 5, 7, 4], [2, 7, 5, 6]],
    [[0, 5, 7, 4], [0, 1, 7, 5], [1, 6, 7, 5], [0, 7, 2, 3], [0, 7, 1, 2], [1, 7, 6, 2]],
    [[0, 4, 5, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 1, 2, 5], [0, 3, 6, 2], [0, 6, 5, 2]],
    [[0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 5, 6, 4], [1, 5, 6, 0], [1, 6, 2, 0]],
)
_PRISM_FIRST = np.array(
    [
        [0, 1, 2, 3, 4, 5],
        [1, 2, 0, 4, 5, 3],
        [2, 0, 1, 5, 3, 4],
        [3, 5, 4, 0, 2, 1],
        [4, 3, 5, 1, 0, 2],
        [5, 4, 3, 2, 1, 0],
    ]
)
_PRISM = ([[0, 1, 2, 5], [0, 1, 5, 4], [0, 4, 5, 3]], [[0, 1, 2, 4], [0, 4, 2, 5], [0, 4, 5, 3]])


def triangles_of_quadrangles(cells: IntArray) -> IntArray:
    """Cut quadrangles from their corner of smallest number.

    Parameters
    ----------
    cells : (m, 4) int64

    Returns
    -------
    (2 m, 3) int64
        Turning as the quadrangles; a quadrangle that two volumes share is cut alike from both sides.
    """
    first = cells.argmin(axis=1)
    turned = np.take_along_axis(cells, (first[:, None] + np.arange(4)) % 4, axis=1)
    return turned[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


def tetrahedra(name: str, cells: IntArray) -> tuple[IntArray, IntArray]:
    """Cut volumes into tetrahedra, each quadrangular face from its corner of smallest number.

    Parameters
    ----------
    name : str
        TET4, PYR5, PRI6 or CUB8.
    cells : (m, n_nodes) int64
        Positive volume.

    Returns
    -------
    cells : (k, 4) int64
        Positive volume, in the order of the elements: 1, 2, 3, and 5 or 6 of each. Neighbours fit, because the cut of
        a face depends on its nodes only; so do triangles made by `triangles_of_quadrangles`.
    owner : (k,) int64
        Row of the element that each is a piece of.

    Raises
    ------
    BadValue
        Another shape.

    Source
    ------
    Dompierre, Labbe, Vallet and Camarero, How to subdivide pyramids, prisms and hexahedra into tetrahedra, 1999.
    """
    if name == "TET4":
        return cells, np.arange(len(cells))
    if name == "PYR5":
        base = cells[:, :4]
        first = base.argmin(axis=1)
        turned = np.take_along_axis(base, (first[:, None] + np.arange(4)) % 4, axis=1)
        a, b, c, d, e = (*turned.T, cells[:, 4])
        return np.stack([a, b, c, e, a, c, d, e], axis=1).reshape(-1, 4), np.repeat(np.arange(len(cells)), 2)
    if name == "PRI6":
        turned = np.take_along_axis(cells, _PRISM_FIRST[cells.argmin(axis=1)], axis=1)
        low = np.minimum(turned[:, 1], turned[:, 5]) < np.minimum(turned[:, 2], turned[:, 4])
        return _by_case(turned, np.where(low, 0, 1), _PRISM)
    if name == "CUB8":
        turned = np.take_along_axis(cells, _TO_FIRST[cells.argmin(axis=1)], axis=1)
        far = _cut_from_corner_six(turned)
        code = far @ np.array([4, 2, 1])
        # Turn so that the faces cut from corner 6 (one or two of three) come in a fixed place.
        turn = np.select([np.isin(code, (1, 6)), np.isin(code, (2, 5))], [1, 2], 0)
        return _by_case(np.take_along_axis(turned, _TURN[turn], axis=1), far.sum(axis=1), _HEXAHEDRON)
    raise BadValue("shape", name, "a volume of first degree")


def _cut_from_corner_six(cells: IntArray) -> IntArray:
    """Tell for the faces (1, 2, 6, 5), (2, 3, 7, 6) and (4, 5, 6, 7) whether corner 6 is on their cut."""
    flags = []
    for own, other in (((1, 6), (2, 5)), ((3, 6), (2, 7)), ((4, 6), (5, 7))):
        flags.append(cells[:, own].min(axis=1) < cells[:, other].min(axis=1))
    return np.stack(flags, axis=1).astype(np.int64)


def _by_case(cells: IntArray, case: IntArray, tables: tuple[list[list[int]], ...]) -> tuple[IntArray, IntArray]:
    """Apply to each element the table of its case, in the order of the elements; tell which each piece is from."""
    parts, owner = [np.zeros((0, 4), np.int64)], [np.zeros(0, np.int64)]
    for number, table in enumerate(tables):
        rows = np.flatnonzero(case == number)
        if len(rows):
            local = np.array(table)
            parts.append(cells[rows][:, local].reshape(-1, 4))
            owner.append(np.repeat(rows, len(local)))
    rows = np.concatenate(owner)
    order = np.argsort(rows, kind="stable")
    return np.concatenate(parts)[order], rows[order]
