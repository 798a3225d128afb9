"""What linear and contact solutions share: the kept factor, free motions, notes of the solver."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

import scipy.sparse as sp

from gibiane.registry import Context
from gibiane_ops.kernels.rigid import FreeMotion, free_motions
from gibiane_ops.kernels.solve import Factor
from gibiane_ops.values.nodes import node_store
from gibiane_ops.values.rigidite import Rigidite
from gibiane_ops.values.system import System

ELASTIC = (("UX", "UY"), ("UX", "UY", "UZ"))
"""Unknowns of systems that know rigid motions."""


def kept(ctx: Context, kind: str, k: Rigidite, extra: Hashable, make: Callable[[], Any]) -> Any:
    """Return what `make` computes for the matrices and conditions of `k` and for `extra`, or what it gave last time.

    One result of each kind is kept: a factor of a large model fills most of the memory.
    """
    cache: dict[str, Any] = ctx.state.setdefault("factors", {})
    parts = [*k.matrices, *k.conditions]
    key = (node_store(ctx).version, extra, *(id(part) for part in parts))
    found = cache.get(kind)
    if found is None or found[0] != key:
        cache.clear()
        found = cache[kind] = key, parts, make()  # the parts stay alive, so that their ids are not used again
    return found[2]


def tell_notes(ctx: Context, solver: Factor) -> None:
    """Pass on what the solver noticed."""
    for note in solver.notes:
        ctx.warn("G201", "{note}", note=note)


def check_held(ctx: Context, system: System, contact_rows: sp.csr_array | None = None) -> None:
    """Fail with G404 when a solid can move as a rigid body, naming the motion."""
    C = system.C if contact_rows is None else sp.vstack([system.C, contact_rows], format="csr")
    if system.names not in ELASTIC:
        return
    motions = free_motions(system.K, system.points, C)
    if motions:
        shown = "; ".join(_motion(m) for m in motions[:3]) + ("; ..." if len(motions) > 3 else "")
        ctx.fail(
            "G404",
            "nothing stops {count} rigid motions: {motions}",
            at="k",
            count=len(motions),
            motions=shown,
            hint="hold the solid with BLOQ or SYMT, or join its contact conditions to the matrix",
        )


def _motion(motion: FreeMotion) -> str:
    """Name a free motion and the solid that makes it, counted from 1."""
    who = " and ".join(f"solid {i + 1}" for i in motion.solids)
    centre = ", ".join(f"{x:g}" for x in motion.centre)
    return f"{who}, centred at ({centre}): {motion.movement}"
