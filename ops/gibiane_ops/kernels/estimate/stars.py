"""Improvement of equilibrated tractions: the energy of the error is minimised star after star."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.estimate.limits import Limits
from gibiane_ops.kernels.estimate.macro import contraction, macro_element, moments, turned
from gibiane_ops.kernels.estimate.simplices import Simplices, colours, others, slots
from gibiane_ops.kernels.threads import one_thread

PENALTY, PENALTY_PRESSED = 1e5, 1e8
"""Weight of the balance of each cell over the energy, in the augmented Lagrangian of a star; that of a star in contact,
whose energy is stiffer where tractions are pushed back to the law."""

STOP = 1e3
"""Stiffness against what leaves the law on contact facets, over that of a traction."""

UZAWA = 3
"""Solutions with one factor: the balance is met to round-off after the third."""

UZAWA_PRESSED, LEFT, LOST = 20, 1e-15, 1e-13
"""The most where tractions are pushed back to the law, the imbalance that is none, and that which is not met."""

ROUNDS = 5
"""Solutions of a star until none of its tractions leaves the law; what the last one leaves cuts the step."""

CHUNK = 64
"""Stars that are assembled together."""

VISITS = 3
"""Improvements in a sweep, over the number of stars: the first sweep begins with one of each star."""

RELAXED = 1.7
"""Over-relaxation from the second visit on: loads travel from star to star in half the visits."""

BEST, SHARE, LEAST = 0.4, 1.0 / 16, 48
"""Stars chosen together: the best, that had this part of the last gains, and at least this share and this number."""


def jumps(mesh: Simplices, tau: FloatArray, stress: FloatArray, cells: IntArray | slice = slice(None)) -> FloatArray:
    """Subtract the tractions of the finite-element stress from the balanced ones, on each side of each cell.

    Parameters
    ----------
    mesh : Simplices
    tau : (n_sides, d, d) float64, force
    stress : (m, n_s) float64
    cells : (k,) int64, optional

    Returns
    -------
    (k, d + 1, d, d) float64, force
    """
    flux = np.einsum("mkis,ms->mki", contraction(mesh.outward[cells], mesh.dim), stress[cells])
    return np.asarray(mesh.sign[cells][..., None, None] * tau[mesh.side[cells]] - flux[:, :, None], np.float64)


def energy_matrices(mesh: Simplices, compliance: FloatArray, cells: IntArray) -> FloatArray:
    """Compute the energy of the stress of cells as a quadratic form of their tractions.

    Parameters
    ----------
    mesh : Simplices
    compliance : (m, n_s, n_s) float64
    cells : (k,) int64

    Returns
    -------
    (k, n_t, n_t) float64, symmetric
        In the order of `macro.MacroElement`, tractions leaving the cell.
    """
    dim = mesh.dim
    macro = macro_element(dim)
    F = mesh.map[cells]
    T = turned(F)
    det = mesh.volume[cells] * (2.0 if dim == 2 else 6.0)
    S = np.matmul(T.swapaxes(1, 2), np.matmul(compliance[cells], T)) / det[:, None, None]
    upper = np.triu_indices(S.shape[1])
    n_t = macro.n_tractions
    H = S[:, upper[0], upper[1]] @ macro.energies
    inverse = np.linalg.inv(F)
    H = np.matmul(H.reshape(len(cells), -1, dim), inverse).reshape(len(cells), n_t, n_t)
    # The other side, by symmetry of the form.
    H = np.matmul(H.swapaxes(1, 2).reshape(len(cells), -1, dim), inverse)
    return np.asarray(H.reshape(len(cells), n_t, n_t), np.float64)


def balance_rows(mesh: Simplices, cells: IntArray) -> FloatArray:
    """Compute resultant forces and moments (over the size of the cell) of tractions on cells.

    Parameters
    ----------
    mesh : Simplices
    cells : (k,) int64

    Returns
    -------
    (k, 6 or 3, n_t) float64
    """
    dim = mesh.dim
    X = mesh.points[mesh.cells[cells]]
    arm = np.matmul(moments(dim), (X - X.mean(axis=1, keepdims=True))[:, others(dim)])
    arm = arm / np.linalg.norm(arm, axis=-1).max(axis=(1, 2))[:, None, None, None] / dim
    turns = [(i, j) for i in range(dim) for j in range(i)]
    B = np.zeros((len(cells), dim + len(turns), dim + 1, dim, dim))
    B[:, range(dim), :, :, range(dim)] = 1.0 / dim
    for row, (i, j) in enumerate(turns, dim):
        B[:, row, :, :, i] = arm[..., j]
        B[:, row, :, :, j] = -arm[..., i]
    return B.reshape(len(cells), dim + len(turns), -1)


@dataclass(eq=False)
class _Springs:
    """Corners of stars that are pushed back to the law.

    Attributes
    ----------
    row, corner, kind : (m,) int64
        Place among the sides of the stars; 0 for a pull, 1 for a slide.
    star, place : (m,) int64
        Place in the systems.
    direction : (m, d) float64
    over : (m,) float64, force
        How far beyond the law the traction is in this direction, before any change.
    stiff : float
    force : (m,) float64
        Multipliers: what pushes, beside the springs.
    blocks : (m, d, d) float64
        What they add to the matrix.
    pull : (m, d) float64
        What they add to the right-hand side, beside their push.
    """

    row: IntArray
    corner: IntArray
    kind: IntArray
    star: IntArray
    place: IntArray
    direction: FloatArray
    over: FloatArray
    stiff: float
    force: FloatArray
    blocks: FloatArray
    pull: FloatArray

    def pushed(self, right: FloatArray, dim: int) -> FloatArray:
        """Return right-hand sides with the push of the springs."""
        found = right.copy()
        push = (self.force + self.stiff * self.over)[:, None] * self.direction
        np.subtract.at(found.reshape(len(right), -1, dim), (self.star, self.place), push)
        return found

    def tighten(self, x: FloatArray) -> None:
        """Raise the multipliers by what the springs still give way."""
        self.force += self.stiff * (self.over + np.einsum("si,si->s", self.direction, x[self.star, self.place]))


class Improver:
    """What every sweep needs: the colours, and the place of each side in the systems of its stars.

    Parameters
    ----------
    mesh : Simplices
    stress : (m, n_s) float64, force / length^2
        Finite-element stress.
    compliance : (m, n_s, n_s) float64, length^2 / force
    free : (n_sides, d, d) float64
        Projector on the directions in which the traction of each side may change.
    pull : (m, n_t) float64, optional
        What a stress that is not uniform in the cells adds, see `pieces.Aim`.
    limits : Limits, optional
        Sides on which tractions obey the law of contact and friction; they do to begin with, and go on to.
    """

    def __init__(
        self,
        mesh: Simplices,
        stress: FloatArray,
        compliance: FloatArray,
        free: FloatArray,
        pull: FloatArray | None = None,
        limits: Limits | None = None,
    ) -> None:
        dim = mesh.dim
        self.mesh, self.stress, self.compliance, self.free = mesh, stress, compliance, free
        self.pull, self.limits = pull, limits
        movable = np.flatnonzero(free.any(axis=(1, 2)))
        corner = others(dim)[mesh.local[movable, 0]]
        star = mesh.star[mesh.cell[movable, 0][:, None], corner]
        side = np.repeat(movable, dim)
        order = np.argsort(star.ravel(), kind="stable")
        self.n_sides = np.bincount(star.ravel(), minlength=mesh.n_stars)
        self.first_side = np.cumsum(self.n_sides) - self.n_sides
        self.sides = side[order]
        place = np.empty(len(order), np.int64)
        place[order] = np.arange(len(order)) - np.repeat(self.first_side, self.n_sides)
        self.place = np.full((len(mesh.nodes), dim), -1)
        self.place[movable] = place.reshape(-1, dim)
        flat = mesh.star.ravel()
        self.corners = np.argsort(flat, kind="stable")
        self.n_corners = np.bincount(flat, minlength=mesh.n_stars)
        self.first_corner = np.cumsum(self.n_corners) - self.n_corners
        partly = np.abs(free - np.eye(dim)).max(axis=(1, 2)) > 0
        self.partly = partly & free.any(axis=(1, 2))
        self.colours: list[IntArray] = []
        for stars in colours(mesh):
            used = stars[self.n_sides[stars] > 0]
            self.colours.append(used[np.argsort(self.n_sides[used], kind="stable")])
        self.n_used = sum(len(stars) for stars in self.colours)
        self.gain: FloatArray | None = None
        self.ahead = np.zeros((0, dim, dim)) if limits is None else np.zeros((len(mesh.nodes), dim, dim))
        self.pushed = np.zeros((len(self.ahead), 2, dim))
        self.touching: NDArray[np.bool_] | None = None
        if limits is not None:
            here = np.flatnonzero(np.abs(limits.normal).max(axis=1) > 0)
            ends = mesh.star[mesh.cell[here, 0][:, None], others(dim)[mesh.local[here, 0]]]
            self.touching = np.zeros(mesh.n_stars, bool)
            self.touching[ends] = True

    @one_thread()
    def sweep(self, tau: FloatArray) -> None:
        """Improve the tractions in place, `VISITS` times around each node on average.

        Parameters
        ----------
        tau : (n_sides, d, d) float64, force
            Balanced tractions, see `tractions.balanced_tractions`; still balanced afterwards.

        Notes
        -----
        Around a node the tractions of the sides through it minimise the energy of ``sigma_hat - sigma_h`` with the
        six rigid balances of each cell as constraints. Colours follow one another, so that the energy never rises.
        After a first visit to each star, those that gained most are visited again and again: near an edge where the
        stress is singular loads travel slowly from star to star, elsewhere one or two visits are enough. They then go
        `RELAXED` times as far, which costs nothing (successive over-relaxation by blocks; the energy falls for any
        factor below 2), but where the law of contact binds tractions no further than it lets them.

        Source
        ------
        Young 1954 (over-relaxation).

        Cost
        ----
        One Cholesky factor for each visit, of 9 unknowns a side in space (324 for 24 tetrahedra around a node), on one
        thread.
        """
        left = VISITS * self.n_used
        if self.gain is None:
            self.gain = np.zeros(self.mesh.n_stars)
            self._visit(np.ones(self.mesh.n_stars, bool), tau, 1.0)
            left -= self.n_used
        while left > 0:
            order = np.argsort(-self.gain, kind="stable")
            reached = np.cumsum(self.gain[order])
            if reached[-1] <= 0.0:
                return
            count = int(np.searchsorted(reached, BEST * reached[-1])) + 1
            count = min(max(count, int(SHARE * self.n_used), LEAST), left)
            chosen = np.zeros(self.mesh.n_stars, bool)
            chosen[order[:count]] = True
            self._visit(chosen, tau, RELAXED)
            left -= count

    def _visit(self, chosen: NDArray[np.bool_], tau: FloatArray, factor: float) -> None:
        """Improve the stars chosen, colour after colour."""
        for stars in self.colours:
            some = stars[chosen[stars]]
            for start in range(0, len(some), CHUNK):
                self._improve(some[start : start + CHUNK], tau, factor)

    def _improve(self, stars: IntArray, tau: FloatArray, factor: float, turn: int = 0) -> None:
        mesh, dim = self.mesh, self.mesh.dim
        block = dim * dim
        row, mine = _ranges(self.first_corner[stars], self.n_corners[stars])
        cells, corner = np.divmod(self.corners[mine], dim + 1)
        sides = others(dim)[corner]
        place = self.place[mesh.side[cells[:, None], sides], slots(dim)[sides, corner[:, None]]]
        sign = mesh.sign[cells]
        k = len(cells)
        each = np.arange(k)[:, None]

        jump = sign[..., None, None] * jumps(mesh, tau, self.stress, cells)
        full = energy_matrices(mesh, self.compliance, cells).reshape(k, dim + 1, block, dim + 1, block)
        full *= sign[:, :, None, None, None] * sign[:, None, None, :, None]
        H = full[each[..., None], sides[:, :, None], :, sides[:, None, :], :]
        rows = np.einsum("kaibj,kbj->kai", full, jump.reshape(k, dim + 1, block), optimize=True)
        if self.pull is not None:
            rows -= sign[..., None] * self.pull[cells].reshape(k, dim + 1, block)
        descent = -rows[each, sides]
        B = balance_rows(mesh, cells).reshape(k, -1, dim + 1, block) * sign[:, None, :, None]
        B = B[each, :, sides].swapaxes(2, 3)
        partial = np.flatnonzero(self.partly[mesh.side[cells[:, None], sides]].any(axis=1))
        if len(partial):
            self._project(mesh.side[cells[:, None], sides][partial], partial, H, B, descent)
        stiff = STOP * float(np.einsum("kaaii->", H)) / (k * dim * block)
        penalty = PENALTY if self.touching is None else np.where(self.touching[stars][row], PENALTY_PRESSED, PENALTY)
        weight = penalty * np.einsum("kaaii->k", H) / (B**2).sum(axis=(1, 2, 3))
        H += weight[:, None, None, None, None] * np.matmul(B[:, :, None], B[:, None].swapaxes(3, 4))

        size = int(self.n_sides[stars].max())
        A = np.zeros((len(stars), size, block, size, block))
        known = place >= 0
        passes = [(sign[each, sides][:, a] == s) & known[:, a] for a in range(dim) for s in (1.0, -1.0)]
        for n, rows_of in enumerate(passes):
            a, q = n // 2, np.flatnonzero(rows_of)
            for b in range(dim):
                both = q[known[q, b]]
                A[row[both], place[both, a], :, place[both, b], :] += H[both, a, b]
        count = self.n_sides[stars]
        s, p = np.nonzero(np.arange(size) >= count[:, None])
        A[s, p, :, p, :] += np.eye(block)
        here, mine = _ranges(self.first_side[stars], count)
        moved = self.sides[mine]
        at = np.arange(len(mine)) - np.repeat(np.cumsum(count) - count, count)
        half = np.flatnonzero(self.partly[moved])
        if len(half):
            fixed = np.kron(np.eye(dim), np.eye(dim) - self.free[moved[half]])
            A[here[half], at[half], :, at[half], :] += fixed * weight.mean()

        def gathered(values: FloatArray) -> FloatArray:
            total = np.zeros((len(stars), size, block))
            for n, rows_of in enumerate(passes):
                q = np.flatnonzero(rows_of)
                total[row[q], place[q, n // 2]] += values[q, n // 2]
            return total.reshape(len(stars), -1)

        start = gathered(descent)
        spring = None
        if self.limits is not None:
            start.reshape(len(stars), size, block)[here, at] -= self.limits.slide[moved].reshape(-1, block)
            spring = self._springs(tau, moved, here, at, stiff, turn)
            s, p = spring.star, spring.place
            at_rows = p[:, None] * dim + np.arange(dim)
            matrix = A.reshape(len(A), size * block, -1)
            np.add.at(matrix, (s[:, None, None], at_rows[:, :, None], at_rows[:, None, :]), spring.blocks)
            np.add.at(start.reshape(len(A), size * dim, dim), (s, p), spring.pull)
        push = np.zeros((k, B.shape[3]))
        right = start if spring is None else spring.pushed(start, dim)
        solve = _factored(A.reshape(len(stars), size * block, -1))
        turns = UZAWA_PRESSED if spring is not None and len(spring.row) else UZAWA
        for each_turn in range(turns):
            x = solve(right).reshape(len(stars), size, block)
            if each_turn == turns - 1:
                break
            local = np.where(known[..., None], x[row[:, None], place], 0.0)
            gap = np.einsum("kair,kai->kr", B, local)
            if turns > UZAWA and np.abs(gap).max() <= LEFT * np.abs(tau[moved]).max():
                break
            push += weight[:, None] * gap
            right = start - gathered(np.einsum("kair,kr->kai", B, push))
            if spring is not None:
                spring.tighten(x.reshape(len(stars), size * dim, dim))
                right = spring.pushed(right, dim)
        if turns > UZAWA:
            # corners that the law stops may be too many for the balance of the cells: such a star is left as it is
            local = np.where(known[..., None], x[row[:, None], place], 0.0)
            gap, worst = np.abs(np.einsum("kair,kai->kr", B, local)).max(axis=1), np.zeros(len(stars))
            np.maximum.at(worst, row, gap)
            x[worst > LOST * np.abs(tau[moved]).max()] = 0.0
        change = x[here, at].reshape(-1, dim, dim)
        if spring is None:
            tau[moved] += factor * change
        else:
            self._within(stars, tau, moved, here, change, spring, factor, turn)
        if self.gain is not None:
            self.gain[stars] = np.maximum((x.reshape(start.shape) * start).sum(axis=1), 0.0)

    def _within(
        self,
        stars: IntArray,
        tau: FloatArray,
        moved: IntArray,
        star: IntArray,
        change: FloatArray,
        spring: _Springs,
        factor: float,
        turn: int,
    ) -> None:
        """Change the tractions as far as the law lets them; stars that it stops are solved again, pushed back."""
        assert self.limits is not None
        full = np.full(len(stars), factor)
        full[spring.star] = 1.0
        least = np.ones(len(stars))
        np.minimum.at(least, star, self.limits.step(tau[moved], full[star, None, None] * change, moved))
        again = least < 1.0
        again[spring.star[spring.force < 0]] = True
        if turn == ROUNDS - 1:
            again[:] = False
        step = np.where(again, 0.0, full * least)
        if again.any():
            rows = again[star]
            sides = moved[rows]
            self.ahead[sides] = tau[sides] + change[rows]
            force = np.zeros((len(moved), 2, tau.shape[1]))
            force[spring.row, spring.kind, spring.corner] = spring.force
            self.pushed[sides] = force[rows]
        tau[moved] += step[star, None, None] * change
        if again.any():
            gain, self.gain = self.gain, None
            self._improve(stars[again], tau, 1.0, turn + 1)
            self.gain = gain

    def _springs(
        self, tau: FloatArray, moved: IntArray, star: IntArray, place: IntArray, stiff: float, turn: int
    ) -> _Springs:
        """Put a spring on each corner that is at its limit, would leave the law, or that the last ones pushed back.

        Where friction is at its bound g the multiplier p of ``|R_t| <= g`` also resists turning, with p / g.
        """
        assert self.limits is not None
        dim = self.mesh.dim
        seen = self.ahead[moved] if turn else tau[moved]
        known = self.pushed[moved] if turn else np.zeros((len(moved), 2, dim))
        row, corner, kind, n, over = self.limits.passed(seen, moved, known > 0 if turn else None)
        normal = self.limits.normal[moved[row]]
        ahead = (seen - tau[moved])[row, corner]
        force = known[row, kind, corner]
        guess = np.maximum(-np.einsum("si,si->s", n, self.limits.slide[moved][row, corner]), 0.0)
        force = np.where(force > 0, force, np.where(kind == 1, guess, 0.0))
        size = np.einsum("si,si->s", n, seen[row, corner])
        bend = np.where(kind == 1, force / np.maximum(size, np.finfo(float).tiny), 0.0)
        across = np.eye(dim) - n[:, :, None] * n[:, None, :] - normal[:, :, None] * normal[:, None, :]
        turning = bend[:, None, None] * across
        blocks = stiff * n[:, :, None] * n[:, None, :] + turning
        pull = np.einsum("sij,sj->si", turning, ahead)
        over = over - np.einsum("si,si->s", n, ahead)
        spot = place[row] * dim + corner
        return _Springs(row, corner, kind, star[row], spot, n, over, stiff, force, blocks, pull)

    def _project(self, sides: IntArray, partial: IntArray, H: FloatArray, B: FloatArray, descent: FloatArray) -> None:
        """Keep the directions that are free on sides where only some are."""
        P = np.kron(np.eye(self.mesh.dim), self.free[sides])
        H[partial] = np.einsum("kaij,kabjl,kblm->kabim", P, H[partial], P, optimize=True)
        B[partial] = np.matmul(P, B[partial])
        descent[partial] = np.einsum("kaij,kaj->kai", P, descent[partial])


def _ranges(first: IntArray, count: IntArray) -> tuple[IntArray, IntArray]:
    """Expand ranges: the number of the range of each entry, and the entry."""
    which = np.repeat(np.arange(len(first)), count)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + first[which]


def _factored(A: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Factorise symmetric positive definite matrices one by one, in place."""
    from scipy.linalg import LinAlgError
    from scipy.linalg.lapack import dpotrf, dpotrs

    factors = []
    for each in A:
        factor, info = dpotrf(each.T, lower=True, overwrite_a=True, clean=False)
        if info:
            raise LinAlgError(f"minor {info} of a star is not positive")
        factors.append(factor)

    def solve(right: FloatArray) -> FloatArray:
        return np.asarray([dpotrs(f, b, lower=True)[0] for f, b in zip(factors, right, strict=True)], np.float64)

    return solve
