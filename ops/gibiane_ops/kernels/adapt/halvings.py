"""Sizes asked for, met by halving simplices and by undoing halvings."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.adapt.sizes import element_sizes
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.mesh.bisection import NAMES, Bisection, coarsened, refined


def adapted(mesh: Bisection, sizes: FloatArray) -> Bisection:
    """Coarsen and refine until simplices have the sizes asked for, within the factor that one halving leaves.

    Parameters
    ----------
    mesh : Bisection
    sizes : (n,) float64, length
        Edge of the regular simplex wanted at each node; a new node takes the mean of the ends of its edge.

    Returns
    -------
    Bisection

    Notes
    -----
    A halving divides the size by ``2^(1/dim)``: a simplex is halved above ``2^(1/(2 dim))`` times the size asked and
    may become whole below its inverse.

    Cost
    ----
    One sort of the edges per halving of the smallest simplices.
    """
    dim = mesh.points.shape[1]
    of = shape(NAMES[dim + 1])
    slack = 2 ** (1 / (2 * dim))
    asked = sizes

    def ratios(state: Bisection) -> FloatArray:
        cells = state.leaf_cells
        present = element_sizes(of, np.abs(geometry.measures(of, state.points[cells])))
        return np.asarray(present / np.exp(np.log(asked[cells]).mean(axis=1)), np.float64)

    while True:
        mesh, kept = coarsened(mesh, ratios(mesh) <= 1 / slack)
        if len(kept) == len(asked):
            break
        asked = asked[kept]
    while True:
        marked = ratios(mesh) > slack
        if not marked.any():
            return mesh
        mesh = refined(mesh, marked)
        new = mesh.ends[len(asked) :]
        asked = np.concatenate([asked, np.sqrt(asked[new[:, 0]] * asked[new[:, 1]])])
