"""Fill closed plane contours with triangles or quadrangles, the contours kept as they are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import MeshingFailed
from gibiane_ops.kernels.remesh.filled import (
    FilledMesh,
    check_sizes,
    set_inner_sizes,
    size_of,
    sizes_of,
    with_given_points,
)
from gibiane_ops.kernels.remesh.session import gmsh_model, read_nodes, read_simplices, set_size_field

# Code of gmsh for its frontal mesher in a plane.
FRONTAL = 6
# Points along each side of the grid that carries sizes divided by a scale.
GRID = 65


def mesh_surface(
    points: FloatArray,
    edges: IntArray,
    sizes: float | FloatArray | None = None,
    *,
    quadrangles: bool = False,
    scale: Callable[[FloatArray], FloatArray] | None = None,
    frontal: bool = False,
) -> FilledMesh:
    """Fill closed plane contours with triangles or quadrangles.

    Parameters
    ----------
    points : (n_points, 2) or (n_points, 3) float64, length
    edges : (m, 2) int64
        Segments of closed contours of one plane, in any order and sense; the largest contains the others, holes.
    sizes : float or (n_points,) float64, length, optional
        Edge wanted inside, one value or one per node of the contours; by default the spacing of the contours.
    quadrangles : bool
        Recombine the triangles.
    scale : callable, optional
        ``scale(points) -> (k,)``, for points of the plane z = 0 that stand for those of a surface: by how much lengths
        grow there. Sizes are wanted on the surface, and must be given.
    frontal : bool
        Advance from the contours instead of inserting points into a Delaunay mesh.

    Returns
    -------
    FilledMesh
        Every segment is the side of a cell; cells turn as the largest contour does when followed from its first
        segment.

    Raises
    ------
    MeshingFailed
        When a contour is open, the points are not in one plane, or the mesher fails.
    BadValue
        When a size is not positive.
    MissingPackage, MissingSystemLibrary
        When gmsh cannot be used.
    """
    check_sizes(sizes)
    contours = contours_of(edges)
    space = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    areas = np.array([geometry.vector_area(space[contour]) for contour in contours])
    lengths = np.linalg.norm(areas, axis=1)
    order = np.argsort(-lengths, kind="stable")
    if not lengths[order[0]] > 0:
        raise MeshingFailed("the contour encloses no area")
    normal = areas[order[0]] / lengths[order[0]]
    used = np.unique(edges)
    height = (space[used] - space[used[0]]) @ normal
    if np.abs(height).max() > 1e-6 * np.ptp(space[used], axis=0).max():
        raise MeshingFailed("the contours are not in one plane")
    extend = {"Mesh.MeshSizeExtendFromBoundary": 1 if sizes is None else 0}
    with gmsh_model(extend | ({"Mesh.Algorithm": FRONTAL} if frontal else {})) as gmsh:
        geo = gmsh.model.geo
        for node in used:
            geo.addPoint(*space[node], 0, int(node) + 1)
        loops = []
        for k in order:
            ends = np.stack([contours[k], np.roll(contours[k], -1)], axis=1) + 1
            lines = [geo.addLine(a, b) for a, b in ends.tolist()]
            for line in lines:
                geo.mesh.setTransfiniteCurve(line, 2)
            loops.append(geo.addCurveLoop(lines))
        surface = geo.addPlaneSurface(loops)
        geo.synchronize()
        if quadrangles:
            gmsh.model.mesh.setRecombine(2, surface)
        axes = np.linalg.svd(normal[None])[2][1:]
        if scale is None:
            set_inner_sizes(gmsh, space[used], space[used] @ axes.T, sizes_of(sizes, used))
        elif sizes is not None:
            _set_scaled_sizes(gmsh, points[used], size_of(points, used, sizes), scale)
        gmsh.model.mesh.generate(2)
        found, position = read_nodes(gmsh)
        given = np.array([position[int(gmsh.model.mesh.getNodes(0, int(node) + 1)[0][0])] for node in used])
        triangles = read_simplices(gmsh, 2, surface, position)
        quads = position[gmsh.model.mesh.getElementsByType(3, surface)[1].astype(np.int64)].reshape(-1, 4)
    blocks = [_turned(found, cells, normal) for cells in ((quads, triangles) if quadrangles else (triangles,))]
    if len(blocks[0]) == 0:
        raise MeshingFailed("no element was made; do the contours cross?")
    return with_given_points(points, used, found, given, *blocks)


def _turned(points: FloatArray, cells: IntArray, normal: FloatArray) -> IntArray:
    """Reverse the cells that turn against a normal."""
    if len(cells) == 0:
        return cells
    side = np.cross(points[cells[:, 1]] - points[cells[:, 0]], points[cells[:, 2]] - points[cells[:, 0]]) @ normal
    return np.where((side < 0)[:, None], cells[:, ::-1], cells)


def _set_scaled_sizes(
    gmsh: Any,
    points: FloatArray,
    size: Callable[[FloatArray], FloatArray],
    scale: Callable[[FloatArray], FloatArray],
) -> None:
    """Install sizes divided by a scale, on a grid over the points fine enough to follow it."""
    from scipy.spatial import Delaunay

    low, high = points.min(axis=0), points.max(axis=0)
    axes = [np.linspace(a, b, GRID) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 2)
    simplices = np.asarray(Delaunay(grid).simplices, np.int64)
    set_size_field(gmsh, np.pad(grid, ((0, 0), (0, 1))), simplices, size(grid) / scale(grid))


def contours_of(edges: IntArray) -> list[IntArray]:
    """Follow segments into closed contours, starting each at the first segment not yet used.

    Parameters
    ----------
    edges : (m, 2) int64

    Returns
    -------
    list of (k,) int64
        The nodes of each in order.

    Raises
    ------
    MeshingFailed
        When a node does not have two segments.
    """
    count = np.bincount(edges.ravel()) if len(edges) else np.zeros(1, np.int64)
    if len(edges) == 0 or (count[count > 0] != 2).any():
        raise MeshingFailed(
            f"open contour: {int(((count != 2) & (count > 0)).sum())} nodes without exactly two segments"
        )
    around: dict[int, list[int]] = {}
    for k, (a, b) in enumerate(edges.tolist()):
        around.setdefault(a, []).append(k)
        around.setdefault(b, []).append(k)
    done = np.zeros(len(edges), bool)
    contours = []
    for start in range(len(edges)):
        if done[start]:
            continue
        chain, k, node = [], start, int(edges[start, 0])
        while not done[k]:
            done[k] = True
            chain.append(node)
            node = int(edges[k].sum()) - node
            first, second = around[node]
            k = second if first == k else first
        contours.append(np.array(chain, np.int64))
    return contours
