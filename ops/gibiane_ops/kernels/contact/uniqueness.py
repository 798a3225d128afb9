"""Whether another start leads to another solution."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.errors import ContactUnbalanced, NotConverged

SAME = 1e-6
"""Largest difference of forces, over the largest force or condensed load, of two states that are one solution."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """What other starts lead to.

    Attributes
    ----------
    unique : bool
        No start leads to another solution. Solutions that no start finds may exist all the same.
    difference : float
        Largest difference of forces, over the largest force or condensed load.
    others : list of ContactState
        Solutions that differ.
    """

    unique: bool
    difference: float
    others: list[ContactState]


def compare_starts(
    interface: Interface,
    mu: float | FloatArray | Friction,
    state: ContactState,
    *,
    slip_origin: FloatArray | None = None,
) -> Comparison:
    """Solve again from the tied bodies, from contact without friction and half-way to what these find, and compare.

    Parameters
    ----------
    interface : Interface
    mu : float, (n,) float64 or Friction
    state : ContactState
    slip_origin : (n, d - 1) float64, optional

    Returns
    -------
    Comparison

    Notes
    -----
    Coulomb solutions are unique for small coefficients only. A start that does not converge says nothing and is left
    out.

    Source
    ------
    Hild 2004, Quarterly Journal of Mechanics and Applied Mathematics 57; Renard 2006, SIAM J. Math. Anal. 38.

    Cost
    ----
    Three contact solutions on the condensed interface, and one more for each other solution found.
    """
    starts: list[ContactState | None] = [None]
    scale = max(float(np.abs(state.r).max(initial=0)), interface.force_scale) or 1.0
    try:
        starts.append(solve_coulomb(interface, 0.0))
    except (NotConverged, ContactUnbalanced) as failure:
        if isinstance(failure.best, ContactState):
            starts.append(failure.best)
    met = [state]
    worst, place = 0.0, 0
    while place < len(starts):
        start = starts[place]
        place += 1
        try:
            found = solve_coulomb(interface, mu, start=start, slip_origin=slip_origin)
        except (NotConverged, ContactUnbalanced):
            continue
        differences = [float(np.abs(found.r - other.r).max(initial=0)) / scale for other in met]
        worst = max(worst, differences[0])
        if min(differences) > SAME:
            # between two stable solutions there may be an unstable one
            starts.append(replace(found, w=(found.w + state.w) / 2, r=(found.r + state.r) / 2))
            met.append(found)
    others = met[1:]
    return Comparison(not others, worst, others)
