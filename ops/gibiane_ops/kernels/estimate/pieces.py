"""Finite-element stresses on the simplices that elements are cut into, and what balances them there."""

from __future__ import annotations

from dataclasses import dataclass, replace
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


def carried(aim: Aim, root: IntArray, rows: IntArray, there: Aim) -> Aim:
    """Take the aims of simplices, (k,) each, but for some `rows` of them, which have their own."""
    found = Aim(aim.mean[root], aim.pull[root], aim.constant[root])
    found.mean[rows], found.pull[rows], found.constant[rows] = there.mean, there.pull, there.constant
    if aim.check is None and there.check is None:
        return found
    return replace(found, check=carried(aim.check or aim, root, rows, there.check or there))


@dataclass(frozen=True, eq=False)
class Source:
    """Where the stress on simplices comes from, so that it is known on parts of them too.

    Attributes
    ----------
    fields : list of Field
        Of each block of elements.
    block, element : (k,) int64
        Block and element of each simplex.
    at : (k, d + 1, d) float64
        Corners of the simplices in reference coordinates of the elements.
    """

    fields: list[Field]
    block: IntArray
    element: IntArray
    at: FloatArray

    def turned(self, order: IntArray) -> Source:
        """Return the same with the corners of each simplex in another order, (k, d + 1)."""
        return replace(self, at=np.take_along_axis(self.at, order[:, :, None], axis=1))

    def parts(self, root: IntArray, share: FloatArray) -> Source:
        """Return that of parts of simplices.

        Parameters
        ----------
        root : (n,) int64
            Simplex of each part.
        share : (n, d + 1, d + 1) float64
            Barycentric coordinates of the corners of each part in the simplex.
        """
        return Source(self.fields, self.block[root], self.element[root], np.matmul(share, self.at[root]))

    def aim(self, corners: FloatArray, compliance: FloatArray, rows: IntArray | None = None) -> Aim:
        """Describe the stress on simplices.

        Parameters
        ----------
        corners : (k, d + 1, d) float64, length
            Of all the simplices.
        compliance : (k, n_s, n_s) float64
            Uniform in each simplex.
        rows : (n,) int64, optional
            Those that are asked for.

        Returns
        -------
        Aim

        Notes
        -----
        Exact where the maps of the elements are affine: the stress is of degree one (TRI6, TE10, QUA4, PRI6), two
        (QUA8, CUB8, PR15) or three (CU20) in the simplices. Elsewhere it is rational, and a coarser rule tells how well
        a finer one integrates it; but for elements with curved sides, on whose chords nothing is exact.
        """
        rows = np.arange(len(corners)) if rows is None else rows
        dim, n_s = corners.shape[2], compliance.shape[1]
        found, check = (_empty(len(rows), dim, n_s) for _ in range(2))
        checked = False
        for number, field in enumerate(self.fields):
            mine = np.flatnonzero(self.block[rows] == number)
            element = self.element[rows[mine]]
            bent = ~field.affine[element] & field.straight[element]
            exact, fine, coarse = _rules(field)
            for some, rule, into in (
                (mine[field.affine[element]], exact, found),
                (mine[~field.straight[element]], coarse, found),
                (mine[bent], fine, found),
                (mine[bent], coarse, check),
            ):
                at = rows[some]
                each = _integrated(field, self.element[at], self.at[at], corners[at], compliance[at], rule)
                into.mean[some], into.pull[some], into.constant[some] = each.mean, each.pull, each.constant
            straight = mine[~bent]
            for name in ("mean", "pull", "constant"):
                getattr(check, name)[straight] = getattr(found, name)[straight]
            checked = checked or bool(bent.any())
        return replace(found, check=check) if checked else found


def _empty(k: int, dim: int, n_s: int) -> Aim:
    return Aim(np.empty((k, n_s)), np.empty((k, macro_element(dim).n_tractions)), np.empty(k))


def _rules(field: Field) -> tuple[Rule, Rule, Rule]:
    """Return a rule that is exact in elements of affine map, and two for the others, the finer one first."""
    if field.of.dim == 2:
        table = quadrature.triangle(4)
        return table, quadrature.simplex(2, 5), table
    table, fine = quadrature.tetrahedron(5), quadrature.simplex(3, 4)
    return fine if field.of.name == "CU20" else table, fine, table


def _integrated(
    field: Field, owner: IntArray, at: FloatArray, corners: FloatArray, compliance: FloatArray, rule: Rule
) -> Aim:
    """Integrate over each part of each macro-element."""
    n, dim, n_s = corners.shape[1], corners.shape[2], compliance.shape[1]
    macro = macro_element(dim)
    inside = shape("TRI3" if dim == 2 else "TET4").N(rule.points)
    weight = rule.weights * factorial(dim) / n
    found = _empty(len(owner), dim, n_s)
    parts = np.repeat(np.eye(n)[None], n, axis=0)
    parts[range(n), range(n)] = 1.0 / n
    bary = np.einsum("qp,kpc->kqc", inside, parts).reshape(-1, n)
    step = max(CHUNK // len(bary), 1)
    alike = np.unique(np.round(at.reshape(len(at), n * dim), 12), axis=0, return_inverse=True)[1].reshape(-1)
    for start in range(0, len(owner), step):
        some = slice(start, start + step)
        strain = field.strains(owner[some], bary @ corners[some], bary @ at[some], alike[some])
        values = np.matmul(strain, field.law[owner[some]]).reshape(-1, n, len(rule.weights), n_s)
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
