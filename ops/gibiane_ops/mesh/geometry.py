"""Reading and measuring: coordinates, distances, barycentres, lengths, areas, volumes."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, ENTIER, FLOTTANT, MAILLAGE, POINT
from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.mesh.building import DIMENSION, dimension, line_nodes, new_mesh, new_point, nodes_of
from gibiane_ops.mesh.degree import every_node, is_quadratic, linear_mesh
from gibiane_ops.values.champs import DIFFUS, ChPoint
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.nodes import FloatArray, IntArray

DENS = operator(
    "DENSITE",
    topic="geometry",
    summary="size of the elements around the points made from now on",
    notice="`DENS x ;` sets the current density, a length. Each new point keeps it, and lines between points "
    "are cut so that their elements have these sizes at the two ends (see DROIT). The same as "
    "OPTI DENS x.",
    example="OPTI DIME 2 ELEM QUA4 ; DENS 0.25 ; L1 = DROIT (0. 0.) (1. 0.) ; MESS (NBEL L1) ;",
    see=["OPTION", "DROIT"],
)


@DENS.form(Arg("x", FLOTTANT, "size of the elements"))
def _dens(ctx: Context, x: float) -> None:
    if not x > 0:
        ctx.fail(17, "a density is a length: {value} cannot be one", at="x", value=x)
    ctx.session.options["DENS"] = x


COOR = operator(
    "COORDONNEE",
    topic="geometry",
    summary="coordinates of points, meshes and fields",
    notice="`X = COOR 1 P` is the first coordinate of a point; `X Y Z = COOR P` gives all of them. Of a mesh "
    "or a CHPOINT, the result is a CHPOINT of component SCAL on its nodes. The number after the last "
    "coordinate is the density. Of a MMODEL or MCHAML: a MCHAML, at the nodes of its elements or where the field "
    "stands. `COOR L 'CURV'` is the distance along a line from its first point.",
    example="OPTI DIME 2 ELEM SEG2 ; P = 3. 4. ; X Y = COOR P ; MESS X ' ' (COOR 2 P) ;",
    see=["DIST", "NORM"],
)


def _scalar(ctx: Context, nodes: IntArray, values: Any) -> ChPoint:
    return ChPoint(nodes_of(ctx), {"SCAL": (nodes, np.asarray(values, np.float64))}, DIFFUS)


def _check_axis(ctx: Context, n: int) -> int:
    dim = dimension(ctx)
    if not 1 <= n <= dim + 1:
        ctx.fail(
            36, "there is no coordinate {n}: 1 to {dim}, or {last} for the density", at="n", n=n, dim=dim, last=dim + 1
        )
    return n - 1


@COOR.form(Arg("p", POINT, "point"), Arg("n", ENTIER, "which", optional=True), gives=["FLOTTANT..."])
def _coor_point(ctx: Context, p: Point, n: int | None) -> Any:
    dim = dimension(ctx)
    values = [*map(float, p.coords[:dim]), float(p.store.density[p.node])]
    return tuple(values[:dim]) if n is None else values[_check_axis(ctx, n)]


@COOR.form(
    Arg("g", (MAILLAGE, CHPOINT), "mesh or nodal field"),
    Arg("n", ENTIER, "which", optional=True),
    Key("CURV", "distance along a line"),
    gives=["CHPOINT..."],
)
def _coor_mesh(ctx: Context, g: Maillage | ChPoint, n: int | None, curv: bool) -> Any:
    dim = dimension(ctx)
    store = nodes_of(ctx)
    if curv:
        if not isinstance(g, Maillage):
            ctx.fail(37, "a line is wanted with 'CURV'", at="g")
        nodes = line_nodes(ctx, linear_mesh(ctx, g), "g")
        if is_quadratic(g):
            nodes = every_node(ctx, nodes)
        steps = np.linalg.norm(np.diff(store.coords[nodes], axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        kept = nodes[:-1] if nodes[0] == nodes[-1] else nodes
        return _scalar(ctx, kept, along[: len(kept)])
    nodes = g.nodes
    table = np.column_stack([store.coords[nodes][:, :dim], store.density[nodes]])
    if n is not None:
        return _scalar(ctx, nodes, table[:, _check_axis(ctx, n)])
    return tuple(_scalar(ctx, nodes, table[:, axis]) for axis in range(dim))


NORM = operator(
    "NORM",
    topic="geometry",
    summary="length of a vector",
    notice="A vector is a POINT: its distance to the origin.",
    example="OPTI DIME 2 ; MESS (NORM (3. 4.)) ;",
    see=["DIST"],
)


@NORM.form(Arg("v", POINT, "vector"), gives=[FLOTTANT])
def _norm(ctx: Context, v: Point) -> float:
    return float(np.linalg.norm(v.coords))


DIST = operator(
    "DIST",
    topic="geometry",
    summary="distance between two points, or two sets of points",
    notice="Of two points, or of a point or mesh and a mesh: the smallest distance between their nodes.",
    example="OPTI DIME 2 ; MESS (DIST (0. 0.) (3. 4.)) ;",
    see=["NORM"],
)


@DIST.form(Arg("a", (POINT, MAILLAGE), "first"), Arg("b", (POINT, MAILLAGE), "second"), gives=[FLOTTANT])
def _dist(ctx: Context, a: Any, b: Any) -> float:
    from scipy.spatial import cKDTree

    first, second = (np.array([x.node]) if isinstance(x, Point) else x.nodes for x in (a, b))
    for nodes, name in ((first, "a"), (second, "b")):
        if len(nodes) == 0:
            ctx.fail(26, "this mesh is empty", at=name)
    coords = nodes_of(ctx).coords
    distance, _ = cKDTree(coords[first]).query(coords[second])
    return float(distance.min())


BARY = operator(
    "BARYCENTRE",
    topic="geometry",
    summary="mean point of the nodes of a mesh",
    notice="The arithmetic mean of the nodes, in general not the centre of gravity. With 'ELEM': a mesh of "
    "points, one at the mean of the corners of each element.",
    example="OPTI DIME 2 ELEM SEG2 ; L = DROIT 4 (0. 0.) (2. 0.) ; X Y = COOR (BARY L) ; MESS X ;",
)


@BARY.form(Arg("g", MAILLAGE, "mesh"), Key("ELEM", "one point per element", name="each"), gives=["POINT|MAILLAGE"])
def _bary(ctx: Context, g: Maillage, each: bool) -> Point | Maillage:
    store = nodes_of(ctx)
    if g.n_cells == 0:
        ctx.fail(26, "this mesh is empty", at="g")
    if each:
        centres = [geometry.centroids(shape(b.shape), store.coords[b.cells]) for b in g.blocks]
        return new_mesh(ctx, [("POI1", store.add(np.concatenate(centres), ctx.option("DENS")).reshape(-1, 1))])
    return new_point(ctx, store.coords[g.nodes].mean(axis=0))


MESU = operator(
    "MESURE",
    topic="geometry",
    summary="length, area or volume of a mesh",
    notice="The measure of the elements of highest dimension in the mesh. On a closed line 'SURF' gives the "
    "area inside (projected on its mean plane), on a closed surface 'VOLU' the volume inside. 'DENS' "
    "gives a CHPOINT: the mean length of the edges around each node.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 2 (0. 0.) (3. 0.)) TRAN 2 (0. 2.) ; MESS (MESU S) ;",
)


@MESU.form(
    Arg("g", MAILLAGE, "mesh"),
    Key(("LONG", "SURF", "VOLU"), "what to measure", name="what"),
    Key("DENS", "lengths of the edges around nodes"),
    gives=["FLOTTANT|CHPOINT"],
)
def _mesu(ctx: Context, g: Maillage, what: str | None, dens: bool) -> float | ChPoint:
    coords = nodes_of(ctx).coords
    if g.n_cells == 0:
        ctx.fail(26, "this mesh is empty", at="g")
    if dens:
        edges = topology.edges(g.kernel_blocks)
        length = np.linalg.norm(coords[edges[:, 1]] - coords[edges[:, 0]], axis=1)
        nodes, place = np.unique(edges, return_inverse=True)
        place = place.reshape(edges.shape)
        around = np.bincount(place.ravel(), np.repeat(length, 2))
        return _scalar(ctx, nodes, around / np.bincount(place.ravel()))
    top = max(DIMENSION[name] for name in g.shapes)
    wanted = top if what is None else ("LONG", "SURF", "VOLU").index(what) + 1
    if wanted == top + 1 and top == 1:
        line_nodes(ctx, g, "g")
        return float(np.linalg.norm(_area_inside(g)))
    if wanted == top + 1 and top == 2:
        return abs(_volume_inside(g))
    if wanted > top:
        ctx.fail(16, "this mesh has nothing of this dimension: it holds {shapes}", at="g", shapes=" ".join(g.shapes))
    parts = [geometry.measures(shape(b.shape), coords[b.cells]) for b in g.blocks if DIMENSION[b.shape] == wanted]
    return float(sum(np.abs(part).sum() for part in parts))


def _area_inside(g: Maillage) -> FloatArray:
    """Return the vector area inside a closed line, half the integral of position times tangent, (3,)."""
    coords = g.store.coords
    origin = coords[g.nodes[0]]
    total = np.zeros(3)
    for block in g.blocks:
        kind = shape(block.shape)
        points, weights = kind.mass_gauss
        X = coords[block.cells] - origin
        tangent = geometry.jacobians(kind, X, points)[..., 0]
        total += np.einsum("q,mqi->i", weights, np.cross(geometry.positions(kind, X, points), tangent)) / 2
    return total


def _volume_inside(g: Maillage) -> float:
    """Return a third of the flux of the position through a closed surface."""
    coords = g.store.coords
    origin = coords[g.nodes[0]]
    total = 0.0
    for block in g.blocks:
        kind = shape(block.shape)
        points, weights = kind.mass_gauss
        X = coords[block.cells] - origin
        flux = (geometry.positions(kind, X, points) * geometry.normal_densities(kind, X, points)).sum(axis=2)
        total += float((flux @ weights).sum()) / 3
    return total
