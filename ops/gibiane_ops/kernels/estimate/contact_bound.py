"""Contact part of a guaranteed bound: tractions that balance the nodal forces and obey the law at every point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.cone import norms, orthogonal_projection
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.macro import moments
from gibiane_ops.kernels.solve import factorize

BoolArray = NDArray[np.bool_]

ITERATIONS = 5000
"""Projections in turn on the balance and on the law before giving up."""

INSIDE = 1e-3
"""Friction bounds are first aimed at this fraction inside, so that few projections are enough where there is room."""

DECAY = 0.98
"""Factor of that fraction from one projection to the next: where every point slips there is no room."""

STALL, LESS = 200, 0.5
"""Projections after which the excess must have fallen by this factor, or else it is given up."""

PARTS = 4
"""Parts of each edge of a facet for the lengths of slips."""

VIOLATION = 1e-9
"""Largest violation of the law, over the largest traction, that is taken for round-off."""


@dataclass(frozen=True, eq=False)
class ContactTractions:
    """Tractions on the facets of body 1.

    Attributes
    ----------
    traction : (m, d, d) float64, force / length^(d - 1)
        At the nodes of each facet, global components, acting on body 1; linear on each facet, not continuous.
    facet : (m,) float64, energy
        Squared contact error of each facet, not below ``int bound |W_t| + R_t . W_t + R_n (W_n - G)``.
    violation : float
        Largest excess over the law, over the largest traction.
    flatness : float
        Largest angle (sine) between the normals of the facets and those of the nodes.
    nodal : bool
        Whether they balance the force of each node; if not, they balance the bodies as wholes.
    """

    traction: FloatArray
    facet: FloatArray
    violation: float
    flatness: float
    nodal: bool = True

    @property
    def admissible(self) -> bool:
        """Whether the tractions obey the law at every point."""
        return self.violation <= VIOLATION


def contact_tractions(
    points: FloatArray,
    facets: IntArray,
    nodes: IntArray,
    frames: FloatArray,
    force: FloatArray,
    relative: FloatArray,
    gap: FloatArray,
    mu: FloatArray,
    threshold: FloatArray,
    held: BoolArray | None = None,
    modes: FloatArray | None = None,
) -> ContactTractions:
    """Find contact tractions that balance nodal forces and obey the law of contact and friction.

    Parameters
    ----------
    points : (n_points, d) float64, length
    facets : (m, d) int64
        SEG2 or TRI3 of the contact surface of body 1.
    nodes : (k,) int64
        Node of body 1 of each contact pair.
    frames : (k, d, d) float64
        Rows: outward normal of body 1, then the tangents.
    force : (k, d) float64, force
        Nodal force on body 1 in these axes.
    relative : (k, d) float64, length
        u1 - u2 in these axes.
    gap : (k,) float64, length
    mu : (k,) float64
        Friction coefficient, 0 without friction.
    threshold : (k,) float64, force / length^(d - 1)
        Friction bound of Tresca's law, 0 for the others.
    held : (k, d) bool, optional
        Global directions in which supports hold both nodes of a pair: their reactions balance whatever contact leaves.

    modes : (q, k, d) float64, length, optional
        Relative displacements, in global axes, of the rigid motions that supports leave to each body. With them,
        tractions that only balance each body are looked for where none balance each node, see `ContactTractions.nodal`.

    Returns
    -------
    ContactTractions
        `admissible` says whether tractions were found; if not, they balance the forces but leave the law.

    Notes
    -----
    Unknowns are the tractions at the nodes of each facet, ``sum_F int_F R N_i = r_i``. A node without force leaves
    none on its facets. From the densities ``M^-1 r``, projections in turn on the balance and on the law (convex sets).
    Lengths of slips are interpolated from the corners of `PARTS`^2 parts of each facet, which bounds them from above.

    With Tresca's bound g nodes that slip all carry g times their area; where the slips of neighbours differ in
    direction no traction within the bound has these forces. The bound of the error does not need them: let u_h be
    admissible, R and w the exact tractions and relative displacements, s_hat any stress in equilibrium with the loads
    and with tractions R_hat within the law. Then
    ``|s_hat - s_h|^2 = |s - s_hat|^2 + |u - u_h|^2 + 2 int (R_hat - R).(w - w_h)``. From ``R.w = R_n G - g |w_t|`` (the
    law), ``R_hat.w >= R_hat_n G - g |w_t|`` (R_hat within it) and ``R.w_h >= R_n G - g |w_h_t|`` (w_h admissible) the
    last integral is not below ``- int g |w_h_t| + R_hat_t . w_h_t + R_hat_n (w_h_n - G)``, the contact error of the
    pair. Densities at the nodes (force over area) are within the law and do the work of the slips; they are brought to
    balance the bodies, and the stress at hand must then be corrected to balance them (`pieces.balanced_stress`).

    Source
    ------
    Coorevits, Hild and Pelle 2000; Louf, Combe and Pelle 2003; Prager and Synge 1947; Duvaut and Lions 1972 (the
    inequality of the law).

    Cost
    ----
    One factorisation of the size of the contact, then a few products for each projection.
    """
    m, d = facets.shape
    place = np.full(int(max(facets.max(), nodes.max())) + 1, len(nodes), np.int64)
    place[nodes] = np.arange(len(nodes))
    local = place[facets]
    rows = np.concatenate([frames, np.zeros((1, d, d))])[local]
    area = geometry.measures(shape("SEG2" if d == 2 else "TRI3"), points[facets])
    mass = area[:, None, None] * moments(d)
    largest = norms(force).max(initial=0.0)
    loaded = np.append(norms(force) > 1e-12 * largest, False)
    # The law says that a facet with an unloaded node carries nothing; the others must carry everything.
    live = loaded[local].all(axis=1)
    column = np.arange(m * d).reshape(m, d)
    take = np.broadcast_to(local[:, :, None], mass.shape)[live]
    A = sp.csr_array(
        (mass[live].ravel(), (take.ravel(), np.broadcast_to(column[:, None, :], mass.shape)[live].ravel())),
        shape=(len(nodes) + 1, m * d),
    )
    carried = np.asarray(abs(A).sum(axis=1)).ravel() > 0
    target = np.einsum("nij,ni->nj", frames, force)
    kept = np.ones((len(nodes), d), bool) if held is None else ~held
    lost = float(np.abs(np.where(kept & ~carried[:-1, None], target, 0.0)).max(initial=0.0))
    bound_mu, bound_fixed = np.append(mu, 0.0)[local].ravel(), np.append(threshold, 0.0)[local].ravel()
    c = np.zeros((m * d, d))
    scale, excess = 0.0, 0.0
    turned = rows.reshape(m * d, d, d)
    if live.any():
        balances = [_Balance(A, np.flatnonzero(carried[:-1] & kept[:, k]), target[:, k]) for k in range(d)]

        def nodes_balanced(c: FloatArray) -> FloatArray:
            return np.stack([balance.nearest(c[:, k]) for k, balance in enumerate(balances)], axis=1)

        c, excess, scale = _within(nodes_balanced(c), nodes_balanced, turned, bound_mu, bound_fixed)
    nodal = excess <= VIOLATION * scale and lost <= VIOLATION * largest
    if not nodal and modes is not None:
        # facets without any force go on carrying none
        used = np.asarray(loaded[local].any(axis=1), np.float64)
        share = mass * used[:, None, None]
        body = _Bodies(share, local, target, modes)
        around = np.bincount(local.ravel(), share.sum(axis=2).ravel(), minlength=len(nodes) + 1)
        density = np.vstack([target, np.zeros((1, d))]) / np.where(around > 0, around, 1.0)[:, None]
        c = density[local].reshape(m * d, d)
        c, excess, scale = _within(body.nearest(c), body.nearest, turned, bound_mu, bound_fixed)
        lost = body.left(c)
    traction = c.reshape(m, d, d)
    pressure = np.maximum(-np.einsum("mai,mai->ma", rows[:, :, 0], traction), 0.0)
    allowed = bound_mu.reshape(m, d) * pressure + bound_fixed.reshape(m, d)
    # Tangents turn from node to node: everything is interpolated in global axes.
    along = np.einsum("nij,ni->nj", frames[:, 1:], relative[:, 1:])
    motion = along + frames[:, 0] * np.minimum(relative[:, 0] - gap, 0.0)[:, None]
    along, motion = (np.vstack([each, np.zeros((1, d))])[local] for each in (along, motion))
    at, weight = _divided(d)
    slip = norms(np.einsum("pb,mbi->mpi", at, along).reshape(-1, d)).reshape(m, -1)
    work = np.einsum("mab,mai,mbi->m", mass, traction, motion) + area * np.einsum("ap,ma,mp->m", weight, allowed, slip)
    normal = geometry.facet_normals(shape("SEG2" if d == 2 else "TRI3"), points[facets])
    cosine = np.abs(np.einsum("mai,mi->ma", rows[:, :, 0], normal))[local < len(nodes)]
    flatness = float(np.sqrt(np.maximum(1 - cosine.min(initial=1.0) ** 2, 0.0)))
    violation = max(excess / scale if scale else 0.0, lost / largest if largest else 0.0)
    return ContactTractions(traction, np.maximum(work, 0.0), violation, flatness, nodal or modes is None)


def _within(
    c: FloatArray,
    nearest: Callable[[FloatArray], FloatArray],
    axes: FloatArray,
    mu: FloatArray,
    threshold: FloatArray,
) -> tuple[FloatArray, float, float]:
    """Project balanced tractions in turn on the law and on their balance; also tell what is left past the law."""
    scale, excess, before = 0.0, 0.0, np.inf
    for turn in range(ITERATIONS):
        inner = np.einsum("nij,nj->ni", axes, c)
        scale = float(np.abs(inner).max(initial=0.0))
        excess = _excess(inner, mu, threshold)
        if excess <= VIOLATION * scale:
            break
        if turn % STALL == STALL - 1:
            if excess > LESS * before:
                break
            before = excess
        inside = 1 - INSIDE * DECAY**turn
        c = nearest(np.einsum("nij,ni->nj", axes, _law(inner, inside * mu, inside * threshold)))
    return c, excess, scale


def _divided(d: int) -> tuple[FloatArray, FloatArray]:
    """Return points of a facet (p, d), barycentric, and weights (d, p) of ``int f g / measure``.

    For f linear, given at the corners, and g linear between the points.
    """
    k, M = PARTS, moments(d)
    points: list[tuple[int, ...]]
    parts: list[list[tuple[int, ...]]]
    if d == 2:
        points = [(k - i, i) for i in range(k + 1)]
        parts = [[(k - i, i), (k - i - 1, i + 1)] for i in range(k)]
    else:
        points = [(k - i - j, i, j) for i in range(k + 1) for j in range(k + 1 - i)]
        steps = [((0, 0, 0), (-1, 1, 0), (-1, 0, 1)), ((0, 0, 0), (-1, 0, 1), (0, -1, 1))]
        every = [[tuple(a + b for a, b in zip(p, s, strict=True)) for s in step] for p in points for step in steps]
        parts = [corners for corners in every if min(min(c) for c in corners) >= 0]
    place = {p: n for n, p in enumerate(points)}
    at, weight = np.array(points) / k, np.zeros((d, len(points)))
    for part in parts:
        rows = [place[c] for c in part]
        weight[:, rows] += at[rows].T @ M / len(parts)
    return at, weight


class _Bodies:
    """The tractions that do the work of the nodal forces in the rigid motions of each body."""

    def __init__(self, mass: FloatArray, local: IntArray, force: FloatArray, modes: FloatArray) -> None:
        motion = np.concatenate([modes, np.zeros((len(modes), 1, modes.shape[2]))], axis=1)[:, local]
        self.C = np.einsum("mab,qmbi->qmai", mass, motion).reshape(
            len(modes), mass.shape[0] * mass.shape[1] * modes.shape[2]
        )
        self.work = np.einsum("qki,ki->q", modes, force)
        self.inverse = np.linalg.pinv(self.C, rcond=1e-10)

    def nearest(self, c: FloatArray) -> FloatArray:
        """Return the nearest of them to some tractions, (n, d)."""
        for _ in range(2):
            c = c - (self.inverse @ (self.C @ c.ravel() - self.work)).reshape(c.shape)
        return c

    def left(self, c: FloatArray) -> float:
        """Return the largest work that tractions leave in motions of largest displacement 1, a force."""
        return float(np.abs(self.C @ c.ravel() - self.work).max(initial=0.0))


class _Balance:
    """The tractions of one component that balance its nodal forces, a plane in the space of all tractions."""

    def __init__(self, A: sp.csr_array, nodes: IntArray, force: FloatArray) -> None:
        self.A = sp.csr_array(A[nodes])
        self.force = force[nodes]
        self.factor = factorize(sp.csr_array(self.A @ self.A.T)) if len(nodes) else None

    def nearest(self, c: FloatArray) -> FloatArray:
        """Return the nearest of them to some tractions, (n,)."""
        if self.factor is None:
            return c
        return np.asarray(c - self.A.T @ self.factor.solve(np.asarray(self.A @ c - self.force)), np.float64)


def _law(r: FloatArray, mu: FloatArray, threshold: FloatArray) -> FloatArray:
    """Return the nearest tractions that obey the law: Coulomb's cone, or a half-line times a disc for Tresca's."""
    cone = orthogonal_projection(r, mu)
    length = norms(r[:, 1:])
    cut = np.divide(threshold, length, out=np.ones_like(length), where=length > threshold)
    disc = np.column_stack([np.minimum(r[:, 0], 0.0), cut[:, None] * r[:, 1:]])
    return np.where((threshold > 0)[:, None], disc, cone)


def _excess(r: FloatArray, mu: FloatArray, threshold: FloatArray) -> float:
    """Return the largest tension or tangential traction above its bound."""
    slide = norms(r[:, 1:]) - mu * np.maximum(-r[:, 0], 0.0) - threshold
    return float(max(r[:, 0].max(initial=0.0), slide.max(initial=0.0)))
