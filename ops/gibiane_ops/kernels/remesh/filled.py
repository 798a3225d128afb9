"""What meshes that fill a given boundary share: the sizes inside, and the points given, kept as they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.remesh.session import set_constant_size, set_size_field


@dataclass(frozen=True, eq=False)
class FilledMesh:
    """Simplices inside a given boundary.

    Attributes
    ----------
    points : (n, dim) float64, length
        The given points, unchanged and first, then the new ones.
    cells : (m, k) int64
        Tetrahedra or triangles (or quadrangles), positive measure.
    rest : (p, 3) int64
        Triangles left over in a mesh of quadrangles, else empty.
    """

    points: FloatArray
    cells: IntArray
    rest: IntArray


def check_sizes(sizes: float | FloatArray | None) -> None:
    """Raise BadValue unless all the sizes given are positive."""
    if sizes is not None and not np.all(np.asarray(sizes) > 0):
        raise BadValue("size", float(np.min(sizes)), "size > 0")


def size_of(points: FloatArray, used: IntArray, sizes: float | FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return the size wanted anywhere inside: constant, or linear between the nodes of the envelope."""
    if not np.ndim(sizes):
        return lambda places: np.full(len(places), float(np.asarray(sizes)))
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    given = np.asarray(sizes, np.float64)[used]
    linear, nearest = LinearNDInterpolator(points[used], given), NearestNDInterpolator(points[used], given)

    def size(places: FloatArray) -> FloatArray:
        values = linear(places)
        return np.asarray(np.where(np.isnan(values), nearest(places), values), np.float64)

    return size


def sizes_of(sizes: float | FloatArray | None, nodes: IntArray) -> float | FloatArray | None:
    """Keep the sizes of some nodes; one size for all stays what it is."""
    return sizes[nodes] if isinstance(sizes, np.ndarray) and sizes.ndim else sizes


def set_inner_sizes(gmsh: Any, points: FloatArray, plane: FloatArray, sizes: float | FloatArray | None) -> None:
    """Install a constant size, or the sizes of boundary points interpolated on their Delaunay mesh.

    `plane` holds the coordinates in which that mesh is made: 2 for a plane contour, 3 for an envelope.
    """
    from scipy.spatial import Delaunay

    if sizes is None:
        return
    if isinstance(sizes, np.ndarray) and sizes.ndim:
        simplices = np.asarray(Delaunay(plane).simplices, np.int64)
        corners = plane[simplices]
        volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
        set_size_field(gmsh, points, simplices[volume > 1e-9 * volume.max()], sizes)
    else:
        set_constant_size(gmsh, float(sizes))


def with_given_points(
    points: FloatArray, used: IntArray, found: FloatArray, given: IntArray, *cells: IntArray
) -> FilledMesh:
    """Renumber so that the given points come first with their own coordinates; `given` are the rows of `used`."""
    new = np.full(len(found), -1, np.int64)
    new[given] = used
    inner = np.flatnonzero(new < 0)
    new[inner] = len(points) + np.arange(len(inner))
    every = np.vstack([points, found[inner][:, : points.shape[1]]])
    rest = new[cells[1]] if len(cells) > 1 else np.zeros((0, 3), np.int64)
    return FilledMesh(every, new[cells[0]], rest)
