"""Free slides of frictionless contact, which no force fixes."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.rigid import unseen


def without_drift(w: FloatArray, interface: Interface) -> FloatArray:
    """Remove the part of w that slides freely without friction: no force opposes it, so nothing fixes it.

    Parameters
    ----------
    w : (n, d) float64, length
    interface : Interface

    Returns
    -------
    (n, d) float64
    """
    R = interface.rigid
    if R.shape[1] == 0:
        return w
    # motions along the surface only: those that change a gap are settled by the normal forces
    D = R @ unseen(R[:: w.shape[1]], 1e-9).T
    return np.asarray(w - (D @ (D.T @ w.ravel())).reshape(w.shape))
