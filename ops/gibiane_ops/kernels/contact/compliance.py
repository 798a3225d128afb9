"""The dense stiffness of the pairs and what follows from it, exact or approximate and then improving."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.interface import FREE_LIMIT

BoolArray = NDArray[np.bool_]

NEGLIGIBLE = 1e-6
"""An error of the force that does less work on the motion, over the product of their sizes, is not learned from."""

ROUND_OFF = 1e-12
"""Nor is one that is smaller than this share of the force."""

TRUST = 10.0
"""Nor is one that is smaller than this many times the error of the solution that it comes from."""


@dataclass(frozen=True, eq=False)
class PairStiffness:
    """Stiffness of the pairs.

    Attributes
    ----------
    S : (n d, n d) float64
        See ``Interface``.
    kref : float
    rigid : (n d, k) float64
        See ``Interface``.
    exact : bool
    """

    S: FloatArray
    kref: float
    rigid: FloatArray
    exact: bool

    @staticmethod
    def of(
        S: FloatArray, active: BoolArray, elastic: float, candidates: FloatArray, energy: FloatArray, *, exact: bool
    ) -> PairStiffness:
        """Complete a stiffness by its mean diagonal and its free motions.

        Parameters
        ----------
        S : (n d, n d) float64
            Changed: rows of inactive components become detached springs.
        active : (n, d) bool
        elastic : float
            Mean diagonal of the stiffness of the bodies, the reference when every relative motion is free.
        candidates : (n d, k) float64
            Orthonormal; free motions are among their combinations.
        energy : (k, k) float64
            Twice the strain energy of the candidates, ``candidates.T @ S @ candidates`` with the exact S.
        exact : bool
            An approximate S is made to vanish on the free motions.
        """
        kref = _natural_stiffness(S, active, elastic)
        inactive = np.flatnonzero(~active.ravel())
        S[inactive, inactive] = kref
        values, vectors = np.linalg.eigh(energy)
        rigid = np.asarray(candidates @ vectors[:, values < FREE_LIMIT * kref])
        if not exact and rigid.shape[1]:
            S = S - rigid @ (rigid.T @ S)
            S = S - (S @ rigid) @ rigid.T
        return PairStiffness(S, kref, rigid, exact)

    def still(self, force: FloatArray) -> FloatArray:
        """Remove the part along the free motions, on which ``S w`` does no work."""
        return np.asarray(force - self.rigid @ (self.rigid.T @ force))

    def learned(self, dw: FloatArray, dy: FloatArray, noise: float = 0.0) -> PairStiffness:
        """Make ``S dw = dy`` by a symmetric change of rank one (SR1).

        Parameters
        ----------
        dw, dy : (n d,) float64
            A change of w and that of ``S w`` with the exact S.
        noise : float, force
            Norm of what may be wrong with dy.

        Notes
        -----
        With d the error of ``S dw``, ``S - d d^T / (d . dw)``. A Galerkin model is too stiff, so that d . dw > 0, and
        the change keeps it too stiff or exact: S stays positive semidefinite and decreases towards the exact one.
        """
        # rigid motions carry no information, and much round-off where the body slides far
        dw = self.still(dw)
        d = self.still(self.S @ dw - dy)
        work, size = float(d @ dw), float(np.linalg.norm(d) * np.linalg.norm(dw))
        if float(np.linalg.norm(d)) <= TRUST * noise:
            return self
        if work <= NEGLIGIBLE * size or size <= ROUND_OFF * float(np.linalg.norm(dy) * np.linalg.norm(dw)):
            return self
        return replace(self, S=self.S - np.outer(d, d / work))


def _natural_stiffness(S: FloatArray, active: BoolArray, elastic: float) -> float:
    """Average the active diagonal of S, or that of the bodies when every relative motion is rigid."""
    if not active.any():
        return 1.0
    mean = float(np.diag(S)[active.ravel()].mean())
    return mean if mean > FREE_LIMIT * elastic else elastic
