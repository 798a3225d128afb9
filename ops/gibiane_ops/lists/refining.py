"""RAFF: lists with more places between their values."""

from __future__ import annotations

import numpy as np

from gibiane.forms import Arg
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, ENTIER, FLOTTANT, LISTREEL, MAILLAGE
from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.listes import ListReel
from gibiane_ops.values.maillage import Maillage

RAFF = operator(
    "RAFF",
    topic="lists",
    summary="list with more places between its values",
    notice="`L2 = RAFF L1 N`: each interval of a LISTREEL is cut into N equal ones; `RAFF L1 x`: into as many "
    "equal ones as leave none longer than x. The values of L1 stay.",
    example="L = RAFF (PROG 0. 1. 3.) 2 ; LIST L ; L = RAFF (PROG 0. 1. 3.) 0.5 ; MESS (DIME L) ;",
    see=["PROGRESSION", "REMAILLER"],
)


def _cut(values: ListReel, counts: IntArray) -> ListReel:
    x = values.values
    if len(x) < 2:
        return ListReel(x)
    starts = np.repeat(x[:-1], counts)
    steps = np.repeat(np.diff(x) / counts, counts)
    rank = np.arange(len(starts)) - np.repeat(np.cumsum(counts) - counts, counts)
    return ListReel(np.concatenate([starts + rank * steps, x[-1:]]))


@RAFF.form(Arg("values", LISTREEL, "list"), Arg("n", ENTIER, "parts of each interval"), gives=[LISTREEL])
def _by_count(ctx: Context, values: ListReel, n: int) -> ListReel:
    if n < 1:
        ctx.fail(36, "an interval is cut into 1 part or more, not {count}", at="n", count=n)
    return _cut(values, np.full(max(len(values.values) - 1, 0), n, np.int64))


@RAFF.form(Arg("values", LISTREEL, "list"), Arg("x", FLOTTANT, "longest interval"), gives=[LISTREEL])
def _by_length(ctx: Context, values: ListReel, x: float) -> ListReel:
    if not x > 0:
        ctx.fail(41, "a length is positive: {value} cannot be one", at="x", value=x)
    # An interval of exactly a whole number of steps is not cut once more for round-off.
    counts = np.maximum(np.ceil(np.abs(np.diff(values.values)) / x * (1 - 1e-12)), 1).astype(np.int64)
    return _cut(values, counts)


@RAFF.form(Arg("g", MAILLAGE, "mesh"), Arg("size", CHPOINT, "sizes"), gives=[MAILLAGE])
def _mesh(ctx: Context, g: Maillage, size: ChPoint) -> Maillage:
    ctx.fail(
        251,
        "meshes refined with hanging nodes are not available",
        at="g",
        hint="REMAILLER makes a new mesh of the same domain of given sizes",
    )
