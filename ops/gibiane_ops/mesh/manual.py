"""MANUEL for meshes: elements made by hand from points."""

from __future__ import annotations

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import MAILLAGE, POINT
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.mesh.building import DIMENSION, dimension, new_mesh
from gibiane_ops.values.maillage import COLOURS, Block, Maillage, Point, cells_from_turn

MANU = operator(
    "MANUEL",
    topic="mesh",
    summary="elements, fields or matrices made by hand",
    notice="`G = MANU TYPE P1 P2 ... (COLOUR)` makes elements of a type from points, as many as an element has for "
    "each; a mesh stands for its points in order. Elements of second degree take corners and mid-nodes in turn, layer "
    "after layer: MANU SEG3 P1 M P2. `MANU 'CHPO' G 'UX' 1. ...` and `MANU 'CHML' MODL ...` make fields. `MANU "
    "'RIGI' G LMOTS LREEL`: a matrix that is the same on all elements of G; LMOTS names the unknowns at a node "
    "(several: one per node of an element), LREEL holds its rows, whole or up to the diagonal, in one list or several; "
    "'ANTI' antisymmetric, 'QUEL' without symmetry, 'DUAL' names the forces. A CHPOINT and 'DIAG': diagonal.",
    example="OPTI DIME 2 ; P1 = 0. 0. ; P2 = 1. 0. ; P3 = 1. 1. ; T = MANU TRI3 P1 P2 P3 ; MESS (MESU T) ;",
    see=["QUELCONQUE", "CHANGER"],
)


@MANU.form(
    Key(tuple(DIMENSION), "type of the elements", name="kind", required=True),
    Key(COLOURS, "colour", name="colour"),
    Arg("points", (POINT, MAILLAGE), "points, or meshes of points", many=True),
    gives=[MAILLAGE],
)
def _mesh(ctx: Context, kind: str, colour: str | None, points: list[Point | Maillage]) -> Maillage:
    dimension(ctx)
    nodes = np.concatenate([np.array([p.node]) if isinstance(p, Point) else p.nodes_in_order() for p in points])
    size = shape(kind).n_nodes
    if len(nodes) % size:
        ctx.fail(
            36, "{count} points do not make whole {kind} elements of {size}", count=len(nodes), kind=kind, size=size
        )
    cells = cells_from_turn(kind, nodes.reshape(-1, size))
    ordered = np.sort(cells, axis=1)
    twice = np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))
    if len(twice):
        ctx.fail(75, "element {number} would have the same node twice", number=int(twice[0]) + 1)
    mesh = new_mesh(ctx, [(kind, cells)])
    if colour is None:
        return mesh
    return Maillage(mesh.store, [Block(kind, cells, np.full(len(cells), COLOURS.index(colour), np.int64))])
