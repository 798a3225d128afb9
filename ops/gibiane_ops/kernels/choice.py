"""Which solver for which system: by size, dimension, number of solutions wanted and memory at hand."""

from __future__ import annotations

from dataclasses import dataclass

from gibiane_ops.kernels.memory import available_memory
from gibiane_ops.kernels.packages import DIRECT, SUPERLU_LIMIT, is_installed

SMALL = 15_000
"""Unknowns up to which a direct factorisation is at least as fast as multigrid, on a solid in space."""

EACH = 6_000
"""A factorisation is cheaper than iterations for more solutions than there are times this many unknowns."""

SINGLE_FROM = 5_000
"""Unknowns from which single precision saves time."""

FEW_COLUMNS = 24
"""Solutions up to which a factorisation in single precision, each of them corrected, is the faster one."""

MEMORY_SHARE = 0.6
"""Share of the free memory that a factorisation may take."""


FACTOR_SECONDS = 3.7e-10
"""Seconds of a factorisation in space over n^2, and of an iteration with multigrid over the entries of the matrix."""

ITERATION_SECONDS = 1e-8

SOLUTIONS = 8
"""Solutions that a contact problem takes."""


@dataclass(frozen=True)
class Choice:
    """A method and why.

    Attributes
    ----------
    method : str
        ``auto`` or ``single`` (direct), ``amg``, ``cg`` or ``minres``, for ``solve.factorize``.
    memory : float
        Predicted memory, bytes.
    reserve : bool
        Whether a direct package may take over from an iteration that fails.
    """

    method: str
    memory: float
    reserve: bool

    @property
    def direct(self) -> bool:
        """Whether the matrix is factorised, without the unknowns that conditions eliminate."""
        return self.method in ("auto", "single")


def direct_memory(n: int, dim: int) -> float:
    """Predict the memory of a direct factorisation of an elastic solid, bytes.

    Parameters
    ----------
    n : int
        Unknowns.
    dim : int
        Dimension of space.

    Notes
    -----
    Nested dissection fills ``n^(4/3)`` entries in space and ``n log n`` in the plane (George 1973); the factors were
    fitted to rslab on blocks of trilinear cubes (1 Gbyte at 106 000 unknowns).
    """
    return 200.0 * n ** (4 / 3) if dim == 3 else 100.0 * n * max(n.bit_length(), 1)


def iterative_memory(entries: int) -> float:
    """Predict the memory of conjugate gradients with multigrid, bytes, from the entries of the matrix."""
    return 40.0 * entries


def factor_is_faster(n: int, entries: int, dim: int, iterations: int, memory: float | None = None) -> bool:
    """Tell whether a factorisation fits and takes less time than `SOLUTIONS` solutions by so many iterations.

    Parameters
    ----------
    n, entries : int
        Unknowns and entries of the matrix.
    dim : int
    iterations : int
        Of one solution with multigrid, as measured.
    memory : float, optional
        Free memory, bytes; that of the machine by default.
    """
    room = MEMORY_SHARE * (available_memory() if memory is None else memory)
    if direct_memory(n, dim) > room or not any(is_installed(name) for name in DIRECT if name != "superlu"):
        return False
    return FACTOR_SECONDS * n**2 < SOLUTIONS * iterations * ITERATION_SECONDS * entries


def choose(
    n: int,
    entries: int,
    dim: int,
    solutions: int,
    *,
    wish: str = "",
    definite: bool = True,
    elastic: bool = True,
    memory: float | None = None,
) -> Choice:
    """Choose a solver for a symmetric system.

    Parameters
    ----------
    n, entries : int
        Unknowns and entries of the matrix.
    dim : int
        Dimension of space.
    solutions : int
        Solutions wanted so far with this matrix.
    wish : str
        ``DIRE`` or ``ITER`` when the user prefers one.
    definite : bool
        Whether the matrix may be positive definite; its diagonal tells when it cannot.
    elastic : bool
        Whether the unknowns are displacements (or one scalar), whose rigid-body modes make multigrid fast.
    memory : float, optional
        Free memory, bytes; that of the machine by default.

    Returns
    -------
    Choice
        Direct for small systems, in the plane, for many solutions; multigrid for few solutions of a large solid
        and whenever a factorisation would not fit; MINRES for an indefinite matrix that cannot be factorised.

    Notes
    -----
    With 106 000 unknowns in space (2 cores) multigrid takes 0.7 s and 0.5 s for each solution, a factorisation 10 s
    and 0.15 s, in single precision 5 s and 0.3 s.
    """
    room = MEMORY_SHARE * (available_memory() if memory is None else memory)
    need = direct_memory(n, dim)
    fits = need <= room
    fast = any(is_installed(name) for name in DIRECT if name != "superlu")
    iterative = ("amg" if elastic else "cg") if definite else "minres"
    if wish == "ITER":
        direct = False
    elif wish == "DIRE":
        direct = True
    elif n <= SMALL:
        direct = fits
    elif not fast and n > SUPERLU_LIMIT and iterative == "amg":
        direct = False
    else:
        few = dim == 3 and iterative == "amg" and solutions * EACH < n
        direct = fits and not few
    if direct:
        halved = n > SINGLE_FROM and solutions <= FEW_COLUMNS and definite and is_installed("rslab")
        return Choice("single", need / 2, True) if halved else Choice("auto", need, True)
    return Choice(iterative, iterative_memory(entries), fits and (fast or n <= SUPERLU_LIMIT))
