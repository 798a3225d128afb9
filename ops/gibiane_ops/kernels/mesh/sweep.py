"""Sweeping lines into surfaces and surfaces into volumes, layer by layer."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray

SWEPT = {"POI1": "SEG2", "SEG2": "QUA4", "TRI3": "PRI6", "QUA4": "CUB8"}


def sweep_cells(name: str, cells: IntArray, layers: IntArray) -> tuple[str, IntArray]:
    """Join each element of a mesh to its images.

    Parameters
    ----------
    name : str
        POI1, SEG2, TRI3 or QUA4.
    cells : (m, n) int64
        Columns of `layers`, not ids of nodes.
    layers : (n_layers + 1, n_base) int64
        Ids of the nodes of the base and of its images.

    Returns
    -------
    name : str
        SEG2, QUA4, PRI6 or CUB8.
    cells : (n_layers * m, 2 n) int64
        First layer first. A swept segment runs round: first segment, then its image backwards, so that the surface
        has the sweep on the left of the line; a swept surface has the base below and its image above.
    """
    below = layers[:-1][:, cells]
    above = layers[1:][:, cells]
    if name == "SEG2":
        above = above[:, :, ::-1]
    joined = np.concatenate([below, above], axis=2)
    return SWEPT[name], joined.reshape(-1, joined.shape[2])


def split_quadrangles(points: FloatArray, cells: IntArray) -> IntArray:
    """Cut quadrangles into triangles along their shorter diagonal.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    cells : (m, 4) int64

    Returns
    -------
    (2 m, 3) int64
        Oriented as the quadrangles; equal diagonals are cut from the first corner.
    """
    X = points[cells]
    first = np.linalg.norm(X[:, 2] - X[:, 0], axis=1)
    second = np.linalg.norm(X[:, 3] - X[:, 1], axis=1)
    other = second < first * (1 - 1e-9)
    local = np.where(other[:, None], [[0, 1, 3, 1, 2, 3]], [[0, 1, 2, 0, 2, 3]])
    return np.take_along_axis(cells, local, axis=1).reshape(-1, 3)


def ruled_layers(base: FloatArray, end: FloatArray, places: FloatArray) -> FloatArray:
    """Place the layers between two congruent sets of nodes, on straight lines.

    Parameters
    ----------
    base, end : (n, dim) float64, length
    places : (n_layers + 1,) float64
        From 0 to 1.

    Returns
    -------
    (n_layers + 1, n, dim) float64, length
    """
    t = places[:, None, None]
    layers: FloatArray = (1 - t) * base[None] + t * end[None]
    layers[-1] = end
    return layers
