"""The contact problem reduced to the relative displacements of the pairs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue

BoolArray = NDArray[np.bool_]

FREE_LIMIT = 1e-9
"""A relative motion is free when its stiffness is below this fraction of the mean diagonal of S."""


@dataclass(frozen=True, eq=False)
class Interface:
    """Condensed equilibrium ``S w = f + r`` of the contact pairs, for any law, coefficient and method.

    Attributes
    ----------
    S : (n d, n d) float64, force / length
        Symmetric, positive semidefinite; rows of one pair are (n, t1 (, t2)). Rows of inactive components are those of
        a detached spring of stiffness ``kref``.
    f : (n d,) float64, force
        Condensed load; ``-f`` is the reaction of tied bodies.
    gap : (n,) float64, length
        Initial distance along the normal, not negative.
    frames : (n, d, d) float64
        Rows n, t1 (, t2) of each pair in global axes.
    active : (n, d) bool
        Components that can vary; a pair whose normal is not active carries no force.
    rigid : (n d, k) float64
        Orthonormal basis of the relative rigid motions that no support holds; ``S @ rigid = 0``.
    kref : float, force / length
        Mean of the active diagonal of S, the natural stiffness of the interface.
    expander : callable
        Gives the whole displacement field from w, or None when the interface was not condensed from a mesh.
    """

    S: FloatArray
    f: FloatArray
    gap: FloatArray
    frames: FloatArray
    active: BoolArray
    rigid: FloatArray
    kref: float
    expander: Callable[[FloatArray], FloatArray] | None = None

    @property
    def n_pairs(self) -> int:
        """Number of pairs."""
        return len(self.gap)

    @property
    def dim(self) -> int:
        """Number of components of a pair."""
        return int(self.active.shape[1])

    @property
    def force_scale(self) -> float:
        """Largest entry of the condensed load, or the force that closes the largest overlap if this is more."""
        return float(max(np.abs(self.f).max(initial=0.0), self.kref * (-self.gap).max(initial=0.0)))

    @property
    def length_scale(self) -> float:
        """Relative displacement that ``force_scale`` gives to the stiffness ``kref``."""
        return self.force_scale / self.kref

    def working_force(self, slip_origin: FloatArray | None) -> float:
        """Give ``force_scale``; without a load, the force that earlier slips can keep: a released body has no other."""
        earlier = 0.0 if slip_origin is None else float(np.abs(slip_origin).max(initial=0))
        return self.force_scale or self.kref * earlier

    def to_global(self, local: FloatArray) -> FloatArray:
        """Turn (n, d) local components into global ones."""
        return np.asarray(np.einsum("nij,ni->nj", self.frames, local))

    def expand(self, w: FloatArray) -> FloatArray:
        """Compute the displacement of every node from the relative displacements.

        Parameters
        ----------
        w : (n, d) float64, length
            Local components.

        Returns
        -------
        (n_dofs,) float64

        Raises
        ------
        BadValue
            When the interface was not condensed from a mesh.

        Cost
        ----
        One solution with the tied matrix.
        """
        if self.expander is None:
            raise BadValue("interface", "a bare matrix", "an interface condensed from a mesh")
        return self.expander(w)
