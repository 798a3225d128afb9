"""Conditions (BLOQ, SYMT, ANTI, DEPI) and loads (FORC, PRES, FSUR)."""

from __future__ import annotations

from typing import Any

import numpy as np
from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, MAILLAGE, MMODEL, MOT, POINT, RIGIDITE

from gibiane_ops.kernels import assembly
from gibiane_ops.kernels.contact.pairs import facets_of_body
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import EmptyContact
from gibiane_ops.values.champs import DISCRET, ChPoint
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.modele import DISPLACEMENTS, FORCES, Modele
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store
from gibiane_ops.values.rigidite import ConditionPart, Rigidite

KNOWN = {"UX", "UY", "UZ", "UR", "RX", "RY", "RZ", "RT", "T"}
_EXAMPLE = (
    "OPTI DIME 2 ELEM QUA4 ; S = (DROI 2 (0 0) (1 0)) TRAN 2 (0 1) ;\n"
    "MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.1E11 'NU' 0.3 ;\n"
)


def family(ctx: Context) -> str:
    """Return the key of the tables of names for the current mode."""
    mode = ctx.option("MODE") or {2: "PLAN DEFO", 3: "TRID"}.get(int(ctx.option("DIME")))
    if mode is None:
        ctx.fail(14, "the dimension of space is not set", hint="OPTI DIME 3 ;")
    return str(mode)[:4]


def support(ctx: Context, place: Maillage | Point) -> IntArray:
    """Return the nodes of a mesh or of a point."""
    nodes = place.nodes if isinstance(place, Maillage) else np.array([place.node])
    if not len(nodes):
        ctx.fail(26, "the mesh has no node", at="g")
    return nodes


def condition(ctx: Context, nodes: IntArray, names: list[str], label: str, sense: str = "=") -> Rigidite:
    """Make one condition per node and name: the unknown takes the value imposed (0 by default)."""
    store = node_store(ctx)
    row = np.arange(len(nodes) * len(names))
    node = np.tile(nodes, len(names))
    multipliers = store.add(store.coords[node])
    name = np.repeat(np.asarray(names), len(nodes))
    return Rigidite([ConditionPart(row, node, name, np.ones(len(row)), multipliers, sense, label)])


def directed(ctx: Context, nodes: IntArray, direction: FloatArray, names: tuple[str, ...], label: str) -> Rigidite:
    """Make one condition per node: the displacement along a direction takes the value imposed."""
    store = node_store(ctx)
    length = float(np.linalg.norm(direction))
    if length == 0:
        ctx.fail(239, "the direction is null")
    unit = direction / length
    used = [i for i in range(len(names)) if abs(unit[i]) > 1e-12]
    n = len(nodes)
    row = np.tile(np.arange(n), len(used))
    node = np.tile(nodes, len(used))
    name = np.repeat([names[i] for i in used], n)
    return Rigidite(
        [ConditionPart(row, node, name, np.repeat(unit[used], n), store.add(store.coords[nodes]), "=", label)]
    )


BLOQ = operator(
    "BLOQUER",
    topic="loads",
    summary="impose displacements",
    notice="Blocks the unknowns named (UX UY UZ, or 'DEPL' for all displacements) on the nodes of a mesh or "
    "point: value 0, or the one that DEPI gives. 'DEPL' 'DIRECTION' V blocks the displacement along "
    "the vector V. One multiplier per node and name.",
    example=_EXAMPLE + "CL = BLOQ 'DEPL' (S POIN 'DROI' (0 0) (1 0) 1.E-6) ; LIST 'RESU' CL ;",
    see=["DEPIMPOSE", "SYMT", "REAC"],
)


