"""How good an estimate is when the true error is known, and exact energies from a sequence of meshes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray


class Effectivity(NamedTuple):
    """Quality of an estimate.

    Attributes
    ----------
    theta : float
        Estimate over true error.
    deviation : float
        Scatter of the same ratio over the elements, relative to its mean; 0 when it is uniform.
    """

    theta: float
    deviation: float


def effectivity(estimate: FloatArray, true: FloatArray) -> Effectivity:
    """Compare squared errors of elements.

    Parameters
    ----------
    estimate, true : (m,) float64, energy

    Returns
    -------
    Effectivity
        NaN where there is no true error.

    Notes
    -----
    ``SD^2 = mean (1 - theta_E / mean theta)^2`` over the elements whose true error is not zero. An estimate is called
    reliable when ``0.8 <= theta <= 1.2`` and ``SD <= 0.2``.

    Source
    ------
    Zhong 1991.
    """
    total = float(true.sum())
    if total <= 0.0:
        return Effectivity(float("nan"), float("nan"))
    some = true > 1e-14 * true.max()
    local = np.sqrt(estimate[some] / true[some])
    mean = float(local.mean())
    scatter = float(np.sqrt(((1 - local / mean) ** 2).mean())) if mean > 0 else float("nan")
    return Effectivity(float(np.sqrt(estimate.sum() / total)), scatter)
