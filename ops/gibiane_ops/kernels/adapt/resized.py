"""Division and merging of hexahedra and quadrangles until they have the sizes asked for."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.adapt.octree import NAMES, BoolArray, Octree, balanced, divided, merged_back, offsets
from gibiane_ops.kernels.adapt.sizes import element_sizes
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.table import shape


def resized(mesh: Octree, sizes: FloatArray) -> tuple[Octree, int]:
    """Put together and divide until elements have the sizes asked for, within the factor that a division leaves.

    Parameters
    ----------
    mesh : Octree
    sizes : (n,) float64, length
        Edge wanted at the nodes of ``mesh.corners``.

    Returns
    -------
    mesh : Octree
        Balanced.
    rounds : int
        Rounds of `balanced` that divided something.

    Notes
    -----
    An element is divided above sqrt(2) times the size asked at its nodes (geometric mean), its children all taking
    what its trilinear interpolation gives; children go below its inverse.
    """
    of = shape(NAMES[2**mesh.dim])
    slack = np.sqrt(2.0)
    _, cells = mesh.corners
    asked = np.log(sizes)[cells]

    def log_ratio(state: Octree, nodal: FloatArray) -> FloatArray:
        points, each = state.corners
        present = element_sizes(of, np.abs(geometry.measures(of, points[each])))
        return np.asarray(np.log(present) - nodal.mean(axis=1), np.float64)

    while True:
        mesh, place = merged_back(mesh, log_ratio(mesh, asked) <= -np.log(slack))
        if len(mesh.root) == len(place):
            break
        count = np.bincount(place)[:, None]
        asked = np.stack([np.bincount(place, each) for each in asked.T], axis=1) / count
    while True:
        marked = log_ratio(mesh, asked) > np.log(slack)
        if not marked.any():
            break
        asked = _children(mesh, marked, asked)
        mesh = divided(mesh, marked)
    return balanced(mesh)


def _children(mesh: Octree, marked: BoolArray, values: FloatArray) -> FloatArray:
    """Interpolate values at the corners of elements to those of their children."""
    of, corner = shape(NAMES[2**mesh.dim]), offsets(mesh.dim)
    places = (corner[:, None, :] + corner[None, :, :]) - 1.0  # corners of child i in the element, -1 to 1
    N = of.N(np.asarray(places, np.float64).reshape(-1, mesh.dim)).reshape(len(corner), len(corner), -1)
    new = np.einsum("ijc,mc->mij", N, values[marked])
    times = np.where(marked, len(corner), 1)
    result = values[np.repeat(np.arange(len(marked)), times)]
    result[marked[np.repeat(np.arange(len(marked)), times)]] = new.reshape(-1, len(corner))
    return result
