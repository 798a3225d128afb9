"""PROJETER: meshes moved along a direction, or away from a centre, onto a surface or another mesh."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, Refused, extend, operator
from gibiane.values import MAILLAGE, POINT
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.mesh import rays
from gibiane_ops.mesh.building import DIMENSION, dimension, nodes_of
from gibiane_ops.mesh.copies import Copier, with_sides
from gibiane_ops.values.maillage import Maillage, Point

HOW = ("CYLI", "CONI")
# How many points each target wants, and what finds the meeting with it.
TARGETS: dict[str, tuple[int, Callable[..., FloatArray]]] = {
    "PLAN": (3, rays.to_plane),
    "SPHE": (2, rays.to_sphere),
    "CYLI": (3, rays.to_cylinder),
    "CONI": (3, rays.to_cone),
    "TORI": (4, rays.to_torus),
    "DROI": (2, rays.to_plane),
    "CERC": (2, rays.to_cylinder),
}
UP = np.array([0.0, 0.0, 1.0])

PROJ = operator(
    "PROJETER",
    topic="mesh",
    summary="copies of meshes projected onto a surface or onto another mesh",
    notice="`G2 = G PROJ ('CYLI') V target` moves each node along the vector V, `G PROJ 'CONI' S target` on the line "
    "from the centre S, to the nearest meeting with the target: 'PLAN' P1 P2 P3, 'SPHE' C P (centre, point of the "
    "sphere), 'CYLI' C1 C2 P (axis, point), 'CONI' S A P (apex, axis, point), 'TORI' C A C2 P (centre, axis, centre of "
    "a small circle, point), in the plane 'DROI' P1 P2 or 'CERC' C P. `G PROJ 'CYLI' V G3` and `G PROJ 'CONI' S G3`: "
    "onto the elements of G3, surfaces in space, lines in the plane. Elements stay the same; several meshes give as "
    "many results, and nodes that they share stay shared. A node that does not meet the target is an error.",
    example="OPTI DIME 3 ELEM QUA4 ; S = (DROIT 4 (-1. -1. 0.) (1. -1. 0.)) TRAN 4 (0. 2. 0.) ; "
    "B = S PROJ (0. 0. 1.) 'SPHE' (0. 0. 0.) (2. 0. 0.) ; Z = COOR 3 B ; MESS (MAXI Z) ;",
    see=["PLUS", "DEPLACER", "DALLER"],
)

Motion = Callable[[FloatArray, Any], FloatArray]


def _motion(ctx: Context, kind: str, start: Point, meeting: Callable[[FloatArray, FloatArray], FloatArray]) -> Motion:
    """Return the function that moves coordinates along their lines."""

    def move(x: FloatArray, nodes: Any) -> FloatArray:
        d = x - start.coords if kind == "CONI" else np.repeat(start.coords[None], len(x), axis=0)
        still = np.linalg.norm(d, axis=1) == 0
        if still.any() and kind == "CYLI":
            ctx.fail(239, "the direction of the projection is a null vector")
        try:
            t = np.where(still, np.nan, meeting(x, np.where(still[:, None], UP, d)))
        except BadValue as failure:
            ctx.fail(237, "the points do not define it: {limit} wanted", limit=failure.limit)
        missed = np.flatnonzero(~np.isfinite(t))
        if len(missed):
            ctx.fail(
                21,
                "{count} of {total} nodes have no projection, the first at ({place})",
                count=len(missed),
                total=len(x),
                place=", ".join(f"{each:.6g}" for each in x[missed[0]][: dimension(ctx)]),
                hint="the line through them in the direction of the projection does not meet the target",
            )
        return np.asarray(x + t[:, None] * d, np.float64)

    return move


def _target(ctx: Context, name: str, points: Sequence[Point]) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """Return what finds the meeting of lines with a surface."""
    at = [p.coords for p in points]
    if name in ("DROI", "CERC"):
        if dimension(ctx) != 2:
            ctx.fail(34, "'{name}' is a target in the plane only", name=name, hint="in space: 'PLAN' or 'CYLI'")
        at = [at[0], at[1], at[0] + UP] if name == "DROI" else [at[0], at[0] + UP, at[1]]
    elif dimension(ctx) != 3:
        ctx.fail(34, "'{name}' is a target in space only", name=name, hint="in the plane: 'DROI' or 'CERC'")
    return lambda x, d: TARGETS[name][1](x, d, *at)


def _onto(ctx: Context, g: Maillage) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """Return what finds the meeting of lines with a mesh."""
    dim = dimension(ctx)
    blocks = [b for b in g.kernel_blocks if DIMENSION[b[0]] == dim - 1]
    if not blocks:
        ctx.fail(
            16,
            "the target of a projection is made of surfaces in space, of lines in the plane; this mesh holds {shapes}",
            shapes=" ".join(g.shapes) or "no element",
            hint="ENVE and CONT give the boundary of a mesh",
        )
    return lambda x, d: rays.to_mesh(x[:, :dim], d[:, :dim], nodes_of(ctx).coords[:, :dim], blocks)


def _meshes(q: Operands) -> list[Maillage]:
    """Read the meshes up to the next word."""
    meshes: list[Maillage] = []
    while (g := q.read(MAILLAGE)) is not None:
        meshes.append(g)
    return meshes


def _read(ctx: Context, q: Operands) -> tuple[list[Maillage], Motion]:
    """Read what is projected, how, and onto what."""
    meshes = _meshes(q)
    if not meshes:
        raise q.missing(MAILLAGE, "the mesh to project")
    first = q.need_keyword([*HOW, *(name for name in TARGETS if name not in HOW)])
    second = q.read_keyword(list(TARGETS)) if first in HOW else None
    meshes += _meshes(q)
    # 'CYLI' or 'CONI' alone is the target when points for it follow, else the way to another mesh.
    given = sum(isinstance(value, Point) for value in q.values)
    onto_mesh = first in HOW and second is None and given <= TARGETS[first][0] and len(meshes) > 1
    kind = first if first in HOW and (second is not None or onto_mesh) else "CYLI"
    start = q.need(POINT, "the direction of the projection" if kind == "CYLI" else "the centre of the projection")
    if onto_mesh:
        return meshes[:-1], _motion(ctx, kind, start, _onto(ctx, meshes[-1]))
    name = second or first
    points = [q.need(POINT, f"'{name}'") for _ in range(TARGETS[name][0])]
    return meshes, _motion(ctx, kind, start, _target(ctx, name, points))


SYNTAX = "g:MAILLAGE... ('CYLI') v:POINT | 'CONI' s:POINT, then a target or a mesh"
KEYS = (
    Key(HOW, "along a vector, or from a centre"),
    Key("PLAN", "plane", *[Arg(name, POINT) for name in ("p1", "p2", "p3")]),
    Key("SPHE", "sphere", Arg("c", POINT), Arg("p", POINT)),
    Key("TORI", "torus", *[Arg(name, POINT) for name in ("c", "a", "c2", "p")]),
    Key("DROI", "line of the plane", Arg("p1", POINT), Arg("p2", POINT)),
    Key("CERC", "circle of the plane", Arg("c", POINT), Arg("p", POINT)),
)


@PROJ.stream(*KEYS, syntax=SYNTAX, gives=["MAILLAGE..."])
def _project(ctx: Context, q: Operands) -> Any:
    meshes, move = _read(ctx, q)
    return Copier(ctx, meshes, move).results()


@extend("DEPLACER").stream(Key("PROJ", "project"), syntax="g:MAILLAGE 'PROJ' ...", gives=[])
def _move_onto(ctx: Context, q: Operands) -> Any:
    if q.read_keyword(["PROJ"]) is None:
        return Refused
    meshes, move = _read(ctx, q)
    store = nodes_of(ctx)
    for mesh in meshes:
        nodes = with_sides(mesh)
        store.coords[nodes] = move(store.coords[nodes], nodes)
    return None
