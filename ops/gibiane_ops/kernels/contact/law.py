"""Friction laws of the pairs: Coulomb, Tresca, cohesion, adhesion, elastic slip and Norton-Hoff, as one map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.cone import norms, orthogonal_projection
from gibiane_ops.kernels.errors import BadValue, UnsupportedLaw

BoolArray = NDArray[np.bool_]

TINY, HUGE = float(np.finfo(float).tiny), float(np.finfo(float).max)

_NORTON_STEPS = 60
"""Newton steps of the scalar equation of Norton-Hoff; monotone and convex, some ten are needed."""


@dataclass(frozen=True, eq=False)
class Friction:
    """Friction of each pair, in nodal forces: a stress is multiplied by the share of area of the node beforehand.

    Attributes
    ----------
    mu : (n,) float64
        Friction coefficients, not negative, infinity allowed.
    cohesion : (n,) float64, force
        Added to ``mu abs(r_n)``; alone (mu = 0) it is Tresca's bound.
    slip_stiffness : (n,) float64, force / length
        Elastic slip ``abs(r_t) / slip_stiffness`` below the bound; infinity for a pair that sticks exactly.
    exponent : (n,) float64
        0 for Coulomb's threshold; p in (0, 1] for Norton-Hoff ``abs(r_t) = bound (abs(w_t) / slip_scale)^p``.
    slip_scale : (n,) float64, length
        Slip at which Norton-Hoff's force reaches the bound.
    adhesion : (n,) float64, force
        Tension that a pair in contact at the start withstands; beyond it the pair comes off for good.
    when_open : bool
        The bound holds on open pairs too: Tresca's problem of minimum, convex. Otherwise friction needs contact.

    Notes
    -----
    One law for all: ``-(w_t - origin) = r_t / slip_stiffness + slip``, slip parallel to ``-r_t``, zero when
    ``abs(r_t) < bound``, with ``bound = mu abs(r_n) + cohesion`` (threshold), or ``slip = slip_scale (abs(r_t) /
    bound)^(1/p)`` (Norton-Hoff).

    Source
    ------
    Oden and Pires 1983, J. Appl. Mech. 50 (regularised and power laws); Kikuchi and Oden 1988, Contact Problems in
    Elasticity.
    """

    mu: FloatArray
    cohesion: FloatArray
    slip_stiffness: FloatArray
    exponent: FloatArray
    slip_scale: FloatArray
    adhesion: FloatArray
    when_open: bool = False

    @staticmethod
    def of(n: int, given: float | FloatArray | Friction) -> Friction:
        """Make the law of n pairs from a coefficient, one per pair, or a law.

        Raises
        ------
        BadValue
            When a coefficient is negative or undefined.
        """
        if isinstance(given, Friction):
            return given
        return friction(n, mu=given)

    @property
    def is_coulomb(self) -> bool:
        """Whether the law is Coulomb's alone."""
        return not (self.cohesion.any() or self.adhesion.any() or self.exponent.any() or self.is_elastic)

    @property
    def is_elastic(self) -> bool:
        """Whether a pair has elastic slip."""
        return bool(np.isfinite(self.slip_stiffness).any())

    @property
    def rubs(self) -> BoolArray:
        """Pairs with some friction, (n,)."""
        return np.asarray((self.mu > 0) | (self.cohesion > 0))

    def need_coulomb(self, method: str, *, cohesion: bool = False) -> None:
        """Raise UnsupportedLaw unless the law is Coulomb's, with cohesion or not.

        Raises
        ------
        UnsupportedLaw
        """
        plain = replace(self, cohesion=np.zeros_like(self.mu)) if cohesion else self
        if not plain.is_coulomb:
            raise UnsupportedLaw(method, "Coulomb's law" + (" with cohesion" if cohesion else ""))

    def need_no_adhesion(self, method: str) -> None:
        """Raise UnsupportedLaw when the law has adhesion.

        Raises
        ------
        UnsupportedLaw
        """
        if self.adhesion.any():
            raise UnsupportedLaw(method, "laws without adhesion")

    def shared(self, middle: IntArray, kept: IntArray) -> Friction:
        """Keep some pairs; what the middles of sides bear by their area goes to the ends, half and half.

        Parameters
        ----------
        middle : (k, 3) int64
            Positions of pairs that are not kept, and of the two ends of their side.
        kept : (n,) int64
        """

        def moved(values: FloatArray) -> FloatArray:
            total = values.copy()
            np.add.at(total, middle[:, 1:], values[middle[:, :1]] / 2)
            return total[kept]

        return replace(
            self,
            mu=self.mu[kept],
            cohesion=moved(self.cohesion),
            slip_stiffness=moved(self.slip_stiffness),
            exponent=self.exponent[kept],
            slip_scale=self.slip_scale[kept],
            adhesion=moved(self.adhesion),
        )

    def scaled(self, force: float, length: float) -> Friction:
        """Write the law in units of a force and a length."""
        return replace(
            self,
            cohesion=self.cohesion / force,
            slip_stiffness=self.slip_stiffness * length / force,
            slip_scale=self.slip_scale / length,
            adhesion=self.adhesion / force,
        )

    def bound(self, normal: FloatArray, bonded: BoolArray | None = None) -> FloatArray:
        """Compute the largest friction force, (n,), for normal forces that are negative in compression."""
        compression = np.maximum(-normal, 0.0)
        slope = np.multiply(self.mu, compression, out=np.zeros_like(compression), where=compression > 0)
        closed = compression > 0
        if bonded is not None:
            # in tension a bonded pair loses friction: mu N + cohesion with N < 0
            slope = np.where(bonded & ~closed, -np.minimum(self.mu, 1e30) * np.maximum(normal, 0.0), slope)
            closed = closed | bonded
        if self.when_open:
            closed = np.ones_like(closed)
        return np.where(closed, np.maximum(slope + self.cohesion, 0.0), 0.0)

    def length(self, t: FloatArray, bound: FloatArray, gamma: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Solve ``s + gamma slip(s) = t`` for the friction force s, with its derivatives by t and by the bound.

        Parameters
        ----------
        t : (n,) float64, force, not negative
            Length of ``r_t - gamma w_t``.
        bound : (n,) float64, force
        gamma : float, force / length

        Returns
        -------
        s, ds_dt, ds_dbound : (n,) float64
        """
        soft = 1 / (1 + gamma / self.slip_stiffness)
        elastic = soft * t
        stick = elastic <= bound
        s = np.where(stick, elastic, bound)
        by_t = np.where(stick, soft, 0.0)
        by_bound = np.where(stick, 0.0, 1.0)
        norton = (self.exponent > 0) & (bound > 0) & (t > 0) & np.isfinite(bound)
        if norton.any():
            s[norton], by_t[norton], by_bound[norton] = _norton(
                t[norton],
                bound[norton],
                gamma * self.slip_scale[norton],
                1 / self.exponent[norton],
                soft[norton],
            )
        return s, by_t, by_bound

    def slip_of(self, w_t: FloatArray, r_t: FloatArray) -> FloatArray:
        """Take the elastic part off a relative displacement, (n, d - 1)."""
        return np.asarray(w_t + r_t / self.slip_stiffness[:, None])

    def nearest_possible(self, r: FloatArray) -> FloatArray:
        """Find the nearest force of a cone that holds every admissible force of the law.

        Parameters
        ----------
        r : (n, d) float64

        Returns
        -------
        (n, d) float64

        Notes
        -----
        Coulomb: the cone itself. Cohesion and adhesion shift its apex; Norton-Hoff has no bound.
        """
        mu = np.where(self.exponent > 0, 1e6, np.minimum(self.mu, 1e6))
        shift = self.adhesion + np.divide(self.cohesion, mu, out=np.zeros_like(mu), where=mu > 0)
        moved = r.copy()
        moved[:, 0] -= shift
        found = orthogonal_projection(moved, mu)
        found[:, 0] += shift
        tresca = mu == 0
        if tresca.any():
            size = norms(r[tresca, 1:])
            bound = self.cohesion[tresca]
            cut = np.divide(bound, size, out=np.ones_like(size), where=size > bound)
            found[tresca] = np.column_stack([np.minimum(r[tresca, 0], shift[tresca]), cut[:, None] * r[tresca, 1:]])
        return found


def friction(
    n: int,
    *,
    mu: float | FloatArray = 0.0,
    cohesion: float | FloatArray = 0.0,
    slip_stiffness: float | FloatArray = np.inf,
    exponent: float | FloatArray = 0.0,
    slip_scale: float | FloatArray = 1.0,
    adhesion: float | FloatArray = 0.0,
    when_open: bool = False,
) -> Friction:
    """Make the law of n pairs, each property a number or one per pair.

    Parameters
    ----------
    n : int
    mu, cohesion, slip_stiffness, exponent, slip_scale, adhesion : float or (n,) float64
    when_open : bool
        See ``Friction``.

    Returns
    -------
    Friction

    Raises
    ------
    BadValue
        When a property is out of its range.
    """
    return Friction(
        mu=_column(n, "friction coefficient", mu, "mu >= 0", low=0.0, high=np.inf),
        cohesion=_column(n, "cohesion", cohesion, "a finite cohesion >= 0", low=0.0),
        slip_stiffness=_column(n, "slip stiffness", slip_stiffness, "slip stiffness > 0", low=TINY, high=np.inf),
        exponent=_column(n, "exponent", exponent, "0 <= exponent <= 1", low=0.0, high=1.0),
        slip_scale=_column(n, "slip scale", slip_scale, "a finite slip scale > 0", low=TINY),
        adhesion=_column(n, "adhesion", adhesion, "a finite adhesion >= 0", low=0.0),
        when_open=when_open,
    )


def joined_laws(laws: Sequence[Friction]) -> Friction:
    """Put the laws of several sets of pairs one after the other.

    Parameters
    ----------
    laws : sequence of Friction

    Returns
    -------
    Friction
    """
    return Friction(
        mu=np.concatenate([law.mu for law in laws]),
        cohesion=np.concatenate([law.cohesion for law in laws]),
        slip_stiffness=np.concatenate([law.slip_stiffness for law in laws]),
        exponent=np.concatenate([law.exponent for law in laws]),
        slip_scale=np.concatenate([law.slip_scale for law in laws]),
        adhesion=np.concatenate([law.adhesion for law in laws]),
        when_open=any(law.when_open for law in laws),
    )


def _column(n: int, what: str, value: float | FloatArray, limit: str, *, low: float, high: float = HUGE) -> FloatArray:
    """Give one value per pair, refusing those out of range and undefined ones."""
    column = np.broadcast_to(np.asarray(value, dtype=np.float64), n).copy()
    bad = ~((column >= low) & (column <= high))
    if bad.any():
        raise BadValue(what, float(column[bad][0]), limit)
    return column


def _norton(
    t: FloatArray, bound: FloatArray, reach: FloatArray, q: FloatArray, soft: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Solve ``s / soft + reach (s / bound)^q = t`` in x = s / bound; the left side is increasing and convex."""
    a = bound / soft
    # both terms are below t: the smaller bound of the two is above the root, and Newton descends to it
    x = np.minimum(t / a, (t / reach) ** (1 / q))
    for _ in range(_NORTON_STEPS):
        rest = a * x + reach * x**q - t
        step = rest / (a + reach * q * x ** (q - 1))
        x = x - step
        if (np.abs(step) <= 1e-15 * x).all():
            break
    slope = a + reach * q * x ** (q - 1)
    # at constant t: a'(bound) x + slope dx = 0 with a = bound / soft, and s = bound x
    by_bound = x - bound * (x / soft) / slope
    return bound * x, bound / slope, by_bound
