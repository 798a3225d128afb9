"""Which way to a contact solution: exact stiffness of the pairs, or a small model that tied solutions correct."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.choice import Choice, choose, direct_memory
from gibiane_ops.kernels.contact.condensation import Condensation, TiedSolution
from gibiane_ops.kernels.contact.condense import interface_memory
from gibiane_ops.kernels.contact.correction import (
    Again,
    Corrected,
    Failure,
    Run,
    Stalled,
    solve_corrected,
    solve_stuck,
    tied_holds,
)
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.errors import NotConverged

SMALL = 10_000
"""Tied unknowns up to which the exact stiffness costs no more than the small model."""

FEW = 24
"""Components of w up to which back substitutions cost no more than the small model."""

PASSES = 8
"""Solutions with the tied matrix that a contact problem is expected to take."""

SECONDS = {"single": (3.7e-10, 2e-8), "auto": (8.8e-10, 3e-8), "amg": (7e-7, 3.5e-8)}
"""Seconds of preparation and of one solution in contact: over n^2 and n^(4/3) with a factor, over the entries else.

Measured on two cubes with 106 000 unknowns and 8.1 million entries: 4.2 s and 0.1 s in single precision, 10 s and
0.15 s in double; by multigrid 5.7 s with the solution of the load and the small model, and 0.28 s for a correction,
which iterates for a few steps only. For 1.17 million unknowns this gives 90 s, where a busy machine took 193 s.
"""

LONGEST = 900.0
"""Seconds of back substitutions that a fallback may take."""


@dataclass(frozen=True)
class Plan:
    """How a contact problem will be solved.

    Attributes
    ----------
    method : str
        ``auto`` or ``single`` (a factor) or ``amg``, see ``factorize``.
    exact : bool
        Exact stiffness at once.
    memory : float
        Predicted peak, bytes, without what the mesh and the matrix take.
    seconds : float
        Predicted duration on two cores, of the first solution with this matrix.
    """

    method: str
    exact: bool
    memory: float
    seconds: float


def plan(
    n: int,
    entries: int,
    components: int,
    dim: int,
    *,
    wish: str = "",
    coordinates: bool = True,
    all_exact: bool = False,
    krylov: bool = False,
) -> Plan:
    """Choose the solver of the tied bodies and the way to the stiffness of the pairs.

    Parameters
    ----------
    n, entries : int
        Tied unknowns, and entries of their matrix.
    components : int
        Active components of w.
    dim : int
    wish : str
        ``DIRE`` or ``ITER`` when the user prefers one.
    coordinates : bool
        Whether the small model can be built.
    all_exact : bool
        Whether the method needs the exact stiffness.
    krylov : bool
        Iterations without condensation, whatever the size; the small model can be built.

    Returns
    -------
    Plan

    Notes
    -----
    A factor takes about n^2 operations in space and each of its solutions n^(4/3), multigrid a time in proportion to
    the entries. The constants were measured on two blocks of trilinear cubes, alone on two cores: see ``SECONDS``.
    They are meant to tell seconds from minutes; a busy machine takes twice as long or more.
    """
    small = n <= SMALL or components <= FEW or dim == 2
    exact = all_exact or not coordinates or (small and not krylov)
    wish, fits = ("ITER", True) if krylov else (wish, coordinates and dim == 3)
    choice = choose(n, entries, dim, components if exact else PASSES, wish=wish, elastic=fits)
    direct = choice.direct
    if not direct and not coordinates:
        choice, direct = Choice("auto", direct_memory(n, dim), True), True
    memory = choice.memory + interface_memory(components // dim, dim) + (0.0 if exact else 12.0 * entries)
    setup, once = SECONDS[choice.method if direct else "amg"]
    if not direct:
        setup, once = setup * entries, once * entries
    elif dim == 3:
        setup, once = setup * n**2, once * n ** (4 / 3)
    else:
        setup, once = 10 * setup * n**1.5, once * n * np.log2(max(n, 2))
    return Plan(choice.method, exact, memory, setup + once * (components if exact else PASSES))


def solve_on_bodies(
    bodies: Condensation,
    load: TiedSolution,
    gap: FloatArray,
    law: Friction,
    run: Run,
    *,
    newton: Run | None,
    again: Again | None = None,
    exact: bool,
    tied_first: bool,
    slip_origin: FloatArray | None = None,
    enough: float = 0.0,
    tell: Callable[[int, float], None] | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> Corrected:
    """Run a method on the exact stiffness, or on the small model with corrections and the exact one in reserve.

    Parameters
    ----------
    bodies : Condensation
    load : TiedSolution
    gap : (n,) float64
    law : Friction
    run : callable
        The method.
    newton : callable or None
        Run first on the small model when the method is another: it learns the most for the least.
    again : callable, optional
        See ``solve_corrected``.
    exact : bool
        From the plan.
    tied_first : bool
        Whether the state of tied bodies may be the answer, without any model.
    slip_origin : (n, d - 1) float64, optional
    enough : float
        See ``solve_corrected``; of no effect on the exact stiffness.
    tell : callable, optional
        See ``solve_corrected``.
    say : callable
        Told in words why the exact stiffness is computed after all.

    Returns
    -------
    Corrected

    Raises
    ------
    NotConverged, StatusCycle, ContactUnbalanced
        From the method on the exact stiffness; on the small model when the exact one would take too long.
    """
    if not exact and not bodies.is_exact:
        frame = bodies.interface_of(load, bodies.unloaded_stiffness(), gap)
        if tied_first and tied_holds(frame, law, slip_origin):
            return solve_stuck(bodies, load, gap)
        try:
            if newton is not None:
                solve_corrected(bodies, load, gap, newton, enough=enough, slip_origin=slip_origin, tell=tell)
            return solve_corrected(
                bodies, load, gap, run, again=again, enough=enough, slip_origin=slip_origin, tell=tell
            )
        except (Stalled, *Failure) as failure:
            seconds = bodies.n_components * bodies.tied.seconds / (8 if bodies.tied.direct else 1)
            way = f"{bodies.n_components} back substitutions, about {seconds:.0f} s"
            if bodies.has_schur:
                way, seconds = "a factorisation of PARDISO", 0.0
            stalled = isinstance(failure, Stalled)
            if seconds > LONGEST:
                if isinstance(failure, Stalled):
                    raise NotConverged(failure.differences, failure.state) from failure
                raise
            reason = str(failure) if stalled else "no solution on the small model"
            say(f"{reason}; exact stiffness by {way}")
    interface = bodies.interface_of(load, bodies.exact(), gap)
    state = run(interface)
    return Corrected(state, interface, interface.expand(state.w), 0, True)


def as_found(bodies: Condensation, load: TiedSolution, gap: FloatArray, state: ContactState) -> Corrected:
    """Complete a state that a failed method has left, with the stiffness known best.

    Parameters
    ----------
    bodies : Condensation
    load : TiedSolution
    gap : (n,) float64
    state : ContactState

    Returns
    -------
    Corrected
    """
    stiffness = bodies.exact() if bodies.is_exact or bodies.learned is None else bodies.learned
    interface = bodies.interface_of(load, stiffness, gap)
    return Corrected(state, interface, interface.expand(state.w), 0, bodies.is_exact)
