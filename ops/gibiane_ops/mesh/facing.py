"""VOLU between two grids of quadrangles that may have different numbers of rows and columns."""

from __future__ import annotations

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.mesh import grids, orientation
from gibiane_ops.mesh.building import explained, new_mesh, nodes_of
from gibiane_ops.mesh.degree import finished, linear_mesh, wants_quadratic
from gibiane_ops.values.maillage import Maillage, Point


def between_grids(ctx: Context, first: Maillage, last: Maillage, p1: Point, p2: Point, n: int | None) -> Maillage:
    """Make n layers of CUB8 between two grids, whose corners p1 and p2 face each other.

    Where their numbers of columns differ the first layer changes from one to the other; that of rows changes in the
    last one (a single layer is halved when both differ).
    """
    quadratic = wants_quadratic(ctx, first, last)
    one, two = _grid(ctx, first, p1, "s"), _grid(ctx, last, p2, "last")
    x = nodes_of(ctx).coords
    two = min((two, two.T), key=lambda other: _twist(x[one], x[other]))
    (rows, columns), (end_rows, end_columns) = (np.array(g.shape) - 1 for g in (one, two))
    for start, stop in ((rows, end_rows), (columns, end_columns)):
        if (start + stop) % 2:
            ctx.fail(
                33,
                "sides of {first} and {second} elements face each other: their sum must be even",
                at="last",
                first=int(start),
                second=int(stop),
                hint="change one of them by one",
            )
    layers = 1 if n is None else n
    if layers < 1:
        ctx.fail(41, "a number of layers is above 0: {value} cannot be one", at="n", value=layers)
    if layers == 1 and rows != end_rows and columns != end_columns:
        layers = 2
    made = _Layers(ctx, one, two)
    grid = one
    for k in range(layers):
        bottom, top = k / layers, (k + 1) / layers
        # Columns change in the first layer, rows in the last.
        target = (end_rows if k == layers - 1 else rows, end_columns)
        above = two if k == layers - 1 else made.level(target, top)
        made.between(grid, above, bottom, top)
        grid = above
    cells = np.concatenate(made.cells)
    x = nodes_of(ctx).coords
    turned = geometry.measures(shape("CUB8"), x[cells]) < 0
    cells[turned] = orientation.reversed_cells("CUB8", cells[turned])
    with explained(ctx, "last"):
        geometry.check_cells(shape("CUB8"), x[cells])
    skin = topology.boundary([("CUB8", cells)])["QUA4"].nodes
    start, stop = (np.isin(skin, grid).all(axis=1) for grid in (one, two))
    faces = {"1": skin[start], "2": skin[stop], "3": skin[~start & ~stop]}
    sides = {name: new_mesh(ctx, [("QUA4", nodes)]) for name, nodes in faces.items()}
    return finished(ctx, new_mesh(ctx, [("CUB8", cells)], sides), quadratic)


def _grid(ctx: Context, surface: Maillage, corner: Point, at: str) -> IntArray:
    block = linear_mesh(ctx, surface).single()
    if block is None or block.shape != "QUA4":
        ctx.fail(
            16,
            "a grid of QUA4 or QUA8 is wanted, this mesh holds {shapes}",
            at=at,
            shapes=" ".join(surface.shapes) or "no element",
        )
    with explained(ctx, at, failed=33):
        return grids.grid_of(block.cells, corner.node)


def _twist(one: FloatArray, two: FloatArray) -> float:
    """Tell how far the corners of two grids are from facing each other."""
    ends = [g[[0, -1, -1], [-1, 0, -1]] - g[0, 0] for g in (one, two)]
    return float(((ends[0] - ends[1]) ** 2).sum())


class _Layers:
    """The elements between grids of nodes; those between the first and the last are new."""

    def __init__(self, ctx: Context, one: IntArray, two: IntArray) -> None:
        self.store = nodes_of(ctx)
        self.one, self.two = (self.store.coords[g].copy() for g in (one, two))
        self.sizes = [float(self.store.density[g].mean()) for g in (one, two)]
        self.cells: list[IntArray] = []

    def add(self, s: FloatArray, t: FloatArray, v: FloatArray) -> IntArray:
        """Add nodes at places along the columns, from grid to grid, and along the rows."""
        share = t[:, None]
        x = (1 - share) * grids.interpolated(self.one, s, v) + share * grids.interpolated(self.two, s, v)
        return self.store.add(x, (1 - t) * self.sizes[0] + t * self.sizes[1])

    def level(self, counts: tuple[int, int], t: float) -> IntArray:
        """Add a grid of nodes."""
        v, s = np.meshgrid(*(np.linspace(0.0, 1.0, n + 1) for n in counts), indexing="ij")
        return self.add(s.ravel(), np.full(s.size, t), v.ravel()).reshape(s.shape)

    def between(self, low: IntArray, high: IntArray, bottom: float, top: float) -> None:
        """Make the elements between two grids of which rows or columns are as many."""
        along = low.shape[0] == high.shape[0]
        lines = (low, high) if along else (low.T, high.T)
        plane, quadrangles = grids.transition(lines[0].shape[1] - 1, lines[1].shape[1] - 1)
        count = lines[0].shape[0]
        inner = plane[lines[0].shape[1] + lines[1].shape[1] :]
        s, t = np.tile(inner[:, 0], count), np.tile(bottom + inner[:, 1] * (top - bottom), count)
        v = np.repeat(np.linspace(0.0, 1.0, count), len(inner))
        new = self.add(*((s, t, v) if along else (v, t, s))).reshape(count, len(inner))
        nodes = np.hstack([*lines, new])
        pairs = np.concatenate([nodes[:-1][:, quadrangles], nodes[1:][:, quadrangles]], axis=2)
        self.cells.append(pairs.reshape(-1, 8))
