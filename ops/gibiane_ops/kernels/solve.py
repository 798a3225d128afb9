"""Factorise and solve symmetric positive definite sparse systems, with whatever package is installed.

Every solve is checked, so that a package may be young, missing or wrong: a bad residual is refined once, then the next
package takes over and a note says so. A singular matrix is recognised by its own null vector, never by a package.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels import packages
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue, MissingPackage, SingularSystem
from gibiane_ops.kernels.packages import DIRECT, MODULES, Iteration, Solve, is_installed

RESIDUAL_LIMIT = 1e-9
"""Largest accepted norm of ``A x - b`` over that of ``b`` (largest entry, column by column)."""

SINGULAR_LIMIT = 1e-14
"""A matrix scaled to a unit diagonal is singular when ``x.A.x / x.x`` falls below this; round-off gives 1e-16."""

SUPERLU_LIMIT = 30_000
"""Number of unknowns above which SuperLU is some fifty times slower than a supernodal package."""

SAMPLED_COLUMNS = 4
"""Number of right-hand sides above which one random combination of them is checked."""


class Factor:
    """A factorised matrix that solves, checks its answer, and changes package when the answer is bad.

    Attributes
    ----------
    name : str
        Package in use: ``rslab``, ``pardiso``, ``superlu``, ``amg`` or ``cg``.
    residual : float
        Largest relative residual met so far.
    notes : tuple of str
        What the user should know: a slow package, a package that failed.
    """

    def __init__(
        self, A: sp.csr_array, names: tuple[str, ...], near_null: FloatArray | None, block: int, tolerance: float
    ) -> None:
        self._A = A
        self._packages = list(names)
        self._near_null = near_null
        self._block = block
        self._tolerance = tolerance
        self._limit = max(RESIDUAL_LIMIT, 10 * tolerance)
        self._notes: list[str] = []
        self._scale = _diagonal_scale(A)
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
        """Iterations of the last solve, 0 for a factorisation."""
        return self._solve.iterations if isinstance(self._solve, Iteration) else 0

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of the matrix."""
        n = self._A.shape[0]
        return (n, n)

    def solve(self, b: FloatArray) -> FloatArray:
        """Solve ``A x = b`` for one or several right-hand sides.

        Parameters
        ----------
        b : (n,) or (n, k) float64
            Right-hand sides, one a column.

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
        while True:
            x = self._solve(b)
            residual, good = self._check(x, b)
            if not good:
                x = x + self._solve(b - self._A @ x)
                residual, good = self._check(x, b)
            if good:
                self.residual = max(self.residual, residual)
                return x
            self._notes.append(f"{self.name}: relative residual {residual:.1e} after one refinement, answer discarded")
            self._next_package()

    def _check(self, x: FloatArray, b: FloatArray) -> tuple[float, bool]:
        """Give the relative residual and whether it is small, or as small as double precision can make it."""
        if not np.isfinite(x).all():
            return float("inf"), False
        if b.ndim == 2 and b.shape[1] > SAMPLED_COLUMNS:
            # a random combination of the columns has a residual unless all have none: one product instead of many
            size = np.abs(b).max(axis=0)
            weights = np.random.default_rng(0).standard_normal(len(size)) / np.where(size > 0, size, 1.0)
            relative = float(np.abs(self._A @ (x @ weights) - b @ weights).max())
            if relative <= self._limit:
                return relative, True
        r = np.abs(self._A @ x - b).max(axis=0)
        size = np.abs(b).max(axis=0)
        relative = float(np.divide(r, size, out=np.zeros_like(r), where=size > 0).max())
        good = r <= self._limit * size
        if not good.all():
            floor = np.abs(self._A) @ np.abs(x) + np.abs(b)
            weight = 1 / self._scale**2
            null = np.abs((x * (self._A @ x)).sum(axis=0)) <= SINGULAR_LIMIT * (weight @ x**2)
            good |= (r <= 64 * np.finfo(float).eps * floor.max(axis=0)) & ~null
        return relative, bool(good.all())

    def _next_package(self) -> None:
        while self._packages:
            self.name = self._packages.pop(0)
            try:
                self._solve = self._factorize(self._A)
            except (RuntimeError, ValueError, ArithmeticError) as error:
                self._notes.append(f"{self.name}: factorisation failed ({error})")
                self._raise_if_singular(shifted=True)
                continue
            if self.name in DIRECT:
                self._raise_if_singular(shifted=False)
            n = self._A.shape[0]
            if self.name == "superlu" and n > SUPERLU_LIMIT:
                self._notes.append(f"{n} unknowns factorised by SuperLU, slow at this size; pip install rslab")
            return
        raise SingularSystem("; ".join(self._notes) or "no package could factorise the matrix")

    def _raise_if_singular(self, shifted: bool) -> None:
        """Look for a null vector by inverse iteration; the matrix itself confirms it, whatever the package did."""
        # a factorisation that broke down is repeated on a slightly shifted matrix, which has the same null vectors
        solve = (
            self._factorize(self._A + sp.diags_array(1e-8 / self._scale**2, format="csr")) if shifted else self._solve
        )
        x = np.random.default_rng(0).standard_normal(self._A.shape[0]) / self._scale
        for _ in range(3 if shifted else 1):
            x = solve(x)
            if not np.isfinite(x).all():
                return
            size = float(np.linalg.norm(x / self._scale))
            x = x / size
            if abs(float(x @ (self._A @ x))) <= SINGULAR_LIMIT:
                unknowns = np.flatnonzero(np.abs(x) >= 0.5 * np.abs(x).max())
                raise SingularSystem(f"the matrix is singular ({self.name})", unknowns=unknowns)
            x = x / self._scale**2

    def _factorize(self, A: sp.csr_array) -> Solve:
        match self.name:
            case "rslab":
                return packages.rslab(A)
            case "pardiso":
                return packages.pardiso(A)
            case "superlu":
                return packages.superlu(A)
            case "amg":
                return packages.amg(A, self._near_null, self._block, self._tolerance)
            case _:
                return packages.cg(A, self._block, self._tolerance)


def factorize(
    A: sp.sparray | sp.spmatrix,
    *,
    method: str = "auto",
    near_null: FloatArray | None = None,
    block: int = 1,
    tolerance: float = 1e-10,
    reserve: bool = True,
) -> Factor:
    """Factorise a symmetric positive definite sparse matrix.

    Parameters
    ----------
    A : (n, n) sparse, symmetric positive definite
    method : str
        ``auto`` takes the first installed direct package among rslab, pardiso (pypardiso), superlu (SciPy) and keeps
        the others in reserve. The name of a package takes that one only. ``amg`` takes conjugate gradients with an
        algebraic multigrid preconditioner (pyamg), ``cg`` with the diagonal blocks; direct packages in reserve.
    near_null : (n, k) float64, optional
        Rigid-body modes, used by ``amg`` only; for 3D elasticity without them it converges slowly.
    block : int
        Unknowns per node, used by ``amg`` and ``cg``; n is a multiple of it.
    tolerance : float
        Relative residual where iterations stop.
    reserve : bool
        Whether direct packages may take over from iterations that fail.

    Returns
    -------
    Factor

    Raises
    ------
    SingularSystem
        When a null vector is found or no package can factorise the matrix.
    MissingPackage
        When ``method`` names a package that is not installed.
    BadValue
        When ``method`` is unknown or the matrix holds infinite or undefined entries.

    Notes
    -----
    The matrix is called singular when one inverse iteration from a random vector finds an x with
    ``x.A.x <= 1e-14 x.D.x``, D the diagonal of A. The measure does not depend on units nor on the package.

    Cost
    ----
    On 3D elasticity with n unknowns, about n^2 operations and n^(4/3) memory; ``amg`` is linear in both.
    """
    if A.format != "bsr" or A.dtype != np.float64:
        A = sp.csr_array(A, dtype=np.float64)
    if not np.isfinite(A.data).all():
        raise BadValue("matrix entry", float(A.data[~np.isfinite(A.data)][0]), "a finite value")
    if method == "auto":
        names = tuple(name for name in DIRECT if is_installed(name))
    elif method not in MODULES:
        raise BadValue("method", method, "one of auto, " + ", ".join(MODULES))
    elif not is_installed(method):
        raise MissingPackage(MODULES[method], f"pip install {MODULES[method]}")
    elif method in ("amg", "cg"):
        names = (method, *(name for name in DIRECT if reserve and is_installed(name)))
    else:
        names = (method,)
    return Factor(A, names, near_null, block, tolerance)


def _diagonal_scale(A: sp.csr_array) -> FloatArray:
    """Give the scaling that makes the diagonal 1; a zero or negative diagonal is no positive definite matrix."""
    diagonal = A.diagonal()
    bad = np.flatnonzero(~(diagonal > 0))
    if len(bad):
        raise SingularSystem("unknowns without stiffness", unknowns=bad)
    return np.asarray(1 / np.sqrt(diagonal))
