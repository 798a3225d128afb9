"""COUTURE: triangles between two lines, or elements between a mesh and a point."""

from __future__ import annotations

import numpy as np

from gibiane.forms import Arg
from gibiane.registry import Context, operator
from gibiane.values import MAILLAGE, POINT
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.geometry import measures
from gibiane_ops.kernels.mesh import orientation, seams
from gibiane_ops.mesh.building import DIMENSION, dimension, line_nodes, new_mesh, nodes_of
from gibiane_ops.mesh.degree import finished, is_quadratic, linear_mesh
from gibiane_ops.values.maillage import Maillage, Point

COUT = operator(
    "COUTURE",
    topic="mesh",
    summary="triangles between two lines, or a mesh joined to a point",
    notice="`S = COUT L1 L2`: a surface of triangles between two lines read in the same direction; they need not have "
    "as many elements. `G2 = COUT G1 P`: one element from each element of G1 to the point P: points give SEG2, lines "
    "TRI3, triangles TET4, quadrangles PYR5; elements that hold P are left out.",
    example="OPTI DIME 2 ELEM TRI3 ; S = COUT (DROIT 4 (0. 0.) (1. 0.)) (DROIT 7 (0. 1.) (1. 1.)) ; MESS (MESU S) ;",
    see=["REGLER", "TRIANGULATION"],
)
RAISED = {"POI1": "SEG2", "SEG2": "TRI3", "TRI3": "TET4", "QUA4": "PYR5"}


@COUT.form(Arg("l1", MAILLAGE, "first line"), Arg("l2", MAILLAGE, "second line"), gives=[MAILLAGE])
def _seam(ctx: Context, l1: Maillage, l2: Maillage) -> Maillage:
    dimension(ctx)
    quadratic = is_quadratic(l1, l2)
    a, b = line_nodes(ctx, linear_mesh(ctx, l1), "l1"), line_nodes(ctx, linear_mesh(ctx, l2), "l2")
    x = nodes_of(ctx).coords
    cells = np.concatenate([a, b])[seams.seam(x[a], x[b])]
    # lines that share an end leave triangles without area there
    cells = cells[(cells != np.roll(cells, 1, axis=1)).all(axis=1)]
    return finished(ctx, new_mesh(ctx, [("TRI3", cells)]), quadratic)


@COUT.form(Arg("g", MAILLAGE, "mesh"), Arg("p", POINT, "point"), gives=[MAILLAGE])
def _star(ctx: Context, g: Maillage, p: Point) -> Maillage:
    dim = dimension(ctx)
    wrong = [name for name in g.shapes if name not in RAISED or DIMENSION[name] >= dim]
    if wrong or not g.shapes:
        ctx.fail(
            16,
            "elements {shapes} cannot be joined to a point here",
            at="g",
            shapes=" ".join(wrong) or "none",
            hint="POI1, SEG2 and in space TRI3 and QUA4 can; CHAN 'LINEAIRE' drops mid-nodes",
        )
    parts = []
    for block in g.blocks:
        cells = block.cells[(block.cells != p.node).all(axis=1)]
        if not len(cells):
            continue
        name = RAISED[block.shape]
        cells = np.column_stack([cells, np.full(len(cells), p.node)])
        if DIMENSION[name] == dim:
            turned = measures(shape(name), nodes_of(ctx).coords[cells][:, :, :dim]) < 0
            cells[turned] = orientation.reversed_cells(name, cells[turned])
        parts.append((name, cells))
    return new_mesh(ctx, parts)
