"""SURFACE 'POLYNOME': a surface given by polynomials of two parameters."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend
from gibiane.values import ENTIER, FLOTTANT, MAILLAGE, POINT
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.mesh import curves
from gibiane_ops.mesh.building import dimension, explained, places_along
from gibiane_ops.mesh.degree import finished, wants_quadratic
from gibiane_ops.mesh.patches import patch
from gibiane_ops.values.maillage import Maillage


@extend("SURFACE").form(
    Key(
        "POLYNOME",
        "surface of polynomials",
        Arg("n1", ENTIER, "number of powers of U"),
        Arg("n2", ENTIER, "number of powers of V"),
        Arg("points", POINT, "coefficients, those of V**0 first", many=True),
        required=True,
    ),
    Key(
        "PARAMETRE",
        "bounds of U and V, 0 to 1 unless given",
        *(Arg(name, FLOTTANT) for name in ("u1", "u2", "v1", "v2")),
    ),
    Key("REGULIER", "nodes at equal distances along the sides"),
    gives=[MAILLAGE],
)
def _polynomial(ctx: Context, polynome: Any, parametre: Any, regulier: bool) -> Maillage:
    dimension(ctx)
    n1, n2, given = polynome
    if n1 < 1 or n2 < 1 or len(given) != n1 * n2:
        ctx.fail(
            36,
            "{first} by {second} coefficients are {wanted} points; {count} are given",
            at="polynome",
            first=n1,
            second=n2,
            wanted=max(n1, 0) * max(n2, 0),
            count=len(given),
        )
    coefficients = np.array([p.coords for p in given]).reshape(n2, n1, 3)
    u1, u2, v1, v2 = parametre or (0.0, 1.0, 0.0, 1.0)
    density, quadratic = float(ctx.option("DENS")), wants_quadratic(ctx)
    with explained(ctx, "polynome"):
        # Lower and upper side (V is constant), left and right side (U is constant).
        along = [curves.Curve(_powers(v, n2) @ coefficients.transpose(1, 0, 2), u1, u2) for v in (v1, v2)]
        across = [curves.Curve(_powers(u, n1) @ coefficients, v1, v2) for u in (u1, u2)]
        grids = []
        for sides in (along, across):
            length = (sides[0].length + sides[1].length) / 2
            count = (len(places_along(ctx, length, density, density, None)) - 1) * (2 if quadratic else 1)
            share = np.linspace(0.0, 1.0, count + 1)
            grids.append([_parameters(side, share, regulier) for side in sides])
    s = np.linspace(0.0, 1.0, len(grids[0][0]))[None, :]
    t = np.linspace(0.0, 1.0, len(grids[1][0]))[:, None]
    u = (1 - t) * grids[0][0] + t * grids[0][1]
    v = (1 - s) * grids[1][0][:, None] + s * grids[1][1][:, None]
    grid = np.einsum("ijk,ijl,klc->ijc", _powers(v, n2), _powers(u, n1), coefficients)
    rows = np.linspace(0.0, 1.0, len(t))
    made = patch(ctx, grid, np.full(grid.shape[:2], -1, np.int64), (density, density), rows, quadratic)
    return finished(ctx, made, quadratic)


def _powers(x: float | FloatArray, n: int) -> FloatArray:
    """Return 1, x, x^2, ... along a new last axis."""
    return np.asarray(np.asarray(x, np.float64)[..., None] ** np.arange(n), np.float64)


def _parameters(side: curves.Curve, share: FloatArray, regular: bool) -> FloatArray:
    """Return the values of the parameter of a side at shares of its length, or of its range."""
    if regular:
        return side.parameters(share)
    return side.start + share * (side.end - side.start)
