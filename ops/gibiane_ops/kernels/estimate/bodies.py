"""Rigid motions that supports leave to the bodies of a mesh: loads must do no work in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.connectivity import solids
from gibiane_ops.kernels.estimate.macro import moments
from gibiane_ops.kernels.estimate.simplices import Simplices
from gibiane_ops.kernels.estimate.tractions import Exterior
from gibiane_ops.kernels.rigid import unseen

BoolArray = NDArray[np.bool_]

NONE = 1e-8
"""Displacement of held nodes that is none, over the largest of the motion."""


def loose_motions(points: FloatArray, cells: Sequence[IntArray], held: FloatArray) -> FloatArray:
    """Find the rigid motions of each body that supports do not prevent.

    Parameters
    ----------
    points : (n, d) float64, length
        d = 2 or 3.
    cells : sequence of (m, n_nodes) int64
        Elements; those that share nodes make a body.
    held : (n, d, d) float64
        Projectors on the directions in which the nodes are held.

    Returns
    -------
    (q, n, d) float64
        Displacements, zero outside of one body, the largest component 1.

    Cost
    ----
    A search of connected components, one singular value decomposition of 3 or 6 columns for each body.
    """
    n, dim = points.shape
    n_bodies, body = solids([("any shape", each) for each in cells], n)
    found = [np.zeros((0, n, dim))]
    for each in range(n_bodies):
        mine = np.flatnonzero(body == each)
        basis = _rigid(points[mine])
        stopped = np.einsum("nij,qnj->niq", held[mine], basis).reshape(-1, len(basis))
        free = unseen(stopped, NONE)
        motions = np.zeros((len(free), n, dim))
        motions[:, mine] = np.einsum("pq,qni->pni", free, basis)
        largest = np.abs(motions).max(axis=(1, 2), initial=np.finfo(float).tiny)
        found.append(motions / largest[:, None, None])
    return np.concatenate(found)


def _rigid(X: FloatArray) -> FloatArray:
    """Return translations and rotations about the middle, (3 or 6, n, d), the largest displacement of each about 1."""
    dim = X.shape[1]
    arm = X - X.mean(axis=0)
    arm = arm / max(float(np.abs(arm).max(initial=0.0)), np.finfo(float).tiny)
    found = [np.tile(row, (len(X), 1)) for row in np.eye(dim)]
    for i in range(dim):
        for j in range(i):
            turn = np.zeros_like(X)
            turn[:, i], turn[:, j] = -arm[:, j], arm[:, i]
            found.append(turn)
    return np.stack(found)


def without_resultants(mesh: Simplices, exterior: Exterior, sides: BoolArray) -> Exterior:
    """Change tractions so that loads do no work in the rigid motions that sides held by supports leave to each body.

    Parameters
    ----------
    mesh : Simplices
    exterior : Exterior
        With resultants that are small: those of chords that stand for curved sides.
    sides : (k,) bool
        Sides of the boundary whose tractions change, as rigid motions do: by the least in the mean.

    Returns
    -------
    Exterior
    """
    dim, edge = mesh.dim, mesh.boundary
    around = np.zeros((len(mesh.points), dim, dim))
    np.add.at(around, mesh.nodes[edge], np.repeat(exterior.free[:, None], dim, axis=1))
    values, vectors = np.linalg.eigh(around)
    held = np.einsum("nik,nk,njk->nij", vectors, np.where(values > NONE, 1.0, 0.0), vectors)
    motions = loose_motions(mesh.points, [mesh.cells], held)
    area = np.linalg.norm(mesh.outward[mesh.cell[edge, 0], mesh.local[edge, 0]], axis=1)
    there = np.einsum("k,ab,qkbi->qkai", area, moments(dim), motions[:, mesh.nodes[edge]], optimize=True)
    work = np.einsum("qkai,kai->q", there, exterior.traction)
    work += np.einsum("m,mi,qmi->q", mesh.volume, exterior.body, motions[:, mesh.cells].mean(axis=2), optimize=True)
    shapes = motions[:, mesh.nodes[edge]] * sides[:, None, None]
    gram = np.einsum("pkai,qkai->pq", there, shapes)
    change = np.einsum("q,qkai->kai", np.linalg.pinv(gram) @ work, shapes)
    return Exterior(exterior.traction - change, exterior.free, exterior.body)