@BLOQ.stream(
    Key("DEPL", "all displacements"),
    Key("DIRECTION", "along a vector", Arg("v", POINT)),
    syntax="name... | 'DEPL' ('DIRECTION' v:POINT) g:MAILLAGE|POINT",
    gives=[RIGIDITE],
)
def _bloq(ctx: Context, q: Operands) -> Rigidite:
    names: list[str] = []
    direction = place = None
    every = DISPLACEMENTS[family(ctx)]
    whole = False
    while True:
        if direction is not None and isinstance(direction, bool):
            direction = q.need(POINT, "the direction")
        found = q.read((MAILLAGE, POINT)) if place is None else None
        if found is not None:
            place = found
            continue
        several = q.read("LISTMOTS")
        if several is not None:
            names.extend(str(w).strip()[:4] for w in several.items)
            continue
        i = q.first_word()
        if i < 0 or q.is_operator_word(i):
            break
        node = q.nodes[i]
        word = str(q.need(MOT)).strip()
        if word[:4] == "DEPL":
            whole = True
        elif word[:4] == "DIRE":
            direction = True
        elif word[:4] in ("MINI", "MAXI", "RADI", "ORTH", "ROTA"):
            ctx.places["word"] = node
            ctx.fail(251, "BLOQ '{word}' is not available yet", at="word", word=word[:4])
        elif word[:4] in KNOWN:
            names.append(word[:4])
        else:
            ctx.places["word"] = node
            ctx.fail(
                197,
                "{word} is not the name of an unknown",
                at="word",
                word=word,
                known=" ".join(every),
                hint="here the unknowns are {known}; 'DEPL' means all of them",
            )
    if place is None:
        raise q.missing(MAILLAGE, "the nodes to block")
    nodes = support(ctx, place)
    if direction is not None:
        return directed(ctx, nodes, direction.coords, every, "BLOQ DIRECTION")
    if whole:
        names = [*names, *every]
    if not names:
        ctx.fail(
            7,
            "which unknown is blocked? A name is missing",
            known=" ".join(every),
            hint="here the unknowns are {known}; 'DEPL' means all of them",
        )
    return condition(ctx, nodes, list(dict.fromkeys(names)), "BLOQ " + " ".join(names))


SYMT = operator(
    "SYMT",
    topic="loads",
    summary="conditions of symmetry about a line or a plane",
    notice="The nodes of the mesh in the plane of three points (line of two in the plane) do not move "
    "normally to it. A node counts within the tolerance: a tenth of the density, or a millionth of "
    "the size of the mesh.",
    example=_EXAMPLE + "CL = SYMT 'DEPL' (0 0) (0 1) S ; LIST 'RESU' CL ;",
    see=["BLOQUER", "ANTI"],
)
ANTI = operator(
    "ANTI",
    topic="loads",
    summary="conditions of antisymmetry about a line or a plane",
    notice="The nodes of the mesh in the plane of three points (line of two in the plane) do not move along "
    "it. Tolerance as for SYMT.",
    example=_EXAMPLE + "CL = ANTI 'DEPL' (0 0) (0 1) S ; LIST 'RESU' CL ;",
    see=["BLOQUER", "SYMT"],
)


def _plane_normal(ctx: Context, p1: Point, p2: Point, p3: Point | None) -> FloatArray:
    a, b = p1.coords, p2.coords
    if int(ctx.option("DIME")) == 2:
        along = b - a
        normal = np.array([-along[1], along[0], 0.0])
    else:
        if p3 is None:
            raise ctx.operands.missing(POINT, "the third point of the plane")
        normal = np.cross(b - a, p3.coords - a)
    length = np.linalg.norm(normal)
    if length == 0:
        ctx.fail(237, "the points do not define a plane: they coincide or are aligned", at="p1")
    return np.asarray(normal / length)


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


_SYMMETRY = (
    Key("DEPL", "displacements (the default)"),
    Key("ROTA", "rotations"),
    Arg("p1", POINT, "point of the plane"),
    Arg("p2", POINT, "point of the plane"),
    Arg("p3", POINT, "point of the plane", optional=True),
    Arg("g", MAILLAGE, "mesh"),
    Arg("tol", FLOTTANT, "tolerance", optional=True),
)


@SYMT.form(*_SYMMETRY, gives=[RIGIDITE])
def _symt(
    ctx: Context, depl: bool, rota: bool, p1: Point, p2: Point, p3: Point | None, g: Maillage, tol: float | None
) -> Rigidite:
    normal = _plane_normal(ctx, p1, p2, p3)
    nodes = _in_plane(ctx, g, p1, normal, tol)
    names = DISPLACEMENTS[family(ctx)]
    axis = int(np.argmax(np.abs(normal)))
    if abs(abs(normal[axis]) - 1.0) < 1e-12:
        return condition(ctx, nodes, [names[axis]], "SYMT")
    return directed(ctx, nodes, normal, names, "SYMT")


@ANTI.form(*_SYMMETRY, gives=[RIGIDITE])
def _anti(
    ctx: Context, depl: bool, rota: bool, p1: Point, p2: Point, p3: Point | None, g: Maillage, tol: float | None
) -> Rigidite:
    normal = _plane_normal(ctx, p1, p2, p3)
    nodes = _in_plane(ctx, g, p1, normal, tol)
    names = DISPLACEMENTS[family(ctx)]
    first = np.asarray(p2.coords - p1.coords)
    parts = directed(ctx, nodes, first, names, "ANTI").parts
    if int(ctx.option("DIME")) == 3:
        parts += directed(ctx, nodes, np.cross(normal, first), names, "ANTI").parts
    return Rigidite(parts)


