"""Contact part of a guaranteed bound: tractions that balance the nodal forces and obey the law at every point."""

from __future__ import annotations

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
    """

    traction: FloatArray
    facet: FloatArray
    violation: float
    flatness: float

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

    Returns
    -------
    ContactTractions
        `admissible` says whether tractions were found; if not, they balance the forces but leave the law.

    Notes
    -----
    Unknowns are the tractions at the nodes of each facet, ``sum_F int_F R N_i = r_i``. A node without force leaves
    none on its facets. From the densities ``M^-1 r``, projections in turn on the balance and on the law (convex sets).
    Lengths of slips are interpolated from the nodes, which bounds them from above.

    Source
    ------
    Coorevits, Hild and Pelle 2000; Louf, Combe and Pelle 2003.

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
    if live.any():
        turned = rows.reshape(m * d, d, d)
        balances = [_Balance(A, np.flatnonzero(carried[:-1] & kept[:, k]), target[:, k]) for k in range(d)]
        c = np.stack([balance.nearest(c[:, k]) for k, balance in enumerate(balances)], axis=1)
        for turn in range(ITERATIONS):
            inner = np.einsum("nij,nj->ni", turned, c)
            scale = float(np.abs(inner).max())
            excess = _excess(inner, bound_mu, bound_fixed)
            if excess <= VIOLATION * scale:
                break
            inside = 1 - INSIDE * DECAY**turn
            law = _law(inner, inside * bound_mu, inside * bound_fixed)
            c = np.einsum("nij,ni->nj", turned, law)
            c = np.stack([balance.nearest(c[:, k]) for k, balance in enumerate(balances)], axis=1)
    traction = c.reshape(m, d, d)
    slip = np.append(norms(relative[:, 1:]), 0.0)[local]
    in_axes = np.einsum("maij,maj->mai", rows, traction)
    motion = np.vstack([relative, np.zeros((1, d))])[local].copy()
    motion[..., 0] = np.minimum(motion[..., 0] - np.append(gap, 0.0)[local], 0.0)
    allowed = bound_mu.reshape(m, d) * np.maximum(-in_axes[..., 0], 0.0) + bound_fixed.reshape(m, d)
    work = np.einsum("mab,mai,mbi->m", mass, in_axes, motion) + np.einsum("mab,ma,mb->m", mass, allowed, slip)
    normal = geometry.facet_normals(shape("SEG2" if d == 2 else "TRI3"), points[facets])
    cosine = np.abs(np.einsum("mai,mi->ma", rows[:, :, 0], normal))[local < len(nodes)]
    flatness = float(np.sqrt(np.maximum(1 - cosine.min(initial=1.0) ** 2, 0.0)))
    violation = max(excess / scale if scale else 0.0, lost / largest if largest else 0.0)
    return ContactTractions(traction, np.maximum(work, 0.0), violation, flatness)


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
