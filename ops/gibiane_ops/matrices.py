"""Matrices made and taken apart by hand: MANU 'RIGI', EXTR of a RIGIDITE, CHAN 'INCO'."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, Refused, extend
from gibiane.values import CHPOINT, LISTMOTS, LISTREEL, MAILLAGE, MOT, POINT, RIGIDITE
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.values.champs import DIFFUS, ChPoint
from gibiane_ops.values.listes import ListMots
from gibiane_ops.values.maillage import Maillage, cells_in_turn
from gibiane_ops.values.modele import dual_of
from gibiane_ops.values.nodes import node_store
from gibiane_ops.values.rigidite import ConditionPart, MatrixPart, Rigidite

MANU, EXTR, CHAN = extend("MANUEL"), extend("EXTRAIRE"), extend("CHANGER")


@dataclass
class _Given:
    """What MANU 'RIGI' reads."""

    where: Any = None
    names: list[ListMots] = field(default_factory=list)
    duals: list[ListMots] = field(default_factory=list)
    rows: list[FloatArray] = field(default_factory=list)
    kind: str = ""


def _read(ctx: Context, q: Operands) -> _Given:
    given, dual = _Given(), False
    while q.values:
        value, node = q.take((MAILLAGE, POINT, CHPOINT, LISTMOTS, LISTREEL))
        if node is None:
            i = q.first_word()
            if i < 0 or q.is_operator_word(i):
                break
            word = q.need_keyword(("TYPE", "DUAL", "ANTI", "QUEL", "DIAG"))
            if word == "TYPE":
                q.need(MOT, "the sub-type")
            elif word == "DUAL":
                dual = True
            else:
                given.kind = word
        elif isinstance(value, ListMots):
            (given.duals if dual else given.names).append(value)
        elif isinstance(value, Maillage) or value.type_name in (POINT, CHPOINT):
            given.where = value
            ctx.places["where"] = node
        else:
            given.rows.append(np.asarray(value.values, np.float64))
            ctx.places["rows"] = node
    return given


@MANU.stream(
    Key("RIGIDITE", "matrix"),
    Key("TYPE", "sub-type, accepted", Arg("t", MOT)),
    Key("DUAL", "names of the forces follow"),
    Key(("ANTI", "QUEL"), "antisymmetric, or without symmetry", name="kind"),
    Key("DIAG", "diagonal matrix of a CHPOINT"),
    syntax="'RIGI' g:MAILLAGE|POINT names:LISTMOTS... ('DUAL' names:LISTMOTS...) ('ANTI'|'QUEL') values:LISTREEL... "
    "| 'RIGI' field:CHPOINT 'DIAG'",
    gives=[RIGIDITE],
)
def _manu_rigi(ctx: Context, q: Operands) -> Any:
    i = q.first_word()
    if i < 0 or str(q.values[i])[:4] != "RIGI":
        return Refused
    del q.values[i], q.nodes[i]
    given = _read(ctx, q)
    if isinstance(given.where, ChPoint):
        return _diagonal(ctx, given)
    if given.where is None:
        raise q.missing(MAILLAGE, "the elements of the matrix")
    if not given.names:
        raise q.missing(LISTMOTS, "the names of the unknowns")
    if not given.rows:
        raise q.missing(LISTREEL, "the values of the matrix")
    return _elementary(ctx, given)


def _diagonal(ctx: Context, given: _Given) -> Rigidite:
    if given.kind != "DIAG":
        ctx.fail(7, "a matrix of a field is diagonal: 'DIAG' is missing", at="where")
    where: ChPoint = given.where
    names = where.names
    values = where.table(names, where.nodes)
    matrix = sp.csr_array(sp.diags_array(values.ravel()))
    return Rigidite([MatrixPart(where.nodes, names, [dual_of(n) for n in names], matrix)])


def _elementary(ctx: Context, given: _Given) -> Rigidite:
    """Make a matrix whose elementary matrices are all the same."""
    where = given.where
    mesh = where if isinstance(where, Maillage) else Maillage.of_nodes(where.store, np.array([where.node]))
    block = mesh.single()
    if block is None:
        ctx.fail(
            25, "elements of one type are wanted, this mesh holds {known}", at="where", known=" ".join(mesh.shapes)
        )
    cells = cells_in_turn(block.shape, block.cells)
    names = _per_node(ctx, given.names, cells.shape[1])
    duals = (
        _per_node(ctx, given.duals, cells.shape[1])
        if given.duals
        else [[dual_of(name) for name in each] for each in names]
    )
    if [len(n) for n in names] != [len(d) for d in duals]:
        ctx.fail(212, "there are not as many names of forces as of unknowns")
    size = sum(len(each) for each in names)
    each = _square(ctx, given, size)
    every = list(dict.fromkeys(n for own in names for n in own))
    pairs = {n: d for own, dual in zip(names, duals, strict=True) for n, d in zip(own, dual, strict=True)}
    nodes = mesh.nodes
    place = np.concatenate(
        [
            np.searchsorted(nodes, cells[:, k])[:, None] * len(every) + [every.index(n) for n in own]
            for k, own in enumerate(names)
        ],
        axis=1,
    )
    total = len(nodes) * len(every)
    shape = (len(cells), size, size)
    rows = np.broadcast_to(place[:, :, None], shape).ravel()
    columns = np.broadcast_to(place[:, None, :], shape).ravel()
    data = np.broadcast_to(each, shape).ravel()
    matrix = sp.csr_array((data, (rows, columns)), shape=(total, total))
    matrix.sum_duplicates()
    part = MatrixPart(nodes, every, [pairs[n] for n in every], matrix, mesh)
    part.symmetric = bool(np.array_equal(each, each.T))
    return Rigidite([part])


def _per_node(ctx: Context, lists: list[ListMots], count: int) -> list[list[str]]:
    """Return the names at each node of an element: one list for all, or one per node."""
    if len(lists) not in (1, count):
        ctx.fail(
            212,
            "one LISTMOTS for all nodes or {count}, one per node of an element, are wanted; {given} are given",
            count=count,
            given=len(lists),
        )
    words = [[w.strip() for w in each.words] for each in lists]
    return words * count if len(words) == 1 else words


def _square(ctx: Context, given: _Given, n: int) -> FloatArray:
    """Return the elementary matrix, (n, n), from its rows, whole or up to the diagonal, in one list or several."""
    lengths = [len(row) for row in given.rows]
    values = np.concatenate(given.rows)
    triangle = given.kind != "QUEL" and (
        (len(lengths) == 1 and n > 1 and lengths[0] == n * (n + 1) // 2) or lengths == list(range(1, n + 1))
    )
    if not triangle and len(values) != n * n:
        ctx.fail(
            212,
            "the matrix has {n} rows: {whole} values, or {half} up to the diagonal, are wanted; {given} are given",
            at="rows",
            n=n,
            whole=n * n,
            half=n * (n + 1) // 2,
            given=len(values),
        )
    sign = -1.0 if given.kind == "ANTI" else 1.0
    if triangle:
        each = np.zeros((n, n))
        each[np.tril_indices(n)] = values
        return np.asarray(each + sign * np.tril(each, -1).T, np.float64)
    each = values.reshape(n, n)
    if given.kind != "QUEL" and not np.array_equal(each, sign * each.T):
        ctx.fail(
            21,
            "the matrix is not antisymmetric" if sign < 0 else "the matrix is not symmetric",
            at="rows",
            hint="'QUEL' makes a matrix without symmetry",
        )
    return each


# -- parts -----------------------------------------------------------------------------------------------------------


def _multipliers(k: Rigidite, unilateral: bool = False) -> IntArray:
    found = [np.zeros(0, np.int64)]
    found += [c.multipliers for c in k.conditions if not unilateral or c.sense != "="]
    found += [c.multipliers for c in k.contacts]
    return np.unique(np.concatenate(found))


def _nodes(k: Rigidite) -> IntArray:
    found = [np.zeros(0, np.int64), *(p.nodes for p in k.matrices), *(c.node for c in k.conditions)]
    found += [c.reactions.node for c in k.conditions]
    for contact in k.contacts:
        pairs = contact.pairs.pairs.ravel()
        found.append(pairs[pairs >= 0])
    return np.unique(np.concatenate(found))


@EXTR.form(
    Arg("k", RIGIDITE, "matrix"),
    Key("MAIL", "nodes", required=True),
    Key(("NOMU", "MULT", "UNIL"), "without multipliers, these alone, those of unilateral conditions", name="which"),
    gives=[MAILLAGE],
)
def _nodes_of_matrix(ctx: Context, k: Rigidite, mail: bool, which: str | None) -> Maillage:
    store = node_store(ctx)
    chosen = [] if which in ("MULT", "UNIL") else [_nodes(k)]
    if which != "NOMU":
        chosen.append(_multipliers(k, which == "UNIL"))
    return Maillage.of_nodes(store, np.unique(store.canonical(np.concatenate(chosen))))


@EXTR.form(
    Arg("k", RIGIDITE, "matrix"),
    Key("COMP", "names of the unknowns", required=True),
    Key("DUAL", "of the forces"),
    gives=[LISTMOTS],
)
def _names_of_matrix(ctx: Context, k: Rigidite, comp: bool, dual: bool) -> ListMots:
    names = [n for p in k.matrices for n in (p.duals if dual else p.names)]
    for condition in k.conditions:
        used = [str(n) for n in np.unique(condition.reactions.name if dual else condition.name)]
        names += [dual_of(n) for n in used] if dual else used
    if k.conditions or k.contacts:
        names.append("FLX" if dual else "LX")
    return ListMots(list(dict.fromkeys(names)))


@EXTR.form(
    Arg("k", RIGIDITE, "matrix"), Key("DIAG", "diagonal, by the names of the unknowns", required=True), gives=[CHPOINT]
)
def _diagonal_of_matrix(ctx: Context, k: Rigidite, diag: bool) -> ChPoint:
    if not k.matrices:
        ctx.fail(26, "there is no stiffness among these conditions", at="k", hint="RIGI makes it from a model")
    total: dict[str, list[tuple[IntArray, FloatArray]]] = {}
    for part in k.matrices:
        values = part.matrix.diagonal().reshape(len(part.nodes), -1)
        for i, name in enumerate(part.names):
            total.setdefault(name, []).append((node_store(ctx).canonical(part.nodes), values[:, i]))
    parts = {}
    for name, pieces in total.items():
        nodes = np.unique(np.concatenate([n for n, _ in pieces]))
        where = np.searchsorted(nodes, np.concatenate([n for n, _ in pieces]))
        total_values = np.bincount(where, np.concatenate([v for _, v in pieces]), minlength=len(nodes))
        parts[name] = (nodes, np.asarray(total_values, np.float64))
    return ChPoint(node_store(ctx), parts, DIFFUS)


@EXTR.form(
    Arg("k", RIGIDITE, "matrix"),
    Arg("names", LISTMOTS, "unknowns kept"),
    Arg("duals", LISTMOTS, "their forces"),
    gives=[RIGIDITE],
)
def _some_unknowns(ctx: Context, k: Rigidite, names: ListMots, duals: ListMots) -> Rigidite:
    kept = [w.strip() for w in names.words]
    parts = []
    for part in k.matrices:
        own = [i for i, n in enumerate(part.names) if n in kept]
        if [part.duals[i] for i in own] != [d.strip() for d in duals.words if d.strip() in part.duals]:
            ctx.fail(
                26,
                "the forces asked for are not those of the unknowns: the matrix would not be square",
                at="duals",
                hint="the forces of {names} are {forces}",
                names=" ".join(part.names),
                forces=" ".join(part.duals),
            )
        if own:
            rows = (np.arange(len(part.nodes))[:, None] * len(part.names) + own).ravel()
            matrix = sp.csr_array(part.matrix[rows][:, rows])
            new = MatrixPart(part.nodes, [part.names[i] for i in own], [part.duals[i] for i in own], matrix, part.mesh)
            new.symmetric = part.symmetric
            parts.append(new)
    if not parts:
        ctx.fail(
            197,
            "the matrix has no unknown of that name; it has {known}",
            at="names",
            known=" ".join(dict.fromkeys(n for p in k.matrices for n in p.names)) or "none",
        )
    return Rigidite(parts)


@CHAN.form(
    Key("INCO", "other unknowns", required=True),
    Arg("k", RIGIDITE, "matrix"),
    Arg("old", LISTMOTS, "unknowns"),
    Arg("new", LISTMOTS, "their new names"),
    Arg("old_duals", LISTMOTS, "forces"),
    Arg("new_duals", LISTMOTS, "their new names"),
    gives=[RIGIDITE],
)
def _renamed(
    ctx: Context, inco: bool, k: Rigidite, old: ListMots, new: ListMots, old_duals: ListMots, new_duals: ListMots
) -> Rigidite:
    if len(old.words) != len(new.words) or len(old_duals.words) != len(new_duals.words):
        ctx.fail(
            212,
            "{old} names are to become {new}",
            at="new",
            old=len(old.words) + len(old_duals.words),
            new=len(new.words) + len(new_duals.words),
        )
    table = {a.strip(): b.strip() for a, b in zip(old.words, new.words, strict=True)}
    forces = {a.strip(): b.strip() for a, b in zip(old_duals.words, new_duals.words, strict=True)}
    known = {n for p in k.matrices for n in p.names} | {str(n) for c in k.conditions for n in np.unique(c.name)}
    absent = [n for n in table if n not in known]
    if absent:
        ctx.fail(
            197,
            "the matrix has no unknown {name}; it has {known}",
            at="old",
            name=absent[0],
            known=" ".join(sorted(known)),
        )
    parts: list[Any] = []
    for part in k.parts:
        if isinstance(part, MatrixPart):
            names, duals = [table.get(n, n) for n in part.names], [forces.get(d, d) for d in part.duals]
            made = MatrixPart(part.nodes, names, duals, part.matrix, part.mesh)
            made.symmetric = part.symmetric
            parts.append(made)
        elif isinstance(part, ConditionPart):
            name = np.array([table.get(str(n), str(n)) for n in part.name])
            renamed = ConditionPart(
                part.row, part.node, name, part.coefficients, part.multipliers, part.sense, part.label, part.line
            )
            if part.own_reactions is not None:
                own = part.own_reactions
                renamed.own_reactions = own._replace(name=np.array([table.get(str(n), str(n)) for n in own.name]))
            parts.append(renamed)
        else:
            parts.append(part)
    return Rigidite(parts)
