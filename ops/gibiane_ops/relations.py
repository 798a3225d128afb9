"""RELA: linear relations between unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, Refused, operator
from gibiane.values import CHPOINT, ENTIER, FLOTTANT, LISTMOTS, MAILLAGE, MMODEL, MOT, POINT, RIGIDITE
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.hanging import hanging_nodes
from gibiane_ops.kernels.mesh.hosts import hosted
from gibiane_ops.kernels.rigid import dependent_motion
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.conditions import KNOWN, ROTATIONS, displacements, family, rows_of, support
from gibiane_ops.values.listes import ListMots
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.modele import DUALS, Modele
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store
from gibiane_ops.values.rigidite import ConditionTerms, Rigidite

SENSES = {"MINI": ">", "MAXI": "<"}
UNKNOWN_OF = {force: unknown for unknown, force in DUALS.items()}

RELA = operator(
    "RELA",
    topic="loads",
    summary="linear relations between unknowns",
    notice="`RELA a1 m1 G1 + a2 m2 G2 - a3 m3 G3`: relation i holds between the unknowns m1 of node i of G1, m2 of "
    "node i of G2 and so on; a mesh of one node, or a point, stands in all relations. A coefficient is 1 if absent; "
    "m is the name of an unknown, or 'DEPL' 'DIRECTION' V ('ROTA' 'DIRECTION' V) for a displacement (rotation) along "
    "a vector. The sum is 0, or the value that DEPI gives; 'MINI': at least, 'MAXI': at most. `RELA CHPO`: one "
    "relation, whose coefficients are the values of the field; with 'DUAL' CHPO2 its reaction is LX times CHPO2 "
    "(names of forces, or of the unknowns that they go with) in place of LX times CHPO, and the system, no longer "
    "symmetric, is solved by LU: friction of known direction, say. CHPO2 must work against the relation. "
    "'ENSE' m G: the unknown m is the same on all of G. "
    "'CORI' 'DEPL' G: G moves as a rigid body. 'MILI' (names) G: nodes in the middle of edges follow the ends. "
    "G1 'ACCRO' G2 (names) (tol): each node of G1 that an element of G2 holds moves with it. G1 'GLISSANT' G2 (tol): "
    "likewise, but free to slide along the line G1. `RELA MODL`: displacements stay continuous where elements of the "
    "model are smaller than their neighbours (nodes in the middle of an edge or of a face, REMAILLER 'LOCA') or of "
    "second degree beside linear ones; no relation where there is none.",
    example="OPTI DIME 2 ELEM QUA4 ; L = DROI 2 (0 0) (1 0) ; S = L TRAN 2 (0 1) ;\n"
    "R = RELA 'UX' L - 'UX' (S COTE 3) ; LIST 'RESU' R ;\n"
    "LIST 'RESU' (RELA 'ENSE' 'UY' (S COTE 3)) ;",
    see=["BLOQUER", "DEPIMPOSE"],
)


@dataclass
class _Term:
    """One term of a relation: coefficients on several names (the components of a direction), and where."""

    names: Sequence[str]
    coefficients: FloatArray
    nodes: IntArray
    words: str


@RELA.stream(
    Key("ENSE", "one value over a mesh", Arg("name", MOT), Arg("g", MAILLAGE)),
    syntax="'ENSE' name:MOT g:MAILLAGE",
    gives=[RIGIDITE],
)
def _ense(ctx: Context, q: Operands) -> Any:
    if q.read_keyword(("ENSE",)) is None:
        return Refused
    place = q.read(MAILLAGE)
    name = str(q.need(MOT, "the unknown that is the same everywhere"))[:4].strip()
    nodes = support(ctx, place if place is not None else q.need(MAILLAGE, "the nodes that keep together"))
    n = len(nodes) - 1
    row = np.arange(n)
    terms = [(row, nodes[1:], name, np.ones(n)), (row, np.full(n, nodes[0]), name, -np.ones(n))]
    return rows_of(ctx, node_store(ctx).coords[nodes[1:]], terms, f"RELA ENSE {name}")


@RELA.stream(
    Key("CORI", "rigid body"),
    Key("DEPL", "by displacements"),
    Key("NOVERIF", "accepted, changes nothing"),
    syntax="'CORI' 'DEPL' ('NOVERIF') g:MAILLAGE",
    gives=[RIGIDITE],
)
def _cori(ctx: Context, q: Operands) -> Any:
    if q.read_keyword(("CORI",)) is None:
        return Refused
    if q.read_keyword(("ROTA",)) is not None:
        ctx.fail(251, "RELA 'CORI' 'ROTA' is not available yet", hint="no element here has rotations; 'CORI' 'DEPL'")
    q.read_keyword(("DEPL",))
    q.read_keyword(("NOVERIF",))
    nodes = support(ctx, q.need(MAILLAGE, "the mesh that moves as a rigid body"))
    names = np.array(displacements(ctx))
    if family(ctx) == "AXIS":
        ctx.fail(34, "a body of revolution moves along its axis only: block UR and use 'ENSE' 'UZ'")
    points = node_store(ctx).coords[nodes][:, : len(names)]
    masters, followers, coefficients = dependent_motion(points)
    d = len(names)
    m = len(followers)
    row = np.repeat(np.arange(m), len(masters))
    master = np.tile(masters, m)
    terms: list[Any] = [
        (np.arange(m), nodes[followers // d], names[followers % d], np.ones(m)),
        (row, nodes[master // d], names[master % d], -coefficients.ravel()),
    ]
    return rows_of(ctx, node_store(ctx).coords[nodes[followers // d]], terms, "RELA CORI")


@RELA.stream(
    Key("MILI", "middle nodes follow the ends", Arg("names", LISTMOTS, optional=True)),
    syntax="'MILI' (names:LISTMOTS) g:MAILLAGE",
    gives=[RIGIDITE],
)
def _mili(ctx: Context, q: Operands) -> Any:
    if q.read_keyword(("MILI",)) is None:
        return Refused
    names = _names(ctx, q.read(LISTMOTS))
    mesh = q.need(MAILLAGE, "the mesh of second degree")
    found = {}
    for name, cells in mesh.kernel_blocks:
        of = shape(name)
        linear = of.ref_nodes[: of.n_corners]
        for node in range(of.n_corners, of.n_nodes):
            distance = np.abs(linear[:, None] + linear[None, :] - 2 * of.ref_nodes[node]).max(axis=2)
            a, b = np.argwhere(np.triu(distance < 1e-12, 1))[0]
            found.update(dict(zip(cells[:, node].tolist(), cells[:, [a, b]].tolist(), strict=True)))
    if not found:
        ctx.fail(16, "this mesh has no nodes in the middle of edges", hint="CHAN 'QUADRATIQUE' makes them")
    middle = np.array(list(found), np.int64)
    ends = np.array(list(found.values()), np.int64)
    n = len(middle)
    row = np.arange(n)
    half = np.full(n, 0.5)
    parts = []
    for name in names:
        terms = [(row, middle, name, np.ones(n)), (row, ends[:, 0], name, -half), (row, ends[:, 1], name, -half)]
        parts += rows_of(ctx, node_store(ctx).coords[middle], terms, f"RELA MILI {name}").parts
    return Rigidite(parts)


@RELA.form(Arg("model", MMODEL, "model"), gives=[RIGIDITE])
def _continuous(ctx: Context, model: Modele) -> Rigidite:
    """Tie the nodes in the middle of edges and faces of larger or linear elements; masters may hang in their turn."""
    store = node_store(ctx)
    blocks = [(zone.shape, zone.cells) for zone in model.zones]
    nodes, masters = hanging_nodes(store.coords, blocks)
    used = masters >= 0
    row = np.repeat(np.arange(len(nodes)), used.sum(axis=1))
    share = np.repeat(1.0 / used.sum(axis=1), used.sum(axis=1))
    if not len(nodes):
        return Rigidite([])
    parts = []
    for name in _names(ctx, None):
        terms: list[Any] = [
            (np.arange(len(nodes)), nodes, name, np.ones(len(nodes))),
            (row, masters[used], name, -share),
        ]
        parts += rows_of(ctx, store.coords[nodes], terms, f"RELA MODL {name}").parts
    return Rigidite(parts)


@RELA.form(
    Arg("g1", (MAILLAGE, POINT), "nodes that are held"),
    Key("ACCRO", "tied to the elements that hold them", required=True),
    Arg("g2", MAILLAGE, "elements"),
    Arg("names", LISTMOTS, "unknowns", optional=True),
    Arg("tol", FLOTTANT, "how far outside, relative to the element", optional=True),
    gives=[RIGIDITE],
)
def _accro(
    ctx: Context, g1: Maillage | Point, accro: bool, g2: Maillage, names: ListMots | None, tol: float | None
) -> Rigidite:
    nodes, weights = _hosts(ctx, g1, g2, tol)
    store = node_store(ctx)
    entries = weights.tocoo()
    parts = []
    for name in _names(ctx, names):
        terms = [
            (np.arange(len(nodes)), nodes, name, np.ones(len(nodes))),
            (entries.row.astype(np.int64), entries.col.astype(np.int64), name, -entries.data),
        ]
        parts += rows_of(ctx, store.coords[nodes], terms, f"RELA ACCRO {name}").parts
    return Rigidite(parts)


@RELA.form(
    Arg("g1", MAILLAGE, "line that slides along itself"),
    Key("GLISSANT", "tied across the line", required=True),
    Arg("g2", MAILLAGE, "elements"),
    Arg("names", LISTMOTS, "unknowns", optional=True),
    Arg("tol", FLOTTANT, "how far outside, relative to the element", optional=True),
    gives=[RIGIDITE],
)
def _slide(
    ctx: Context, g1: Maillage, glissant: bool, g2: Maillage, names: ListMots | None, tol: float | None
) -> Rigidite:
    if not all(name.startswith("SEG") for name in g1.shapes) or not g1.n_cells:
        ctx.fail(16, "what slides is a line, not {shapes}", at="g1", shapes=", ".join(g1.shapes) or "an empty mesh")
    nodes, weights = _hosts(ctx, g1, g2, tol)
    unknowns = _names(ctx, names)
    across = _across(g1, nodes, node_store(ctx).coords, len(unknowns))
    entries = weights.tocoo()
    row, column = entries.row.astype(np.int64), entries.col.astype(np.int64)
    parts = []
    for vectors in across:
        terms: list[Any] = []
        for i, name in enumerate(unknowns):
            terms.append((np.arange(len(nodes)), nodes, name, vectors[:, i]))
            terms.append((row, column, name, -entries.data * vectors[row, i]))
        parts += rows_of(ctx, node_store(ctx).coords[nodes], terms, "RELA GLISSANT").parts
    return Rigidite(parts)


def _across(line: Maillage, nodes: IntArray, coords: FloatArray, dim: int) -> list[FloatArray]:
    """Return unit vectors normal to a line at its nodes: one in the plane, two in space, each (n, dim)."""
    total = np.zeros((len(coords), 3))
    for block in line.blocks:
        ends = block.cells[:, :2]
        for at in block.cells.T:
            np.add.at(total, at, coords[ends[:, 1]] - coords[ends[:, 0]])
    along = total[nodes] / np.linalg.norm(total[nodes], axis=1, keepdims=True)
    if dim == 2:
        return [np.column_stack([-along[:, 1], along[:, 0]])]
    smallest = np.eye(3)[np.argmin(np.abs(along), axis=1)]
    first = np.cross(along, smallest)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return [first, np.cross(along, first)]


def _hosts(ctx: Context, g1: Maillage | Point, g2: Maillage, tol: float | None) -> tuple[IntArray, Any]:
    """Return the nodes of g1 that elements of g2 hold, and the weights of the nodes of the session at each."""
    store = node_store(ctx)
    nodes = np.setdiff1d(support(ctx, g1, "g1"), g2.nodes)
    dim = max(int(ctx.option("DIME")), 1)
    inside, weights = hosted(
        store.coords[nodes][:, :dim], store.coords[:, :dim], g2.kernel_blocks, 1e-5 if tol is None else tol
    )
    if not len(inside):
        ctx.fail(
            21,
            "no element of the second mesh holds a node of the first that is not its own",
            at="g1",
            hint="a last number says how far outside an element a node may be, relative to its size (1.E-5)",
        )
    return nodes[inside], weights


def _names(ctx: Context, names: ListMots | None) -> list[str]:
    return [w.strip()[:4] for w in names.words] if names is not None else list(displacements(ctx))


@RELA.form(
    Arg("field", CHPOINT, "coefficients"),
    Key(("MINI", "MAXI"), "at least, at most", name="sense"),
    Key("DUAL", "its reaction, for a multiplier of one", Arg("reactions", CHPOINT)),
    gives=[RIGIDITE],
)
def _field(ctx: Context, field: ChPoint, sense: str | None, dual: ChPoint | None) -> Rigidite:
    terms = _terms_of(ctx, field, "field")
    centre = node_store(ctx).coords[np.unique(np.concatenate([t[1] for t in terms]))].mean(axis=0)
    made = rows_of(ctx, centre[None], terms, "RELA CHPOINT", SENSES.get(sense or "", "="))
    if dual is not None:
        row, node, names, values = zip(*_terms_of(ctx, dual, "dual"), strict=True)
        name = np.repeat([UNKNOWN_OF.get(n, n) for n in names], [len(r) for r in row])
        made.conditions[0].own_reactions = ConditionTerms(
            np.concatenate(row), np.concatenate(node), name, np.concatenate(values)
        )
    return made


def _terms_of(ctx: Context, field: ChPoint, at: str) -> list[tuple[IntArray, IntArray, str, FloatArray]]:
    """Return the values of a field, which are not zero, as terms of one relation."""
    terms = []
    for name, (nodes, values) in field.parts.items():
        used = values != 0
        if used.any():
            terms.append((np.zeros(int(used.sum()), np.int64), nodes[used], name, values[used]))
    if not terms:
        ctx.fail(26, "all coefficients of the relation are zero", at=at)
    return terms


@RELA.stream(
    Key(("MINI", "MAXI"), "at least, at most", name="sense"),
    Key("DEPL", "displacement along a vector"),
    Key("ROTA", "rotation along a vector"),
    Key("DIRECTION", "vector", Arg("v", POINT)),
    syntax="('MINI'|'MAXI') (a) name|'DEPL' 'DIRECTION' v:POINT g:MAILLAGE|POINT +|- (a) name g...",
    gives=[RIGIDITE],
)
def _rela(ctx: Context, q: Operands) -> Any:
    sense = SENSES.get(q.read_keyword(tuple(SENSES)) or "", "=")
    terms: list[_Term] = []
    while True:
        sign = 1.0
        i = q.first_word()
        if i >= 0 and q.values[i] in ("+", "-"):
            sign = -1.0 if q.values[i] == "-" else 1.0
            del q.values[i], q.nodes[i]
        elif terms and not (q.values and type(q.values[0]) in (int, float)):
            break
        terms.append(_term(ctx, q, sign))
    many = [t for t in terms if len(t.nodes) > 1]
    n = len(many[0].nodes) if many else 1
    wrong = next((t for t in many if len(t.nodes) != n), None)
    if wrong is not None:
        ctx.fail(
            26,
            "the meshes of the terms have {first} and {other} nodes: a relation takes one node of each",
            first=n,
            other=len(wrong.nodes),
            hint="a mesh of one node, or a point, stands in all relations",
        )
    row = np.arange(n)
    entries: list[Any] = []
    for term in terms:
        nodes = np.broadcast_to(term.nodes, n)
        entries += [
            (row, nodes, name, np.full(n, x)) for name, x in zip(term.names, term.coefficients, strict=True) if x != 0
        ]
    label = "RELA " + " ".join(t.words for t in terms).removeprefix("+")
    where = node_store(ctx).coords[np.broadcast_to((many or terms)[0].nodes, n)]
    return rows_of(ctx, where, entries, label, sense)


def _term(ctx: Context, q: Operands, sign: float) -> _Term:
    value = q.read((ENTIER, FLOTTANT))
    factor = sign * (1.0 if value is None else float(value))
    place = q.read((MAILLAGE, POINT))
    i = q.first_word()
    ctx.places["name"] = q.nodes[i] if i >= 0 else ctx.node
    word = str(q.need(MOT, "the name of an unknown")).strip()[:4]
    names: Sequence[str] = (word,)
    weights = np.array([factor])
    if word in ("DEPL", "ROTA"):
        if q.read_keyword(("DIRECTION",)) is None:
            ctx.fail(7, "a keyword is missing: {words}", at="name", words="'DIRECTION'")
        vector = q.need(POINT, "the direction").coords
        names = displacements(ctx) if word == "DEPL" else ROTATIONS[family(ctx)]
        length = float(np.linalg.norm(vector[: len(names)]))
        if length == 0:
            ctx.fail(239, "the direction is null", at="name")
        weights = factor * vector[: len(names)] / length
    elif word == "DUAL":
        ctx.fail(37, "'DUAL' wants a second field behind it", at="name", hint="RELA CHPO 'DUAL' CHPO2")
    elif word not in KNOWN:
        known = " ".join(displacements(ctx))
        hint = "here the unknowns are {known}; 'DEPL' 'DIRECTION' V takes them along a vector"
        ctx.fail(197, "{word} is not the name of an unknown", at="name", word=word, known=known, hint=hint)
    if place is None:
        place = q.need((MAILLAGE, POINT), "the nodes of the relation")
    nodes = place.nodes_in_order() if isinstance(place, Maillage) else np.array([place.node])
    return _Term(names, weights, nodes, f"{'-' if factor < 0 else '+'}{word}")
