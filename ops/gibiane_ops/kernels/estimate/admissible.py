"""Constitutive relation error: distance of a finite-element stress to a stress in exact equilibrium with the loads."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.estimate.equilibrium import equilibrium_residual
from gibiane_ops.kernels.estimate.improve import improve
from gibiane_ops.kernels.estimate.joints import Joined, Joint
from gibiane_ops.kernels.estimate.macro import STATIC
from gibiane_ops.kernels.estimate.pieces import Aim, Source, uniform_aim
from gibiane_ops.kernels.estimate.regions import LAYERS, grown, regions
from gibiane_ops.kernels.estimate.simplices import Simplices, simplices
from gibiane_ops.kernels.estimate.target import Target
from gibiane_ops.kernels.estimate.tractions import Exterior, balanced_tractions
from gibiane_ops.kernels.estimate.zoom import zoomed

SWEEPS = 2
"""Improvements: the second one also has smaller cells where the first leaves most."""

ZOOMS, GROWTH = 10, 1.25
"""Largest number of times that cells are halved, and number of cells above which they no longer are, over the first."""

MARKED, ABOVE = 0.2, 4.0
"""Share of the squared estimate that the cells to be halved hold, and what each holds at least, over the mean."""


@dataclass(frozen=True, eq=False)
class Admissible:
    """A stress in equilibrium and its distance to the finite-element stress.

    Attributes
    ----------
    target : Target
        The finite-element stress on the mesh of the stress in equilibrium.
    tau : (n_sides, d, d) float64, force
        Tractions times measures on the sides of this mesh.
    error : (m,) float64, energy
        ``int (sigma_hat - sigma_h) : D^-1 : (sigma_hat - sigma_h)`` of each cell.
    energy : (m,) float64, energy
        ``int sigma_h : D^-1 : sigma_h`` of each cell.
    sum_energy : (m,) float64, energy
        ``int (sigma_hat + sigma_h) : D^-1 : (sigma_hat + sigma_h)`` of each cell.
    history : list of float
        Estimate after the balance of tractions and after each sweep, contact included.
    residual : float
        Largest violation of equilibrium found in the stress, relative, see `equilibrium_residual`.
    excess : float
        Largest violation of the law of contact on the facets of a joint, over the largest traction there; not positive
        within the law.
    contact : (k,) float64, energy
        What the improved tractions change in the squared contact error, by facet of the joint.
    remainder : float, energy
        What the integration of stresses that are no polynomials may have left, see `pieces.Aim`: part of `error`.
    """

    target: Target
    tau: FloatArray
    error: FloatArray
    energy: FloatArray
    sum_energy: FloatArray
    history: list[float]
    residual: float
    excess: float = 0.0
    contact: FloatArray = field(default_factory=lambda: np.zeros(0))
    remainder: float = 0.0

    @property
    def total(self) -> float:
        """The estimate, a square root of an energy."""
        return float(np.sqrt(self.error.sum()))


def plane_compliance(law: FloatArray, dim: int) -> FloatArray:
    """Invert a Hooke law on the components that tractions see.

    Parameters
    ----------
    law : (..., c, c) float64
        4 components in a plane (strain or stress), 6 in space.
    dim : int

    Returns
    -------
    (..., n_s, n_s) float64

    Notes
    -----
    In plane strain the remaining stress zz is the one that holds eps_zz = 0.
    """
    keep = np.array(STATIC[dim])
    return np.asarray(np.linalg.inv(law[..., keep[:, None], keep]), np.float64)


def admissible_stress(
    points: FloatArray,
    cells: IntArray,
    stress: FloatArray,
    law: FloatArray,
    exterior: Exterior,
    *,
    sweeps: int = SWEEPS,
    mesh: Simplices | None = None,
    aim: Aim | None = None,
    source: Source | None = None,
    joint: Joint | None = None,
) -> Admissible:
    """Build a stress in equilibrium with the loads, near a finite-element stress, and measure their distance.

    Parameters
    ----------
    points : (n, d) float64, length
    cells : (m, d + 1) int64
        TRI3 or TET4.
    stress : (m, c) float64, force / length^2
        Galerkin stress of linear elements, uniform in each cell.
    law : (c, c) or (m, c, c) float64
        Hooke law.
    exterior : Exterior
        Loads and supports, on the sides ``simplices(points, cells).boundary``.
    sweeps : int
        Improvements; from the second on also with smaller cells where much is left.
    mesh : Simplices, optional
        That of the same points and cells, when it is at hand.
    aim : Aim, optional
        The finite-element stress to which the distance is taken, when the cells are pieces of its elements; `stress`
        then only has to balance the loads at the nodes.
    source : Source, optional
        Where the aim comes from, when it is not uniform in the cells.
    joint : Joint, optional
        Contact facets whose tractions, given with the loads, may be improved too within the law.

    Returns
    -------
    Admissible

    Raises
    ------
    NotEquilibrated
        The stress is not the solution under these loads and supports.
    InvertedElement
        A flat cell.

    Notes
    -----
    Three steps: tractions in balance around each node, improvement of large parts of the mesh at once (of the whole
    where it is small, or plane), stress of the macro-elements. Where the exact stress is singular so must the
    equilibrated one be: cells with more than their share of the estimate are halved for it, again and again.
    With linear tractions on the sides and a uniform body force in each cell the equilibrium is exact, hence
    ``|s - s_hat|^2 + |u - u_h|^2 = |s_hat - s_h|^2`` (Prager and Synge): the estimate bounds the error from above.

    Source
    ------
    Prager and Synge 1947; Ladeveze and Leguillon 1983; Johnson and Mercier 1978; Doerfler 1996 (what is halved).

    Cost
    ----
    Linear in the number of cells; below a millisecond a tetrahedron and sweep.
    """
    mesh = simplices(points, cells) if mesh is None else mesh
    dim = mesh.dim
    sigma = stress[:, STATIC[dim]]
    tau = balanced_tractions(mesh, sigma, exterior)
    residual = equilibrium_residual(mesh, tau, exterior)
    free = np.broadcast_to(np.eye(dim), (len(mesh.nodes), dim, dim)).copy()
    free[mesh.boundary] = exterior.free
    given = np.zeros((len(mesh.nodes), dim, dim))
    edge = mesh.outward[mesh.cell[mesh.boundary, 0], mesh.local[mesh.boundary, 0]]
    given[mesh.boundary] = exterior.traction * np.linalg.norm(edge, axis=1)[:, None, None]
    compliance = np.broadcast_to(plane_compliance(law, dim), (len(cells), sigma.shape[1], sigma.shape[1]))
    whole = uniform_aim(sigma, dim) if aim is None else aim
    target = Target(mesh, whole, compliance, exterior.body, free, given, np.arange(len(cells)), source=source)
    if joint is not None and len(joint.closed):
        target, tau = Joined(mesh, joint).target(target, tau)

    facets = 0 if joint is None else len(joint.closed)
    start, error = target.work(tau, facets), 0.0 if joint is None else joint.error

    def estimate() -> float:
        contact = 2 * float((target.work(tau, facets) - start).sum())
        return float(np.sqrt(max(target.distance(tau).sum() + error + contact, 0.0)))

    history = [estimate()]
    for turn in range(sweeps):
        before = len(target.cell)
        if turn and (target.source is not None or not target.aim.pull.any()):
            target, tau = _zoomed(target, tau)
        cut = regions(target.mesh, turn)
        # the least of a whole mesh is found already
        for part in cut if turn == 0 or len(cut) > 1 or len(target.cell) > before else []:
            improve(target, tau, part)
        history.append(estimate())

    def summed(values: FloatArray) -> FloatArray:
        return np.bincount(target.cell, values, len(cells)).astype(np.float64)

    energy = target.mesh.volume * np.einsum("ms,mst,mt->m", target.aim.mean, target.compliance, target.aim.mean)
    return Admissible(
        target,
        tau,
        summed(target.distance(tau)),
        summed(energy + target.aim.constant),
        summed(target.distance(tau, -1.0)),
        history,
        max(residual, target.residual(tau)),
        0.0 if target.limits is None else target.limits.excess(tau),
        2 * (target.work(tau, facets) - start),
        float(target.remainder(tau).sum()),
    )


def _zoomed(target: Target, tau: FloatArray) -> tuple[Target, FloatArray]:
    """Halve the cells that hold most of the distance, again and again, and improve the stress around them."""
    room = GROWTH * len(target.cell)
    for _ in range(ZOOMS):
        marked = _worst(target.distance(tau))
        if not marked.any() or len(target.cell) > room:
            break
        target, tau, fresh = zoomed(target, tau, marked)
        for part in regions(target.mesh, 0, grown(target.mesh, fresh, LAYERS)):
            improve(target, tau, part)
    return target, tau


def _worst(distance: FloatArray) -> NDArray[np.bool_]:
    """Mark the cells of largest distance that hold a share of the whole, none where all are about alike."""
    order = np.argsort(-distance, kind="stable")
    count = int(np.searchsorted(np.cumsum(distance[order]), MARKED * distance.sum())) + 1
    marked = np.zeros(len(distance), bool)
    marked[order[:count]] = True
    return np.asarray(marked & (distance > ABOVE * distance.mean()))
