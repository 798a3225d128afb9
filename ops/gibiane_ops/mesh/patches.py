"""Grids of nodes made into surfaces, their four sides recorded."""

from __future__ import annotations

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.mesh import degenerate, sweep
from gibiane_ops.mesh.building import line_between, new_mesh, nodes_of, surface_shape
from gibiane_ops.mesh.degree import bend_diagonals
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.middles import middles_of


def elements(ctx: Context, cells: IntArray, quadratic: bool) -> list[tuple[str, IntArray]]:
    """Turn quadrangles into elements of the type of OPTI ELEM; those with a corner twice become triangles."""
    quadrangles, triangles = degenerate.split_off_triangles(cells)
    if surface_shape(ctx) == "TRI3":
        cut = sweep.split_quadrangles(nodes_of(ctx).coords, quadrangles)
        if quadratic:
            bend_diagonals(ctx, quadrangles, cut)
        return [("TRI3", np.concatenate([cut, triangles]))]
    return [("QUA4", quadrangles), ("TRI3", triangles)]


def halved(places: FloatArray) -> FloatArray:
    """Put the middles between places, (m + 1,) to (2 m + 1,)."""
    result = np.empty(2 * len(places) - 1)
    result[::2], result[1::2] = places, (places[1:] + places[:-1]) / 2
    return result


def patch(
    ctx: Context, grid: FloatArray, ids: IntArray, sizes: tuple[float, float], places: FloatArray, quadratic: bool
) -> Maillage:
    """Make a surface of first degree of a grid: nodes of id -1 are added, -2 is the first of the row.

    In second degree every other row and column holds mid-nodes.
    """
    new = ids == -1
    if quadratic:
        new[1::2, 1::2] = False
    density = np.broadcast_to((sizes[0] + places * (sizes[1] - sizes[0]))[:, None], ids.shape)
    ids[new] = nodes_of(ctx).add(grid[new], density[new])
    seam = ids[:, -1] == -2
    ids[seam, -1] = ids[seam, 0]
    corners = ids
    if quadratic:
        corners = ids[::2, ::2]
        for first, middle, last in (
            (ids[::2, :-1:2], ids[::2, 1::2], ids[::2, 2::2]),
            (ids[:-1:2, ::2], ids[1::2, ::2], ids[2::2, ::2]),
        ):
            middles_of(ctx).record(np.stack([first.ravel(), last.ravel()], axis=1), middle.ravel())
    sides = {
        "1": line_between(ctx, corners[0]),
        "2": line_between(ctx, corners[:, -1]),
        "3": line_between(ctx, corners[-1][::-1]),
        "4": line_between(ctx, corners[::-1, 0]),
    }
    return new_mesh(ctx, elements(ctx, grid_cells(corners), quadratic), sides)


def grid_cells(ids: IntArray) -> IntArray:
    """Return the quadrangles of a grid of nodes, (m + 1, n + 1) to (m n, 4)."""
    return np.stack([ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]], axis=2).reshape(-1, 4)
