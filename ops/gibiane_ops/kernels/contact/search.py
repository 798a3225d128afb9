"""Which facets may face which points or facets: a tree of their centres, never all against all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.geometry import normal_densities
from gibiane_ops.kernels.topology import Block

SLANT = 1.25
"""How much farther along its normal than straight away a facet may lie."""


@dataclass(frozen=True, eq=False)
class Spheres:
    """Facets of all blocks of a surface, one after the other, with the spheres around them.

    Attributes
    ----------
    block, facet : (m,) int64
        Block of each, and its place in the block.
    centre : (m, d) float64, length
    radius : (m,) float64, length
    normal : (m, d) float64
        Unit mean normals.
    """

    block: IntArray
    facet: IntArray
    centre: FloatArray
    radius: FloatArray
    normal: FloatArray


def spheres(points: FloatArray, facets: Sequence[Block]) -> Spheres:
    """Put a sphere around each facet.

    Parameters
    ----------
    points : (n_points, d) float64, length
    facets : sequence of (shape name, (m, n_nodes) int64)

    Returns
    -------
    Spheres
    """
    block, facet, centre, radius, normal = [], [], [], [], []
    for number, (name, cells) in enumerate(facets):
        X, of = points[cells], shape(name)
        mean = np.einsum("mqi,q->mi", normal_densities(of, X, of.mass_gauss[0]), of.mass_gauss[1])
        block.append(np.full(len(cells), number))
        facet.append(np.arange(len(cells)))
        centre.append(X.mean(axis=1))
        radius.append(np.linalg.norm(X - X.mean(axis=1, keepdims=True), axis=2).max(axis=1, initial=0.0))
        normal.append(mean / np.linalg.norm(mean, axis=1)[:, None])
    return Spheres(*(np.concatenate(each) for each in (block, facet, centre, radius, normal)))


def reach(x: FloatArray) -> float:
    """Give the largest gap that contact may bridge: half the extent of the surface.

    Parameters
    ----------
    x : (k, d) float64, length
        Nodes of the surface.

    Returns
    -------
    float, length
    """
    return 0.5 * float(np.ptp(x, axis=0).max())


def candidates(x: FloatArray, radius: FloatArray | float, among: Spheres, far: float) -> tuple[IntArray, IntArray]:
    """List the facets that spheres may face: (sphere, facet) pairs.

    Parameters
    ----------
    x : (k, d) float64, length
        Centres.
    radius : (k,) float64 or float, length
    among : Spheres
    far : float, length
        Largest gap.

    Returns
    -------
    sphere, facet : (n,) int64
        Every facet that touches the sphere grown by the distance of its nearest facet is there.

    Cost
    ----
    A k-d tree; the lists grow with the square of the gap over the size of the facets.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(among.centre)
    nearest = tree.query(x)[0]
    found = tree.query_ball_point(x, np.minimum(SLANT * nearest, far) + radius + among.radius.max(initial=0.0))
    counts = np.array([len(each) for each in found], np.int64)
    flat = np.concatenate([np.zeros(0, np.int64), *(np.asarray(each, np.int64) for each in found)])
    return np.repeat(np.arange(len(x)), counts), flat
