"""Finite-element stresses on the simplices that elements are cut into, and what balances them there."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels import assembly, elasticity, quadrature
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import NotConverged
from gibiane_ops.kernels.estimate.fields import Field
from gibiane_ops.kernels.estimate.macro import macro_element, moments, turned
from gibiane_ops.kernels.estimate.simplices import Simplices
from gibiane_ops.kernels.estimate.tractions import Exterior
from gibiane_ops.kernels.quadrature import Rule
from gibiane_ops.kernels.solve import factorize

CHUNK = 200_000
"""Points at which strains are evaluated together."""

SHIFT = 1e-9
"""Diagonal added to the stiffness, over its own, so that bodies held by contact alone have a factor; corrected away."""

CORRECTIONS = 20
LEFT = 1e-12
"""Largest force left at a node, over the largest there was."""


@dataclass(frozen=True, eq=False)
class Aim:
    """A finite-element stress that is not uniform in the simplices.

    Also the uniform stresses at hand where those to start from are others, see `uniform_aim`.

    Attributes
    ----------
    mean : (k, n_s) float64, force / length^2
        Its mean in each simplex.
    pull : (k, n_t) float64, length^2
        ``int s_hat : D^-1 : (sigma_h - mean)`` as a linear form of the tractions, in the order of `macro.MacroElement`.
    constant : (k,) float64, energy
        ``int (sigma_h - mean) : D^-1 : (sigma_h - mean)``.
    check : Aim, optional
        The same by a coarser rule, where the stress is no polynomial: their difference tells what integration leaves.
    """

    mean: FloatArray
    pull: FloatArray
    constant: FloatArray
    check: Aim | None = None


def uniform_aim(stress: FloatArray, dim: int) -> Aim:
    """Return the aim of stresses that are uniform in the simplices, (k, n_s), components of `macro.STATIC`."""
    return Aim(stress, np.zeros((len(stress), macro_element(dim).n_tractions)), np.zeros(len(stress)))


def joined_aims(parts: list[Aim]) -> Aim:
    """Put aims one after the other; those that need no check are their own."""
    mean, pull, constant = (
        np.concatenate(each) for each in zip(*[(a.mean, a.pull, a.constant) for a in parts], strict=True)
    )
    if all(a.check is None for a in parts):
        return Aim(mean, pull, constant)
    return Aim(
        mean, pull, constant, joined_aims([Aim(b.mean, b.pull, b.constant) for b in (a.check or a for a in parts)])
    )


def aim_of(field: Field, owner: IntArray, at: FloatArray, corners: FloatArray, compliance: FloatArray) -> Aim:
    """Describe the stress of elements on their simplices.

    Parameters
    ----------
    field : Field
    owner : (k,) int64
        Element of each simplex.
    at : (k, d + 1, d) float64
        Reference coordinates of the corners of the simplices.
    corners : (k, d + 1, d) float64, length
        These corners, in the order of the mesh of simplices.
    compliance : (k, n_s, n_s) float64
        Uniform in each simplex.

    Returns
    -------
    Aim

    Notes
    -----
    Exact where the maps of the elements are affine: the stress is of degree one (TRI6, TE10, QUA4, PRI6), two (QUA8,
    CUB8, PR15) or three (CU20) in the simplices. Elsewhere it is rational, and a coarser rule tells how well a finer
    one integrates it.
    """
    bent = ~field.affine[owner]
    exact, first, second = _rules(field)
    found = _integrated(field, owner, at, corners, compliance, exact if not bent.any() else first)
    if not bent.any():
        return found
    check = Aim(found.mean.copy(), found.pull.copy(), found.constant.copy())
    again = _integrated(field, owner[bent], at[bent], corners[bent], compliance[bent], second)
    check.mean[bent], check.pull[bent], check.constant[bent] = again.mean, again.pull, again.constant
    return Aim(found.mean, found.pull, found.constant, check)


def _rules(field: Field) -> tuple[Rule, Rule, Rule]:
    """Return a rule that is exact in elements of affine map, and two for the others, the finer one first."""
    dim, linear = field.of.dim, field.of.degree == 1
    if dim == 2:
        return quadrature.triangle(4), quadrature.simplex(2, 5), quadrature.simplex(2, 4)
    if field.of.name == "CU20":
        return quadrature.simplex(3, 4), quadrature.simplex(3, 5), quadrature.simplex(3, 4)
    table = quadrature.tetrahedron(5)
    return table, quadrature.simplex(3, 4 if linear else 5), table if linear else quadrature.simplex(3, 4)


def _integrated(
    field: Field, owner: IntArray, at: FloatArray, corners: FloatArray, compliance: FloatArray, rule: Rule
) -> Aim:
    """Integrate over each part of each macro-element."""
    n, dim, n_s = corners.shape[1], corners.shape[2], compliance.shape[1]
    macro = macro_element(dim)
    inside = shape("TRI3" if dim == 2 else "TET4").N(rule.points)
    weight = rule.weights * factorial(dim) / n
    found = Aim(np.empty((len(owner), n_s)), np.empty((len(owner), macro.n_tractions)), np.empty(len(owner)))
    parts = np.repeat(np.eye(n)[None], n, axis=0)
    parts[range(n), range(n)] = 1.0 / n
    bary = np.einsum("qp,kpc->kqc", inside, parts).reshape(-1, n)
    law = np.linalg.inv(compliance)
    step = max(CHUNK // len(bary), 1)
    for start in range(0, len(owner), step):
        some = slice(start, start + step)
        strain = field.strains(owner[some], bary @ corners[some], bary @ at[some])
        values = np.matmul(strain, law[some]).reshape(-1, n, len(rule.weights), n_s)
        mean = np.einsum("q,mkqs->ms", weight, values)
        values = values - mean[:, None, None]
        F = (corners[some, 1:] - corners[some, :1]).swapaxes(1, 2)
        det = np.abs(np.linalg.det(F))
        volume = det / factorial(dim)
        strain = np.matmul(values, compliance[some][:, None])
        G = np.einsum("q,qp,mkqs->mkps", weight, inside, strain, optimize=True) * volume[:, None, None, None]
        # s = T s_ref / det, tau_ref = F^-1 tau.
        pulled = np.matmul(G, (turned(F) / det[:, None, None])[:, None])
        reference = pulled.reshape(len(F), -1) @ macro.stress.reshape(-1, macro.n_tractions)
        found.pull[some] = np.matmul(reference.reshape(len(F), -1, dim), np.linalg.inv(F)).reshape(len(F), -1)
        found.mean[some] = mean
        found.constant[some] = volume * np.einsum("q,mkqs,mkqs->m", weight, values, strain, optimize=True)
    return found


def balanced_stress(
    mesh: Simplices, stress: FloatArray, law: FloatArray, exterior: Exterior, held: FloatArray
) -> FloatArray:
    """Correct uniform stresses of simplices by those of a displacement, so that the loads are balanced at the nodes.

    Parameters
    ----------
    mesh : Simplices
    stress : (m, c) float64, force / length^2
    law : (m, c, c) float64
    exterior : Exterior
    held : (n, d, d) float64
        Projectors on the directions in which the nodes are held.

    Returns
    -------
    (m, c) float64

    Raises
    ------
    NotConverged
        Forces are left that displacements cannot balance: a body is free to move under its loads.

    Cost
    ----
    One factorisation of the stiffness of the simplices.
    """
    dim = mesh.dim
    of = shape("TRI3" if dim == 2 else "TET4")
    cells = mesh.cells.copy()
    X = mesh.points[cells]
    wrong = np.linalg.det(X[:, 1:] - X[:, :1]) < 0
    cells[wrong, :2] = cells[wrong, 1::-1]
    X = mesh.points[cells]
    n = len(mesh.points)
    points = len(of.gauss[1])
    inner = elasticity.internal_forces(of, X, np.repeat(stress[:, None], points, axis=1))
    body = np.repeat((exterior.body * mesh.volume[:, None] / (dim + 1))[:, None], dim + 1, axis=1)
    force = assembly.assemble_vector(n, dim, [(cells, body - inner)]).reshape(n, dim)
    edge = mesh.boundary
    area = np.linalg.norm(mesh.outward[mesh.cell[edge, 0], mesh.local[edge, 0]], axis=1)
    given = np.einsum("ab,kbi,k->kai", moments(dim), exterior.traction, area)
    np.add.at(force, mesh.nodes[edge], given)
    Q = sp.block_diag(list(np.eye(dim) - held), format="csr") if held.any() else sp.eye_array(n * dim, format="csr")
    K = sp.csr_array(Q @ assembly.assemble(n, dim, [(cells, elasticity.element_stiffness(of, X, law))]) @ Q)
    right = Q @ force.ravel()
    scale = float(K.diagonal().mean())
    lift = sp.csr_array(sp.eye_array(n * dim) - Q) * scale + sp.eye_array(n * dim) * (SHIFT * scale)
    factor = factorize(sp.csr_array(K + lift))
    largest = max(float(np.abs(right).max(initial=0.0)), float(np.abs(given).max(initial=0.0)))
    u, left, history = np.zeros(n * dim), right, [1.0]
    for _ in range(CORRECTIONS):
        if np.abs(left).max(initial=0.0) <= LEFT * largest:
            break
        u = u + factor.solve(left)
        left = right - K @ u
        history.append(float(np.abs(left).max()) / largest)
    else:
        raise NotConverged(history, u.reshape(n, dim))
    strain = elasticity.strains(of, X, (Q @ u).reshape(n, dim)[cells], of.gauss[0])
    return np.asarray(stress + elasticity.stresses(strain, law)[:, 0], np.float64)
