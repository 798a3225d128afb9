"""Conditions on unknowns as RIGIDITE: along names, along directions, and in general terms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gibiane.registry import Context
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.modele import DISPLACEMENTS
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store
from gibiane_ops.values.rigidite import ConditionPart, Rigidite

ROTATIONS = {"TRID": ("RX", "RY", "RZ"), "PLAN": ("RZ",), "AXIS": ("RT",)}
KNOWN = {"UX", "UY", "UZ", "UR", "UT", "RX", "RY", "RZ", "RT", "T", "P", "PI", "TH"}
# What a term of a condition with a coefficient below this share of the largest is: round-off of a unit vector.
NEGLIGIBLE = 1e-12


def family(ctx: Context) -> str:
    """Return the key of the tables of names for the current mode."""
    mode = ctx.option("MODE") or {2: "PLAN DEFO", 3: "TRID"}.get(int(ctx.option("DIME")))
    if mode is None:
        ctx.fail(14, "the dimension of space is not set", hint="OPTI DIME 3 ;")
    return str(mode)[:4]


def support(ctx: Context, place: Maillage | Point, at: str | None = "g") -> IntArray:
    """Return the nodes of a mesh or of a point."""
    nodes = place.nodes if isinstance(place, Maillage) else np.array([place.node])
    if not len(nodes):
        ctx.fail(26, "the mesh has no node", at=at)
    return nodes


def rows_of(
    ctx: Context,
    points: FloatArray,
    terms: Sequence[tuple[IntArray, IntArray, Any, FloatArray]],
    label: str,
    sense: str = "=",
) -> Rigidite:
    """Make general conditions, one multiplier node each.

    Parameters
    ----------
    points : (m, dim) float64, length
        Where the multiplier nodes are put, one per condition.
    terms : sequence of (row (k,), node (k,), name or names (k,), coefficient (k,))
    label : str
        What the user wrote (BLOQ UX); the line of the instruction is added to it for messages.
    sense : str
        "=", "<" (at most) or ">" (at least) the value that DEPI gives.
    """
    row = np.concatenate([r for r, _, _, _ in terms])
    node = np.concatenate([n for _, n, _, _ in terms])
    name = np.concatenate([np.full(len(r), n) if isinstance(n, str) else np.asarray(n) for r, _, n, _ in terms])
    value = np.concatenate([c for _, _, _, c in terms])
    multipliers = node_store(ctx).add(points)
    line = ctx.operands.span(ctx.node).line
    return Rigidite([ConditionPart(row, node, name, value, multipliers, sense, label, line)])


def condition(ctx: Context, nodes: IntArray, names: Sequence[str], label: str, sense: str = "=") -> Rigidite:
    """Make one condition per node and name: the unknown takes the value imposed (0 by default)."""
    row = np.arange(len(nodes) * len(names))
    node = np.tile(nodes, len(names))
    name = np.repeat(np.asarray(names), len(nodes))
    return rows_of(ctx, node_store(ctx).coords[node], [(row, node, name, np.ones(len(row)))], label, sense)


def directed(
    ctx: Context, nodes: IntArray, direction: FloatArray, names: Sequence[str], label: str, sense: str = "="
) -> Rigidite:
    """Make one condition per node: a vector of unknowns along a direction takes the value imposed.

    The direction is one for all nodes, (dim,), or one for each, (n, dim).
    """
    each = np.broadcast_to(direction, (len(nodes), direction.shape[-1]))[:, : len(names)]
    length = np.linalg.norm(each, axis=1)
    if not length.all():
        ctx.fail(239, "the direction is null", at="direction")
    unit = each / length[:, None]
    terms = []
    for i, name in enumerate(names):
        used = np.flatnonzero(np.abs(unit[:, i]) > NEGLIGIBLE)
        terms.append((used, nodes[used], name, unit[used, i]))
    return rows_of(ctx, node_store(ctx).coords[nodes], terms, label, sense)


def displacements(ctx: Context) -> tuple[str, ...]:
    """Return the names of the displacements in the current mode."""
    return DISPLACEMENTS[family(ctx)]
