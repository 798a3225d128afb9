"""What the operators that choose the next mesh read: a map of errors, a prescribed error, nodes at one place."""

from __future__ import annotations

import numpy as np

from gibiane.registry import Context
from gibiane_ops.values.champs import MChaml
from gibiane_ops.values.material import on_zone
from gibiane_ops.values.modele import ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray


def error_map(ctx: Context, field: MChaml, zones: list[ModelZone]) -> FloatArray:
    """Return the error of each element, (n_cells,), through the zones.

    Raises
    ------
    GibianeError
        236 when the component cannot be chosen, 1012 for numbers that are not finite, 41 for negative ones.
    """
    name = "TOTA" if "TOTA" in field.names else field.names[0] if len(field.names) == 1 else None
    if name is None:
        ctx.fail(
            236,
            "the map has neither one component nor a component TOTA; it has {known}",
            at="carte",
            known=" ".join(field.names) or "none",
        )
    found = np.concatenate([on_zone(ctx, field, z, "carte").component(name).mean(axis=1) for z in zones])
    if not np.isfinite(found).all():
        ctx.fail(
            1012,
            "the map holds {count} values that are no numbers (NaN or infinite)",
            at="carte",
            count=int((~np.isfinite(found)).sum()),
            hint="they come from the stress: MAXI and MINI of each component show where",
        )
    if (found < 0).any():
        ctx.fail(
            41,
            "an error is not negative: {count} values of the map are, down to {least}",
            at="carte",
            count=int((found < 0).sum()),
            least=f"{found.min():.3g}",
        )
    return found


def prescribed(ctx: Context, prec: float | None) -> float:
    """Return the prescribed error that a keyword 'PREC' gives.

    Raises
    ------
    GibianeError
        7 when it is missing, 41 when it is not positive.
    """
    if prec is None:
        ctx.fail(7, "the prescribed error is missing", hint="'PREC' 0.05 for 5 percent")
    if not prec > 0:
        ctx.fail(
            41,
            "the prescribed error is {value}: it must be above 0",
            at="prec",
            value=prec,
            hint="a relative error, e.g. 'PREC' 0.05 for 5 percent",
        )
    return prec


def refuse_no_elements(ctx: Context, nbma: float | None) -> None:
    """Fail with 41 when a largest number of elements (keyword 'NBMA') is not positive."""
    if nbma is not None and not nbma > 0:
        ctx.fail(41, "the largest number of elements is {value}: it must be above 0", at="nbma", value=nbma)


def coincident(points: FloatArray) -> IntArray | None:
    """Return the pairs of nodes at one place (the two sides of a contact), (k, 2), or None."""
    from scipy.spatial import cKDTree

    reach = 1e-9 * float(np.ptp(points, axis=0).max())
    pairs = cKDTree(points).query_pairs(reach, output_type="ndarray")
    return pairs.astype(np.int64) if len(pairs) else None
