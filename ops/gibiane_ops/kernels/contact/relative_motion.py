"""Rigid relative motions of contact pairs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.interface import FREE_LIMIT
from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.kernels.rigid import unseen

BoolArray = NDArray[np.bool_]


def rigid_candidates(contact: ContactPairs, frames: FloatArray, active: BoolArray) -> FloatArray:
    """Span the relative rigid motions of each zone that blocked components allow, by an orthonormal basis.

    Parameters
    ----------
    contact : ContactPairs
    frames : (n, d, d) float64
    active : (n, d) bool

    Returns
    -------
    (n d, k) float64
        Local components.
    """
    points = contact.on_pairs(contact.points)
    modes = [
        np.einsum("nij,njk->nik", frames, _rigid_modes(points, contact.zone == zone)).reshape(active.size, -1)
        for zone in np.unique(contact.zone)
    ]
    candidates = _orthonormal(np.hstack(modes))
    # keep the combinations that leave blocked components at rest
    blocked = candidates[~active.ravel()]
    if len(blocked):
        candidates = _orthonormal(candidates @ unseen(blocked, FREE_LIMIT).T)
    return candidates


def _rigid_modes(points: FloatArray, member: BoolArray) -> FloatArray:
    """Build the 3 or 6 rigid motions of the members, (n, d, k), in global components and of order 1."""
    n, d = points.shape
    x = points - points[member].mean(axis=0)
    x = x / max(float(np.abs(x[member]).max()), np.finfo(float).tiny)
    planes = [(i, j) for i in range(d) for j in range(i + 1, d)]
    modes = np.zeros((n, d, d + len(planes)))
    modes[:, range(d), range(d)] = 1
    for k, (i, j) in enumerate(planes):
        modes[:, i, d + k] = -x[:, j]
        modes[:, j, d + k] = x[:, i]
    modes[~member] = 0
    return modes


def _orthonormal(columns: FloatArray) -> FloatArray:
    """Give an orthonormal basis of the span; one pair or pairs on a line have fewer motions than six."""
    U, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(U[:, values > FREE_LIMIT * values.max(initial=1.0)])
