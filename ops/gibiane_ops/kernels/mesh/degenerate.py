"""Elements that have lost a corner, and the lower elements that they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.elements.table import shape


def split_off_triangles(cells: IntArray) -> tuple[IntArray, IntArray]:
    """Separate quadrangles from those that have one corner twice in a row.

    Parameters
    ----------
    cells : (m, 4) int64

    Returns
    -------
    quadrangles : (k, 4) int64
    triangles : (m - k, 3) int64
        In the order of `cells`, turning as they did.
    """
    same = cells == np.roll(cells, -1, axis=1)
    rows = np.flatnonzero(same.any(axis=1))
    if len(rows) == 0:
        return cells, np.zeros((0, 3), np.int64)
    drop = same[rows].argmax(axis=1)
    local = (drop[:, None] + np.array([1, 2, 3])) % 4
    return np.delete(cells, rows, axis=0), np.take_along_axis(cells[rows], local, axis=1)


def lowered(name: str, cells: IntArray) -> tuple[dict[str, tuple[IntArray, IntArray]], IntArray]:
    """Replace elements that have nodes twice by the lower elements that they are.

    Parameters
    ----------
    name : str
        Shape.
    cells : (m, n_nodes) int64

    Returns
    -------
    by_shape : dict of str to ((k, .) int64, (k,) int64)
        The elements and the rows that they come from, increasing.
    hopeless : (p,) int64
        Rows that are no element any more (all nodes one, or an impossible collapse of a volume).

    Notes
    -----
    What counts is which local nodes are equal: each pattern is treated once. Of a volume, the faces are reduced to
    their different corners, equal opposite faces vanish, and the rest is known by its numbers of corners and faces.
    """
    pattern = np.argmax(cells[:, :, None] == cells[:, None, :], axis=2)
    sound = np.arange(cells.shape[1])
    kinds, kind = np.unique(pattern, axis=0, return_inverse=True)
    found: dict[str, list[tuple[IntArray, IntArray]]] = {}
    hopeless = [np.zeros(0, np.int64)]
    for number, equal in enumerate(kinds):
        rows = np.flatnonzero(kind.ravel() == number)
        local: tuple[int, ...] = tuple(equal.tolist())
        reduced = (name, local) if np.array_equal(equal, sound) else _reduce(name, local)
        if reduced is None:
            hopeless.append(rows)
        else:
            found.setdefault(reduced[0], []).append((cells[rows][:, np.array(reduced[1])], rows))
    by_shape = {}
    for lower, parts in found.items():
        rows = np.concatenate([each for _, each in parts])
        order = np.argsort(rows)
        by_shape[lower] = np.concatenate([each for each, _ in parts])[order], rows[order]
    return by_shape, np.concatenate(hopeless)


def _reduce(name: str, pattern: tuple[int, ...]) -> tuple[str, tuple[int, ...]] | None:
    """Return the shape that a collapse leaves, and which local nodes are its corners."""
    dim = shape(name).dim
    if dim < 3:
        corners = _polygon(pattern)
        lower = {1: "POI1", 2: "SEG2", 3: "TRI3"}.get(len(corners))
        return None if lower is None or len(set(corners)) < len(corners) else (lower, corners)
    faces: list[tuple[int, ...]] = []
    for _, local in shape(name).faces:
        face = _polygon(tuple(pattern[i] for i in local))
        if len(face) < 3:
            continue
        if len(set(face)) < len(face):
            return None
        opposite = next((f for f in faces if set(f) == set(face)), None)
        if opposite is None:
            faces.append(face)
        else:
            faces.remove(opposite)
    return _solid(faces)


def _polygon(nodes: tuple[int, ...]) -> tuple[int, ...]:
    """Drop the corners that repeat the one before them, round the polygon."""
    kept = [node for i, node in enumerate(nodes) if node != nodes[i - 1]]
    if not kept:
        return nodes[:1]
    return tuple(dict.fromkeys(kept)) if len(set(kept)) == 2 else tuple(kept)


def _solid(faces: list[tuple[int, ...]]) -> tuple[str, tuple[int, ...]] | None:
    """Recognise a tetrahedron, a pyramid or a prism by its faces, whose corners turn seen from outside."""
    corners = {node for face in faces for node in face}
    triangles = [face for face in faces if len(face) == 3]
    squares = [face for face in faces if len(face) == 4]
    if (len(corners), len(triangles), len(squares)) == (4, 4, 0):
        a, b, c = triangles[0]
        return "TET4", (a, c, b, *(corners - {a, b, c}))
    if (len(corners), len(triangles), len(squares)) == (5, 4, 1):
        a, b, c, d = squares[0]
        return "PYR5", (a, d, c, b, *(corners - {a, b, c, d}))
    if (len(corners), len(triangles), len(squares)) == (6, 2, 3):
        base = triangles[0]
        bottom = (base[0], base[2], base[1])
        above = [_other_end(node, set(base), squares) for node in bottom]
        return None if None in above else ("PRI6", (*bottom, *(int(node) for node in above if node is not None)))
    return None


def _other_end(node: int, base: set[int], squares: Sequence[tuple[int, ...]]) -> int | None:
    """Return the corner joined to a corner of the base by an edge that is not in the base."""
    for face in squares:
        if node in face:
            at = face.index(node)
            for neighbour in (face[at - 1], face[(at + 1) % 4]):
                if neighbour not in base:
                    return neighbour
    return None
