"""The way to a contact solution, announced and followed: plan, progress, method on the bodies."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from typing import Any

from gibiane.registry import Context
from gibiane_ops.kernels.constraints import Reduction
from gibiane_ops.kernels.contact.condensation import Condensation, TiedSolution
from gibiane_ops.kernels.contact.correction import Corrected
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.contact.strategy import Plan, plan, solve_on_bodies
from gibiane_ops.values.linear import METHODS, solver_wish
from gibiane_ops.values.methods import Method
from gibiane_ops.values.nodes import FloatArray
from gibiane_ops.values.solving import ELASTIC
from gibiane_ops.values.system import System

LONG = 10.0
"""Seconds from which the duration is announced and the progress shown."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """The tied bodies and how contact between them is to be found."""

    bodies: Condensation
    way: Plan


def way_of(ctx: Context, system: System, pairs: ContactPairs, reduction: Reduction, exact: bool, krylov: bool) -> Plan:
    """Choose the way and, with ECHO, say it in one line."""
    if krylov and not _iterates(system):
        ctx.fail(
            21,
            "'KRYL' needs elastic solids and conditions without MINI or MAXI",
            at="k",
            hint="the default method 'NEWT' treats them",
        )
    n, _ = _sizes(system, pairs, reduction)
    chosen = _plan(ctx, system, pairs, reduction, exact, krylov)
    if ctx.option("ECHO") >= 1:
        how = "condensed on" if chosen.exact else "corrected on a small model of"
        solver = METHODS.get(chosen.method, "a factor")
        duration = f", {chosen.seconds:.0f} s" if chosen.seconds > LONG else ""
        ctx.write(
            f" RESO : {n} equations of tied solids by {solver}, contact {how} {len(pairs.pairs)} pairs, "
            f"about {chosen.memory / 1e9:.2g} Gbyte{duration}"
        )
    return chosen


def serves(
    ctx: Context,
    system: System,
    pairs: ContactPairs,
    reduction: Reduction,
    exact: bool,
    krylov: bool,
    found: Prepared,
) -> bool:
    """Tell whether bodies prepared for another method serve one that may need the exact stiffness.

    Prepared for a few solutions by multigrid, they would take one for each component of the pairs where a factor is
    the faster way.
    """
    if not exact or found.bodies.is_exact or found.bodies.tied.direct:
        return True
    return _plan(ctx, system, pairs, reduction, exact, krylov).method == found.way.method


def _plan(ctx: Context, system: System, pairs: ContactPairs, reduction: Reduction, exact: bool, krylov: bool) -> Plan:
    n, components = _sizes(system, pairs, reduction)
    return plan(
        n, system.K.nnz, components, system.dim,
        wish=solver_wish(ctx), coordinates=_iterates(system), all_exact=exact, krylov=krylov,
    )  # fmt: skip


def _iterates(system: System) -> bool:
    """Tell whether the small model can be built."""
    return system.names in ELASTIC and not len(system.stop_signs)


def _sizes(system: System, pairs: ContactPairs, reduction: Reduction) -> tuple[int, int]:
    """Count the tied unknowns and the components of the relative displacements."""
    n = len(reduction.free) - len(pairs.pairs) * system.dim * bool((pairs.pairs >= 0).all())
    return n, (len(pairs.pairs) + len(system.stop_signs)) * system.dim


def run_on_bodies(
    ctx: Context,
    prepared: Prepared,
    load: TiedSolution,
    gap: FloatArray,
    law: Friction,
    method: Method,
    *,
    exact: bool,
    enough: float,
    start: ContactState | None,
    slip_origin: FloatArray | None,
) -> Corrected:
    """Run a method, with its progress on a terminal and the change to the exact stiffness said.

    Parameters
    ----------
    exact : bool
        Whether the exact stiffness is needed whatever the plan.
    enough : float
        Energy norm of the rest at which corrections may stop; 0 never.
    """
    echo = ctx.option("ECHO") >= 1
    progress = _Progress(echo)
    options: dict[str, Any] = {"start": start, "slip_origin": slip_origin}
    plain = method.is_newton and start is None

    def again(interface: Interface, before: ContactState) -> ContactState:
        return method.solve(interface, law, start=before, slip_origin=slip_origin)

    def say(text: str) -> None:
        progress.clear()
        if echo:
            ctx.write(f" RESO : {text}")

    if prepared.way.method == "amg" and prepared.bodies.tied.direct:
        say("multigrid iterates long on these elements, a factor takes over")
    found = solve_on_bodies(
        prepared.bodies, load, gap, law,
        lambda interface: method.solve(interface, law, **options),
        newton=None if method.is_newton else lambda interface: method.solve_exact(interface, law, slip_origin),
        again=again if method.is_newton else None, exact=exact or prepared.way.exact,
        tied_first=plain, slip_origin=slip_origin, enough=enough, tell=progress.tell, say=say,
    )  # fmt: skip
    progress.clear()
    if echo and enough and found.exact:
        say("contact is condensed, where iterations cost next to nothing: 'ARRE' changes nothing")
    if echo and not found.exact:
        say("the tied solids are the solution" if not found.corrections else f"{found.corrections} corrections")
    return found


class _Progress:
    """One line on a terminal, rewritten; shown when a solution lasts, and with ECHO."""

    def __init__(self, wanted: bool) -> None:
        self._wanted = wanted and sys.stderr.isatty()
        self._start = time.monotonic()
        self._shown = False

    def tell(self, number: int, difference: float) -> None:
        """Show the number of a correction and the difference of forces that it leaves."""
        elapsed = time.monotonic() - self._start
        if self._wanted and elapsed > 1.0:
            sys.stderr.write(f"\r contact: correction {number}, difference {difference:.1e}, {elapsed:.0f} s ")
            sys.stderr.flush()
            self._shown = True

    def clear(self) -> None:
        """Take the line away."""
        if self._shown:
            sys.stderr.write("\r" + " " * 78 + "\r")
            sys.stderr.flush()
            self._shown = False
