"""From a RIGIDITE and its second members to a compact numbering, a sparse matrix, conditions and load vectors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from gibiane.registry import Context
from gibiane_ops.kernels.contact.law import Friction, friction, joined_laws
from gibiane_ops.kernels.contact.pairs import ContactPairs, joined, no_pairs
from gibiane_ops.kernels.topology import used_nodes
from gibiane_ops.values.champs import DIFFUS, ChPoint
from gibiane_ops.values.following import without_followers
from gibiane_ops.values.nodes import FloatArray, IntArray, NodeStore, node_store
from gibiane_ops.values.rigidite import ConditionPart, ConditionTerms, ContactPart, Rigidite

ROTATIONS = {"RX", "RY", "RZ", "RT"}


@dataclass(eq=False)
class System:
    """A system ready for the kernels: unknown `d i + c` is component `names[c]` of node `nodes[i]`.

    Attributes
    ----------
    store : NodeStore
    nodes : (n,) int64, sorted
    names, duals : tuple of str, length d
    K : (n d, n d) csr_array
    C : (m, n d) csr_array
        Conditions, row by row of `conditions`.
    conditions : list of ConditionPart
    contacts : list of ContactPart
    multipliers : (m,) int64
        Node of the session that carries the value and the multiplier of each row of C.
    stops : (k, n d) csr_array
        Unilateral conditions, each turned so that it reads `row . u <= value`.
    stop_multipliers : (k,) int64
    stop_signs : (k,) float64
        1 for MAXI, -1 for MINI: the rows, and the values of the load, are multiplied by it.
    reactions, stop_reactions : csr_array
        Where the multipliers of C and of the stops act: ``K u = F + reactions.T m``. These rows themselves unless
        RELA 'DUAL' gave others.
    following : (k,) int64
        Multiplier nodes of the contact pairs left out, because their middles follow the ends of their side.
    symmetric : bool
        Whether K is, and the conditions act along themselves.
    """

    store: NodeStore
    nodes: IntArray
    names: tuple[str, ...]
    duals: tuple[str, ...]
    K: sp.csr_array
    C: sp.csr_array
    conditions: list[ConditionPart]
    contacts: list[ContactPart]
    multipliers: IntArray
    stops: sp.csr_array
    stop_multipliers: IntArray
    stop_signs: FloatArray
    reactions: sp.csr_array
    stop_reactions: sp.csr_array
    following: IntArray
    symmetric: bool = True

    @property
    def dim(self) -> int:
        """Unknowns per node."""
        return len(self.names)

    @property
    def points(self) -> FloatArray:
        """Coordinates of the nodes, (n, d), length."""
        return self.store.coords[self.nodes][:, : self.dim]

    def load(self, ctx: Context, field: ChPoint, *, lenient: bool = False) -> tuple[FloatArray, FloatArray]:
        """Split a second member into forces on the unknowns, (n d,), and values of the conditions, (m,).

        Fails with error 53 (node without stiffness) or 54 (unknown that the matrix has not) unless `lenient`.
        """
        F = np.zeros(len(self.nodes) * self.dim)
        imposed = np.zeros(len(self.multipliers))
        own = [self.multipliers, self.stop_multipliers, self.following, *(part.multipliers for part in self.contacts)]
        for name, (nodes, values) in field.parts.items():
            if name == "FLX":
                imposed = field.at("FLX", self.multipliers)
                stray = np.setdiff1d(nodes[values != 0], np.concatenate(own))
                if len(stray) and not lenient:
                    ctx.fail(
                        53,
                        "the load imposes {count} values on conditions that the matrix does not hold",
                        at="f",
                        count=len(stray),
                        hint="join the conditions of BLOQ or RIGI to the matrix with ET",
                    )
                continue
            if name not in self.duals:
                if lenient or not values.any():
                    continue
                ctx.fail(
                    54,
                    "the load has a component {name}; the matrix knows {known}",
                    at="f",
                    name=name,
                    known=" ".join(self.duals),
                )
            place = np.minimum(np.searchsorted(self.nodes, nodes), len(self.nodes) - 1)
            known = self.nodes[place] == nodes
            if not known.all() and values[~known].any() and not lenient:
                first = nodes[~known][np.flatnonzero(values[~known])[0]]
                where = " ".join(f"{x:g}" for x in self.store.coords[first])
                ctx.fail(
                    53,
                    "the load acts on {count} nodes without stiffness, the first at ({where})",
                    at="f",
                    count=int((values[~known] != 0).sum()),
                    where=where,
                )
            F[place[known] * self.dim + self.duals.index(name)] += values[known]
        return F, imposed

    def gaps(self, field: ChPoint) -> FloatArray:
        """Return the initial gaps of all contact pairs: those of the second member, else of the geometry."""
        found = []
        for part in self.contacts:
            in_load = "FLX" in field.names and np.isin(part.multipliers, field.parts["FLX"][0]).all()
            found.append(field.at("FLX", part.multipliers) if in_load else part.pairs.gap)
        return np.concatenate([np.zeros(0), *found])

    def pairs(self, ctx: Context, gap: FloatArray) -> ContactPairs:
        """Return the pairs of all contact zones in the compact numbering, with these gaps; -1 stays the obstacle.

        Fails with error 53 when a surface belongs to no solid of the matrix.
        """
        whole = joined([part.pairs for part in self.contacts]) if self.contacts else no_pairs(self.dim)
        every = np.concatenate([whole.pairs.ravel(), whole.node])
        wanted = self.store.canonical(np.maximum(every, 0))
        ids = np.minimum(np.searchsorted(self.nodes, wanted), len(self.nodes) - 1)
        lost = np.unique(wanted[(self.nodes[ids] != wanted) & (every >= 0)])
        if len(lost):
            first = self.store.coords[lost[0]][: self.dim]
            ctx.fail(
                53,
                "{count} contact nodes have no stiffness, the first at ({where})",
                at="k",
                count=len(lost),
                where=" ".join(f"{x:g}" for x in first),
                hint="join the stiffness of both solids; a surface that belongs to no solid is 'RIGIDE'",
            )
        ids = np.where(every < 0, -1, ids)
        n = whole.pairs.size
        return replace(whole, pairs=ids[:n].reshape(-1, 2), node=ids[n:], gap=gap)

    def friction(self) -> Friction:
        """Return the law of every pair, and no friction for the stops."""
        stops = friction(len(self.stop_signs))
        return joined_laws([*(part.law for part in self.contacts), stops])

    def stop_values(self, field: ChPoint) -> FloatArray:
        """Return the values of the stops, zero where the second member has none."""
        return self.stop_signs * field.at("FLX", self.stop_multipliers)

    def field(self, u: FloatArray, multipliers: FloatArray) -> ChPoint:
        """Return the solution as a field: the unknowns on the nodes, LX on the multiplier nodes."""
        table = u.reshape(-1, self.dim)
        parts = {name: (self.nodes, table[:, i]) for i, name in enumerate(self.names)}
        if len(multipliers):
            parts["LX"] = (self.multipliers, multipliers)
        return ChPoint(self.store, parts, DIFFUS)


def build(ctx: Context, rigidity: Rigidite, *, bilateral: bool = False) -> System:
    """Give numbers to the unknowns of a RIGIDITE and gather its matrices and conditions.

    Conditions with MINI or MAXI become stops, or equalities when `bilateral`.
    """
    store = node_store(ctx)
    if not rigidity.matrices:
        ctx.fail(26, "there is no stiffness among these conditions", at="k", hint="RIGI makes it from a model")
    names = tuple(dict.fromkeys(n for part in rigidity.matrices for n in part.names))
    duals = tuple(dict.fromkeys(n for part in rigidity.matrices for n in part.duals))
    supports = [store.canonical(part.nodes) for part in rigidity.matrices]
    nodes = used_nodes(supports)
    size = len(nodes) * len(names)
    K = sp.csr_array((size, size))
    for number, (part, support) in enumerate(zip(rigidity.matrices, supports, strict=True)):
        columns = np.array([names.index(n) for n in part.names])
        place = (np.searchsorted(nodes, support)[:, None] * len(names) + columns).ravel()
        whole = len(place) == size and bool((np.diff(place) == 1).all())
        matrix = part.matrix if whole else _renumbered(part.matrix, place, size)
        K = K + matrix if number else matrix
    conditions = _applicable(ctx, rigidity.conditions, names)
    numbering = _Numbering(ctx, store, nodes, names)
    C = numbering.matrix(conditions, [c.terms for c in conditions])
    symmetric = all(part.symmetric for part in rigidity.matrices)
    reactions = C
    if any(c.own_reactions is not None for c in conditions):
        symmetric = False
        reactions = numbering.matrix(conditions, [c.reactions for c in conditions])
    turns = {"=": 0.0, "<": 1.0, ">": -1.0}
    signs = [np.full(len(c.multipliers), 0.0 if bilateral else turns[c.sense]) for c in conditions]
    sign = np.concatenate([np.zeros(0), *signs])
    if not symmetric and rigidity.contacts:
        ctx.fail(251, "contact wants a symmetric matrix", at="k")
    carriers = np.concatenate([np.zeros(0, np.int64), *(c.multipliers for c in conditions)])
    equal, stop = np.flatnonzero(sign == 0), np.flatnonzero(sign)
    turned = sp.diags_array(sign[stop])
    contacts, following = without_followers(store, nodes, len(names), C[equal], rigidity.contacts)
    return System(
        store,
        nodes,
        names,
        duals,
        K,
        C[equal],
        conditions,
        contacts,
        carriers[equal],
        sp.csr_array(turned @ C[stop]) if len(stop) else C[stop],
        carriers[stop],
        sign[stop],
        reactions[equal],
        sp.csr_array(turned @ reactions[stop]) if len(stop) else C[stop],
        following,
        symmetric,
    )


@dataclass(eq=False)
class _Numbering:
    """The numbers of the unknowns of a system, to write conditions with."""

    ctx: Context
    store: NodeStore
    nodes: IntArray
    names: tuple[str, ...]

    def matrix(self, conditions: list[ConditionPart], terms: list[ConditionTerms]) -> sp.csr_array:
        """Return the terms of some conditions as rows, one after the other."""
        rows, cols, data = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
        start = 0
        for condition, each in zip(conditions, terms, strict=True):
            rows.append(each.row + start)
            cols.append(self._columns(condition, each))
            data.append(each.coefficients)
            start += len(condition.multipliers)
        place = (np.concatenate(rows), np.concatenate(cols))
        return sp.csr_array((np.concatenate(data), place), shape=(start, len(self.nodes) * len(self.names)))

    def _columns(self, condition: ConditionPart, terms: ConditionTerms) -> IntArray:
        """Return the numbers of the unknowns of terms; a node or an unknown that the matrix has not is an error."""
        ids = self.store.canonical(terms.node)
        place = np.minimum(np.searchsorted(self.nodes, ids), len(self.nodes) - 1)
        lost = self.nodes[place] != ids
        if lost.any():
            where = " ".join(f"{x:g}" for x in self.store.coords[ids[lost][0]])
            self.ctx.fail(
                53,
                "{which}: {count} of its nodes have no stiffness, the first at ({where})",
                at="k",
                which=condition.origin,
                count=int(lost.sum()),
                where=where,
            )
        unknown = [str(n) for n in np.unique(terms.name) if str(n) not in self.names]
        if unknown:
            self.ctx.fail(
                197,
                "{which}: the matrix has no unknown {name}; it has {known}",
                at="k",
                which=condition.origin,
                name=unknown[0],
                known=" ".join(self.names),
            )
        ordered = sorted(self.names)
        column = np.array([self.names.index(n) for n in ordered])[np.searchsorted(ordered, terms.name)]
        return np.asarray(place * len(self.names) + column, np.int64)


def _applicable(ctx: Context, conditions: list[ConditionPart], names: tuple[str, ...]) -> list[ConditionPart]:
    """Leave aside the conditions on rotations alone when the matrix has no rotation (`BLOQ 'DEPL' 'ROTA'`, SYMT)."""
    if any(n in ROTATIONS for n in names):
        return conditions
    kept = [c for c in conditions if not set(np.unique(c.name).tolist()) <= ROTATIONS]
    if len(kept) < len(conditions) and not ctx.state.setdefault("rotations told", False):
        ctx.state["rotations told"] = True
        ctx.warn(
            "G409",
            "{count} conditions on rotations are left aside: the matrix has no rotation",
            level=0,
            count=sum(len(c.multipliers) for c in conditions if c not in kept),
        )
    return kept


def _renumbered(matrix: sp.csr_array, place: IntArray, size: int) -> sp.csr_array:
    entries = sp.coo_array(matrix)
    return sp.csr_array((entries.data, (place[entries.row], place[entries.col])), shape=(size, size))
