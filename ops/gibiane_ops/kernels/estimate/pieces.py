"""Stresses of bricks and quadrangles on the simplices that they are cut into, for stresses in equilibrium."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels import assembly, elasticity, quadrature
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import NotConverged
from gibiane_ops.kernels.estimate.macro import macro_element, moments, turned
from gibiane_ops.kernels.estimate.simplices import Simplices
from gibiane_ops.kernels.estimate.tractions import Exterior
from gibiane_ops.kernels.mesh.simplices import tetrahedra, triangles_of_quadrangles
from gibiane_ops.kernels.solve import factorize

CHUNK = 2048
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
    """

    mean: FloatArray
    pull: FloatArray
    constant: FloatArray


def uniform_aim(stress: FloatArray, dim: int) -> Aim:
    """Return the aim of stresses that are uniform in the simplices, (k, n_s), components of `macro.STATIC`."""
    return Aim(stress, np.zeros((len(stress), macro_element(dim).n_tractions)), np.zeros(len(stress)))


def cut(name: str, cells: IntArray, rank: IntArray) -> tuple[IntArray, IntArray]:
    """Cut elements of first degree into simplices.

    Parameters
    ----------
    name : str
    cells : (m, n_nodes) int64
    rank : (n_points,) int64
        Order of the nodes: each quadrangular face is cut from its node of lowest rank.

    Returns
    -------
    corners : (k, d + 1) int64
        Corners of the element that each simplex takes.
    owner : (k,) int64
    """
    local = rank[cells]
    if name == "QUA4":
        pieces, owner = triangles_of_quadrangles(local), np.repeat(np.arange(len(cells)), 2)
    elif name == "TRI3":
        pieces, owner = local, np.arange(len(cells))
    else:
        pieces, owner = tetrahedra(name, local)
    return (local[owner][:, None, :] == pieces[:, :, None]).argmax(axis=2), owner


def aim_of(of: Shape, mesh_map: FloatArray, nodal: FloatArray, corners: IntArray, compliance: FloatArray) -> Aim:
    """Describe the stress of elements on their simplices.

    Parameters
    ----------
    of : Shape
        Of the elements.
    mesh_map : (k, d, d) float64, length
        Maps of the simplices, their corners in the order of `corners`.
    nodal : (k, n_nodes, n_s) float64
        Stress at the nodes of the element of each simplex, interpolated in between.
    corners : (k, d + 1) int64
        Corners of the element that each simplex takes.
    compliance : (k, n_s, n_s) float64

    Returns
    -------
    Aim

    Notes
    -----
    Exact on parallelograms and parallelepipeds, where the stress is of second degree in the simplices.
    """
    dim = mesh_map.shape[1]
    n, macro = dim + 1, macro_element(dim)
    rule = quadrature.triangle(4) if dim == 2 else quadrature.tetrahedron(5)
    inside = shape("TRI3" if dim == 2 else "TET4").N(rule.points)
    weight = rule.weights * factorial(dim) / n
    found = Aim(
        np.empty((len(corners), nodal.shape[2])), np.empty((len(corners), macro.n_tractions)), np.empty(len(corners))
    )
    parts = np.repeat(np.eye(n)[None], n, axis=0)
    parts[range(n), range(n)] = 1.0 / n
    bary = np.einsum("qp,kpc->kqc", inside, parts)
    for start in range(0, len(corners), CHUNK):
        some = slice(start, start + CHUNK)
        xi = np.einsum("kqc,mcd->mkqd", bary, of.ref_nodes[corners[some]])
        N = of.N(xi.reshape(-1, xi.shape[-1])).reshape(*xi.shape[:3], -1)
        values = np.einsum("mkqn,mns->mkqs", N, nodal[some], optimize=True)
        mean = np.einsum("q,mkqs->ms", weight, values)
        values = values - mean[:, None, None]
        F = mesh_map[some]
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
