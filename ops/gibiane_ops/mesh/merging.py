"""Putting meshes together and making their nodes one: ET, ELIM, CONF."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend, operator
from gibiane.values import FLOTTANT, MAILLAGE, POINT, Table
from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.mesh import distances, unions
from gibiane_ops.kernels.topology import used_nodes
from gibiane_ops.mesh.building import LINES, explained, join, nodes_of, tolerance_of
from gibiane_ops.values.champs import DIFFUS, INDETERMINE, ChPoint
from gibiane_ops.values.maillage import Block, Maillage, Point

GEOMETRY = (MAILLAGE, POINT)


def as_mesh(x: Maillage | Point) -> Maillage:
    """Return a mesh: itself, or the POI1 at a point."""
    return Maillage.of_nodes(x.store, np.array([x.node])) if isinstance(x, Point) else x


@extend("ET").form(
    Arg("a", GEOMETRY, "mesh or point"),
    Arg("b", GEOMETRY, "mesh or point"),
    Key("TELQUEL", "keep lines in the order given"),
    gives=[MAILLAGE],
)
def _et(ctx: Context, a: Maillage | Point, b: Maillage | Point, telquel: bool) -> Maillage:
    first, second = as_mesh(a), as_mesh(b)
    if first is second:
        return first
    new = _without(second, first)
    if not telquel and _follows(second, first) and not _follows(first, second):
        return join([new, first])
    return join([first, new])


def _follows(a: Maillage, b: Maillage) -> bool:
    """Say whether line b starts where line a ends."""
    one, two = a.single(), b.single()
    return (
        one is not None
        and two is not None
        and one.shape == two.shape
        and one.shape in LINES
        and one.cells[-1, 1] == two.cells[0, 0]
    )


def _without(mesh: Maillage, others: Maillage) -> Maillage:
    """Return a mesh without the elements that another has too."""
    blocks = []
    for block in mesh.blocks:
        known = others.cells(block.shape)
        fresh = unions.not_in(block.cells, known) if len(known) else slice(None)
        blocks.append(Block(block.shape, block.cells[fresh], block.colours[fresh]))
    return Maillage(mesh.store, blocks)


ELIM = operator(
    "ELIMINATION",
    topic="mesh",
    summary="make nodes that are close to one another one node",
    notice="`ELIM G (tol) ;` merges the nodes of G that are closer than tol, by default a tenth of the current "
    "density. `ELIM G1 G2 (tol) ;` merges nodes of G2 into nodes of G1 only, never two of one mesh. Every "
    "mesh, point and field that refers to them follows: DISCRET values are added, DIFFUS values must "
    "agree (1042), other fields cannot be merged (1041). The number of merged nodes is shown with "
    "OPTI ECHO 1.",
    example="OPTI DIME 2 ELEM SEG2 ; L1 = DROIT 2 (0. 0.) (1. 0.) ; L2 = DROIT 2 (1. 0.) (2. 0.) ; "
    "L = L1 ET L2 ; ELIM L 1.E-6 ; MESS (NBNO L) ;",
    see=["CONFONDRE", "REGENERER", "ET"],
)


@ELIM.form(
    Arg("g1", GEOMETRY, "mesh"),
    Arg("g2", GEOMETRY, "second mesh", optional=True),
    Arg("tolerance", FLOTTANT, "distance", optional=True),
)
def _elim(ctx: Context, g1: Maillage | Point, g2: Maillage | Point | None, tolerance: float | None) -> None:
    store = nodes_of(ctx)
    one = as_mesh(g1).nodes
    two = one if g2 is None else as_mesh(g2).nodes
    limit = tolerance_of(ctx, tolerance, one if g2 is None else used_nodes([one, two]))
    with explained(ctx, "tolerance"):
        if g2 is None:
            pairs = one[distances.close_pairs(store.coords[one], limit)]
        else:
            only = np.setdiff1d(two, one)
            rows = distances.facing_pairs(store.coords[one], store.coords[only], limit)
            pairs = np.stack([one[rows[:, 0]], only[rows[:, 1]]], axis=1)
    _merge(ctx, pairs[:, 0], pairs[:, 1])


CONF = operator(
    "CONFONDRE",
    topic="mesh",
    summary="make two points one",
    notice="`CONF P1 P2 ;` brings P1 to the place of P2; meshes and fields follow as with ELIM.",
    example="OPTI DIME 2 ; P1 = 0. 0. ; P2 = 0. 0. ; CONF P1 P2 ; MESS (EGA P1 P2) ;",
    see=["ELIMINATION"],
)


@CONF.form(Arg("a", POINT, "first point"), Arg("b", POINT, "point whose place both take"))
def _conf(ctx: Context, a: Point, b: Point) -> None:
    if a.node != b.node:
        place = b.coords
        _merge(ctx, np.array([a.node]), np.array([b.node]))
        nodes_of(ctx).coords[a.node] = place


def _merge(ctx: Context, kept: IntArray, dropped: IntArray) -> None:
    if len(kept) == 0:
        if ctx.option("ECHO") >= 1:
            ctx.write(" 0 noeud elimine")
        return
    store = nodes_of(ctx)
    for field in _fields(ctx.session.names().values(), set()):
        _check_field(ctx, field, kept, dropped)
    before = len(used_nodes([store.canonical(kept), store.canonical(dropped)]))
    store.merge(kept, dropped)
    after = len(used_nodes([store.canonical(kept), store.canonical(dropped)]))
    if ctx.option("ECHO") >= 1:
        ctx.write(f" {before - after} noeud(s) elimine(s)")


def _fields(values: Any, seen: set[int]) -> Iterator[ChPoint]:
    for value in values:
        if isinstance(value, ChPoint):
            yield value
        elif isinstance(value, Table) and id(value) not in seen:
            seen.add(id(value))
            yield from _fields([entry for _, entry in value.entries.values()], seen)


def _check_field(ctx: Context, field: ChPoint, kept: IntArray, dropped: IntArray) -> None:
    if field.nature not in (DIFFUS, INDETERMINE):
        return
    for name, (nodes, _) in field.parts.items():
        both = np.isin(kept, nodes) & np.isin(dropped, nodes)
        if not both.any():
            continue
        if field.nature == INDETERMINE:
            ctx.fail(
                1041,
                "a field without nature has values ({name}) at two nodes that would become one",
                name=name,
                hint="give it a nature: 'NATU' 'DIFFUS' or 'DISCRET'",
            )
        gap = np.abs(field.at(name, kept[both]) - field.at(name, dropped[both]))
        scale = max(float(np.abs(field.at(name, nodes)).max()), 1e-300)
        if gap.max() > 1e-10 * scale:
            ctx.fail(
                1042,
                "a DIFFUS field has different values of {name} at two nodes that would become one: they "
                "differ by {gap}",
                name=name,
                gap=f"{gap.max():.4g}",
            )
