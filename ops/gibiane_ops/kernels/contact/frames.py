"""Local frames of the contact pairs: normal first, then the tangents, within what the supports leave free."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray

BoolArray = NDArray[np.bool_]

ALIGNED = 1e-6
"""A normal whose free part is shorter than this is a normal that the supports hold."""


OFF = 0.75
"""An axis is well off the normal when its component is below this one."""


def local_frames(normals: FloatArray, free: BoolArray) -> tuple[FloatArray, BoolArray, FloatArray]:
    """Build one orthonormal frame per pair, aligned with the components that supports block.

    Parameters
    ----------
    normals : (n, d) float64
        Unit outward normals of body 1, d = 2 or 3.
    free : (n, d) bool
        Components of the relative displacement that the supports leave free.

    Returns
    -------
    frames : (n, d, d) float64
        Rows n, t1 (, t2): ``local = frames @ global``.
    active : (n, d) bool
        Local components that can vary.
    shortening : (n,) float64
        Length of the free part of the normal: ``normal . w = shortening w_n``; 1 where the normal is not active.

    Notes
    -----
    A blocked component does no work: the contact law acts in the subspace of the free ones, whose normal is the
    projection of n. Where n itself is blocked the pair carries no contact force.
    """
    part = np.where(free, normals, 0.0)
    length = np.sqrt(np.einsum("ni,ni->n", part, part))
    holds = length > ALIGNED
    shortening = np.where(holds, length, 1.0)
    n = np.where(holds[:, None], part / shortening[:, None], normals)
    if normals.shape[1] == 2:
        tangent = np.column_stack([-n[:, 1], n[:, 0]])
        frames = np.stack([n, tangent], axis=1)
    else:
        t1, t2 = _tangents(n, free, holds)
        frames = np.stack([n, t1, t2], axis=1)
    # an axis of the frame is active when it lies within the free components
    outside = np.where(free[:, None, :], 0.0, frames)
    active = np.abs(outside).max(axis=2) <= ALIGNED
    active[:, 0] &= holds
    return frames, active, shortening


def _tangents(n: FloatArray, free: BoolArray, holds: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Choose t1 and t2 so that every blocked direction other than the normal is an axis of the frame."""
    # t1 and t2 are normal to a reference axis and to n. First an axis that must be kept, blocked where the normal is
    # free, free where the normal is blocked; then y, z, x, whichever is well off n: neighbours on a surface that turns
    # little take the same, so that their tangential components can be compared, and t1 is x when n is z
    kept = np.where(holds[:, None], ~free, free)
    score = np.where(np.abs(n) <= OFF, 0.0, np.abs(n)) - np.where(kept, 2.0, 0.0) + [2e-9, 0.0, 1e-9]
    axis = np.eye(3)[score.argmin(axis=1)]
    t1 = np.cross(axis, n)
    t1 /= np.sqrt(np.einsum("ni,ni->n", t1, t1))[:, None]
    return t1, np.cross(n, t1)
