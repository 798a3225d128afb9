"""Warn of displacements that are not continuous between linear and quadratic elements."""

from __future__ import annotations

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.topology import middles_on_linear
from gibiane_ops.values.nodes import node_store
from gibiane_ops.values.rigidite import Rigidite


def warn_torn(ctx: Context, k: Rigidite) -> None:
    """Tell of mid-nodes on the side of a linear element that no condition holds; free when degrees are not mixed."""
    blocks = [block for part in k.matrices if part.mesh is not None for block in part.mesh.kernel_blocks]
    if len({shape(name).degree for name, _ in blocks if shape(name).dim > 0}) < 2:
        return
    middles = middles_on_linear(blocks)[:, 2]
    held = [condition.node for condition in k.conditions]
    loose = np.setdiff1d(middles, np.concatenate([np.zeros(0, np.int64), *held]))
    if len(loose):
        place = node_store(ctx).coords[loose[0]]
        ctx.warn(
            "G420",
            "{count} middle nodes of quadratic elements stand on sides of linear ones, and nothing ties them: the "
            "displacement tears there, and the energy is wrong; the first is at ({place})",
            at="k",
            count=len(loose),
            place=" ".join(f"{x:.4g}" for x in place),
            hint="RESO (K ET (RELA MODL)) F ties them, MODL the model of all elements",
        )
