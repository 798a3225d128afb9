"""What an equilibrated stress comes near to, and what may change in its tractions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.estimate.equilibrium import equilibrium_residual, errors
from gibiane_ops.kernels.estimate.forms import jumps
from gibiane_ops.kernels.estimate.limits import Limits
from gibiane_ops.kernels.estimate.pieces import Aim, Source
from gibiane_ops.kernels.estimate.simplices import Simplices
from gibiane_ops.kernels.estimate.tractions import Exterior


@dataclass(frozen=True, eq=False)
class Target:
    """A finite-element stress on the mesh of the equilibrated one.

    Attributes
    ----------
    mesh : Simplices
    aim : Aim
        The finite-element stress.
    compliance : (m, n_s, n_s) float64, length^2 / force
    body : (m, d) float64, force / length^d
    free : (n_sides, d, d) float64
        Projector on the directions in which the traction of each side may change.
    given : (n_sides, d, d) float64, force
        Tractions times measures in the other directions.
    cell : (m,) int64
        Cell of the finite-element mesh that each cell is a part of.
    limits : Limits, optional
        Sides on which tractions obey the law of contact and friction; they do to begin with, and go on to.
    facet : (n_sides,) int64, optional
        Contact facet that each of these sides is a part of; -1 elsewhere.
    source : Source, optional
        Where the finite-element stress comes from when it is not uniform in the cells.
    """

    mesh: Simplices
    aim: Aim
    compliance: FloatArray
    body: FloatArray
    free: FloatArray
    given: FloatArray
    cell: IntArray
    limits: Limits | None = None
    facet: IntArray | None = None
    source: Source | None = None

    def distance(self, tau: FloatArray, sign: float = 1.0) -> FloatArray:
        """Integrate the energy of ``sigma_hat - sign sigma_h`` over each cell, (m,) float64, with what this may leave.

        Parameters
        ----------
        tau : (n_sides, d, d) float64, force
        sign : float
        """
        return self._integral(self.aim, tau, sign) + self.remainder(tau, sign)

    def remainder(self, tau: FloatArray, sign: float = 1.0) -> FloatArray:
        """Return what integration may leave of the distance, (m,) float64: the difference of two rules."""
        if self.aim.check is None:
            return np.zeros(len(self.cell))
        return np.abs(self._integral(self.aim, tau, sign) - self._integral(self.aim.check, tau, sign))

    def _integral(self, aim: Aim, tau: FloatArray, sign: float) -> FloatArray:
        sigma = sign * aim.mean
        pulled = (aim.pull * jumps(self.mesh, tau, sigma).reshape(len(sigma), -1)).sum(axis=1)
        found = errors(self.mesh, tau, sigma, self.compliance) - 2 * sign * pulled + aim.constant
        return np.asarray(np.maximum(found, 0.0), np.float64)

    def residual(self, tau: FloatArray) -> float:
        """Return the largest violation of equilibrium, and of what is given, over the largest traction force.

        Parameters
        ----------
        tau : (n_sides, d, d) float64, force
        """
        edge = self.mesh.boundary
        area = np.linalg.norm(self.mesh.outward[self.mesh.cell[edge, 0], self.mesh.local[edge, 0]], axis=1)
        exterior = Exterior(self.given[edge] / area[:, None, None], self.free[edge], self.body)
        found = equilibrium_residual(self.mesh, tau, exterior)
        gap = np.einsum("kij,kaj->kai", np.eye(self.mesh.dim) - self.free, tau - self.given)
        scale = float(np.abs(tau).max(initial=0.0))
        return max(found, float(np.abs(gap).max(initial=0.0)) / scale) if scale else found

    def work(self, tau: FloatArray, n_facets: int) -> FloatArray:
        """Return the work of contact tractions in the slip, by contact facet, (n_facets,) float64, energy."""
        if self.limits is None or self.facet is None:
            return np.zeros(n_facets)
        sides = np.flatnonzero(self.facet >= 0)
        return np.bincount(self.facet[sides], self.limits.work(tau)[sides], n_facets).astype(np.float64)
