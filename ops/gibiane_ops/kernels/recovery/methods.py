"""The smoothings by their names."""

from __future__ import annotations

from collections.abc import Sequence

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.recovery.averages import mean_of_centres, mean_of_nodes, project
from gibiane_ops.kernels.recovery.blocks import Recovered, StressBlock
from gibiane_ops.kernels.recovery.patches import patch_recovery

METHODS = ("MOYE", "MOYC", "PROJ", "LUMP", "SPR", "FULL")


def recover(
    points: FloatArray, blocks: Sequence[StressBlock], method: str = "SPR", degree: int | None = None
) -> Recovered:
    """Smooth the stresses of one solid by a named method.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    blocks : list of StressBlock
    method : {'MOYE', 'MOYC', 'PROJ', 'LUMP', 'SPR', 'FULL'}
        Nodal mean of extrapolated or of centre values, L2 projection (consistent or lumped), patch recovery
        with complete polynomials or with the functions of the elements.
    degree : int, optional
        Highest degree of the patches; that of the elements if absent.

    Returns
    -------
    Recovered

    Raises
    ------
    BadValue
        Unknown method.
    NotConverged
        PROJ only.
    """
    match method:
        case "MOYE":
            return Recovered(mean_of_nodes(len(points), blocks))
        case "MOYC":
            return Recovered(mean_of_centres(len(points), blocks))
        case "PROJ" | "LUMP":
            return Recovered(project(points, blocks, lumped=method == "LUMP"))
        case "SPR":
            return patch_recovery(points, blocks, degree)
        case "FULL":
            return patch_recovery(points, blocks, degree, full=True)
        case _:
            raise BadValue("method", method, f"one of {' '.join(METHODS)}")
