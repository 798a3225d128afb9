"""Sizes that a user wants of elements: a number, a field of lengths or of metrics, read and checked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels.adapt.sizes import predicted_count
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.memory import available_memory
from gibiane_ops.kernels.topology import Block
from gibiane_ops.values.champs import ChPoint

BYTES_OF_AN_ELEMENT = 1000.0
"""Memory of a tetrahedron while gmsh meshes, measured: 1050 for 185 000 of them, 1470 for 67 000."""

Size = float | ChPoint | None


def sizes_at(ctx: Context, size: Size, nodes: IntArray, at: str = "size") -> float | FloatArray | None:
    """Return wanted edge lengths at nodes: one number, or the values of a field of component SCAL (length) or G.

    Raises
    ------
    GibianeError
        41 for a size that is not positive, 181 for a field of other components or that misses nodes.
    """
    if size is None:
        return None
    if not isinstance(size, ChPoint):
        if not size > 0:
            ctx.fail(41, "a size is a length: {value} cannot be one", at=at, value=size)
        return float(size)
    name = next((n for n in ("SCAL", "G") if n in size.names), None)
    if name is None:
        if {"G11", "G22"} & set(size.names):
            ctx.fail(
                251,
                "sizes that depend on the direction (components {names}) are not available",
                at=at,
                names=" ".join(size.names),
                hint="a field SCAL holds edge lengths, a field G their square inverses",
            )
        ctx.fail(
            181,
            "a field of sizes has the component SCAL (edge length) or G (its square inverse), not {names}",
            at=at,
            names=" ".join(size.names) or "none",
        )
    values = _everywhere(ctx, size, name, nodes, at)
    if not (values > 0).all():
        ctx.fail(41, "a size is a length: {value} cannot be one", at=at, value=f"{values.min() + 0.0:.6g}")
    return values if name == "SCAL" else np.asarray(values**-0.5, np.float64)


def _everywhere(ctx: Context, size: ChPoint, name: str, nodes: IntArray, at: str) -> FloatArray:
    """Return the values of a component at nodes, all of which must have one."""
    missing = np.setdiff1d(nodes, size.parts[name][0])
    if len(missing):
        ctx.fail(
            181,
            "the field of sizes has no value at {count} of {total} nodes",
            at=at,
            count=len(missing),
            total=len(nodes),
            hint="it must cover the whole mesh: MANU 'CHPO' or TAILLE make such a field",
        )
    return size.at(name, nodes)


METRIC = {2: ("G11", "G21", "G22"), 3: ("G11", "G21", "G22", "G31", "G32", "G33")}
"""Components of a metric by dimension: the rows of the lower triangle."""


def metric_at(ctx: Context, size: Size, nodes: IntArray, dim: int) -> FloatArray | None:
    """Return the metrics at nodes, (n, dim, dim), of a field that holds them (components G11 G21 G22 ...), else None.

    Raises
    ------
    GibianeError
        181 for a field without all the components, or that misses nodes; 41 for a metric that is not positive.
    """
    if not isinstance(size, ChPoint) or not {"G11", "G22"} & set(size.names):
        return None
    wanted = METRIC[dim]
    if not set(wanted) <= set(size.names):
        ctx.fail(
            181,
            "a metric has the components {wanted}, not {names}",
            at="size",
            wanted=" ".join(wanted),
            names=" ".join(size.names),
            hint="TAILLE 'METRIQUE' makes such a field",
        )
    result = np.zeros((len(nodes), dim, dim))
    for name in wanted:
        i, j = int(name[1]) - 1, int(name[2]) - 1
        result[:, i, j] = result[:, j, i] = _everywhere(ctx, size, name, nodes, "size")
    finite = np.isfinite(result).all(axis=(1, 2), keepdims=True)
    bad = np.linalg.eigvalsh(np.where(finite, result, 0.0))[:, 0] <= 0
    if bad.any():
        ctx.fail(
            41,
            "a metric has positive lengths in every direction: that of {count} nodes has not",
            at="size",
            count=int(bad.sum()),
            hint="G11 G22 - G21**2 and G11 are above 0; a size h in every direction is G11 = G22 = 1/h**2"
            if dim == 2
            else "a size h in every direction is G11 = G22 = G33 = 1/h**2",
        )
    return result


def refuse_too_many(
    ctx: Context, points: FloatArray, blocks: Sequence[Block], sizes: float | FloatArray, at: str = "size"
) -> None:
    """Refuse sizes that ask for more elements than the memory holds: a mesher would not come back.

    Raises
    ------
    GibianeError
        G414 with the number of elements.
    """
    nodal = np.broadcast_to(np.asarray(sizes, np.float64), len(points))
    with np.errstate(over="ignore", divide="ignore"):
        count = predicted_count(points, blocks, nodal)
    count = min(count, 1e300)
    needed = count * BYTES_OF_AN_ELEMENT
    if needed > available_memory():
        ctx.fail(
            "G414",
            "sizes down to {least} ask for about {count} elements, which would take {needed} of memory",
            at=at,
            least=f"{nodal.min():.3g}",
            count=f"{count:.2g}",
            needed=f"{needed / 1e9:.2g} GB",
            hint="larger sizes; TAILLE bounds the number of elements with 'NBMA'",
        )
