"""Moved copies of objects (PLUS, MOIN, TOUR, SYME, HOMO, AFFI) and DEPLACER, which moves them in place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, MAILLAGE, MCHAML, MMODEL, POINT, TABLE, Table
from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.mesh import transforms
from gibiane_ops.kernels.mesh.transforms import Affine
from gibiane_ops.mesh.building import axis_end, dimension, nodes_of
from gibiane_ops.mesh.copies import Copier, with_sides
from gibiane_ops.values.champs import DIFFUS, ChPoint
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.modele import DISPLACEMENTS

OBJECTS = Arg("objects", (MAILLAGE, POINT, CHPOINT, MMODEL, MCHAML), "objects to move, then what moves them", many=True)
TURNED = Arg("objects", (MAILLAGE, POINT, CHPOINT, MMODEL), "objects, then the points", many=True)
SOLID = Arg("objects", (MAILLAGE, POINT, CHPOINT, MMODEL), "objects to move", many=True)

SEVERAL = (
    "Several objects give as many results; nodes that they share stay shared. The nodes are new: ELIM joins them "
    "to those of other meshes."
)

PLUS = operator(
    "PLUS",
    topic="mesh",
    summary="moved copies of objects",
    notice="`G2 = G1 PLUS V` translates points, meshes, fields and models by a vector; with a CHPOINT in place "
    "of V each node moves by its values UX UY UZ (0 where it has none). A TABLE gives a table of its "
    "moved objects. " + SEVERAL,
    example="OPTI DIME 2 ELEM SEG2 ; L1 = DROIT 2 (0. 0.) (1. 0.) ; L2 = L1 PLUS (0. 3.) ; "
    "X Y = COOR (L2 POIN 'FINA') ; MESS X ' ' Y ;",
    see=["MOINS", "TOUR", "SYMETRIE", "DEPLACER"],
)
MOIN = operator(
    "MOINS",
    topic="mesh",
    summary="copies of objects moved back, or the field that leads from one mesh to another",
    notice="As PLUS with the opposite vector or field. `CH = G2 MOIN G1`, two meshes made alike: the CHPOINT on "
    "G1 that moves it onto G2. " + SEVERAL,
    example="OPTI DIME 2 ELEM SEG2 ; L1 = DROIT 2 (0. 0.) (1. 0.) ; L2 = L1 PLUS (0. 3.) ; "
    "CH = L2 MOIN L1 ; MESS (MAXI CH) ;",
    see=["PLUS"],
)


def shift(ctx: Context, by: Any, sign: float, at: str = "objects") -> Callable[[FloatArray, Any], FloatArray]:
    """Return the function that moves coordinates of given nodes."""
    if isinstance(by, Point):
        vector = sign * by.coords
        return lambda x, nodes: np.asarray(x + vector, np.float64)
    if not isinstance(by, ChPoint):
        ctx.fail(
            37,
            "no POINT or CHPOINT that says by how much to move",
            at=at,
            hint="the last operand is the vector: G PLUS (0. 0. 1.)",
        )
    # UZ is a name of two families, hence the largest number of names in common.
    # On a tie the family of the mode wins: UZ alone is the second coordinate in AXIS.
    here = DISPLACEMENTS.get(str(ctx.option("MODE"))[:4])
    names = max(DISPLACEMENTS.values(), key=lambda family: (len(set(family) & set(by.names)), family == here))
    if not set(names) & set(by.names):
        ctx.fail(181, "the field has no displacement; it has {known}", at=at, known=" ".join(by.names) or "none")
    if len(names) == 3 and dimension(ctx) == 2 and "UZ" in by.names and np.any(by.parts["UZ"][1]):
        ctx.fail(
            34,
            "the field moves nodes by UZ, out of the plane of OPTI DIME 2",
            at=at,
            hint="EXCO keeps the components wanted: EXCO (MOTS 'UX' 'UY') CH (MOTS 'UX' 'UY')",
        )

    def move(x: FloatArray, nodes: Any) -> FloatArray:
        result = x.copy()
        result[:, : len(names)] += sign * by.table(names, nodes)
        return result

    return move


def _translated(ctx: Context, objects: list[Any], sign: float) -> Any:
    *moved, by = objects
    if not moved:
        ctx.fail(37, "no object to move, or no vector", at="objects", hint="G PLUS (0. 0. 1.)")
    return Copier(ctx, moved, shift(ctx, by, sign)).results()


def _moved_table(ctx: Context, t: Table, by: Point | ChPoint, sign: float) -> Table:
    keys = [key for key, _ in t.entries.values() if key != "SOUSTYPE"]
    result = t.copy()
    for key, value in zip(keys, Copier(ctx, [t.get(key) for key in keys], shift(ctx, by, sign)).results(), strict=True):
        result.set(key, value)
    return result


@PLUS.form(OBJECTS, gives=["same types..."])
def _plus(ctx: Context, objects: list[Any]) -> Any:
    return _translated(ctx, objects, 1.0)


@PLUS.form(Arg("t", TABLE, "table of objects"), Arg("v", (POINT, CHPOINT), "vector or field"), gives=[TABLE])
def _plus_table(ctx: Context, t: Table, v: Any) -> Table:
    return _moved_table(ctx, t, v, 1.0)


@MOIN.form(OBJECTS, gives=["same types..."])
def _moins(ctx: Context, objects: list[Any]) -> Any:
    if len(objects) == 2 and isinstance(objects[0], Maillage) and isinstance(objects[1], Maillage):
        return _difference(ctx, objects[0], objects[1])
    return _translated(ctx, objects, -1.0)


@MOIN.form(Arg("t", TABLE, "table of objects"), Arg("v", (POINT, CHPOINT), "vector or field"), gives=[TABLE])
def _moins_table(ctx: Context, t: Table, v: Any) -> Table:
    return _moved_table(ctx, t, v, -1.0)


def _difference(ctx: Context, end: Maillage, start: Maillage) -> ChPoint:
    if [(b.shape, b.cells.shape) for b in end.blocks] != [(b.shape, b.cells.shape) for b in start.blocks]:
        ctx.fail(
            21,
            "the two meshes are not made alike: {end} and {start} elements",
            at="objects",
            end=end.n_cells,
            start=start.n_cells,
            hint="one must be a moved copy of the other, or made by the same operations",
        )
    first, last = (np.concatenate([b.cells.ravel() for b in g.blocks]) for g in (start, end))
    nodes, row = np.unique(first, return_index=True)
    x = nodes_of(ctx).coords
    dim = dimension(ctx)
    names = DISPLACEMENTS.get(str(ctx.option("MODE"))[:4], DISPLACEMENTS["TRID"])[:dim]
    return ChPoint.from_table(start.store, names, nodes, (x[last[row]] - x[nodes])[:, :dim], DIFFUS)


def _affine(ctx: Context, make: Callable[[], Affine]) -> Affine:
    """Make a map, refusing coincident or aligned points."""
    try:
        return make()
    except BadValue as failure:
        ctx.fail(237, "the points do not define it: {limit} wanted", limit=failure.limit)


def _copies(ctx: Context, objects: Sequence[Any], motion: Affine) -> Any:
    if not objects:
        ctx.fail(37, "no object to move")
    return Copier(ctx, objects, lambda x, nodes: motion(x), motion).results()


def _points(ctx: Context, objects: list[Any], count: int, what: str) -> tuple[list[Any], list[Point]]:
    """Take the last points off a list of operands."""
    kept, points = objects[:-count], objects[-count:]
    if len(points) < count or not all(isinstance(p, Point) for p in points):
        ctx.fail(37, "no POINT for {what}", what=what, at="objects")
    return kept, points


def _rotation(ctx: Context, angle: float, points: Sequence[Point]) -> Affine:
    axis = axis_end(ctx, points[0], points[1] if len(points) > 1 else None)
    return _affine(ctx, lambda: transforms.rotation(angle, points[0].coords, axis))


TOUR = operator(
    "TOUR",
    topic="mesh",
    summary="copies of objects turned about a point or an axis",
    notice="`G2 = G1 TOUR angle P1 (P2)`: degrees, about P1 in the plane, about the axis P1-P2 in space. The "
    "components of displacements, forces, rotations and moments of a CHPOINT turn too. " + SEVERAL,
    example="OPTI DIME 2 ELEM SEG2 ; L2 = (DROIT 2 (1. 0.) (2. 0.)) TOUR 90. (0. 0.) ; "
    "X Y = COOR (L2 POIN 'FINA') ; MESS X ' ' Y ;",
    see=["PLUS", "SYMETRIE", "ROTATION"],
)


@TOUR.form(Arg("angle", FLOTTANT, "degrees"), TURNED, gives=["same types..."])
def _tour(ctx: Context, angle: float, objects: list[Any]) -> Any:
    kept, points = _points(ctx, objects, 2 if dimension(ctx) == 3 else 1, "the centre or the axis")
    return _copies(ctx, kept, _rotation(ctx, angle, points))


P, P1, P2, P3 = (Arg(name, POINT) for name in ("p", "p1", "p2", "p3"))
SYME = operator(
    "SYMETRIE",
    topic="mesh",
    summary="mirror images of objects",
    notice="About a point ('POIN' P), a line ('DROI' P1 P2: a reflection in the plane, a half turn in space) or a "
    "plane ('PLAN' P1 P2 P3). Surfaces and volumes are turned over where the symmetry exchanges left and "
    "right, so that volumes stay positive and normals stay outside. " + SEVERAL,
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 2 (1. 0.) (2. 0.)) TRAN 2 (0. 1.) ; "
    "S2 = S SYME 'DROI' (0. 0.) (0. 1.) ; MESS (MESU S2) ;",
    see=["PLUS", "TOUR", "HOMOTHETIE"],
)


@SYME.form(SOLID, Key("POINT", "about a point", P, required=True), gives=["same types..."])
def _syme_point(ctx: Context, objects: list[Any], point: Point) -> Any:
    return _copies(ctx, objects, transforms.symmetry_point(point.coords, dimension(ctx) < 3))


@SYME.form(SOLID, Key("DROIT", "about a line", P1, P2, required=True), gives=["same types..."])
def _syme_line(ctx: Context, objects: list[Any], droit: tuple[Point, Point]) -> Any:
    a, b = droit
    return _copies(ctx, objects, _affine(ctx, lambda: transforms.symmetry_line(a.coords, b.coords, dimension(ctx) < 3)))


@SYME.form(SOLID, Key("PLAN", "about a plane", P1, P2, P3, required=True), gives=["same types..."])
def _syme_plane(ctx: Context, objects: list[Any], plan: tuple[Point, Point, Point]) -> Any:
    a, b, c = plan
    return _copies(ctx, objects, _affine(ctx, lambda: transforms.symmetry_plane(a.coords, b.coords, c.coords)))


HOMO = operator(
    "HOMOTHETIE",
    topic="mesh",
    summary="copies of objects made larger or smaller about a point",
    notice="`G2 = G1 HOMO ratio P`. " + SEVERAL,
    example="OPTI DIME 2 ELEM SEG2 ; L = (DROIT 2 (1. 0.) (2. 0.)) HOMO 3. (0. 0.) ; MESS (MESU L) ;",
    see=["AFFINITE", "SYMETRIE"],
)
AFFI = operator(
    "AFFINITE",
    topic="mesh",
    summary="copies of objects stretched along a direction",
    notice="`G2 = G1 AFFI ratio P1 P2`: distances to P1 along the direction P1-P2 are multiplied by the ratio. "
    + SEVERAL,
    example="OPTI DIME 2 ELEM SEG2 ; L = (DROIT 2 (1. 0.) (2. 0.)) AFFI 3. (0. 0.) (1. 0.) ; MESS (MESU L) ;",
    see=["HOMOTHETIE"],
)


@HOMO.form(Arg("ratio", FLOTTANT, "ratio"), TURNED, gives=["same types..."])
def _homo(ctx: Context, ratio: float, objects: list[Any]) -> Any:
    kept, (centre,) = _points(ctx, objects, 1, "the centre")
    return _copies(ctx, kept, transforms.homothety(ratio, centre.coords))


@AFFI.form(Arg("ratio", FLOTTANT, "ratio"), TURNED, gives=["same types..."])
def _affi(ctx: Context, ratio: float, objects: list[Any]) -> Any:
    kept, (a, b) = _points(ctx, objects, 2, "the direction")
    return _copies(ctx, kept, _affine(ctx, lambda: transforms.affinity(ratio, a.coords, b.coords)))


DEPL = operator(
    "DEPLACER",
    topic="mesh",
    summary="move the nodes of a mesh or a point, in place",
    notice="`DEPL G 'PLUS' V ;`, 'MOIN' V, 'TOUR' angle P1 (P2), 'HOMO' ratio P, 'AFFI' ratio P1 P2, 'SYME' then "
    "'POIN' P, 'DROI' P1 P2 or 'PLAN' P1 P2 P3: as the operators of these names, but the nodes of G "
    "themselves move, and every object that shares them with it. V may be a CHPOINT.",
    example="OPTI DIME 2 ELEM SEG2 ; L = DROIT 2 (1. 0.) (2. 0.) ; DEPL L 'PLUS' (0. 5.) ; MESS (MINI (COOR 2 L)) ;",
    see=["PLUS", "TOUR"],
)
WHAT = Arg("g", (MAILLAGE, POINT), "what to move")
BY = Arg("v", (POINT, CHPOINT), "vector or field")


def _move(ctx: Context, g: Maillage | Point, move: Callable[[FloatArray, Any], FloatArray]) -> None:
    store = nodes_of(ctx)
    nodes = np.array([g.node]) if isinstance(g, Point) else with_sides(g)
    store.coords[nodes] = move(store.coords[nodes], nodes)


@DEPL.form(WHAT, Key(("PLUS", "MOINS"), "translate", BY, name="how", required=True))
def _depl(ctx: Context, g: Maillage | Point, how: tuple[str, Point | ChPoint]) -> None:
    _move(ctx, g, shift(ctx, how[1], 1.0 if how[0] == "PLUS" else -1.0, "how"))


@DEPL.form(WHAT, Key("TOUR", "turn", Arg("angle", FLOTTANT), P1, Arg("p2", POINT, optional=True), required=True))
def _depl_tour(ctx: Context, g: Maillage | Point, tour: tuple[float, Point, Point | None]) -> None:
    motion = _rotation(ctx, tour[0], [p for p in tour[1:] if isinstance(p, Point)])
    _move(ctx, g, lambda x, nodes: motion(x))


@DEPL.form(WHAT, Key("HOMO", "enlarge", Arg("ratio", FLOTTANT), P, required=True))
def _depl_homo(ctx: Context, g: Maillage | Point, homo: tuple[float, Point]) -> None:
    motion = transforms.homothety(homo[0], homo[1].coords)
    _move(ctx, g, lambda x, nodes: motion(x))


@DEPL.form(WHAT, Key("AFFI", "stretch", Arg("ratio", FLOTTANT), P1, P2, required=True))
def _depl_affi(ctx: Context, g: Maillage | Point, affi: tuple[float, Point, Point]) -> None:
    motion = _affine(ctx, lambda: transforms.affinity(affi[0], affi[1].coords, affi[2].coords))
    _move(ctx, g, lambda x, nodes: motion(x))


@DEPL.form(
    WHAT,
    Key("SYME", "mirror", required=True),
    Key("POINT", "about a point", P),
    Key("DROIT", "about a line", P1, P2),
    Key("PLAN", "about a plane", P1, P2, P3),
)
def _depl_syme(
    ctx: Context,
    g: Maillage | Point,
    syme: bool,
    point: Point | None,
    droit: tuple[Point, Point] | None,
    plan: tuple[Point, Point, Point] | None,
) -> None:
    def make() -> Affine:
        if point is not None:
            return transforms.symmetry_point(point.coords, dimension(ctx) < 3)
        if droit is not None:
            return transforms.symmetry_line(droit[0].coords, droit[1].coords, dimension(ctx) < 3)
        if plan is None:
            ctx.fail(7, "'SYME' wants 'POIN', 'DROI' or 'PLAN'")
        return transforms.symmetry_plane(plan[0].coords, plan[1].coords, plan[2].coords)

    motion = _affine(ctx, make)
    _move(ctx, g, lambda x, nodes: motion(x))
