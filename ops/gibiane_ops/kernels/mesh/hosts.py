"""Which element of a mesh holds each of many points, and the weights of its nodes there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.mesh.locate import overshoot, reference_coordinates
from gibiane_ops.kernels.topology import Block


def hosted(
    points: FloatArray, coords: FloatArray, blocks: Sequence[Block], tolerance: float = 1e-5
) -> tuple[IntArray, sp.csr_array]:
    """Find the points that an element holds and interpolate there.

    Parameters
    ----------
    points : (k, dim) float64, length
    coords : (n_points, dim) float64, length
        Nodes of the mesh.
    blocks : sequence of (str, (m, n_nodes) int64)
        Solids, or surfaces and lines in a larger space.
    tolerance : float
        How far outside an element a point may be, relative to the size of the element.

    Returns
    -------
    inside : (j,) int64
        Rows of the points that an element holds, increasing.
    weights : (j, n_points) csr_array
        Row i interpolates at point inside[i] the values at the nodes of the mesh; rows sum to 1.

    Notes
    -----
    Of several elements the one is taken that the point overshoots least, the first of equal ones.

    Cost
    ----
    For each point, the elements whose circumscribed sphere about their centre holds it.
    """
    from scipy.spatial import cKDTree

    best = np.full(len(points), np.inf)
    rows: list[IntArray] = []
    columns: list[IntArray] = []
    values: list[FloatArray] = []
    tree = cKDTree(points) if len(points) else None
    for name, cells in blocks:
        if tree is None:
            break
        X = coords[cells]
        centre = X.mean(axis=1)
        radius = np.linalg.norm(X - centre[:, None], axis=2).max(axis=1)
        found = tree.query_ball_point(centre, radius * (1 + 2 * tolerance))
        count = np.array([len(each) for each in found])
        if not count.any():
            continue
        element = np.repeat(np.arange(len(cells)), count)
        point = np.concatenate([np.asarray(each, np.int64) for each in found if len(each)])
        xi = reference_coordinates(name, X[element], points[point])
        N = shape(name).N(xi)
        off = np.linalg.norm(np.einsum("mn,mni->mi", N, X[element]) - points[point], axis=1) / radius[element]
        out = np.maximum(overshoot(name, xi), off)
        order = np.lexsort((element, out, point))
        _, first = np.unique(point[order], return_index=True)
        chosen = order[first]
        chosen = chosen[(out[chosen] <= tolerance) & (out[chosen] < best[point[chosen]])]
        best[point[chosen]] = out[chosen]
        n = cells.shape[1]
        rows.append(np.repeat(point[chosen], n))
        columns.append(cells[element[chosen]].ravel())
        values.append(N[chosen].ravel())
        # A point that an earlier block held less well belongs to this one alone.
        for i in range(len(rows) - 1):
            stay = ~np.isin(rows[i], point[chosen])
            rows[i], columns[i], values[i] = rows[i][stay], columns[i][stay], values[i][stay]
    inside = np.flatnonzero(np.isfinite(best))
    none = np.zeros(0, np.int64)
    row = np.searchsorted(inside, np.concatenate([none, *rows]))
    entries = (np.concatenate([np.zeros(0), *values]), (row, np.concatenate([none, *columns])))
    return inside, sp.csr_array(entries, shape=(len(inside), len(coords)))
