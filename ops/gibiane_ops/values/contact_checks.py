"""What is wrong with a contact scene before it is solved, or doubtful after."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane.registry import Context
from gibiane_ops.kernels import errors as k_errors
from gibiane_ops.kernels.contact.outward import facets_of_body
from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.geometry import facet_normals
from gibiane_ops.values.nodes import IntArray
from gibiane_ops.values.rigidite import Rigidite
from gibiane_ops.values.system import System

FAR = 0.5
"""Slip over the size of the facets above which the pairs of the start are doubtful."""


def overlapping(system: System, pairs: ContactPairs) -> NDArray[np.bool_]:
    """Find the pairs that penetrate: by their surfaces, or by a gap that the user gave."""
    whole = np.concatenate([np.zeros(0), *(part.pairs.gap for part in system.contacts)])
    given = pairs.gap != whole
    given[pairs.penetrating] = True
    return np.asarray(given & (pairs.gap < 0))


def refuse_held(ctx: Context, pairs: ContactPairs, active: NDArray[np.bool_], fixed: IntArray, n_nodes: int) -> None:
    """Fail when conditions were left out: slave nodes are held, and too few master nodes can move for them."""
    d = active.shape[1]
    movable = np.ones((n_nodes, d), dtype=bool)
    movable.reshape(-1)[fixed] = False
    moves = np.abs(pairs.matrix(n_nodes)) @ movable.astype(float) > 0
    lost = ~pairs.plain & ~active[: len(pairs.pairs), 0] & moves.all(axis=1)
    if lost.any():
        ctx.fail(
            "G407",
            "nodes of the slave surface are held, or lie in a corner that leans, and the master cannot follow them "
            "all: {count} would be left without contact, the first at ({where})",
            at="k",
            count=int(lost.sum()),
            where=" ".join(f"{x:g}" for x in pairs.points[np.flatnonzero(lost)[0]]),
            hint="take the held surface as the master",
        )


def warn_far(ctx: Context, system: System, pairs: ContactPairs, state: ContactState) -> None:
    """Say when slips are so large that nodes face other facets than those of the start."""
    rigid = np.concatenate(
        [np.zeros(0, bool), *(np.full(len(part.multipliers), part.zone.rigid) for part in system.contacts)]
    )
    slip = np.linalg.norm(state.w[: len(rigid), 1:], axis=1)
    far = ~rigid & (slip > FAR * pairs.size)
    if far.any():
        worst = int(np.argmax(np.where(far, slip / pairs.size, 0.0)))
        ctx.warn(
            "G417",
            "{count} contact nodes slip by more than half a facet, most by {slip} at ({where})",
            at="k",
            count=int(far.sum()),
            slip=f"{slip[worst]:.3g}",
            where=" ".join(f"{x:g}" for x in pairs.points[worst]),
            hint="nodes keep the facets that they face at the start: the result holds for small slips",
        )


def held_rows(system: System, pairs: ContactPairs) -> sp.csr_array:
    """Write the relative displacements of the pairs and the stops as rows."""
    tied = sp.kron(pairs.matrix(len(system.nodes)), sp.eye_array(system.dim), format="csr")
    return sp.csr_array(sp.vstack([tied, system.stops], format="csr"))


def check_normals(ctx: Context, k: Rigidite, system: System) -> None:
    """Fail with G402 when the normals of a slave surface point into its own solid."""
    blocks = [b for part in k.matrices if part.mesh is not None for b in part.mesh.kernel_blocks]
    points = system.store.coords[:, : system.dim]
    for part in system.contacts:
        for name, cells in part.zone.slave.kernel_blocks:
            try:
                turned = facets_of_body(blocks, [(name, cells)])[0][1]
            except k_errors.EmptyContact:
                continue
            given, outward = (facet_normals(shape(name), points[c]) for c in (cells, turned))
            wrong = int((np.einsum("mi,mi->m", given, outward) < 0).sum())
            if wrong:
                ctx.fail(
                    "G402",
                    "the normals of {count} facets of the slave surface point into their solid",
                    at="k",
                    count=wrong,
                    hint="take the surface with FACE or ENVE, or turn it with ORIE or INVE",
                )
