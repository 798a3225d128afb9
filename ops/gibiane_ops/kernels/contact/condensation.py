"""Bodies condensed on their contact pairs: loads, interfaces, displacements and forces of what `condense` has made."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.constraints import Reduction
from gibiane_ops.kernels.contact.compliance import PairStiffness
from gibiane_ops.kernels.contact.fields import Fields
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.kernels.contact.pardiso_schur import PardisoSchur
from gibiane_ops.kernels.contact.relative_motion import rigid_candidates
from gibiane_ops.kernels.contact.small_model import SmallModel, interpolation, schur, small_model
from gibiane_ops.kernels.contact.tied import TiedSolver
from gibiane_ops.kernels.errors import SingularSystem
from gibiane_ops.kernels.packages import is_installed
from gibiane_ops.kernels.rigid import solids
from gibiane_ops.kernels.solve import Factor

BoolArray = NDArray[np.bool_]

SCHUR_UNKNOWNS, SCHUR_COMPONENTS = 10_000, 64
"""Tied unknowns and components of w above which PARDISO's Schur complement is faster than back substitutions."""

REMEMBERED = 6
"""Displacements kept to start the iterations of other loads and coefficients from."""


@dataclass(frozen=True, eq=False)
class TiedSolution:
    """What one load gives on the tied bodies.

    Attributes
    ----------
    F0 : (n_dofs,) float64
        Load without the part of prescribed displacements.
    U0 : (n_dofs,) float64
        Displacement at v = 0 and w = 0.
    x : (n_v,) float64
        Displacement of the tied bodies.
    f : (n d,) float64
        Condensed load.
    """

    F0: FloatArray
    U0: FloatArray
    x: FloatArray
    f: FloatArray


