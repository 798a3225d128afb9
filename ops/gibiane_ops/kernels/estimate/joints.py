"""Closed contact facets as inner sides, so that the pressures there are improved with the other tractions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.estimate.simplices import Simplices, others, simplices, slots

MARGIN = 1e-3
"""Pressure that is kept on freed facets, over the mean one: less is pushed back to it."""


@dataclass(frozen=True, eq=False)
class Joint:
    """Facets in contact without friction, closed at all their nodes.

    Attributes
    ----------
    name : (n,) int64
        For each node the one that stands for it: nodes of a closed pair share it.
    closed : (k, d) int64
        Closed facets by the names of their nodes.
    """

    name: IntArray
    closed: IntArray


class Joined:
    """A mesh whose closed contact facets are inner sides.

    Parameters
    ----------
    mesh : Simplices
        With both sides of every contact facet on its boundary.
    joint : Joint

    Attributes
    ----------
    mesh : Simplices
        Of the same cells in the same order, with merged nodes.
    sides : (k,) int64
        Its sides in contact, whose pressures are free.
    normal : (n_sides, d) float64
        Unit normals there, leaving the first cell; zero elsewhere.
    """

    def __init__(self, mesh: Simplices, joint: Joint) -> None:
        dim = mesh.dim
        merged = joint.name[mesh.cells]
        self.order = np.argsort(merged, axis=1)
        cells = np.take_along_axis(merged, self.order, axis=1)
        X = mesh.points[cells]
        inverted = np.linalg.det(X[:, 1:] - X[:, :1]) < 0
        cells[inverted, :2] = cells[inverted, 1::-1]
        self.mesh = simplices(mesh.points, cells)
        self.separate = mesh
        inner = self.mesh.cell[:, 1] >= 0
        was_boundary = mesh.cell[self._old(self.mesh.cell[:, 0], self.mesh.local[:, 0])[0], 1] < 0
        wanted = {tuple(row) for row in np.sort(joint.closed, axis=1).tolist()}
        self.crossed = np.flatnonzero(inner & was_boundary)
        kept = [tuple(row) in wanted for row in self.mesh.nodes[self.crossed].tolist()]
        self.sides = self.crossed[np.array(kept, bool)]
        self.normal = np.zeros((len(self.mesh.nodes), dim))
        out = self.mesh.outward[self.mesh.cell[self.sides, 0], self.mesh.local[self.sides, 0]]
        self.normal[self.sides] = out / np.linalg.norm(out, axis=1)[:, None]

    def _old(self, cell: IntArray, local: IntArray) -> tuple[IntArray, IntArray]:
        """Return the side of the separate mesh, and the places of its corners, for sides of cells of the joined one."""
        dim = self.separate.dim
        face = self.order[cell, local]
        corners = self.order[cell[:, None], others(dim)[local]]
        return self.separate.side[cell, face], slots(dim)[face[:, None], corners]

    def taken(self, tau: FloatArray) -> FloatArray:
        """Carry tractions of the separate mesh over, (n_sides, d, d)."""
        cell, local = self.mesh.cell[:, 0], self.mesh.local[:, 0]
        side, places = self._old(cell, local)
        sign = self.separate.sign[cell, self.order[cell, local]]
        return np.asarray(tau[side[:, None], places] * sign[:, None, None], np.float64)

    def given_back(self, tau: FloatArray) -> FloatArray:
        """Carry tractions back: opposite ones on the two sides of contact facets."""
        found = np.empty((len(self.separate.nodes), *tau.shape[1:]))
        for half, sign in ((1, -1.0), (0, 1.0)):
            rows = np.flatnonzero(self.mesh.cell[:, half] >= 0)
            cell, local = self.mesh.cell[rows, half], self.mesh.local[rows, half]
            side, places = self._old(cell, local)
            own = self.separate.sign[cell, self.order[cell, local]]
            found[side[:, None], places] = tau[rows] * (sign * own)[:, None, None]
        return found

    def turned(self, pull: FloatArray) -> FloatArray:
        """Reorder a form of the tractions of each cell, (m, n_t), as the corners of the joined mesh are."""
        dim, m = self.mesh.dim, len(self.order)
        local = np.tile(np.arange(dim + 1), m)
        face = self.order.ravel()
        corners = np.repeat(self.order, dim + 1, axis=0)[np.arange(len(face))[:, None], others(dim)[local]]
        values = pull.reshape(m, dim + 1, dim, dim)[np.repeat(np.arange(m), dim + 1), face]
        places = slots(dim)[face[:, None], corners]
        return np.asarray(np.take_along_axis(values, places[:, :, None], axis=1).reshape(m, -1), np.float64)

    def separate_sides(self) -> IntArray:
        """Return the sides of the separate mesh that are in contact with free pressures, those of both bodies."""
        found = [self._old(self.mesh.cell[self.sides, half], self.mesh.local[self.sides, half])[0] for half in (0, 1)]
        return np.concatenate(found)

    def free(self, separate: FloatArray) -> FloatArray:
        """Return the projectors on the directions free on each side, given those of the separate mesh."""
        dim = self.mesh.dim
        side, _ = self._old(self.mesh.cell[:, 0], self.mesh.local[:, 0])
        found = separate[side]
        found[self.crossed] = 0.0
        n = self.normal[self.sides]
        found[self.sides] = n[:, :, None] * n[:, None, :]
        return np.asarray(found.reshape(-1, dim, dim), np.float64)

    def tension(self, tau: FloatArray) -> FloatArray:
        """Return the normal forces at the corners of the free facets, (k, d) float64; positive in tension."""
        return np.asarray(np.einsum("kai,ki->ka", tau[self.sides], self.normal[self.sides]), np.float64)

    def margin(self, tau: FloatArray) -> FloatArray:
        """Return what is to be kept of the pressure of each side, (n_sides,) float64, force."""
        area = np.zeros(len(self.mesh.nodes))
        cell, local = self.mesh.cell[self.sides, 0], self.mesh.local[self.sides, 0]
        area[self.sides] = np.linalg.norm(self.mesh.outward[cell, local], axis=1)
        total = float(area.sum())
        mean = max(float(-self.tension(tau).mean(axis=1).sum()), 0.0) / total if total else 0.0
        return MARGIN * mean * area

    def inside(self, start: FloatArray, tau: FloatArray) -> FloatArray:
        """Return the tractions nearest to the improved ones, on the way from the first ones, that are in compression.

        The first ones are returned where they are in tension themselves and the improved ones too.
        """
        before, after = self.tension(start), self.tension(tau)
        if after.max(initial=-1.0) <= 0 or before.max(initial=-1.0) > 0:
            return tau
        out = after > 0
        step = float((before[out] / (before[out] - after[out])).min())
        return np.asarray(start + step * (tau - start), np.float64)