DEPI = operator(
    "DEPIMPOSE",
    topic="loads",
    summary="values of imposed displacements",
    notice="The second member of conditions: a value for all of them, or a CHPOINT with the unknowns that "
    "BLOQ names. To be added to the load.",
    example=_EXAMPLE + "CL = BLOQ 'UY' (S POIN 'DROI' (0 0) (1 0) 1.E-6) ; LIST 'RESU' (DEPI CL 0.01) ;",
    see=["BLOQUER"],
)


@DEPI.form(Arg("k", RIGIDITE, "conditions"), Arg("x", FLOTTANT, "value"), gives=[CHPOINT])
def _depi(ctx: Context, k: Rigidite, x: float) -> ChPoint:
    rows = _rows(ctx, k)
    nodes = np.concatenate([part.multipliers for part in rows])
    return ChPoint(node_store(ctx), {"FLX": (nodes, np.full(len(nodes), x))}, DISCRET)


@DEPI.form(Arg("k", RIGIDITE, "conditions"), Arg("field", CHPOINT, "values"), gives=[CHPOINT])
def _depi_field(ctx: Context, k: Rigidite, field: ChPoint) -> ChPoint:
    nodes, values = [], []
    for part in _rows(ctx, k):
        store = node_store(ctx)
        total = np.zeros(len(part.multipliers))
        for name in np.unique(part.name):
            if str(name) not in field.names:
                ctx.fail(181, "the field has no component {name}", at="field", name=str(name))
            terms = part.name == name
            np.add.at(
                total,
                part.row[terms],
                part.coefficients[terms] * field.at(str(name), store.canonical(part.node[terms])),
            )
        nodes.append(part.multipliers)
        values.append(total)
    return ChPoint(node_store(ctx), {"FLX": (np.concatenate(nodes), np.concatenate(values))}, DISCRET)


def _rows(ctx: Context, k: Rigidite) -> list[ConditionPart]:
    if not k.conditions:
        ctx.fail(26, "this matrix holds no condition", at="k", hint="BLOQ makes conditions")
    return k.conditions


FORC = operator(
    "FORCE",
    topic="loads",
    summary="forces on the nodes of a mesh or point",
    notice="`FORC V G`: the vector V is shared between the nodes of G, V/n each. `FORC 'FX' x ('FY' y) G` "
    "likewise, by component.",
    example=_EXAMPLE + "F = FORC (0 -1.E6) (S POIN 'DROI' (0 1) (1 1) 1.E-6) ; LIST F ;",
    see=["PRESSION"],
)


@FORC.form(Arg("v", POINT, "vector"), Arg("g", (MAILLAGE, POINT), "where"), gives=[CHPOINT])
def _forc(ctx: Context, v: Point, g: Maillage | Point) -> ChPoint:
    nodes = support(ctx, g)
    names = FORCES[family(ctx)]
    share = v.coords[: len(names)] / len(nodes)
    return ChPoint.from_table(node_store(ctx), names, nodes, np.tile(share, (len(nodes), 1)), DISCRET)


@FORC.form(
    *(Key(name, "component", Arg("x", FLOTTANT)) for name in ("FX", "FY", "FZ", "FR")),
    Arg("g", (MAILLAGE, POINT), "where"),
    gives=[CHPOINT],
)
def _forc_named(
    ctx: Context, fx: float | None, fy: float | None, fz: float | None, fr: float | None, g: Maillage | Point
) -> ChPoint:
    given = {n: x for n, x in (("FX", fx), ("FY", fy), ("FZ", fz), ("FR", fr)) if x is not None}
    wrong = [n for n in given if n not in FORCES[family(ctx)]]
    if wrong or not given:
        ctx.fail(
            197,
            "{name} is not a force here; the forces are {known}",
            name=wrong[0] if wrong else "this",
            known=" ".join(FORCES[family(ctx)]),
        )
    nodes = support(ctx, g)
    return ChPoint(
        node_store(ctx), {n: (nodes, np.full(len(nodes), x / len(nodes))) for n, x in given.items()}, DISCRET
    )


