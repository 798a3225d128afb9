"""Where a field passes a test: POIN and ELEM on fields."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend
from gibiane.values import CHPOINT, FLOTTANT, LISTMOTS, MAILLAGE, MCHAML
from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.supports import support_points
from gibiane_ops.values.algebra import Field, values_of
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.listes import ListMots
from gibiane_ops.values.maillage import Block, Maillage
from gibiane_ops.values.modele import ModelZone
from gibiane_ops.values.nodes import FloatArray, node_store

FIELD = (CHPOINT, MCHAML)
Test = Callable[[FloatArray], Any]
TESTS: dict[str, Callable[[FloatArray, float], Any]] = {
    "SUPERIEUR": np.greater,
    "EGSUPE": np.greater_equal,
    "EGALE": np.equal,
    "EGINFE": np.less_equal,
    "INFERIEUR": np.less,
    "DIFFERENT": np.not_equal,
}
ABS = Key("ABS", "of the absolute values")
NAMES = Key(("AVEC", "SANS"), "components to keep or to drop", Arg("listed", LISTMOTS), name="names")
CONDITION = Key(tuple(TESTS), "condition", Arg("x", FLOTTANT), name="test", required=True)
BETWEEN = Key("COMPRIS", "between two values, included", Arg("low", FLOTTANT), Arg("high", FLOTTANT), required=True)
EXTREME = Key(("MAXI", "MINI"), "extreme value", name="which", required=True)
Names = tuple[str, ListMots] | None


def _kept(field: Field, names: Names) -> list[str]:
    if names is None:
        return field.names
    return [n for n in field.names if (n in names[1].words) == (names[0] == "AVEC")]


def _measured(test: Test, absolute: bool) -> Test:
    return (lambda v: test(np.abs(v))) if absolute else test


def _extreme(ctx: Context, field: Field, which: str, absolute: bool, kept: list[str]) -> Test:
    """Return the test that only the extreme value of a field passes."""
    values = values_of(field, kept)
    if not len(values):
        ctx.fail(21, "the field has no value", at="field")
    every = np.abs(values) if absolute else values
    extreme = every.max() if which == "MAXI" else every.min()
    return _measured(lambda v: v == extreme, absolute)


def _points(ctx: Context, field: Field, test: Test, kept: list[str]) -> Maillage:
    """Return the nodes (new points, for an element field) where some component passes a test."""
    store = node_store(ctx)
    if isinstance(field, ChPoint):
        found = [nodes[test(values)] for name, (nodes, values) in field.parts.items() if name in kept]
        nodes = np.unique(np.concatenate(found)) if found else np.zeros(0, np.int64)
    else:
        points = [np.zeros((0, 3))]
        for zone in field.zones:
            if isinstance(zone.zone, ModelZone):
                of = shape(zone.zone.shape)
                passed = np.any([test(zone.component(n)) for n in zone.names if n in kept], axis=0)
                at = geometry.positions(of, store.coords[zone.zone.cells], support_points(of, field.support))
                points.append(at[passed])
        nodes = store.add(np.concatenate(points)) if sum(len(p) for p in points) else np.zeros(0, np.int64)
    if not len(nodes):
        ctx.warn(26, "no value of the field satisfies the condition: the mesh is empty", at="field")
    return Maillage.of_nodes(store, nodes)


POIN = extend("POINT")


@POIN.form(Arg("field", FIELD, "field"), CONDITION, gives=[MAILLAGE])
def _points_test(ctx: Context, field: Field, test: tuple[str, float]) -> Maillage:
    word, x = test
    return _points(ctx, field, lambda v: TESTS[word](v, x), field.names)


@POIN.form(Arg("field", FIELD, "field"), BETWEEN, gives=[MAILLAGE])
def _points_between(ctx: Context, field: Field, compris: tuple[float, float]) -> Maillage:
    low, high = compris
    return _points(ctx, field, lambda v: (v >= low) & (v <= high), field.names)


@POIN.form(Arg("field", FIELD, "field"), EXTREME, ABS, NAMES, gives=[MAILLAGE])
def _points_extreme(ctx: Context, field: Field, which: str, abs: bool, names: Names) -> Maillage:
    kept = _kept(field, names)
    return _points(ctx, field, _extreme(ctx, field, which, abs, kept), kept)


ELEM = extend("ELEM")
HOW = Key(("LARGEMENT", "STRICTEMENT"), "some point of the element, or all", name="how")


def _elements(ctx: Context, field: MChaml, test: Test, kept: list[str], strict: bool) -> Maillage:
    """Return the elements of which some point (all points) have a component that passes a test."""
    store = node_store(ctx)
    blocks: dict[str, list[Any]] = {}
    for zone in field.zones:
        names = [n for n in zone.names if n in kept]
        if isinstance(zone.zone, ModelZone) and names:
            passed = np.any([test(zone.component(n)) for n in names], axis=0)
            rows = passed.all(axis=1) if strict else passed.any(axis=1)
            block = zone.zone.mesh.blocks[0]
            blocks.setdefault(block.shape, []).append((block.cells[rows], block.colours[rows]))
    chosen = Maillage(
        store,
        [
            Block(name, *(np.concatenate(column) for column in zip(*parts, strict=True)))
            for name, parts in blocks.items()
        ],
    )
    if not chosen.n_cells:
        ctx.warn(26, "no element of the field satisfies the condition: the mesh is empty", at="field")
    return chosen


@ELEM.form(Arg("field", MCHAML, "element field"), CONDITION, ABS, HOW, NAMES, gives=[MAILLAGE])
def _elements_test(
    ctx: Context, field: MChaml, test: tuple[str, float], abs: bool, how: str | None, names: Names
) -> Maillage:
    word, x = test
    return _elements(ctx, field, _measured(lambda v: TESTS[word](v, x), abs), _kept(field, names), how == "STRICTEMENT")


@ELEM.form(Arg("field", MCHAML, "element field"), BETWEEN, ABS, HOW, NAMES, gives=[MAILLAGE])
def _elements_between(
    ctx: Context, field: MChaml, compris: tuple[float, float], abs: bool, how: str | None, names: Names
) -> Maillage:
    low, high = compris
    test = _measured(lambda v: (v >= low) & (v <= high), abs)
    return _elements(ctx, field, test, _kept(field, names), how == "STRICTEMENT")


@ELEM.form(Arg("field", MCHAML, "element field"), EXTREME, ABS, HOW, NAMES, gives=[MAILLAGE])
def _elements_extreme(ctx: Context, field: MChaml, which: str, abs: bool, how: str | None, names: Names) -> Maillage:
    kept = _kept(field, names)
    found = _elements(ctx, field, _extreme(ctx, field, which, abs, kept), kept, strict=False)
    if how == "STRICTEMENT":
        first = found.blocks[0]
        return Maillage(found.store, [Block(first.shape, first.cells[:1], first.colours[:1])])
    return found
