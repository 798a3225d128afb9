"""Imposed displacements: BLOQ, SYMT, ANTI, DEPI."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.nodes import Node
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, LISTMOTS, MAILLAGE, MOT, POINT, RIGIDITE
from gibiane_ops.values.champs import DISCRET, ChPoint
from gibiane_ops.values.conditions import KNOWN, ROTATIONS, condition, directed, displacements, family, support
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store
from gibiane_ops.values.rigidite import ConditionPart, Rigidite

SENSES = {"MINI": ">", "MAXI": "<"}
WORDS = (*SENSES, "DEPL", "ROTA")
_EXAMPLE = (
    "OPTI DIME 2 ELEM QUA4 ; S = (DROI 2 (0 0) (1 0)) TRAN 2 (0 1) ;\n"
    "MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.1E11 'NU' 0.3 ;\n"
)

BLOQ = operator(
    "BLOQUER",
    topic="loads",
    summary="impose displacements",
    notice="Blocks the unknowns named (UX UY UZ, a LISTMOTS, 'DEPL' for all displacements, 'ROTA' for all "
    "rotations) on the nodes of a mesh or point: value 0, or the one that DEPI gives. 'DIRECTION' V blocks the "
    "displacement ('ROTA': the rotation) along the vector V, or along the vectors of a CHPOINT. 'RADIAL' P1 (P2) "
    "blocks the displacement away from the point P1 (in space: from the axis P1 P2), 'ORTHO' P1 (P2) the one around "
    "it. 'MAXI' means at most the value, 'MINI' at least. One multiplier per node and name. Rotations that the "
    "matrix does not have are left aside by RESO.",
    example=_EXAMPLE + "CL = BLOQ 'DEPL' (S POIN 'DROI' (0 0) (1 0) 1.E-6) ; LIST 'RESU' CL ;\n"
    "LIST 'RESU' (BLOQ 'RADIAL' (0 0) (S POIN 'DROI' (1 0) (1 1) 1.E-6)) ;",
    see=["DEPIMPOSE", "SYMT", "RELA", "REAC"],
)


@dataclass
class _Wish:
    """What BLOQ is asked for, word by word."""

    names: list[str] = field(default_factory=list)
    words: list[str] = field(default_factory=list)
    sense: str = "="
    whole: bool = False
    rotations: bool = False
    direction: Point | ChPoint | None = None
    about: str = ""
    centre: list[Point] = field(default_factory=list)
    place: Maillage | Point | None = None

    @property
    def label(self) -> str:
        """What the user wrote, for messages."""
        return " ".join(["BLOQ", *self.words])


@BLOQ.stream(
    Key(("MINI", "MAXI"), "at least, at most", name="sense"),
    Key("DEPL", "all displacements"),
    Key("ROTA", "all rotations"),
    Key("DIRECTION", "along a vector", Arg("v", (POINT, CHPOINT))),
    Key("RADIAL", "away from a point or an axis", Arg("p1", POINT), Arg("p2", POINT, optional=True)),
    Key("ORTHO", "around a point or an axis", Arg("p1", POINT), Arg("p2", POINT, optional=True)),
    syntax="('MINI'|'MAXI') name... | ('DEPL') ('ROTA') ('DIRECTION' v:POINT|CHPOINT) | 'RADIAL'|'ORTHO' p1:POINT "
    "(p2:POINT) g:MAILLAGE|POINT",
    gives=[RIGIDITE],
)
def _bloq(ctx: Context, q: Operands) -> Rigidite:
    wish = _Wish()
    while True:
        if wish.place is None:
            wish.place = q.read((MAILLAGE, POINT))
            if wish.place is not None:
                continue
        several = q.read(LISTMOTS)
        if several is not None:
            wish.names.extend(str(w).strip()[:4] for w in several.words)
            wish.words.extend(wish.names)
            continue
        i = q.first_word()
        # DEPL and ROTA are operators too; here they are words of BLOQ.
        if i < 0 or (q.is_operator_word(i) and str(q.values[i])[:4] not in WORDS):
            break
        node = q.nodes[i]
        _word(ctx, q, wish, str(q.need(MOT)).strip(), node)
    if wish.place is None:
        raise q.missing(MAILLAGE, "the nodes to block")
    return _blocked(ctx, wish, wish.place)


def _word(ctx: Context, q: Operands, wish: _Wish, word: str, node: Node) -> None:
    """Take one word of BLOQ, with the operands that belong to it."""
    short = word[:4]
    wish.words.append(short)
    if short in SENSES:
        wish.sense = SENSES[short]
    elif short == "DEPL":
        wish.whole = True
    elif short == "ROTA":
        wish.rotations = True
    elif short == "DIRE":
        ctx.places["direction"] = q.nodes[0] if q.nodes else node
        wish.direction = q.need((POINT, CHPOINT), "the direction")
    elif short in ("RADI", "ORTH"):
        wish.about = short
        ctx.places["centre"] = node
        wish.centre = [q.need(POINT, "the centre")]
        if int(ctx.option("DIME")) == 3:
            wish.centre.append(q.need(POINT, "the second point of the axis"))
    elif short in KNOWN:
        wish.names.append(short)
    else:
        ctx.places["word"] = node
        known = " ".join(displacements(ctx))
        hint = "here the unknowns are {known}; 'DEPL' means all of them"
        ctx.fail(197, "{word} is not the name of an unknown", at="word", word=word, known=known, hint=hint)


def _blocked(ctx: Context, wish: _Wish, place: Maillage | Point) -> Rigidite:
    nodes = support(ctx, place)
    every, rotations = displacements(ctx), ROTATIONS[family(ctx)]
    if wish.about:
        return directed(ctx, nodes, _around(ctx, wish, nodes), every, wish.label, wish.sense)
    if wish.direction is not None:
        vector = rotations if wish.rotations else every
        if isinstance(wish.direction, Point):
            direction = wish.direction.coords
        else:
            _components(ctx, wish.direction, vector)
            direction = wish.direction.table(vector, nodes)
        return directed(ctx, nodes, direction, vector, wish.label, wish.sense)
    names = list(dict.fromkeys([*wish.names, *(every if wish.whole else ())]))
    if not names and not wish.rotations:
        ctx.fail(
            7,
            "which unknown is blocked? A name is missing",
            known=" ".join(every),
            hint="here the unknowns are {known}; 'DEPL' means all of them",
        )
    groups = [group for group in (names, list(rotations) if wish.rotations else []) if group]
    return Rigidite([part for g in groups for part in condition(ctx, nodes, g, wish.label, wish.sense).parts])


def _components(ctx: Context, vectors: ChPoint, names: tuple[str, ...]) -> None:
    missing = [n for n in names if n not in vectors.names]
    if missing:
        ctx.fail(65, "the field has no component {name}", at="direction", name=missing[0])


def _around(ctx: Context, wish: _Wish, nodes: IntArray) -> FloatArray:
    """Return the directions of BLOQ 'RADIAL' or 'ORTHO', (n, 3)."""
    arm = node_store(ctx).coords[nodes] - wish.centre[0].coords
    axis = np.array([0.0, 0.0, 1.0])
    if len(wish.centre) == 2:
        axis = wish.centre[1].coords - wish.centre[0].coords
        length = float(np.linalg.norm(axis))
        if length == 0:
            ctx.fail(237, "the two points of the axis coincide", at="centre")
        axis /= length
    arm = arm - np.outer(arm @ axis, axis)
    away = np.linalg.norm(arm, axis=1)
    on_axis = away <= 1e-10 * away.max(initial=0.0)
    if on_axis.any():
        where = " ".join(f"{x:g}" for x in node_store(ctx).coords[nodes[on_axis][0]])
        ctx.fail(
            238,
            "{count} nodes lie on the axis, the first at ({where}): they have no radial direction",
            at="centre",
            count=int(on_axis.sum()),
            where=where,
            hint="leave them out with DIFF",
        )
    return arm if wish.about == "RADI" else np.cross(axis, arm)


SYMT = operator(
    "SYMT",
    topic="loads",
    summary="conditions of symmetry about a line or a plane",
    notice="The nodes of the mesh in the plane of three points (line of two in the plane) do not move "
    "normally to it ('DEPL', the default); 'ROTA': they do not turn about its directions. A node counts within the "
    "tolerance: a tenth of the density, or a millionth of the size of the mesh.",
    example=_EXAMPLE + "CL = SYMT 'DEPL' (0 0) (0 1) S ; LIST 'RESU' CL ;",
    see=["BLOQUER", "ANTI"],
)
ANTI = operator(
    "ANTI",
    topic="loads",
    summary="conditions of antisymmetry about a line or a plane",
    notice="The nodes of the mesh in the plane of three points (line of two in the plane) do not move along "
    "it ('DEPL', the default); 'ROTA': they do not turn about its normal. Tolerance as for SYMT.",
    example=_EXAMPLE + "CL = ANTI 'DEPL' (0 0) (0 1) S ; LIST 'RESU' CL ;",
    see=["BLOQUER", "SYMT"],
)


def _plane(ctx: Context, p1: Point, p2: Point, p3: Point | None) -> tuple[FloatArray, FloatArray]:
    """Return the unit normal of a plane, and one or two vectors along it, (k, 3)."""
    first = p2.coords - p1.coords
    if int(ctx.option("DIME")) == 2:
        normal = np.array([-first[1], first[0], 0.0])
    else:
        if p3 is None:
            raise ctx.operands.missing(POINT, "the third point of the plane")
        normal = np.cross(first, p3.coords - p1.coords)
    length = np.linalg.norm(normal)
    if length == 0:
        ctx.fail(237, "the points do not define a plane: they coincide or are aligned", at="p1")
    normal = normal / length
    along = [first] if p3 is None else [first, np.cross(normal, first)]
    return normal, np.array(along)


def _in_plane(ctx: Context, g: Maillage, p1: Point, normal: FloatArray, tol: float | None) -> IntArray:
    store = node_store(ctx)
    nodes = g.nodes
    X = store.coords[nodes]
    if tol is None:
        density = float(ctx.option("DENS"))
        tol = density / 10 if density > 0 else 1e-6 * float(np.ptp(X, axis=0).max(initial=0.0))
    near = nodes[np.abs((X - p1.coords) @ normal) <= tol]
    if not len(near):
        ctx.fail(221, "no node of the mesh lies in the plane (tolerance {tol})", at="g", tol=f"{tol:g}")
    return np.asarray(near)


def _along(ctx: Context, nodes: IntArray, vectors: FloatArray, names: tuple[str, ...], label: str) -> list[Any]:
    """Block a vector of unknowns along several directions; along an axis of coordinates this is one name."""
    parts = []
    for vector in vectors:
        axis = int(np.argmax(np.abs(vector)))
        if abs(abs(vector[axis]) / np.linalg.norm(vector) - 1.0) < 1e-12:
            parts += condition(ctx, nodes, [names[axis]], label).parts
        else:
            parts += directed(ctx, nodes, vector, names, label).parts
    return parts


_SYMMETRY = (
    Key("DEPL", "displacements (the default)"),
    Key("ROTA", "rotations"),
    Arg("p1", POINT, "point of the plane"),
    Arg("p2", POINT, "point of the plane"),
    Arg("p3", POINT, "point of the plane", optional=True),
    Arg("g", MAILLAGE, "mesh"),
    Arg("tol", FLOTTANT, "tolerance", optional=True),
)


def _mirror(ctx: Context, label: str, normally: bool, depl: bool, rota: bool, nodes: IntArray, plane: Any) -> Rigidite:
    """Block displacements and rotations at a plane: displacements along its normal or in it, rotations the reverse."""
    normal, along = plane
    across = normal[None, :]
    parts: list[Any] = []
    if depl or not rota:
        parts += _along(ctx, nodes, across if normally else along, displacements(ctx), label)
    if rota:
        rotations = ROTATIONS[family(ctx)]
        if len(rotations) == 3:
            parts += _along(ctx, nodes, along if normally else across, rotations, label)
        elif normally:
            parts += condition(ctx, nodes, rotations, label).parts
    return Rigidite(parts)


@SYMT.form(*_SYMMETRY, gives=[RIGIDITE])
def _symt(
    ctx: Context, depl: bool, rota: bool, p1: Point, p2: Point, p3: Point | None, g: Maillage, tol: float | None
) -> Rigidite:
    plane = _plane(ctx, p1, p2, p3)
    return _mirror(ctx, "SYMT", True, depl, rota, _in_plane(ctx, g, p1, plane[0], tol), plane)


@ANTI.form(*_SYMMETRY, gives=[RIGIDITE])
def _anti(
    ctx: Context, depl: bool, rota: bool, p1: Point, p2: Point, p3: Point | None, g: Maillage, tol: float | None
) -> Rigidite:
    plane = _plane(ctx, p1, p2, p3)
    return _mirror(ctx, "ANTI", False, depl, rota, _in_plane(ctx, g, p1, plane[0], tol), plane)


DEPI = operator(
    "DEPIMPOSE",
    topic="loads",
    summary="values of imposed displacements and relations",
    notice="The second member of conditions: a value for all of them, or a CHPOINT with the unknowns that BLOQ or "
    "RELA names (each condition takes the combination of its terms). 'RELA' CHPOINT: one component, whose value at "
    "the node of each condition is taken; the terms of a condition must then stand on one node. To be added to the "
    "load. Rotations are in radians.",
    example=_EXAMPLE + "CL = BLOQ 'UY' (S POIN 'DROI' (0 0) (1 0) 1.E-6) ; LIST 'RESU' (DEPI CL 0.01) ;",
    see=["BLOQUER", "RELA"],
)


@DEPI.form(Arg("k", RIGIDITE, "conditions"), Arg("x", FLOTTANT, "value"), gives=[CHPOINT])
def _depi(ctx: Context, k: Rigidite, x: float) -> ChPoint:
    return _imposed(ctx, [(part, np.full(len(part.multipliers), x)) for part in _rows(ctx, k)])


@DEPI.form(Arg("k", RIGIDITE, "conditions"), Arg("field", CHPOINT, "values"), gives=[CHPOINT])
def _depi_field(ctx: Context, k: Rigidite, field: ChPoint) -> ChPoint:
    found = []
    for part in _rows(ctx, k):
        total = np.zeros(len(part.multipliers))
        for name in np.unique(part.name):
            if str(name) not in field.names:
                ctx.fail(181, "the field has no component {name}", at="field", name=str(name))
            terms = part.name == name
            value = field.at(str(name), node_store(ctx).canonical(part.node[terms]))
            np.add.at(total, part.row[terms], part.coefficients[terms] * value)
        found.append((part, total))
    return _imposed(ctx, found)


@DEPI.form(
    Arg("k", RIGIDITE, "conditions"),
    Key("RELA", "values by node", Arg("field", CHPOINT, "values"), required=True),
    gives=[CHPOINT],
)
def _depi_rela(ctx: Context, k: Rigidite, rela: ChPoint) -> ChPoint:
    if len(rela.names) != 1:
        names = " ".join(rela.names)
        ctx.fail(26, "the field of the values has the components {names}; one is wanted", at="rela", names=names)
    found = []
    for part in _rows(ctx, k):
        nodes = node_store(ctx).canonical(part.node)
        own = np.zeros(len(part.multipliers), np.int64)
        own[part.row] = nodes
        if (own[part.row] != nodes).any():
            _several_nodes(ctx, part)
        found.append((part, rela.at(rela.names[0], own)))
    return _imposed(ctx, found)


def _several_nodes(ctx: Context, part: ConditionPart) -> NoReturn:
    ctx.fail(
        21,
        "{which} relates unknowns of several nodes: a value by node does not say which",
        at="k",
        which=part.origin,
        hint="DEPI with a number, or with a field that has the unknowns of the relation",
    )


def _imposed(ctx: Context, values: list[tuple[ConditionPart, FloatArray]]) -> ChPoint:
    nodes = np.concatenate([part.multipliers for part, _ in values])
    return ChPoint(node_store(ctx), {"FLX": (nodes, np.concatenate([v for _, v in values]))}, DISCRET)


def _rows(ctx: Context, k: Rigidite) -> list[ConditionPart]:
    if not k.conditions:
        ctx.fail(26, "this matrix holds no condition", at="k", hint="BLOQ and RELA make conditions")
    return k.conditions
