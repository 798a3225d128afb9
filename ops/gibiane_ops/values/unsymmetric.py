"""Solutions of systems without symmetry: MANU 'RIGI' 'QUEL', RELA 'DUAL'."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels import errors as k_errors
from gibiane_ops.kernels.packages import SUPERLU_LIMIT
from gibiane_ops.kernels.unsymmetric import ConditionedFactor, complementary
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.linear import reduced
from gibiane_ops.values.nodes import FloatArray
from gibiane_ops.values.solving import check_held
from gibiane_ops.values.system import System


def solve_unsymmetric_system(
    ctx: Context, system: System, loads: Sequence[tuple[FloatArray, FloatArray]], limits: FloatArray
) -> list[ChPoint]:
    """Solve for several second members; conditions with MINI or MAXI act only where they are reached.

    Parameters
    ----------
    loads : forces (n,) and imposed values (m,) of each second member
    limits : (k, s) float64
        Values of the stops for each.
    """
    F = np.column_stack([force for force, _ in loads])
    d = np.column_stack([values for _, values in loads])
    kept = reduced(ctx, system, d).kept
    if abs(system.K - system.K.T).max() <= 1e-9 * abs(system.K).max():
        check_held(ctx, system)
    try:
        factor = ConditionedFactor(system.K, system.C[kept], system.reactions[kept])
        if factor.package == "superlu" and factor.n > SUPERLU_LIMIT:
            ctx.warn(
                "G201",
                "{count} equations without symmetry factorised by SuperLU, slow at this size",
                count=factor.n,
                hint="pip install pypardiso",
            )
        u, m = factor.solve(F, d[kept])
        forces = np.zeros(limits.shape)
        if len(limits):
            U, M = factor.solve(system.stop_reactions.toarray().T, np.zeros((len(kept), len(limits))))
            for i in range(F.shape[1]):
                forces[:, i] = -_pushes(ctx, system.stops @ U, limits[:, i] - system.stops @ u[:, i])
            u, m = u + U @ forces, m + M @ forces
    except k_errors.SingularSystem as failure:
        ctx.fail(
            49,
            "the system without symmetry is singular: {reason}",
            at="k",
            reason=str(failure),
            hint="a reaction of RELA 'DUAL' must work against its relation; conditions must hold the solid without "
            "those of MINI and MAXI",
        )
    multipliers = np.zeros(d.shape)
    multipliers[kept] = m
    return [_with_stops(system, system.field(u[:, i], multipliers[:, i]), forces[:, i]) for i in range(F.shape[1])]


def _pushes(ctx: Context, compliance: FloatArray, gap: FloatArray) -> FloatArray:
    """Return how hard each stop pushes back."""
    try:
        return complementary(compliance, gap)
    except k_errors.NotConverged:
        ctx.fail(
            1119,
            "no set of unilateral conditions that act holds them all",
            at="k",
            hint="the reaction of RELA 'DUAL' must push against its relation: MAXI wants both of one sign",
        )


def _with_stops(system: System, field: ChPoint, forces: FloatArray) -> ChPoint:
    """Add the multipliers of the stops to a solution."""
    if not len(forces):
        return field
    own, values = field.parts.get("LX", (np.zeros(0, np.int64), np.zeros(0)))
    nodes = np.concatenate([own, system.stop_multipliers])
    every = np.concatenate([values, system.stop_signs * forces])
    return ChPoint(field.store, field.parts | {"LX": (nodes, every)}, field.nature)
