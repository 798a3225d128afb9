"""What linear and contact solutions share: the kept factor, free motions, notes of the solver."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from gibiane.registry import Context
from gibiane_ops.kernels.memory import available_memory
from gibiane_ops.kernels.rigid import FreeMotion, free_motions
from gibiane_ops.kernels.solve import Factor
from gibiane_ops.values.nodes import node_store
from gibiane_ops.values.rigidite import ConditionPart, MatrixPart, Rigidite
from gibiane_ops.values.system import System

ELASTIC = (("UX", "UY"), ("UX", "UY", "UZ"))
"""Unknowns of systems that know rigid motions."""

SPARE = 2e9
"""Free memory, bytes, below which only one result is kept at all."""


def kept(
    ctx: Context,
    kind: str,
    k: Rigidite,
    extra: Hashable,
    make: Callable[[], Any],
    serves: Callable[[Any], bool] = lambda found: True,
) -> Any:
    """Return what `make` computes for the matrices and conditions of `k` and for `extra`, or what it gave last time.

    Matrices made anew are recognised by their entries. One result of each kind is kept, and only for the last
    matrices: a factor of a large model fills most of the memory. One that `serves` refuses is made anew.
    """
    cache: dict[str, Any] = ctx.state.setdefault("factors", {})
    version, parts = node_store(ctx).version, [*k.matrices, *k.conditions]
    found = cache.get(kind)
    same = found is not None and found[0] == version and found[1] == extra and _same_parts(found[2], parts)
    if found is not None and same and serves(found[3]):
        return found[3]
    del found
    cache.pop(kind, None)
    for other in [name for name, entry in cache.items() if not _shared(entry[2], parts)]:
        del cache[other]
    if available_memory() < SPARE:
        cache.clear()
    made = make()
    cache[kind] = version, extra, parts, made  # the parts stay alive, so that theirs are no copies of other objects
    return made


def _shared(a: Sequence[Any], b: Sequence[Any]) -> bool:
    """Tell whether two lists of parts hold the same matrices."""
    one, two = ([part for part in parts if isinstance(part, MatrixPart)] for parts in (a, b))
    return _same_parts(one, two)


def _same_parts(a: Sequence[Any], b: Sequence[Any]) -> bool:
    return len(a) == len(b) and all(_same(one, two) for one, two in zip(a, b, strict=True))


def _same(a: Any, b: Any) -> bool:
    """Compare two matrices or conditions by what they hold; the nodes of multipliers do not matter."""
    if a is b:
        return True
    if isinstance(a, MatrixPart) and isinstance(b, MatrixPart):
        A, B = sp.csr_array(a.matrix), sp.csr_array(b.matrix)
        return (
            (a.names, a.duals, a.symmetric, A.nnz) == (b.names, b.duals, b.symmetric, B.nnz)
            and np.array_equal(a.nodes, b.nodes)
            and all(np.array_equal(getattr(A, name), getattr(B, name)) for name in ("indptr", "data", "indices"))
        )
    if isinstance(a, ConditionPart) and isinstance(b, ConditionPart):
        arrays = ("row", "node", "name", "coefficients")
        pairs = [(getattr(a, name), getattr(b, name)) for name in arrays]
        pairs += zip(a.reactions, b.reactions, strict=True)
        return a.sense == b.sense and all(np.array_equal(one, two) for one, two in pairs)
    return False


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