PRES = operator(
    "PRESSION",
    topic="loads",
    summary="nodal forces of a pressure",
    notice="Consistent forces of a pressure on facets of the boundary of the model; positive, it pushes into "
    "the solid, whichever way the facets turn. The pressure is a number or a CHPOINT (one component).",
    example=_EXAMPLE + "F = PRES 'MASS' MO 1.E6 (CONT S ELEM 'APPU' 'STRI' (S POIN 'DROI' (0 1) (1 1) 1.E-6)) ;\n"
    "LIST F ;",
    see=["FORCE", "FSUR"],
)
FSUR = operator(
    "FSUR",
    topic="loads",
    summary="nodal forces of a traction on facets",
    notice="Consistent forces of a uniform force per unit of area (of length in the plane) on facets of the model.",
    example=_EXAMPLE + "F = FSUR 'MASS' MO (0 -1.E6) (CONT S ELEM 'APPU' 'STRI' (S POIN 'DROI' (0 1) (1 1) 1.E-6)) ;\n"
    "LIST F ;",
    see=["PRESSION"],
)


def _sum(ctx: Context, dim: int, names: tuple[str, ...], parts: list[tuple[IntArray, FloatArray]]) -> ChPoint:
    nodes = np.unique(np.concatenate([cells.ravel() for cells, _ in parts]))
    local = [(np.searchsorted(nodes, cells), forces) for cells, forces in parts]
    total = assembly.assemble_vector(len(nodes), dim, local).reshape(len(nodes), dim)
    return ChPoint.from_table(node_store(ctx), names, nodes, total, DISCRET)


def _body(ctx: Context, model: Modele) -> tuple[int, tuple[str, ...], list[tuple[str, IntArray]]]:
    if not model.zones:
        ctx.fail(26, "this model has no solid", at="model")
    zone = model.zones[0]
    return zone.dim, FORCES[zone.family], [(z.shape, z.cells) for z in model.zones]


def _check_facets(ctx: Context, g: Maillage, dim: int) -> None:
    wrong = [b.shape for b in g.blocks if shape(b.shape).dim != dim - 1]
    if wrong or not g.n_cells:
        ctx.fail(
            16,
            "a pressure acts on facets, not on {shapes}",
            at="g",
            shapes=", ".join(wrong) or "an empty mesh",
            hint="FACE, ENVE or CONT give the facets of a solid; ELEM 'APPU' chooses among them",
        )


@PRES.form(
    Key("MASS", "on a solid", required=True),
    Arg("model", MMODEL, "model"),
    Arg("p", FLOTTANT, "pressure"),
    Arg("g", MAILLAGE, "facets"),
    gives=[CHPOINT],
)
def _pres(ctx: Context, mass: bool, model: Modele, p: float, g: Maillage) -> ChPoint:
    return _pressure(ctx, model, g, lambda cells: p)


@PRES.form(
    Key("MASS", "on a solid", required=True),
    Arg("model", MMODEL, "model"),
    Arg("p", CHPOINT, "pressure field"),
    Arg("g", MAILLAGE, "facets"),
    gives=[CHPOINT],
)
def _pres_field(ctx: Context, mass: bool, model: Modele, p: ChPoint, g: Maillage) -> ChPoint:
    if len(p.names) != 1:
        ctx.fail(26, "the pressure has several components", at="p")
    return _pressure(ctx, model, g, lambda cells: p.at(p.names[0], cells.ravel()).reshape(cells.shape))


def _pressure(ctx: Context, model: Modele, g: Maillage, value: Any) -> ChPoint:
    dim, names, body = _body(ctx, model)
    _check_facets(ctx, g, dim)
    X = node_store(ctx).coords[:, :dim]
    try:
        turned = facets_of_body(body, g.kernel_blocks)
    except EmptyContact as failure:
        ctx.fail(21, "{reason}", at="g", reason=failure.reason, hint="is the model made of the solid that has them?")
    return _sum(ctx, dim, names, [(c, assembly.pressure_load(shape(n), X[c], value(c))) for n, c in turned])


@FSUR.form(
    Key("MASS", "on a solid", required=True),
    Arg("model", MMODEL, "model"),
    Arg("v", POINT, "traction"),
    Arg("g", MAILLAGE, "facets"),
    gives=[CHPOINT],
)
def _fsur(ctx: Context, mass: bool, model: Modele, v: Point, g: Maillage) -> ChPoint:
    dim, names, _ = _body(ctx, model)
    _check_facets(ctx, g, dim)
    X = node_store(ctx).coords[:, :dim]
    return _sum(
        ctx,
        dim,
        names,
        [(b.cells, assembly.distributed_load(shape(b.shape), X[b.cells], v.coords[:dim])) for b in g.blocks],
    )
