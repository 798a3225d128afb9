"""Constitutive relation error: distance of a finite-element stress to a stress in exact equilibrium with the loads."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.estimate.joints import Joined, Joint
from gibiane_ops.kernels.estimate.macro import STATIC, contraction, macro_element, turned
from gibiane_ops.kernels.estimate.pieces import Aim
from gibiane_ops.kernels.estimate.simplices import Simplices, others, simplices
from gibiane_ops.kernels.estimate.stars import Improver, jumps
from gibiane_ops.kernels.estimate.tractions import Exterior, balanced_tractions
from gibiane_ops.kernels.estimate.whole import improve_whole

SWEEPS = 2
"""Sweeps over the stars in space: after two the estimate is 10 to 25 % above the error, singular edges included."""

CHUNK = 4096


@dataclass(frozen=True, eq=False)
class Admissible:
    """A stress in equilibrium and its distance to the finite-element stress.

    Attributes
    ----------
    mesh : Simplices
    tau : (n_sides, d, d) float64, force
        Tractions times measures on the sides.
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
    """

    mesh: Simplices
    tau: FloatArray
    error: FloatArray
    energy: FloatArray
    sum_energy: FloatArray
    history: list[float]
    residual: float
    excess: float = 0.0
    contact: FloatArray = field(default_factory=lambda: np.zeros(0))

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
        Improvements: in space star by star, in a plane of the whole at once, where one reaches the least estimate.
    mesh : Simplices, optional
        That of the same points and cells, when it is at hand.
    aim : Aim, optional
        The finite-element stress to which the distance is taken, when the cells are pieces of its elements; `stress`
        then only has to balance the loads at the nodes.
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
    Three steps: tractions in balance around each node, improvement around each node (in a plane of all the nodes
    together), stress of the macro-elements.
    With linear tractions on the sides and a uniform body force in each cell the equilibrium is exact, hence
    ``|s - s_hat|^2 + |u - u_h|^2 = |s_hat - s_h|^2`` (Prager and Synge): the estimate bounds the error from above.

    Source
    ------
    Prager and Synge 1947; Ladeveze and Leguillon 1983; Johnson and Mercier 1978.

    Cost
    ----
    Linear in the number of cells; below a millisecond a tetrahedron and sweep.
    """
    mesh = simplices(points, cells) if mesh is None else mesh
    dim = mesh.dim
    sigma = stress[:, STATIC[dim]]
    compliance = np.broadcast_to(plane_compliance(law, dim), (len(cells), sigma.shape[1], sigma.shape[1]))
    tau = balanced_tractions(mesh, sigma, exterior)
    pull: FloatArray | None = None
    constant: FloatArray | float = 0.0
    if aim is not None:
        sigma, pull, constant = aim.mean, aim.pull, aim.constant

    def distance(sign: float) -> FloatArray:
        found = errors(mesh, tau, sign * sigma, compliance)
        if pull is not None:
            found -= 2 * sign * (pull * jumps(mesh, tau, sign * sigma).reshape(len(pull), -1)).sum(axis=1)
        return np.maximum(found + constant, 0.0)

    given = 0.0 if joint is None else joint.error
    history, excess, contact = [float(np.sqrt(distance(1.0).sum() + given))], 0.0, np.zeros(0)
    if sweeps:
        free = np.broadcast_to(np.eye(dim), (len(mesh.nodes), dim, dim)).copy()
        free[mesh.boundary] = exterior.free
        joined = Joined(mesh, joint) if joint is not None and len(joint.closed) else None
        on, together, limits, turned_pull = mesh, tau, None, pull
        if joined is not None:
            on, together, free = joined.mesh, joined.taken(tau), joined.free(free)
            limits = joined.limits(together)
            limits = limits.spending(history[0] ** 2) if dim == 3 else limits
            turned_pull = None if pull is None else joined.turned(pull)
        work = None if limits is None else limits.work(together)
        improver = Improver(on, sigma, compliance, free, turned_pull, limits) if dim == 3 else None
        for _ in range(sweeps if dim == 3 else 1):
            if improver is None:
                improve_whole(on, sigma, compliance, free, together, turned_pull, limits)
            else:
                improver.sweep(together)
            tau = together if joined is None else joined.given_back(together)
            if joined is not None and joint is not None and limits is not None and work is not None:
                changed = 2 * (limits.work(together) - work)[joined.sides]
                contact = np.bincount(joined.facet, changed, len(joint.closed)).astype(np.float64)
            history.append(float(np.sqrt(max(distance(1.0).sum() + given + contact.sum(), 0.0))))
        if joined is not None and limits is not None:
            exterior, excess = _with_contact(joined, exterior, tau), limits.excess(together)
    energy = mesh.volume * np.einsum("ms,mst,mt->m", sigma, compliance, sigma) + constant
    residual = equilibrium_residual(mesh, tau, exterior)
    return Admissible(mesh, tau, distance(1.0), energy, distance(-1.0), history, residual, excess, contact)


