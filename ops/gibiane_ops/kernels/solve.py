"""Solve symmetric sparse systems, with whatever package is installed, and check every answer.

Packages may be young, missing or wrong: a bad residual is refined once, then the next package takes over and a note
says so. A singular matrix is recognised by its own null vector, never by a package.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels import iterations, packages
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue, MissingPackage, SingularSystem
from gibiane_ops.kernels.iterations import Iteration
from gibiane_ops.kernels.packages import DIRECT, MODULES, Solve, is_installed

RESIDUAL_LIMIT = 1e-9
"""Largest accepted norm of ``A x - b`` over that of ``b`` (largest entry, column by column)."""

SINGULAR_LIMIT = 1e-14
"""A matrix scaled to a unit diagonal is singular when an eigenvalue falls below this; round-off gives 1e-16."""

SAMPLED_COLUMNS = 4
"""Number of right-hand sides above which one random combination of them is checked."""

ITERATIVE = ("amg", "cg", "minres")
FAILURES = (RuntimeError, ValueError, ArithmeticError, MemoryError)


class Factor:
    """A factorised or preconditioned matrix that solves, checks its answer, and changes package when it is bad.

    Attributes
    ----------
    name : str
        In use: ``single`` (rslab in single precision, corrected), ``rslab``, ``pardiso``, ``superlu``, ``amg``,
        ``cg`` or ``minres``.
    residual : float
        Largest relative residual met so far.
    notes : tuple of str
        What the user should know: a slow package, a package that failed.
    """

    def __init__(
        self,
        A: sp.csr_array,
        names: tuple[str, ...],
        near_null: FloatArray | None,
        block: int,
        tolerance: float,
        trial: int = 0,
    ) -> None:
        self._A = A
        self._packages = list(names)
        self._near_null = near_null
        self._block = block
        self._tolerance = tolerance
        self._trial = trial
        self._limit = max(RESIDUAL_LIMIT, 10 * tolerance)
        self._notes: list[str] = []
        self._scale, self._definite = _diagonal_scale(A)
        if not self._definite:
            self._packages = [name for name in names if name not in ("single", "amg", "cg")]
        self.name = ""
        self.residual = 0.0
        self._solve: Solve = np.copy
        if A.shape[0]:
            self._next_package()

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know about this factorisation."""
        return tuple(self._notes)

    @property
    def iterations(self) -> int:
        """Iterations of the last solve, 0 for a factorisation in double precision."""
        return int(getattr(self._solve, "iterations", 0))

    @property
    def negative(self) -> int | None:
        """Number of negative eigenvalues that a factorisation met; None when it does not tell."""
        return getattr(self._solve, "negative", 0 if self._definite else None)

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of the matrix."""
        n = self._A.shape[0]
        return (n, n)

    def solve(self, b: FloatArray, tolerance: float | None = None) -> FloatArray:
        """Solve ``A x = b`` for one or several right-hand sides.

        Parameters
        ----------
        b : (n,) or (n, k) float64
            Right-hand sides, one a column.
        tolerance : float, optional
            Relative residual, Euclidean, that suffices here; what iterates stops there instead of at its own.

        Returns
        -------
        (n,) or (n, k) float64

        Raises
        ------
        SingularSystem
            When no package brings the residual below ``RESIDUAL_LIMIT``.

        Cost
        ----
        One forward and one back substitution for each column, and a product by A; of several columns one random
        combination is checked.
        """
        b = np.asarray(b, dtype=np.float64)
        if not np.isfinite(b).all():
            raise BadValue("right-hand side", float(b[~np.isfinite(b)][0]), "a finite value")
        if b.size == 0:
            return np.zeros_like(b)
        # the check takes the largest entry of a residual that iterations measure in the Euclidean norm
        limit = self._limit if tolerance is None else max(self._limit, tolerance * np.sqrt(len(b)))
        while True:
            try:
                x = self._once(b, tolerance)
                residual, good = self._check(x, b, limit)
                if not good:
                    x = x + self._once(b - self._A @ x, tolerance)
                    residual, good = self._check(x, b, limit)
            except FAILURES as error:
                self._note(f"{self.name}: no solution ({error})")
                self._next_package()
                continue
            if good:
                if tolerance is None:
                    self.residual = max(self.residual, residual)
                return x
            self._note(f"{self.name}: relative residual {residual:.1e} after one refinement, answer discarded")
            self._next_package()

    def _note(self, text: str) -> None:
        # that single precision does not suffice is no failure: double precision follows
        if self.name != "single":
            self._notes.append(text)

    def _once(self, b: FloatArray, tolerance: float | None) -> FloatArray:
        if tolerance is not None and isinstance(self._solve, Iteration):
            return self._solve(b, tolerance)
        return self._solve(b)

    def _check(self, x: FloatArray, b: FloatArray, limit: float) -> tuple[float, bool]:
        """Give the relative residual and whether it is small, or as small as double precision can make it."""
        if not np.isfinite(x).all():
            return float("inf"), False
        if b.ndim == 2 and b.shape[1] > SAMPLED_COLUMNS:
            # a random combination of the columns has a residual unless all have none: one product instead of many
            size = np.abs(b).max(axis=0)
            weights = np.random.default_rng(0).standard_normal(len(size)) / np.where(size > 0, size, 1.0)
            relative = float(np.abs(self._A @ (x @ weights) - b @ weights).max())
            if relative <= limit:
                return relative, True
        r = np.abs(self._A @ x - b).max(axis=0)
        size = np.abs(b).max(axis=0)
        relative = float(np.divide(r, size, out=np.zeros_like(r), where=size > 0).max())
        good = r <= limit * size
        if not good.all():
            floor = np.abs(self._A) @ np.abs(x) + np.abs(b)
            null = self._weakness(x) <= SINGULAR_LIMIT
            good |= (r <= 64 * np.finfo(float).eps * floor.max(axis=0)) & ~null
        return relative, bool(good.all())

    def _weakness(self, x: FloatArray) -> FloatArray:
        """Bound the smallest eigenvalue of the scaled matrix by each column of x: tiny for a null vector."""
        Ax = self._A @ x
        scale = self._scale if x.ndim == 1 else self._scale[:, None]
        size = ((x / scale) ** 2).sum(axis=0)
        # of an indefinite matrix the quotient of Rayleigh can vanish without a null vector
        value = np.abs((x * Ax).sum(axis=0)) if self._definite else np.sqrt((scale**2 * Ax**2).sum(axis=0) * size)
        return np.asarray(np.divide(value, size, out=np.full_like(size, np.inf), where=size > 0))

    def _next_package(self) -> None:
        while self._packages:
            self.name = self._packages.pop(0)
            self._solve = np.copy
            try:
                self._solve = self._factorize(self._A)
                self._probe()
            except FAILURES as error:
                what = "factorisation failed" if self.name in DIRECT else "no solution"
                if self.name != "amg" or not self._trial:
                    self._note(f"{self.name}: {what} ({error})")
                if self.name in DIRECT:
                    self._raise_if_singular(shifted=True)
                continue
            if getattr(self._solve, "negative", 0):
                self._definite = False
            if self.name in DIRECT:
                self._raise_if_singular(shifted=False)
            n = self._A.shape[0]
            if self.name == "superlu" and n > packages.SUPERLU_LIMIT:
                missing = [MODULES[name] for name in DIRECT if not is_installed(name)]
                advice = f"; pip install {missing[0]}" if missing else ""
                self._notes.append(f"{n} unknowns factorised by SuperLU, slow at this size{advice}")
            return
        raise SingularSystem("; ".join(self._notes) or "no package could factorise the matrix")

    def _probe(self) -> None:
        """Iterate on a random right-hand side, which a singular matrix cannot give: its residual stops falling.

        The load itself may leave a mechanism alone, and its answer would then look right.
        """
        if self.name in ("amg", "cg") and isinstance(self._solve, Iteration):
            n = self._A.shape[0]
            right = np.random.default_rng(0).standard_normal(n) / self._scale
            # a null vector holds about 1 / sqrt(n) of a random vector
            self._solve(right, tolerance=0.1 / np.sqrt(n), most=self._trial or None)

    def _raise_if_singular(self, shifted: bool) -> None:
        """Look for a null vector by inverse iteration; the matrix itself confirms it, whatever the package did."""
        # a factorisation that broke down is repeated on a slightly shifted matrix, which has the same null vectors
        try:
            solve = (
                self._factorize(self._A + sp.diags_array(1e-8 / self._scale**2, format="csr"))
                if shifted
                else self._solve
            )
        except FAILURES:
            return
        x = np.random.default_rng(0).standard_normal(self._A.shape[0]) / self._scale
        for _ in range(3 if shifted else 1):
            x = solve(x)
            if not np.isfinite(x).all():
                return
            x = x / float(np.linalg.norm(x / self._scale))
            # of an indefinite matrix round-off in the residual itself is larger
            if self._weakness(x) <= SINGULAR_LIMIT * (1 if self._definite else 10):
                unknowns = np.flatnonzero(np.abs(x) >= 0.5 * np.abs(x).max())
                raise SingularSystem(f"the matrix is singular ({self.name})", unknowns=unknowns)
            x = x / self._scale**2

    def _factorize(self, A: sp.csr_array) -> Solve:
        match self.name:
            case "single":
                return iterations.single(A)
            case "rslab":
                return packages.rslab(A)
            case "pardiso":
                return packages.pardiso(A)
            case "superlu":
                return packages.superlu(A)
            case "amg":
                patient = not any(name in DIRECT for name in self._packages)
                return iterations.amg(A, self._near_null, self._block, self._tolerance, patient=patient)
            case "cg":
                return iterations.cg(A, self._block, self._tolerance)
            case _:
                return iterations.Minres(A, self._tolerance)


def factorize(
    A: sp.sparray | sp.spmatrix,
    *,
    method: str = "auto",
    near_null: FloatArray | None = None,
    block: int = 1,
    tolerance: float = 1e-10,
    reserve: bool = True,
    trial: int = 0,
) -> Factor:
    """Factorise or precondition a symmetric sparse matrix.

    Parameters
    ----------
    A : (n, n) sparse, symmetric
    method : str
        ``auto`` takes the first installed direct package among rslab, pardiso (pypardiso), superlu (SciPy) and keeps
        the others in reserve. ``single`` tries rslab in single precision first, each solution corrected to double:
        half the time and memory, for few right-hand sides. The name of a package takes that one only. ``amg`` takes
        conjugate gradients with an algebraic multigrid preconditioner, ``cg`` with the diagonal blocks, ``minres``
        allows negative eigenvalues; direct packages in reserve.
    near_null : (n, k) float64, optional
        Rigid-body modes, used by ``amg`` only; for 3D elasticity without them it converges slowly.
    block : int
        Unknowns per node, used by ``amg`` and ``cg``; n is a multiple of it.
    tolerance : float
        Relative residual where iterations stop.
    reserve : bool
        Whether direct packages may take over from iterations that fail.
    trial : int
        Iterations of ``amg`` on a first right-hand side after which a factorisation, in single precision if it can be,
        takes over without a note; 0: as many as in any solution.

    Returns
    -------
    Factor

    Raises
    ------
    SingularSystem
        When a null vector is found or no package can factorise the matrix.
    TooLarge
        When the analysis of the pattern shows that a factorisation does not fit into the memory there is.
    MissingPackage
        When ``method`` names a package that is not installed.
    BadValue
        When ``method`` is unknown or the matrix holds infinite or undefined entries.

    Notes
    -----
    The matrix is called singular when one inverse iteration from a random vector finds an x with
    ``x.A.x <= 1e-14 x.D.x``, D the diagonal of A; of an indefinite matrix, with a residual as small. The measure does
    not depend on units nor on the package. An indefinite matrix is recognised by its diagonal, by negative pivots, or
    by a direction of negative energy that conjugate gradients meet.

    Cost
    ----
    On 3D elasticity with n unknowns, about n^2 operations and n^(4/3) memory; ``amg`` is linear in both.
    """
    if A.format != "bsr" or A.dtype != np.float64:
        A = sp.csr_array(A, dtype=np.float64)
    if not np.isfinite(A.data).all():
        raise BadValue("matrix entry", float(A.data[~np.isfinite(A.data)][0]), "a finite value")
    installed = tuple(name for name in DIRECT if is_installed(name))
    match method:
        case "auto":
            names = installed
        case "single":
            names = ("single", *installed) if is_installed("rslab") else installed
        case "amg" | "cg" | "minres":
            last = () if method == "minres" else ("minres",)
            direct = ("single", *installed) if trial and is_installed("rslab") else installed
            names = (method, *(direct if reserve else last))
        case _ if method not in MODULES:
            raise BadValue("method", method, "one of auto, single, " + ", ".join((*MODULES, *ITERATIVE)))
        case _ if not is_installed(method):
            raise MissingPackage(MODULES[method], f"pip install {MODULES[method]}")
        case _:
            names = (method,)
    return Factor(A, names, near_null, block, tolerance, trial)


def _diagonal_scale(A: sp.csr_array) -> tuple[FloatArray, bool]:
    """Give the scaling that makes the diagonal 1, and whether the matrix may be positive definite.

    Without a positive diagonal it is not; rows are then scaled by their largest entry.
    """
    diagonal = A.diagonal()
    if (diagonal > 0).all():
        return np.asarray(1 / np.sqrt(diagonal)), True
    size = np.asarray(abs(A).max(axis=1).todense()).ravel()
    empty = np.flatnonzero(size == 0)
    if len(empty):
        raise SingularSystem("unknowns without stiffness", unknowns=empty)
    return np.asarray(1 / np.sqrt(size)), False
