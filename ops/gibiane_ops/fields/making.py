"""MANUEL on fields: nodal and element fields from names and values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, Refused, extend
from gibiane.values import CHPOINT, ENTIER, FLOTTANT, LISTMOTS, LISTREEL, MAILLAGE, MCHAML, MMODEL, MOT, POINT
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.supports import SUPPORTS, support_points
from gibiane_ops.values.algebra import SCALAIRE
from gibiane_ops.values.champs import DIFFUS, DISCRET, INDETERMINE, ChamZone, ChPoint, MChaml, Part
from gibiane_ops.values.listes import ListReel
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.modele import STRAINS, STRESSES, Modele, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store

NATURES = {"INDE": INDETERMINE, "DIFF": DIFFUS, "DISC": DISCRET}

MANU = extend("MANUEL")


@dataclass
class _Alone:
    """A value at one point of one element, zero elsewhere; numbers from 1."""

    element: int
    point: int
    value: float


@dataclass
class _Given:
    """What was read: where, components with values, and words."""

    where: Any = None
    count: int | None = None
    parts: list[tuple[str, Any]] = field(default_factory=list)
    names: Any = None
    values: Any = None
    words: dict[str, str] = field(default_factory=dict)


def _read(ctx: Context, q: Operands, places: tuple[str, ...], options: tuple[str, ...]) -> _Given:
    """Read operands in any order, then pairs of a component and its value until no more word is for us."""
    given = _Given()
    while q.values:
        value, node = q.take((*places, LISTMOTS, LISTREEL, ENTIER))
        if node is not None:
            _place(ctx, given, value, node)
            continue
        i = q.first_word()
        if i < 0 or q.is_operator_word(i):
            break
        option = q.read_keyword(options)
        if option in ("NATU", "TITR", "TYPE", "TITRE", "NATURE"):
            given.words[option[:4]] = str(q.need(MOT, f"'{option}'"))
        elif option == "REPA":
            given.words["REPA"] = "REPA"
        elif option == "POSI":
            given.words["support"] = q.need_keyword(SUPPORTS)
        elif option is not None:
            given.words["support"] = option
        elif given.count is not None and len(given.parts) >= given.count:
            break
        else:
            ctx.places["name"] = q.nodes[i]
            name = str(q.need(MOT)).strip()
            value = _alone(q) if "POSI" in options else None
            if value is None:
                value = q.read((FLOTTANT, LISTREEL))
            if value is None:
                raise q.missing("FLOTTANT or LISTREEL", f"the component {name}")
            given.parts.append((name, value))
    return given


def _alone(q: Operands) -> _Alone | None:
    """Read the numbers of an element and of a point, and a value, when these three come next."""
    if [type(v) for v in q.values[:2]] != [int, int] or len(q.values) < 3 or type(q.values[2]) not in (int, float):
        return None
    return _Alone(q.need(ENTIER), q.need(ENTIER), float(q.need(FLOTTANT)))


def _place(ctx: Context, given: _Given, value: Any, node: Any) -> None:
    if isinstance(value, int):
        given.count = value
    elif isinstance(value, ListReel):
        given.values = value
    elif isinstance(value, Maillage | Point | Modele):
        if given.where is not None:
            ctx.places["second"] = node
            ctx.fail(21, "one support is wanted, two are given", at="second")
        given.where = value
        ctx.places["where"] = node
    else:
        given.names = value


def _components(ctx: Context, given: _Given) -> list[tuple[str, Any]]:
    """Return the components asked for: the pairs, and those of the two lists (missing values are zero)."""
    parts = list(given.parts)
    if given.names is not None:
        values = [] if given.values is None else given.values.values.tolist()
        parts += [(n, values[k] if k < len(values) else 0.0) for k, n in enumerate(given.names.words)]
    if not parts:
        ctx.fail(37, "no component is given", hint="a name and a value: 'UX' 1.")
    if len({n for n, _ in parts}) < len(parts):
        ctx.fail(21, "one component is given twice ({names})", names=" ".join(n for n, _ in parts))
    return parts


@MANU.stream(
    Key("CHPO", "nodal field"),
    Key("NATURE", "nature", Arg("m", MOT)),
    Key("TITRE", "title", Arg("t", MOT)),
    syntax="'CHPO' g:MAILLAGE|POINT (n:ENTIER) name value ... | names:LISTMOTS values:LISTREEL ('NATU' m) ('TITR' t)",
    gives=[CHPOINT],
)
def _manu_chpo(ctx: Context, q: Operands) -> Any:
    if not _starts_with(q, "CHPO"):
        return Refused
    given = _read(ctx, q, (MAILLAGE, POINT), ("NATU", "TITR"))
    if given.where is None:
        raise q.missing(MAILLAGE, "the nodes of the field")
    nature = NATURES.get(given.words.get("NATU", "INDE")[:4].upper())
    if nature is None:
        ctx.fail(7, "unknown nature '{nature}'; accepted: INDETERMINE, DIFFUS, DISCRET", nature=given.words["NATU"])
    store = node_store(ctx)
    points = isinstance(given.where, Maillage) and given.where.shapes == ["POI1"]
    if isinstance(given.where, Point):
        nodes = np.array([given.where.node])
    else:
        nodes = given.where.cells("POI1").ravel() if points else given.where.nodes_in_order()
    parts: dict[str, Part] = {}
    for name, value in _components(ctx, given):
        if isinstance(value, ListReel):
            if len(value.values) != len(nodes):
                ctx.fail(
                    212,
                    "the component {name} has {given} values for {wanted} points",
                    at="where",
                    name=name,
                    given=len(value.values),
                    wanted=len(nodes),
                    hint="a LISTREEL has one value per node, in the order of CHAN 'POI1'",
                )
            parts[name] = _distinct(ctx, nodes, value.values, nature)
        else:
            parts[name] = _distinct(ctx, nodes, np.full(len(nodes), float(value)), nature)
    return ChPoint(store, parts, nature, given.words.get("TITR", ""))


def _starts_with(q: Operands, word: str) -> bool:
    i = q.first_word()
    if i < 0 or str(q.values[i])[:4] != word:
        return False
    del q.values[i], q.nodes[i]
    return True


def _distinct(ctx: Context, nodes: IntArray, values: FloatArray, nature: str) -> Part:
    """Give each node one value: the sum of a DISCRET field, the common value of another one."""
    unique, first, inverse = np.unique(nodes, return_index=True, return_inverse=True)
    if len(unique) == len(nodes):
        return nodes, values
    if nature == DISCRET:
        return unique, np.asarray(np.bincount(inverse, values, minlength=len(unique)), np.float64)
    if nature == INDETERMINE:
        ctx.fail(
            1041,
            "{count} points come twice: the nature must say what becomes of their values",
            at="where",
            count=len(nodes) - len(unique),
            hint="'NATU' 'DISCRET' sums them, 'NATU' 'DIFFUS' wants them equal",
        )
    if not np.array_equal(values[first][inverse], values):
        ctx.fail(1042, "a point that comes twice has two values", at="where")
    return unique, values[first]


@MANU.stream(
    Key(("CHML", "CHAM"), "element field", name="what"),
    Key("TYPE", "sub-type", Arg("t", MOT)),
    Key("REPA", "one value per element", Arg("values", LISTREEL)),
    Key("POSI", "word before the points"),
    Key(SUPPORTS, "points", name="support"),
    syntax="'CHML' model:MMODEL|MAILLAGE name (element:ENTIER point:ENTIER) value ... "
    "('REPA' name values:LISTREEL) ('TYPE' t) ('POSI') (support)",
    gives=[MCHAML],
)
def _manu_chml(ctx: Context, q: Operands) -> Any:
    if not (_starts_with(q, "CHML") or _starts_with(q, "CHAM")):
        return Refused
    given = _read(ctx, q, (MMODEL, MAILLAGE), ("TYPE", "REPA", "TITR", "POSI", *SUPPORTS))
    if given.where is None:
        raise q.missing(MMODEL, "the elements of the field")
    on_mesh = isinstance(given.where, Maillage)
    zones = mesh_zones(ctx, given.where) if on_mesh else [*given.where.zones, *given.where.heated, *given.where.loads]
    if not zones:
        ctx.fail(21, "there is no element to carry the field", at="where")
    support = given.words.get("support") or ("NOEUD" if on_mesh else "STRESSES")
    parts = _components(ctx, given)
    total = sum(len(z.cells) for z in zones)
    result, start = [], 0
    for zone in zones:
        m, n = len(zone.cells), len(support_points(shape(zone.shape), support))
        columns = []
        for name, value in parts:
            if isinstance(value, _Alone):
                columns.append(_one_value(ctx, value, start, (m, n), total))
            elif isinstance(value, ListReel):
                if len(value.values) != total:
                    ctx.fail(
                        212,
                        "the component {name} has {given} values for {wanted} elements",
                        at="where",
                        name=name,
                        given=len(value.values),
                        wanted=total,
                    )
                columns.append(np.repeat(value.values[start : start + m, None], n, axis=1))
            else:
                columns.append(np.full((m, n), float(value)))
        result.append(ChamZone(zone, [name for name, _ in parts], np.stack(columns, axis=2)))
        start += m
    names = [name for name, _ in parts]
    return MChaml(result, given.words.get("TYPE", "").strip() or _subtype(names), support, given.words.get("TITR", ""))


def _one_value(ctx: Context, given: _Alone, start: int, size: tuple[int, int], total: int) -> FloatArray:
    """Return the values of one zone, whose first element has the number `start` (from 0) in the model."""
    for number, count in ((given.element, total), (given.point, size[1])):
        if not 1 <= number <= count:
            ctx.fail(1068, "there is no number {number}: this object has {size}", at="where", number=number, size=count)
    values = np.zeros(size)
    if start < given.element <= start + size[0]:
        values[given.element - 1 - start, given.point - 1] = given.value
    return values


def _subtype(names: list[str]) -> str:
    """Guess a sub-type from the names of components."""
    for tables, subtype in ((STRESSES, "CONTRAINTES"), (STRAINS, "DEFORMATIONS")):
        if any(set(names) <= set(table) for table in tables.values()):
            return subtype
    return "CARACTERISTIQUES" if set(names) <= {"YOUN", "NU", "RHO", "ALPH"} else SCALAIRE


def mesh_zones(ctx: Context, mesh: Maillage) -> list[ModelZone]:
    """Return the zones of element fields on a bare mesh; the same ones each time, so that such fields combine."""
    known: dict[int, tuple[Maillage, list[ModelZone]]] = ctx.state.setdefault("zones of meshes", {})
    found = known.get(id(mesh))
    if found is None:
        mode = ctx.option("MODE") or ("TRID" if int(ctx.option("DIME")) == 3 else "PLAN DEFO")
        zones = [ModelZone(Maillage(mesh.store, [b]), "", (), mode) for b in mesh.blocks]
        found = known[id(mesh)] = mesh, zones
    return found[1]
