"""What the operators on curves share: curves as numbers, some of their points; lines and components of fields."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from gibiane.diagnostics import nearest
from gibiane.forms import Arg
from gibiane.registry import Context
from gibiane.values import EVOLUTIO
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.mesh import chains
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.evolution import Curve, Evolution
from gibiane_ops.values.listes import ListMots, items_of, like
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.nodes import node_store

CURVES = Arg("curves", EVOLUTIO, "curves")


def kept(curve: Curve, points: list[int]) -> Curve:
    """Return a curve with some of its points (numbers from 0)."""
    x, y = items_of(curve.x), items_of(curve.y)
    return replace(curve, x=like(curve.x, [x[i] for i in points]), y=like(curve.y, [y[i] for i in points]))


def numeric(ctx: Context, curves: Evolution, at: str = "curves") -> Iterator[tuple[Curve, Any, Any]]:
    """Yield each curve with its abscissae and ordinates as float64; fail for lists of words."""
    for number, curve in enumerate(curves.curves, 1):
        if isinstance(curve.x, ListMots) or isinstance(curve.y, ListMots):
            ctx.fail(21, "curve {number} is not made of numbers", at=at, number=number)
        yield curve, curve.x.values.astype(np.float64), curve.y.values.astype(np.float64)


def ordinates(ctx: Context, curves: Evolution, at: str = "curves") -> Iterator[tuple[Curve, FloatArray]]:
    """Yield each curve with its ordinates; its abscissae may be words."""
    for number, curve in enumerate(curves.curves, 1):
        if isinstance(curve.y, ListMots):
            ctx.fail(21, "curve {number} is not made of numbers", at=at, number=number)
        yield curve, curve.y.values.astype(np.float64)


def component(ctx: Context, field: ChPoint | MChaml, name: str | None) -> str:
    """Return the name of a component that a field has: the one given, or the only one."""
    if name is not None and name.strip() in field.names:
        return name.strip()
    known = " ".join(field.names) or "none"
    if name is None and len(field.names) == 1:
        return field.names[0]
    if name is None:
        ctx.fail(181, "the field has {count} components ({known}): name one", count=len(field.names), known=known)
    close = nearest(name.strip(), field.names)
    ctx.fail(
        181,
        "the field has no component {name}; it has {known}",
        name=name.strip(),
        known=known,
        close=close,
        hint="did you mean {close}?" if close else None,
    )


def line_nodes(ctx: Context, line: Maillage, at: str) -> IntArray:
    """Return the nodes along a line in order, mid-nodes included; those of a mesh of points as they stand."""
    block = line.single()
    if block is not None and block.shape == "POI1":
        return block.cells[:, 0]
    if block is None or block.shape not in ("SEG2", "SEG3"):
        ctx.fail(
            16,
            "a line is wanted, this mesh holds {shapes}",
            at=at,
            shapes=" ".join(line.shapes) or "no element",
            label="holds {shapes}",
            hint="COTE and CONT give the lines of a surface",
        )
    along = block.cells[:, np.argsort(shape(block.shape).ref_nodes[:, 0])]
    rows, turned = chains.follow(along)
    cells = along[rows]
    cells[turned] = cells[turned, ::-1]
    if (cells[1:, 0] != cells[:-1, -1]).any():
        ctx.fail(21, "this line is in several pieces, or branches", at=at, label="not one continuous line")
    return np.concatenate([cells[:1, 0], cells[:, 1:].ravel()])


def abscissae(ctx: Context, nodes: IntArray) -> FloatArray:
    """Return the length of a line from its first node to each node, along straight pieces."""
    steps = np.linalg.norm(np.diff(node_store(ctx).coords[nodes], axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])