@dataclass(eq=False)
class Condensation:
    """Tied matrix, what solves with it and the stiffness of the pairs: whatever does not depend on the load.

    Attributes
    ----------
    contact : ContactPairs
    tied : TiedSolver
    frames : (n, d, d) float64
    active : (n, d) bool
        See ``Interface``.
    n_stops : int
    """

    contact: ContactPairs
    tied: TiedSolver
    frames: FloatArray
    active: BoolArray
    n_stops: int
    _shortening: FloatArray
    _K: sp.csr_array
    _KBw: sp.csr_array
    _Kvw: sp.csr_array
    _fields: Fields
    _reduction: Reduction
    _points: FloatArray | None
    _exact: PairStiffness | None = field(default=None, init=False)
    _small: SmallModel | None = field(default=None, init=False)
    _last: TiedSolution | None = field(default=None, init=False)
    learned: PairStiffness | None = field(default=None, init=False)
    _known: list[tuple[FloatArray, FloatArray]] = field(default_factory=list, init=False)

    @property
    def factor(self) -> Factor:
        """What solves with the tied matrix."""
        return self.tied.factor

    @property
    def n_components(self) -> int:
        """Components of w that can vary."""
        return int(self.active.sum())

    @property
    def has_coordinates(self) -> bool:
        """Whether the small model can be built."""
        return self._points is not None and not self.n_stops

    @property
    def is_exact(self) -> bool:
        """Whether the exact stiffness is known already."""
        return self._exact is not None

    def exact(self) -> PairStiffness:
        """Compute the exact stiffness of the pairs, once.

        Cost
        ----
        One solution with the tied matrix per active component of w; one factorisation where PARDISO is installed.
        """
        if self._exact is None:
            S = self._schur()
            if self.n_stops:
                candidates = np.eye(len(S))[:, self.active.ravel()]
            else:
                candidates = rigid_candidates(self.contact, self.frames, self.active)
            energy = candidates.T @ S @ candidates
            self._exact = PairStiffness.of(S, self.active, self._elastic, candidates, energy, exact=True)
        return self._exact

    def small(self) -> SmallModel:
        """Build the small model of the bodies, once; ``learned`` starts as its stiffness."""
        if self._small is None:
            columns = np.flatnonzero(self.active.ravel())
            self._small = small_model(self.tied.A, self._Kvw, self._Kww(), self._coarse(), columns)
            candidates = rigid_candidates(self.contact, self.frames, self.active)
            # the small model holds every rigid motion: the true energy of its fields tells which are free
            moved = self._fields.Bw @ candidates - self._fields.Bv @ self._small.solve(self._Kvw @ candidates)
            energy = moved.T @ (self._K @ moved)
            self.learned = PairStiffness.of(
                self._small.S, self.active, self._elastic, candidates, energy, exact=False
            )  # fmt: skip
        return self._small

    def load(self, F: FloatArray, offset: FloatArray | None = None) -> TiedSolution:
        """Solve the tied bodies under a load and prescribed displacements.

        Parameters
        ----------
        F : (n_dofs,) float64, force
        offset : (n_dofs,) float64, optional
            ``Reduction.offset`` of the same conditions with other prescribed values; those given to ``condense`` when
            left out.

        Returns
        -------
        TiedSolution
            That of the last call when the load has not changed.

        Cost
        ----
        One solution with the tied matrix.
        """
        fields, last = self._fields, self._last
        U0 = fields.constant(self._reduction.offset if offset is None else offset)
        F0 = F - self._K @ U0
        if last is not None and np.array_equal(last.F0, F0) and np.array_equal(last.U0, U0):
            return last
        right = fields.Bv.T @ F0
        x = self.tied.solve(right)
        if not self.tied.direct and self.has_coordinates:
            x = x + self.small().solve(right - self.tied.A @ x)
        f = np.asarray(fields.Bw.T @ F0 - self._Kvw.T @ x)
        self._last = TiedSolution(F0, U0, x, f)
        return self._last

    def interface(
        self,
        F: FloatArray,
        offset: FloatArray | None = None,
        stop_values: FloatArray | None = None,
        gap: FloatArray | None = None,
    ) -> Interface:
        """Condense a load and prescribed displacements on the pairs, exactly.

        Parameters
        ----------
        F, offset
            See ``load``.
        stop_values : (n_stops,) float64, optional
            Largest values of the stops, zero when left out.
        gap : (n_pairs,) float64, length, optional
            Initial gaps, those of the pairs when left out.

        Returns
        -------
        Interface
            The pairs, then the stops.

        Cost
        ----
        One solution with the tied matrix, and what ``exact`` costs.
        """
        solution = self.load(F, offset)
        return self.interface_of(solution, self.exact(), self.gaps(solution, stop_values, gap))

    def interface_of(self, solution: TiedSolution, stiffness: PairStiffness, gap: FloatArray) -> Interface:
        """Put together an interface whose stiffness may be approximate."""

        def expand(w: FloatArray) -> FloatArray:
            flat = np.ravel(w)
            return self.displacement(solution, flat, self.tied.solve(self._Kvw @ flat))

        return Interface(
            stiffness.S, solution.f, gap, self.frames, self.active, stiffness.rigid, stiffness.kref, expand
        )  # fmt: skip

    def unloaded_stiffness(self) -> PairStiffness:
        """Give an empty stiffness, for what needs no more than the geometry of the pairs and their load."""
        size = self.active.size
        return PairStiffness(sp.csr_array((size, size)), self._elastic, np.zeros((size, 0)), False)

    def displacement(self, solution: TiedSolution, w: FloatArray, x: FloatArray) -> FloatArray:
        """Compute the displacement of every unknown from w, (n d,), and x with ``Kvv x = Kvw w``."""
        return np.asarray(self._fields.Bv @ (solution.x - x) + self._fields.Bw @ w + solution.U0)

    def coupling(self, w: FloatArray) -> FloatArray:
        """Compute ``Kvw w``, the force of relative displacements on the tied bodies."""
        return np.asarray(self._Kvw @ w)

    def force(self, w: FloatArray, x: FloatArray) -> FloatArray:
        """Compute ``S w`` from x with ``Kvv x = Kvw w``."""
        return np.asarray(self._fields.Bw.T @ (self._KBw @ w) - self._Kvw.T @ x)

    def remember(self, w: FloatArray, x: FloatArray) -> None:
        """Keep a solution of ``Kvv x = Kvw w``, from which iterations for another w will start."""
        if not self.tied.direct and w.any():
            self._known = [*self._known[1 - REMEMBERED :], (w, x)]

    def recalled(self, w: FloatArray) -> FloatArray:
        """Combine the solutions kept so as to come close to that of w."""
        if not self._known:
            return np.zeros(self.tied.A.shape[0])
        W, X = (np.column_stack(columns) for columns in zip(*self._known, strict=True))
        return np.asarray(X @ np.linalg.lstsq(W, w, rcond=1e-8)[0])

    def gaps(
        self, solution: TiedSolution, stop_values: FloatArray | None = None, gap: FloatArray | None = None
    ) -> FloatArray:
        """Compute what is left of the gaps when prescribed displacements of both sides are applied, and the stops."""
        d = self.active.shape[1]
        relative = self.contact.matrix(len(solution.U0) // d) @ solution.U0.reshape(-1, d)
        start = self.contact.gap if gap is None else gap
        start = (start - (relative * self.contact.normals).sum(axis=1)) / self._shortening
        return np.concatenate([start, np.zeros(self.n_stops) if stop_values is None else stop_values])

    @property
    def has_schur(self) -> bool:
        """Whether PARDISO's own Schur complement serves: it is installed, and back substitutions are many."""
        large = self.tied.A.shape[0] > SCHUR_UNKNOWNS and self.n_components > SCHUR_COMPONENTS
        return large and self.tied.direct and is_installed("pardiso")

    def _schur(self) -> FloatArray:
        columns = np.flatnonzero(self.active.ravel())
        if self.has_schur:
            Kww = sp.csr_array(self._fields.Bw.T @ self._KBw)[columns][:, columns]
            try:
                found = PardisoSchur(self.tied.A, sp.csr_array(self._Kvw[:, columns]), Kww).S
            except (SingularSystem, OSError, MemoryError):
                found = None  # back substitutions with the factor that is there
            if found is not None:
                S = np.zeros((self.active.size, self.active.size))
                S[np.ix_(columns, columns)] = found
                return S
        return schur(self.tied, self._Kvw, self._Kww(), columns)

    def _Kww(self) -> FloatArray:
        return np.asarray((self._fields.Bw.T @ self._KBw).toarray())

    @cached_property
    def _elastic(self) -> float:
        return float(self._K.diagonal().mean())

    def _coarse(self) -> sp.csr_array:
        """Interpolate the tied unknowns: those near the contact kept, the others on coarse grids."""
        assert self._points is not None
        roots, d = self._fields.roots(), self.active.shape[1]
        Bv, Bw = self._fields.Bv, self._fields.Bw
        near = roots < 0
        near[Bv[np.flatnonzero(np.diff(Bw.indptr))].indices] = True
        near[np.flatnonzero(np.diff(self._Kvw.indptr))] = True
        roots = np.maximum(roots, 0)
        body = solids(self._K, self._K.shape[0] // d, d)
        return interpolation(self.tied.A, near, body[roots // d], self._points[roots // d], roots % d)
