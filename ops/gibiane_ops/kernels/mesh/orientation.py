"""Turning elements over, and finding those that turn the wrong way."""

from __future__ import annotations

from functools import cache

import numpy as np

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape


@cache
def _mirror(name: str) -> tuple[int, ...]:
    nodes = shape(name).ref_nodes
    image = nodes.copy()
    if shape(name).dim == 1:
        image[:, 0] = -image[:, 0]
    elif shape(name).dim > 1:
        image[:, [0, 1]] = nodes[:, [1, 0]]
    distance = np.abs(image[:, None] - nodes[None]).sum(axis=2)
    return tuple(int(i) for i in distance.argmin(axis=1))


def reversed_cells(name: str, cells: IntArray) -> IntArray:
    """Turn elements over.

    Parameters
    ----------
    name : str
        Shape.
    cells : (m, n_nodes) int64

    Returns
    -------
    (m, n_nodes) int64
        The same elements with the opposite orientation; surfaces and volumes keep their first node. A volume gets
        the opposite sign of jacobian. Points do not change.

    Notes
    -----
    The permutation is the mirror image of the reference nodes: a segment end for end, others by exchange of the first
    two reference axes.
    """
    return cells[:, list(_mirror(name))]


def negative(name: str, X: FloatArray) -> IntArray:
    """Find the elements of negative measure.

    Parameters
    ----------
    name : str
        A shape that fills the space.
    X : (m, n_nodes, dim) float64, length

    Returns
    -------
    (k,) int64
        Their rows.
    """
    return np.flatnonzero(geometry.measures(shape(name), X) < 0).astype(np.int64)
