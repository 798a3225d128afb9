"""Which solver for which system: by size, dimension, number of solutions wanted and memory at hand."""

from __future__ import annotations

from dataclasses import dataclass

from gibiane_ops.kernels.packages import DIRECT, is_installed

SMALL = 60_000
"""Unknowns up to which a direct factorisation is at least as fast as multigrid, on a solid in space."""

MANY_SOLUTIONS = 4
"""Number of solutions with one matrix from which a factorisation is cheaper than iterations."""

MEMORY_SHARE = 0.6
"""Share of the free memory that a factorisation may take."""


@dataclass(frozen=True)
class Choice:
    """A method and why.

    Attributes
    ----------
    method : str
        ``auto`` (direct), ``amg`` or ``cg``, for ``solve.factorize``.
    memory : float
        Predicted memory, bytes.
    reserve : bool
        Whether a direct package may take over from an iteration that fails.
    """

    method: str
    memory: float
    reserve: bool


def available_memory() -> float:
    """Return the memory that a process may still take, bytes; infinity where the system does not say."""
    try:
        with open("/proc/meminfo", encoding="ascii") as lines:
            free = next(int(line.split()[1]) * 1024.0 for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration):
        free = float("inf")
    try:
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    except (ImportError, OSError):
        return free
    return min(free, float(limit)) if limit > 0 else free


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
    """Predict the memory of a multigrid hierarchy, bytes, from the entries of the matrix."""
    return 24.0 * entries


def choose(
    n: int, entries: int, dim: int, solutions: int, *, wish: str = "", elastic: bool = True, memory: float | None = None
) -> Choice:
    """Choose a solver for a symmetric positive definite system.

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
    elastic : bool
        Whether the unknowns are displacements, whose rigid-body modes make multigrid fast.
    memory : float, optional
        Free memory, bytes; that of the machine by default.

    Returns
    -------
    Choice
        Direct for small systems, in the plane, for several solutions; multigrid for one solution of a large solid
        and whenever a factorisation would not fit.

    Notes
    -----
    With 106 000 unknowns in space multigrid takes half the time of a factorisation, but each further solution takes
    as long as a quarter of one.
    """
    room = MEMORY_SHARE * (available_memory() if memory is None else memory)
    need = direct_memory(n, dim)
    fits = need <= room
    iterative = "amg" if is_installed("amg") and elastic else "cg"
    fast = any(is_installed(name) for name in DIRECT if name != "superlu")
    if wish == "ITER":
        direct = False
    elif wish == "DIRE" or n <= SMALL:
        direct = True
    else:
        single = dim == 3 and elastic and solutions < MANY_SOLUTIONS
        direct = fits and not (iterative == "amg" and (single or not fast))
    if direct:
        return Choice("auto", need, True)
    return Choice(iterative, iterative_memory(entries), fits)
