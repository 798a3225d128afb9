"""Closed contact facets as inner sides, or free ones on an obstacle: tractions there are improved with the others."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.estimate.limits import KEPT, Limits
from gibiane_ops.kernels.estimate.macro import moments
from gibiane_ops.kernels.estimate.pieces import Aim
from gibiane_ops.kernels.estimate.simplices import Simplices, oriented, others, simplices, slots
from gibiane_ops.kernels.estimate.target import Target


@dataclass(frozen=True, eq=False)
class Joint:
    """Facets in contact, closed at all their nodes, whose pressures may change, and friction of Tresca's law.

    Attributes
    ----------
    name : (n,) int64
        For each node the one that stands for it: nodes of a closed pair share it, that of the master.
    closed : (k, d) int64
        Closed facets by the names of their nodes; those on an obstacle by their own nodes.
    bound : (k, d) float64, force / length^(d - 1), optional
        Tresca's bound at these nodes; infinite where only pressures may change, as without it.
    slip : (k, d, d) float64, length, optional
        Tangential displacement of slave over master at these nodes, global axes; none without it.
    error : float, energy
        Squared contact error (twice the integral) of all the contact, with the tractions at the beginning.
    """

    name: IntArray
    closed: IntArray
    bound: FloatArray | None = None
    slip: FloatArray | None = None
    error: float = 0.0


class Joined:
    """A mesh whose closed contact facets are inner sides, but for those on an obstacle, which stay on the boundary.

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
    facet : (k,) int64
        Facet of the joint of each.
    bound : (n_sides, d) float64, force
        Largest tangential tractions at the corners; infinite where they may not change.
    slide : (n_sides, d, d) float64, length
        See `limits.Limits`.
    """

    def __init__(self, mesh: Simplices, joint: Joint) -> None:
        dim = mesh.dim
        merged = joint.name[mesh.cells]
        self.order = np.argsort(merged, axis=1)
        cells = np.take_along_axis(merged, self.order, axis=1)
        self.mesh = simplices(mesh.points, oriented(mesh.points, cells))
        self.separate = mesh
        inner = self.mesh.cell[:, 1] >= 0
        was_boundary = mesh.cell[self._old(self.mesh.cell[:, 0], self.mesh.local[:, 0])[0], 1] < 0
        order = np.argsort(joint.closed, axis=1)
        wanted = {tuple(row): i for i, row in enumerate(np.take_along_axis(joint.closed, order, axis=1).tolist())}
        self.crossed = np.flatnonzero(inner & was_boundary)
        skin = np.flatnonzero(was_boundary)
        found = np.array([wanted.get(tuple(row), -1) for row in self.mesh.nodes[skin].tolist()], np.int64)
        self.sides, self.facet = skin[found >= 0], found[found >= 0]
        self.normal = np.zeros((len(self.mesh.nodes), dim))
        out = self.mesh.outward[self.mesh.cell[self.sides, 0], self.mesh.local[self.sides, 0]]
        area = np.linalg.norm(out, axis=1)
        self.normal[self.sides] = out / area[:, None]
        self.bound = np.full((len(self.mesh.nodes), dim), np.inf)
        if joint.bound is not None:
            self.bound[self.sides] = np.take_along_axis(joint.bound, order, axis=1)[self.facet] * area[:, None]
        self.slide = np.zeros((len(self.mesh.nodes), dim, dim))
        if joint.slip is not None:
            slip = np.take_along_axis(joint.slip, order[:, :, None], axis=1)[self.facet]
            side, _ = self._old(self.mesh.cell[self.sides, 0], self.mesh.local[self.sides, 0])
            old = mesh.nodes[side]
            # nodes of the slave bear another name; on an obstacle there is none but the slave
            slave = (joint.name[old] != old).any(axis=1) | (self.mesh.cell[self.sides, 1] < 0)
            sign = np.where(slave, 1.0, -1.0)
            self.slide[self.sides] = np.einsum("s,ab,sbi->sai", sign, moments(dim), slip)

    def _old(self, cell: IntArray, local: IntArray) -> tuple[IntArray, IntArray]:
        """Return the side of the separate mesh, and the places of its corners, for sides of cells of the joined one."""
        dim = self.separate.dim
        face = self.order[cell, local]
        corners = self.order[cell[:, None], others(dim)[local]]
        return self.separate.side[cell, face], slots(dim)[face[:, None], corners]

    def target(self, separate: Target, tau: FloatArray) -> tuple[Target, FloatArray]:
        """Carry a target of the separate mesh and its tractions over.

        Parameters
        ----------
        separate : Target
            Contact tractions are given there, opposite on both sides.
        tau : (n_sides, d, d) float64, force

        Returns
        -------
        target : Target
            Contact tractions are free within the law.
        tau : (n_sides, d, d) float64, force
        """
        together = self.taken(tau)
        limits = self.limits(together)
        facet = np.full(len(self.mesh.nodes), -1)
        facet[self.sides] = self.facet
        # where the two sides differ the mean is none of them: the residual shows it
        given = self.taken(separate.given)
        given[self.crossed] = (given[self.crossed] + self.taken(separate.given, 1)[self.crossed]) / 2
        found = replace(
            separate,
            mesh=self.mesh,
            aim=self._turned_aim(separate.aim),
            free=self.free(separate.free),
            given=given,
            limits=limits,
            facet=facet,
            source=None if separate.source is None else separate.source.turned(self.order),
        )
        square = float(found.distance(together).sum())
        return replace(found, limits=limits.spending(square) if self.mesh.dim == 3 else limits), together

    def _turned_aim(self, aim: Aim) -> Aim:
        check = None if aim.check is None else self._turned_aim(aim.check)
        return replace(aim, pull=self.turned(aim.pull), check=check)

    def taken(self, tau: FloatArray, half: int = 0) -> FloatArray:
        """Carry tractions of the separate mesh over, (n_sides, d, d), from the first cells or the second ones."""
        found = np.zeros((len(self.mesh.nodes), *tau.shape[1:]))
        rows = np.flatnonzero(self.mesh.cell[:, half] >= 0)
        cell, local = self.mesh.cell[rows, half], self.mesh.local[rows, half]
        side, places = self._old(cell, local)
        sign = self.separate.sign[cell, self.order[cell, local]] * (-1.0 if half else 1.0)
        found[rows] = tau[side[:, None], places] * sign[:, None, None]
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

    def free(self, separate: FloatArray) -> FloatArray:
        """Return the projectors on the directions free on each side, given those of the separate mesh."""
        dim = self.mesh.dim
        side, _ = self._old(self.mesh.cell[:, 0], self.mesh.local[:, 0])
        found = separate[side]
        found[self.crossed] = 0.0
        n = self.normal[self.sides]
        found[self.sides] = n[:, :, None] * n[:, None, :]
        found[self.sides[np.isfinite(self.bound[self.sides]).all(axis=1)]] = np.eye(dim)
        return np.asarray(found.reshape(-1, dim, dim), np.float64)

    def limits(self, tau: FloatArray) -> Limits:
        """Return what the law asks of the free tractions; a part of the mean pressure of `tau` is to be kept."""
        area = np.zeros(len(self.mesh.nodes))
        cell, local = self.mesh.cell[self.sides, 0], self.mesh.local[self.sides, 0]
        area[self.sides] = np.linalg.norm(self.mesh.outward[cell, local], axis=1)
        pull = np.einsum("kai,ki->", tau[self.sides], self.normal[self.sides]) / self.mesh.dim
        mean = max(-float(pull), 0.0) / max(float(area.sum()), np.finfo(float).tiny)
        return Limits(self.normal, KEPT * mean * area, self.bound, self.slide)
