"""Linear solutions of a system: contradictions and free motions named, a solver chosen, its answer checked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels import errors as k_errors
from gibiane_ops.kernels.choice import Choice, choose
from gibiane_ops.kernels.constraints import Reduction, reduce_conditions
from gibiane_ops.kernels.packages import DIRECT, is_installed
from gibiane_ops.kernels.rigid import rigid_modes
from gibiane_ops.kernels.solve import Factor, factorize
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.nodes import FloatArray, IntArray
from gibiane_ops.values.rigidite import Rigidite
from gibiane_ops.values.solving import ELASTIC, check_held, kept, tell_notes
from gibiane_ops.values.system import System

ENERGY_LIMIT = 1e-6
"""Share of the energy that may be missing in ``u.K.u = u.(F + r)`` before a warning is due."""
ROUND_OFF = 1e-13
SHOWN = 6
"""Conditions of one instruction that a message names."""

METHODS = {
    "single": "sparse LDLt in single precision (rslab), corrected to double",
    "rslab": "sparse LDLt (rslab)",
    "pardiso": "sparse Cholesky (PARDISO)",
    "superlu": "sparse LU (SuperLU)",
    "amg": "conjugate gradients with algebraic multigrid",
    "cg": "conjugate gradients with block diagonal preconditioner",
    "minres": "MINRES, for an indefinite matrix",
}


# -- conditions ------------------------------------------------------------------------------------------------------


def reduced(ctx: Context, system: System, imposed: FloatArray) -> Reduction:
    """Eliminate the conditions of a system, or fail with G407 naming those that contradict each other."""
    try:
        reduction = reduce_conditions(system.C, imposed)
    except k_errors.ContradictoryConditions as failure:
        ctx.fail(
            "G407",
            "conditions contradict each other at ({where}), by {gap}: {conditions}",
            at="k",
            where=_place(system, int(failure.rows[-1])),
            gap=f"{failure.residual:.3g}",
            conditions=_written(system, failure.rows, imposed),
            hint="they prescribe different values of the same unknowns: leave one out, or give both the same DEPI",
        )
    if len(reduction.redundant) and ctx.option("ECHO") >= 1:
        names = ", ".join(_origins(system, reduction.redundant))
        ctx.write(f" RESO : {len(reduction.redundant)} conditions repeat others and are left out: {names}")
    return reduction


def _origins(system: System, rows: IntArray) -> list[str]:
    """Return what the user wrote for some rows of the conditions, each once."""
    wanted = system.multipliers[rows]
    found = [c for c in system.conditions if np.isin(wanted, c.multipliers).any()]
    return list(dict.fromkeys(c.origin for c in found))


def _written(system: System, rows: IntArray, imposed: FloatArray) -> str:
    """Return what the user wrote for some rows with the values imposed, those of one instruction together."""
    values = imposed.reshape(len(system.multipliers), -1)
    by_line: dict[int, list[str]] = {}
    for row in rows.tolist():
        part = next(c for c in system.conditions if system.multipliers[row] in c.multipliers)
        # several second members: which of them contradicts the others is not known here
        value = f" = {values[row, 0]:.6g}" if values.shape[1] == 1 else ""
        texts = by_line.setdefault(part.line, [])
        if part.label + value not in texts:
            texts.append(part.label + value)
    return "; ".join(", ".join(texts[:SHOWN]) + (f" (line {line})" if line else "") for line, texts in by_line.items())


def _place(system: System, row: int) -> str:
    """Return the coordinates where a condition stands."""
    point = system.store.coords[system.multipliers[row]][: max(system.dim, 2)]
    return " ".join(f"{x:g}" for x in point)


# -- singular systems ------------------------------------------------------------------------------------------------


def singular(ctx: Context, system: System, failure: k_errors.SingularSystem, numbers: IntArray | None) -> NoReturn:
    """Fail with error 49, naming the unknowns that nothing holds; `numbers` are theirs in the system."""
    if numbers is None or not len(failure.unknowns):
        ctx.fail(49, "the system is singular: {reason}", at="k", reason=str(failure))
    unknowns = numbers[failure.unknowns]
    space = max(int(ctx.option("DIME")), 2)
    points = system.store.coords[system.nodes[unknowns[:3] // system.dim]][:, :space]
    named = [
        f"{system.names[i % system.dim]} at ({' '.join(f'{x:g}' for x in point)})"
        for i, point in zip(unknowns[:3].tolist(), points, strict=True)
    ]
    ctx.fail(
        49,
        "the system is singular: {count} unknowns can change without force, {which}",
        at="k",
        count=len(unknowns),
        which=", ".join(named) + (", ..." if len(unknowns) > 3 else ""),
        hint="hold them with BLOQ; parts that share only a node or an edge can turn about it",
    )


# -- solution --------------------------------------------------------------------------------------------------------


@dataclass(eq=False)
class _Solver:
    """A factor, how it was chosen, and how many solutions it has given."""

    factor: Factor
    choice: Choice
    solved: int = 0


def solve_linear(
    ctx: Context, k: Rigidite, system: System, loads: list[tuple[FloatArray, FloatArray]], precision: float | None
) -> list[ChPoint]:
    """Solve for several second members with one factorisation, kept for the next call with the same matrix."""
    F = np.column_stack([force for force, _ in loads])
    reduction = reduced(ctx, system, np.column_stack([values for _, values in loads]))
    wish = solver_wish(ctx)
    definite = bool((system.K.diagonal()[reduction.free] > 0).all())
    space = int(ctx.option("DIME"))

    def choice(solutions: int, memory: float | None = None) -> Choice:
        elastic = system.names in ELASTIC or system.dim == 1
        size = len(reduction.free), system.K.nnz, space, solutions
        return choose(*size, wish=wish, definite=definite, elastic=elastic, memory=memory)

    def make(solutions: int) -> _Solver:
        check_held(ctx, system)
        chosen = choice(solutions)
        try:
            return _prepared(ctx, system, reduction, chosen, wish, precision)
        except k_errors.TooLarge as failure:
            if wish == "DIRE":
                _too_large(ctx, failure)
            return _prepared(ctx, system, reduction, choice(solutions, memory=0.0), wish, precision)

    count = F.shape[1]
    extra = system.C.shape[0], wish, precision
    solver: _Solver = kept(ctx, "factor", k, extra, lambda: make(count))
    solver.solved += count
    if not solver.choice.direct and choice(solver.solved).direct:
        ctx.state["factors"].clear()
        total = solver.solved
        solver = kept(ctx, "factor", k, extra, lambda: make(total))
        solver.solved = total
    v = _solution(ctx, system, reduction, solver, reduction.load(system.K, F))
    tell_notes(ctx, solver.factor)
    _tell_solution(ctx, solver.factor)
    u = reduction.expand(v)
    r = reduction.reactions(system.K, u, F)
    _check_energy(ctx, system, u, F, r)
    m = reduction.multipliers(r)
    return [system.field(u[:, i], m[:, i]) for i in range(count)]


def _bytes(size: float) -> str:
    return f"{size / 1e9:.2g} Gbyte" if size >= 1e9 else f"{max(size / 1e6, 1):.0f} Mbyte"


def _too_large(ctx: Context, failure: k_errors.TooLarge) -> NoReturn:
    ctx.fail(
        "G414",
        "{what} would need {needed} of memory, the limit is {limit}",
        at="k",
        what=failure.what,
        needed=f"{failure.needed / 1e9:.3g} GB",
        limit=f"{failure.limit / 1e9:.3g} GB",
        hint="OPTI 'RESO' 'ITER' needs much less memory",
    )


def _tell_solution(ctx: Context, factor: Factor) -> None:
    """Say how far a solver went."""
    if ctx.option("ECHO") >= 1 and factor.shape[0]:
        count = f"{factor.iterations} iterations, " if factor.iterations else ""
        minus = f", {factor.negative} negative eigenvalues" if factor.negative else ""
        # the next power of ten: round-off itself is no information
        reached = 10.0 ** math.ceil(math.log10(max(factor.residual, 1e-12)))
        ctx.write(f" RESO : {count}relative residual below {reached:.0e}{minus}")


def solver_wish(ctx: Context) -> str:
    """Return the solver that OPTI 'RESO' asks for: DIRE, ITER, or nothing."""
    word = str(ctx.session.options.get("RESO") or "")[:4]
    if word not in ("", "DIRE", "ITER"):
        ctx.fail(19, "OPTI 'RESO' '{word}' is not available", word=word, hint="'DIRE', 'ITER', or neither")
    return word


def _prepared(
    ctx: Context, system: System, reduction: Reduction, choice: Choice, wish: str, precision: float | None
) -> _Solver:
    """Say the choice and prepare the solver."""
    if ctx.option("ECHO") >= 1:
        name = choice.method if choice.method != "auto" else next(p for p in DIRECT if is_installed(p))
        ctx.write(f" RESO : {len(reduction.free)} equations, {METHODS[name]}, about {_bytes(choice.memory)}")
    try:
        if choice.direct:
            return _Solver(factorize(reduction.matrix(system.K), method=choice.method), choice)
        modes = None
        if system.names in ELASTIC:
            modes = rigid_modes(system.points, system.points.mean(axis=0))
            eliminated = np.ones(len(modes), bool)
            eliminated[reduction.free] = False
            modes[eliminated] = 0.0
        default = 1e-12 if wish == "ITER" else 1e-10
        factor = factorize(
            reduction.whole_matrix(system.K, system.dim),
            method=choice.method,
            near_null=modes,
            block=system.dim,
            tolerance=default if precision is None else min(max(precision, 1e-14), 1e-2),
            reserve=choice.reserve,
        )
    except k_errors.SingularSystem as failure:
        singular(ctx, system, failure, reduction.free if choice.direct else np.arange(reduction.n))
    return _Solver(factor, choice)


def _solution(ctx: Context, system: System, reduction: Reduction, solver: _Solver, load: FloatArray) -> FloatArray:
    """Return the free unknowns, (n_free, k)."""
    whole = not solver.choice.direct
    try:
        if not whole:
            return solver.factor.solve(load)
        padded = np.zeros((reduction.n, load.shape[1]))
        padded[reduction.free] = load
        return np.asarray(solver.factor.solve(padded)[reduction.free])
    except k_errors.TooLarge as failure:
        _too_large(ctx, failure)
    except k_errors.SingularSystem as failure:
        singular(ctx, system, failure, np.arange(reduction.n) if whole else reduction.free)


def _check_energy(ctx: Context, system: System, u: FloatArray, F: FloatArray, r: FloatArray) -> None:
    """Warn when the strain energy of a solution is not the work of loads and reactions."""
    energy = np.einsum("ij,ij->j", u, system.K @ u)
    work = np.einsum("ij,ij->j", u, F + r)
    size = np.maximum(np.abs(energy), np.abs(work))
    # A rigid motion has no energy but round-off, whose size that of the single springs tells.
    size = np.maximum(size, ROUND_OFF / ENERGY_LIMIT * (system.K.diagonal() @ u**2))
    gap = np.divide(np.abs(energy - work), size, out=np.zeros_like(size), where=size > 0)
    if gap.max(initial=0.0) > ENERGY_LIMIT:
        ctx.warn(
            "G415",
            "the strain energy of the solution differs from the work of the loads by {gap} of it",
            gap=f"{gap.max():.1e}",
            hint="the matrix is ill conditioned: very different stiffnesses, flat elements, or a solid barely held",
        )
