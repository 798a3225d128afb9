"""Vectors: arithmetic of points, scalar and vector products."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gibiane.forms import Arg
from gibiane.registry import Context, extend, operator
from gibiane.values import ENTIER, FLOTTANT, POINT
from gibiane_ops.mesh.building import dimension, new_point
from gibiane_ops.values.maillage import Point
from gibiane_ops.values.nodes import FloatArray

NUMBER = (ENTIER, FLOTTANT)

PVEC = operator(
    "PVECTORIEL",
    topic="geometry",
    summary="vector product of two vectors",
    notice="Of two POINT taken as vectors, in space. In the plane, of one vector: the same turned by 90 degrees.",
    example="OPTI DIME 3 ; X Y Z = COOR (PVEC (1. 0. 0.) (0. 1. 0.)) ; MESS Z ;",
    see=["PSCAL"],
)


PMIX = operator(
    "PMIXTE",
    topic="geometry",
    summary="mixed product of three vectors",
    notice="`x = PMIX U V W`: the product of U by the vector product of V and W, in space.",
    example="OPTI DIME 3 ; MESS (PMIX (1. 0. 0.) (0. 1. 0.) (0. 0. 2.)) ;",
    see=["PVECTORIEL", "PSCAL"],
)


@PMIX.form(
    Arg("u", POINT, "vector"), Arg("v", POINT, "second vector"), Arg("w", POINT, "third vector"), gives=[FLOTTANT]
)
def _pmix(ctx: Context, u: Point, v: Point, w: Point) -> float:
    return float(u.coords @ np.cross(v.coords, w.coords))


@extend("PSCAL").form(Arg("u", POINT, "vector"), Arg("v", POINT, "vector"), gives=[FLOTTANT])
def _psca(ctx: Context, u: Point, v: Point) -> float:
    return float(u.coords @ v.coords)


@PVEC.form(Arg("u", POINT, "vector"), Arg("v", POINT, "second vector, in space", optional=True), gives=[POINT])
def _pvec(ctx: Context, u: Point, v: Point | None) -> Point:
    if dimension(ctx) == 2 and v is None:
        x, y, _ = u.coords
        return new_point(ctx, np.array([-y, x, 0.0]))
    if v is None:
        ctx.fail(37, "no POINT for its second vector", at="u")
    return new_point(ctx, np.cross(u.coords, v.coords))


A, B = Arg("a", POINT, "point or vector"), Arg("b", POINT, "vector")


def _in_range(ctx: Context, compute: Callable[[], FloatArray], at: str) -> Point:
    """Make a point; fail where a coordinate is too large."""
    with np.errstate(over="ignore"):
        coords = compute()
    if not np.isfinite(coords).all():
        ctx.fail(26, "a coordinate of the result is too large for a FLOTTANT", at=at)
    return new_point(ctx, coords)


@extend("+").form(A, B, gives=[POINT])
def _plus(ctx: Context, a: Point, b: Point) -> Point:
    return _in_range(ctx, lambda: a.coords + b.coords, "b")


@extend("-").form(A, B, gives=[POINT])
def _minus(ctx: Context, a: Point, b: Point) -> Point:
    return _in_range(ctx, lambda: a.coords - b.coords, "b")


@extend("*").form(Arg("x", NUMBER, "number"), A, gives=[POINT])
def _times(ctx: Context, x: float, a: Point) -> Point:
    return _in_range(ctx, lambda: x * a.coords, "a")


@extend("/").form(A, Arg("x", NUMBER, "number"), gives=[POINT])
def _over(ctx: Context, a: Point, x: float) -> Point:
    if x == 0:
        ctx.fail(26, "division by zero", at="x")
    return _in_range(ctx, lambda: a.coords / x, "x")