def _with_contact(joined: Joined, exterior: Exterior, tau: FloatArray) -> Exterior:
    """Put the tractions found on contact facets among the imposed tractions."""
    mesh = joined.separate
    area = np.linalg.norm(mesh.outward[mesh.cell[:, 0], mesh.local[:, 0]], axis=1)
    row = np.full(len(mesh.nodes), -1)
    row[mesh.boundary] = np.arange(len(mesh.boundary))
    traction = exterior.traction.copy()
    sides = joined.separate_sides()
    traction[row[sides]] = tau[sides] / area[sides, None, None]
    return Exterior(traction, exterior.free, exterior.body)


def stress_at_corners(mesh: Simplices, tractions: FloatArray, cells: IntArray | slice = slice(None)) -> FloatArray:
    """Evaluate the stress that tractions impose, at the corners of the parts of each cell.

    Parameters
    ----------
    mesh : Simplices
    tractions : (k, d + 1, d, d) float64, force
        Leaving the cell, times the measure of the side.
    cells : (k,) int64, optional

    Returns
    -------
    (k, d + 1, d + 1, n_s) float64, force / length^2
        By part and corner, see `macro.MacroElement`.
    """
    F = mesh.map[cells]
    det = mesh.volume[cells] * (2.0 if mesh.dim == 2 else 6.0)
    pulled = np.matmul(tractions, np.linalg.inv(F).swapaxes(1, 2)[:, None])
    reference = macro_element(mesh.dim).stress
    n = mesh.dim + 1
    local = (pulled.reshape(len(F), -1) @ reference.reshape(n * n * reference.shape[2], -1).T).reshape(
        len(F), n * n, -1
    )
    return np.asarray(np.matmul(local, turned(F).swapaxes(1, 2) / det[:, None, None]).reshape(len(F), n, n, -1))


def errors(mesh: Simplices, tau: FloatArray, sigma: FloatArray, compliance: FloatArray) -> FloatArray:
    """Integrate the energy of ``sigma_hat - sigma_h`` over each cell, (m,).

    Notes
    -----
    The macro-element reproduces uniform stresses, so that the difference comes from the jumps of tractions alone: no
    cancellation, and an exact finite-element stress has no error to round-off.
    """
    n = mesh.dim + 1
    found = np.empty(len(mesh.cells))
    mass = (np.eye(n) + 1.0) / (n * (n + 1))
    for start in range(0, len(found), CHUNK):
        part = np.arange(start, min(start + CHUNK, len(found)))
        s = stress_at_corners(mesh, jumps(mesh, tau, sigma, part), part)
        strain = np.matmul(np.matmul(mass, s), compliance[part][:, None])
        found[part] = mesh.volume[part] / n * (strain * s).sum(axis=(1, 2, 3))
    return np.maximum(found, 0.0)


def equilibrium_residual(mesh: Simplices, tau: FloatArray, exterior: Exterior) -> float:
    """Check the stress itself: divergence in every part of every cell, and tractions on every side from both cells.

    Parameters
    ----------
    mesh : Simplices
    tau : (n_sides, d, d) float64, force
    exterior : Exterior

    Returns
    -------
    float
        Largest residual force over the largest traction force: round-off when the equilibrium holds.
    """
    dim = mesh.dim
    n, scale = dim + 1, float(np.abs(tau).max(initial=0.0))
    if scale == 0.0:
        return float(np.abs(exterior.body).max(initial=0.0) > 0)
    worst = 0.0
    macro = macro_element(dim)
    for start in range(0, len(mesh.cells), CHUNK):
        part = np.arange(start, min(start + CHUNK, len(mesh.cells)))
        out = mesh.sign[part][..., None, None] * tau[mesh.side[part]]
        F = mesh.map[part]
        pulled = np.matmul(out, np.linalg.inv(F).swapaxes(1, 2)[:, None]).reshape(len(part), -1)
        # Piola: div sigma = F div_ref sigma_ref / |det F|.
        reference = (pulled @ macro.divergence.reshape(n * dim, -1).T).reshape(len(part), n, dim)
        force = np.matmul(reference, F.swapaxes(1, 2)) / (2.0 if dim == 2 else 6.0)
        force = force + (exterior.body[part] * mesh.volume[part][:, None])[:, None]
        worst = max(worst, float(np.abs(force).max()))
        s = stress_at_corners(mesh, out, part)
        worst = max(worst, _traction_gap(mesh, s, out, part))
    edge = mesh.boundary
    area = np.linalg.norm(mesh.outward[mesh.cell[edge, 0], mesh.local[edge, 0]], axis=1)
    gap = tau[edge] - exterior.traction * area[:, None, None]
    imposed = np.einsum("kij,kaj->kai", np.eye(dim) - exterior.free, gap)
    return max(worst, float(np.abs(imposed).max(initial=0.0))) / scale


def _traction_gap(mesh: Simplices, stress: FloatArray, out: FloatArray, cells: IntArray) -> float:
    """Return the largest difference between tractions and those of the stress evaluated on the sides of cells."""
    found = 0.0
    for k, corners in enumerate(others(mesh.dim)):
        applied = np.einsum("mis,mas->mai", contraction(mesh.outward[cells, k], mesh.dim), stress[:, k, corners])
        found = max(found, float(np.abs(applied - out[:, k]).max(initial=0.0)))
    return found
