"""Smaller cells for the equilibrated stress where it is far from the finite-element one, which stays as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.estimate.limits import Limits
from gibiane_ops.kernels.estimate.macro import contraction, moments
from gibiane_ops.kernels.estimate.pieces import Aim, Source, carried
from gibiane_ops.kernels.estimate.simplices import Simplices, oriented, others, simplices, slots
from gibiane_ops.kernels.estimate.target import Target
from gibiane_ops.kernels.mesh.bisection import Bisection, refined, started


def zoomed(target: Target, tau: FloatArray, marked: NDArray[np.bool_]) -> tuple[Target, FloatArray, NDArray[np.bool_]]:
    """Halve cells, and those that must follow so that no node hangs; tractions stay in balance.

    Parameters
    ----------
    target : Target
    tau : (n_sides, d, d) float64, force
        Balanced tractions.
    marked : (m,) bool

    Returns
    -------
    target : Target
        The same on the smaller cells.
    tau : (n_sides, d, d) float64, force
        On the sides of the old cells the same tractions; on a side between two halves those that balance both, as near
        as can be (least squares) to those of the finite-element stress.
    fresh : (k,) bool
        The cells that are halves.

    Notes
    -----
    Both sides of contact facets are halved alike, since they are sides between two cells here; linear tractions within
    the law of contact at the corners are so at the middles too.

    Cost
    ----
    One sort of the edges, and one small least-squares problem a halving.
    """
    mesh = target.mesh
    tree = refined(started(mesh.points, mesh.cells), marked)
    fine = simplices(tree.points, oriented(tree.points, tree.leaf_cells))
    fresh = tree.parent[tree.leaves] >= 0
    return _carried(target, tree, fine), _gathered(tree, fine, _halved(target, tau, tree)), fresh


def _carried(target: Target, tree: Bisection, fine: Simplices) -> Target:
    """Carry everything but tractions over to the smaller cells."""
    mesh, dim = target.mesh, target.mesh.dim
    root = tree.root[tree.leaves]
    side, weight = _sides(mesh, tree, fine, root)
    on = np.flatnonzero(side >= 0)
    old = side[on]
    ratio = _areas(fine)[on] / _areas(mesh)[old]
    # a side is seen from its first cell, which may be a part of the second one of the old side
    first = root[fine.cell[on, 0]]
    turn = np.where(mesh.cell[old, 0] == first, 1.0, -1.0)
    free = np.broadcast_to(np.eye(dim), (len(fine.nodes), dim, dim)).copy()
    free[on] = target.free[old]
    given = np.zeros((len(fine.nodes), dim, dim))
    given[on] = (turn * ratio)[:, None, None] * np.matmul(weight[on], target.given[old])
    aim, source = _stress(target, root, fine)
    limits, facet = None, None
    if target.limits is not None and target.facet is not None:
        law, n = target.limits, len(fine.nodes)
        normal, keep, bound = np.zeros((n, dim)), np.zeros(n), np.full((n, dim), np.inf)
        slide, facet = np.zeros((n, dim, dim)), np.full(n, -1)
        normal[on], keep[on], facet[on] = turn[:, None] * law.normal[old], ratio * law.keep[old], target.facet[old]
        known = np.isfinite(law.bound[old])
        held = np.einsum("sab,sb->sa", weight[on], np.where(known, law.bound[old], 0.0)) * ratio[:, None]
        lost = np.einsum("sab,sb->sa", weight[on], np.where(known, 0.0, 1.0)) > 0
        bound[on] = np.where(lost, np.inf, held)
        carry = np.matmul(np.matmul(moments(dim), weight[on]), np.linalg.inv(moments(dim)))
        slide[on] = turn[:, None, None] * np.matmul(carry, law.slide[old])
        limits = Limits(normal, keep, bound, slide, law.margin)
    return replace(
        target,
        mesh=fine,
        aim=aim,
        compliance=target.compliance[root],
        body=target.body[root],
        free=free,
        given=given,
        cell=target.cell[root],
        limits=limits,
        facet=facet,
        source=source,
    )


def _stress(target: Target, root: IntArray, fine: Simplices) -> tuple[Aim, Source | None]:
    """Describe the finite-element stress on the smaller cells, which have the compliance of their roots."""
    whole, source = target.aim, target.source
    if source is None:
        return Aim(whole.mean[root], whole.pull[root], whole.constant[root]), None
    X = fine.points[fine.cells]
    first = target.mesh.points[target.mesh.cells[root, :1]]
    inner = np.matmul(X - first, np.linalg.inv(target.mesh.map[root]).swapaxes(1, 2))
    share = np.concatenate([1 - inner.sum(axis=2, keepdims=True), inner], axis=2)
    made = np.flatnonzero(np.bincount(root)[root] > 1)
    smaller = source.parts(root, share)
    return carried(whole, root, made, smaller.aim(X, target.compliance[root], made)), smaller


def _areas(mesh: Simplices) -> FloatArray:
    """Return the measures of the sides."""
    return np.asarray(np.linalg.norm(mesh.outward[mesh.cell[:, 0], mesh.local[:, 0]], axis=1), np.float64)


def _sides(mesh: Simplices, tree: Bisection, fine: Simplices, root: IntArray) -> tuple[IntArray, FloatArray]:
    """Find the old side that each side is a part of, -1 inside old cells, and its corners there.

    Returns
    -------
    side : (n_sides,) int64
    weight : (n_sides, d, d) float64
        Barycentric coordinates of the corners in the old side.
    """
    n = len(mesh.points)
    known = np.arange(len(tree.points))
    ends = np.where(known[:, None] < n, known[:, None], tree.ends)
    cells = mesh.cells[root[fine.cell[:, 0]]]
    # share[s, a, c]: barycentric coordinate of corner a of side s at corner c of the old cell
    share = (ends[fine.nodes][:, :, :, None] == cells[:, None, None]).mean(axis=2)
    used = (share > 0).any(axis=1)
    inside, k = used.all(axis=1), np.argmin(used, axis=1)
    side = np.where(inside, -1, mesh.side[root[fine.cell[:, 0]], k])
    return side, np.take_along_axis(share, others(mesh.dim)[k][:, None, :], axis=2)


def _halved(target: Target, tau: FloatArray, tree: Bisection) -> FloatArray:
    """Find the tractions that leave every simplex of the history.

    Returns
    -------
    (k, d + 1, d, d) float64, force
        By simplex, side that faces each of its nodes, corner of this side in the order of the simplex, component.
    """
    mesh, dim = target.mesh, target.mesh.dim
    m, place = len(mesh.cells), slots(dim)
    out = np.zeros((len(tree.cells), dim + 1, dim, dim))
    out[:m] = mesh.sign[..., None, None] * tau[mesh.side]
    done, left = np.arange(len(tree.cells)) < m, np.arange(m, len(tree.cells))
    while len(left):
        ready = done[tree.parent[left]]
        rows, left = left[ready], left[~ready]
        pairs = rows[np.argsort(tree.parent[rows], kind="stable")].reshape(-1, 2)
        one, two = pairs.T
        whole = tree.parent[one]
        middle = tree.split[whole][:, None]
        b, a = (tree.cells[one] == middle).argmax(axis=1), (tree.cells[two] == middle).argmax(axis=1)
        for k in range(dim + 1):
            for half, kept, lost in ((one, a, b), (two, b, a)):
                given = out[whole, k].copy()
                both = np.flatnonzero((k != a) & (k != b))
                given[both] /= 2
                at_kept, at_lost = place[k, kept[both]], place[k, lost[both]]
                given[both, at_lost] = (given[both, at_lost] + given[both, at_kept]) / 2
                out[half, k] = given
        _balance(target, tree, out, one, a)
        # the side between them, seen from the other half
        mine = np.take_along_axis(tree.cells[one], others(dim)[a], axis=1)
        theirs = np.take_along_axis(tree.cells[two], others(dim)[b], axis=1)
        same = (theirs[:, :, None] == mine[:, None]).argmax(axis=2)
        out[two, b] = -np.take_along_axis(out[one, a], same[:, :, None], axis=1)
        done[rows] = True
    return out


def _balance(target: Target, tree: Bisection, out: FloatArray, rows: IntArray, last: IntArray) -> None:
    """Find the tractions on one side of simplices, that which faces node `last`, from those on the others, in place."""
    dim, each = target.mesh.dim, np.arange(len(rows))
    X, root = tree.points[tree.cells[rows]], tree.root[rows]
    F = (X[:, 1:] - X[:, :1]).swapaxes(1, 2)
    inverse = np.linalg.inv(F)
    volume = np.abs(np.linalg.det(F)) / (2.0 if dim == 2 else 6.0)
    slope = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)[each, last]
    flux = np.einsum("kis,ks->ki", contraction(-dim * volume[:, None] * slope, dim), target.aim.mean[root])
    arm = np.matmul(dim * moments(dim), (X - X.mean(axis=1, keepdims=True))[:, others(dim)])
    arm = arm / np.linalg.norm(arm, axis=-1).max(axis=(1, 2))[:, None, None, None]
    turns = [(i, j) for i in range(dim) for j in range(i)]
    B = np.zeros((len(rows), dim + 1, dim + len(turns), dim, dim))
    B[:, :, range(dim), :, range(dim)] = 1.0
    for row, (i, j) in enumerate(turns, dim):
        B[:, :, row, :, i], B[:, :, row, :, j] = arm[..., j], -arm[..., i]
    out[rows, last] = np.repeat(flux[:, None], dim, axis=1)
    gap = np.einsum("kfrai,kfai->kr", B, out[rows])
    gap[:, :dim] += dim * volume[:, None] * target.body[root]
    A = B[each, last].reshape(len(rows), dim + len(turns), -1)
    out[rows, last] -= np.matmul(np.linalg.pinv(A), gap[..., None]).reshape(-1, dim, dim)


def _gathered(tree: Bisection, fine: Simplices, out: FloatArray) -> FloatArray:
    """Take the tractions of sides from those that leave their first cells."""
    dim, leaves = fine.dim, tree.leaves
    order = np.argsort(tree.leaf_cells, axis=1)
    cell, local = fine.cell[:, 0], fine.local[:, 0]
    face = order[cell, local]
    corners = slots(dim)[face[:, None], order[cell[:, None], others(dim)[local]]]
    return np.asarray(out[leaves[cell][:, None], face[:, None], corners], np.float64)
