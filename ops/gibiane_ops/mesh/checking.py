"""VERM: what may be wrong in a mesh; TRIA: triangulations of points and of contours."""

from __future__ import annotations

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, MAILLAGE
from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.mesh import unions
from gibiane_ops.mesh.building import DIMENSION, dimension, new_mesh, nodes_of
from gibiane_ops.mesh.degree import LINEAR
from gibiane_ops.mesh.filling import contour_of, fill_contour
from gibiane_ops.values.maillage import Maillage

VERM = operator(
    "VERM",
    topic="mesh",
    summary="tell what may be wrong in a mesh",
    notice="`VERM G ;` warns of elements that are there more than once, of elements of first degree on edges of "
    "elements of second degree, and of volumes that meet along faces of different types (a quadrangle against "
    "triangles). It says nothing of a sound mesh.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 3 (0. 0.) (1. 0.)) TRAN 2 (0. 1.) ; VERM S ;",
    see=["ELIMINATION", "REGENERER", "INDI"],
)


@VERM.form(Arg("g", MAILLAGE, "mesh"))
def _verm(ctx: Context, g: Maillage) -> None:
    x = nodes_of(ctx).coords

    def place(nodes: IntArray) -> str:
        return ", ".join(f"{each:.6g}" for each in x[nodes].mean(axis=0)[: dimension(ctx)])

    for block in g.blocks:
        group, first = topology.group_by_nodes(block.cells)
        if len(first) < len(block.cells):
            again = int(np.flatnonzero(np.bincount(group)[group] > 1)[0])
            ctx.warn(
                21,
                "{count} {shape} are there more than once: element {number} is the first, near ({place})",
                at="g",
                count=len(block.cells) - len(first),
                shape=block.shape,
                number=again + 1,
                place=place(block.cells[again]),
            )
    low, high = (_edges(g, quadratic) for quadratic in (False, True))
    mixed = low[unions.is_in(low, high)]
    if len(mixed):
        ctx.warn(
            21,
            "{count} edge(s) have a mid-node in one element and none in its neighbour, the first near ({place})",
            at="g",
            count=len(mixed),
            place=place(mixed[0]),
            hint="CHAN 'QUADRATIQUE' or 'LINEAIRE' makes all elements alike",
        )
    facets = [f.nodes[:, : shape(n).n_corners] for n, f in topology.boundary(_solids(g)).items()]
    triangles = np.concatenate([np.zeros((0, 3), np.int64), *(f for f in facets if f.shape[1] == 3)])
    halves = [f[:, [0, 1, 2, 0, 2, 3, 0, 1, 3, 1, 2, 3]].reshape(-1, 3) for f in facets if f.shape[1] == 4]
    unlike = triangles[unions.is_in(triangles, np.concatenate([np.zeros((0, 3), np.int64), *halves]))]
    if len(unlike):
        ctx.warn(
            21,
            "{count} triangle(s) stand against half a quadrangle of a neighbour, the first near ({place})",
            at="g",
            count=len(unlike),
            place=place(unlike[0]),
            hint="the two volumes are not joined there: pyramids, or CHAN TET4 of both, join them",
        )


def _solids(g: Maillage) -> list[tuple[str, IntArray]]:
    return [b for b in g.kernel_blocks if DIMENSION[b[0]] == 3]


def _edges(g: Maillage, quadratic: bool) -> IntArray:
    return topology.edges([b for b in g.kernel_blocks if DIMENSION[b[0]] >= 1 and (b[0] in LINEAR) == quadratic])


TRIA = operator(
    "TRIANGULATION",
    topic="mesh",
    summary="triangulation of points, or of a contour with as few nodes as can be",
    notice="`G = TRIA P`: the Delaunay triangulation of a mesh of points (POI1), TRI3 in the plane, TET4 in space; it "
    "fills their convex hull ('CONV' is accepted). `S = TRIA L (N)`: the inside of plane closed lines with few nodes "
    "beside theirs; N is accepted. SURF and REMAILLER make better elements.",
    example="OPTI DIME 2 ; P = POIN (PROG 0. 1. 1. 0. 0.5) (PROG 0. 0. 1. 1. 0.4) ; T = TRIA P ; "
    "MESS (NBEL T) ' ' (MESU T) ;",
    see=["SURFACE", "REMAILLER"],
)


@TRIA.form(
    Arg("g", MAILLAGE, "points, or closed lines"),
    Key("CONV", "accepted"),
    Arg("n", ENTIER, "accepted", optional=True),
    gives=[MAILLAGE],
)
def _tria(ctx: Context, g: Maillage, conv: bool, n: int | None) -> Maillage:
    dim = dimension(ctx)
    if g.shapes != ["POI1"]:
        segments = contour_of(ctx, g, "g")
        size = float(np.linalg.norm(np.ptp(nodes_of(ctx).coords[g.nodes], axis=0)))
        return fill_contour(ctx, segments, size, False, "g")
    from scipy.spatial import Delaunay

    nodes, x = g.nodes, nodes_of(ctx).coords[g.nodes][:, :dim]
    if dim < 2 or np.linalg.matrix_rank(x - x[0], tol=1e-12 * float(np.abs(x).max())) < dim:
        ctx.fail(21, "{count} points that span no area or volume have no triangulation", at="g", count=len(nodes))
    cells = np.asarray(Delaunay(x).simplices, np.int64)
    volume = np.linalg.det(x[cells[:, 1:]] - x[cells[:, :1]])
    # Points on one circle or sphere leave flat pieces, which fill nothing.
    cells = np.where((volume < 0)[:, None], cells[:, [1, 0, *range(2, dim + 1)]], cells)
    return new_mesh(ctx, [({2: "TRI3", 3: "TET4"}[dim], nodes[cells[np.abs(volume) > 1e-10 * np.abs(volume).max()]])])
