"""Fill a closed envelope with tetrahedra, or closed contours with triangles, the boundary kept as it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import BadValue, MeshingFailed
from gibiane_ops.kernels.remesh.inside import refined
from gibiane_ops.kernels.remesh.session import (
    gmsh_model,
    read_nodes,
    read_simplices,
    set_constant_size,
    set_size_field,
)

# A mesh of fewer elements than this part of what the sizes ask for is made again by another method.
FAR_FROM_WANTED = 8.0
# Codes of gmsh for its frontal meshers.
FRONTAL_2D, FRONTAL_3D = 6, 4
# Points along each side of the grid that carries sizes divided by a scale.
GRID = 65


@dataclass(frozen=True, eq=False)
class FilledMesh:
    """Simplices inside a given boundary.

    Attributes
    ----------
    points : (n, dim) float64, length
        The given points, unchanged and first, then the new ones.
    cells : (m, k) int64
        Tetrahedra or triangles (or quadrangles), positive measure.
    rest : (p, 3) int64
        Triangles left over in a mesh of quadrangles, else empty.
    """

    points: FloatArray
    cells: IntArray
    rest: IntArray


def _check_sizes(sizes: float | FloatArray | None) -> None:
    if sizes is not None and not np.all(np.asarray(sizes) > 0):
        raise BadValue("size", float(np.min(sizes)), "size > 0")


def mesh_volume(
    points: FloatArray, facets: IntArray, sizes: float | FloatArray | None = None, *, frontal: bool = False
) -> FilledMesh:
    """Fill a closed envelope of triangles with tetrahedra.

    Parameters
    ----------
    points : (n_points, 3) float64, length
    facets : (m, 3) int64
        Triangles of one or several closed surfaces; the largest contains the others, which are cavities.
    sizes : float or (n_points,) float64, length, optional
        Edge wanted inside, one value or one per node of the envelope; by default the spacing of the envelope. Where
        the envelope is much coarser, elements grow from the size inside to its facets.
    frontal : bool
        Advance from the envelope instead of inserting points into a Delaunay mesh.

    Returns
    -------
    FilledMesh
        The facets are faces of the tetrahedra, untouched.

    Raises
    ------
    MeshingFailed
        When an edge of the envelope does not have two facets, or the mesher fails (envelope that crosses itself).
    BadValue
        When a size is not positive.
    MissingPackage, MissingSystemLibrary
        When gmsh cannot be used.

    Cost
    ----
    About 30 000 tetrahedra a second.
    """
    _check_sizes(sizes)
    shells = _shells(facets)
    filled = _filled(points, shells, sizes, frontal)
    if sizes is not None and len(filled.cells) < _wanted(filled, sizes) / FAR_FROM_WANTED:
        # Gmsh puts no point inside a coarse envelope whatever the size; its parallel mesher (HXT) does, but does not
        # give the same mesh twice.
        finer = refined(filled.points, filled.cells, facets, _size_of(points, np.unique(facets), sizes), len(points))
        filled = FilledMesh(*finer, filled.rest)
    if len(filled.cells) == 0:
        raise MeshingFailed("no tetrahedron was made; does the envelope cross itself?")
    outside = topology.boundary([("TET4", filled.cells)])["TRI3"].nodes
    group, _ = topology.group_by_nodes(np.vstack([facets, outside]))
    if len(outside) != len(facets) or len(np.unique(group)) != len(facets):
        raise MeshingFailed("the mesher changed the envelope")
    return filled


def _size_of(points: FloatArray, used: IntArray, sizes: float | FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return the size wanted anywhere inside: constant, or linear between the nodes of the envelope."""
    if not np.ndim(sizes):
        return lambda places: np.full(len(places), float(np.asarray(sizes)))
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    given = np.asarray(sizes, np.float64)[used]
    linear, nearest = LinearNDInterpolator(points[used], given), NearestNDInterpolator(points[used], given)

    def size(places: FloatArray) -> FloatArray:
        values = linear(places)
        return np.asarray(np.where(np.isnan(values), nearest(places), values), np.float64)

    return size


def _filled(points: FloatArray, shells: list[IntArray], sizes: float | FloatArray | None, frontal: bool) -> FilledMesh:
    """Run the mesher inside closed surfaces."""
    used = np.unique(np.concatenate(shells))
    tags = np.zeros(len(points), np.int64)
    tags[used] = np.arange(1, len(used) + 1)
    extend = {"Mesh.MeshSizeExtendFromBoundary": 1 if sizes is None else 0}
    with gmsh_model(extend | ({"Mesh.Algorithm3D": FRONTAL_3D} if frontal else {})) as gmsh:
        box = [np.ptp(points[shell], axis=(0, 1)).prod() for shell in shells]
        # The nodes are numbered once; each shell is an entity of its own.
        for number, shell in enumerate(shells, 1):
            own = np.unique(shell)
            gmsh.model.addDiscreteEntity(2, number)
            gmsh.model.mesh.addNodes(2, number, tags[own], points[own].ravel())
            gmsh.model.mesh.addElementsByType(number, 2, [], tags[shell].ravel())
        loops = [gmsh.model.geo.addSurfaceLoop([k + 1]) for k in np.argsort(box)[::-1]]
        gmsh.model.geo.addVolume(loops)
        gmsh.model.geo.synchronize()
        _set_inner_sizes(gmsh, points[used], points[used], _at(sizes, used))
        gmsh.model.mesh.generate(3)
        found, position = read_nodes(gmsh)
        cells = read_simplices(gmsh, 3, 1, position)
    return _with_given_points(points, used, found, position[1 : len(used) + 1], cells)


def _wanted(filled: FilledMesh, sizes: float | FloatArray) -> float:
    """Estimate how many regular tetrahedra of the wanted sizes the mesh holds."""
    X = filled.points[filled.cells]
    volume = np.abs(np.linalg.det(X[:, 1:] - X[:, :1])) / 6
    given = np.asarray(sizes, np.float64)
    if given.ndim:
        # Inside, where no size is given, that of the boundary nodes of the same element, or the mean.
        known = np.concatenate([given, np.full(len(filled.points) - len(given), np.nan)])[filled.cells]
        inner = np.isnan(known)
        mean = float(given[np.unique(filled.cells[filled.cells < len(given)])].mean())
        given = np.where(inner, mean, known).mean(axis=1)
    return float((volume * 6 * np.sqrt(2) / given**3).sum())


def _set_inner_sizes(gmsh: Any, points: FloatArray, plane: FloatArray, sizes: float | FloatArray | None) -> None:
    """Install a constant size, or the sizes of boundary points interpolated on their Delaunay mesh.

    `plane` holds the coordinates in which that mesh is made: 2 for a plane contour, 3 for an envelope.
    """
    from scipy.spatial import Delaunay

    if sizes is None:
        return
    if isinstance(sizes, np.ndarray) and sizes.ndim:
        simplices = np.asarray(Delaunay(plane).simplices, np.int64)
        corners = plane[simplices]
        volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
        set_size_field(gmsh, points, simplices[volume > 1e-9 * volume.max()], sizes)
    else:
        set_constant_size(gmsh, float(sizes))


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


def _with_given_points(
    points: FloatArray, used: IntArray, found: FloatArray, given: IntArray, *cells: IntArray
) -> FilledMesh:
    """Renumber so that the given points come first with their own coordinates; `given` are the rows of `used`."""
    new = np.full(len(found), -1, np.int64)
    new[given] = used
    inner = np.flatnonzero(new < 0)
    new[inner] = len(points) + np.arange(len(inner))
    every = np.vstack([points, found[inner][:, : points.shape[1]]])
    rest = new[cells[1]] if len(cells) > 1 else np.zeros((0, 3), np.int64)
    return FilledMesh(every, new[cells[0]], rest)


def _shells(facets: IntArray) -> list[IntArray]:
    """Split an envelope into closed surfaces, refusing open ones."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = np.sort(facets[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edge, _ = topology.group_by_nodes(ends)
    count = np.bincount(edge)
    if len(facets) == 0 or (count != 2).any():
        raise MeshingFailed(f"the envelope is not closed: {int((count != 2).sum())} edges without exactly two facets")
    order = np.argsort(edge, kind="stable").reshape(-1, 2) // 3
    links = coo_array((np.ones(len(order)), order.T), shape=(len(facets),) * 2)
    n, label = connected_components(links, directed=False)
    return [facets[label == k] for k in range(n)]


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
    _check_sizes(sizes)
    contours = contours_of(edges)
    space = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    areas = np.array([_area_vector(space[contour]) for contour in contours])
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
    with gmsh_model(extend | ({"Mesh.Algorithm": FRONTAL_2D} if frontal else {})) as gmsh:
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
            _set_inner_sizes(gmsh, space[used], space[used] @ axes.T, _at(sizes, used))
        elif sizes is not None:
            _set_scaled_sizes(gmsh, points[used], _size_of(points, used, sizes), scale)
        gmsh.model.mesh.generate(2)
        found, position = read_nodes(gmsh)
        given = np.array([position[int(gmsh.model.mesh.getNodes(0, int(node) + 1)[0][0])] for node in used])
        triangles = read_simplices(gmsh, 2, surface, position)
        quads = position[gmsh.model.mesh.getElementsByType(3, surface)[1].astype(np.int64)].reshape(-1, 4)
    blocks = [_turned(found, cells, normal) for cells in ((quads, triangles) if quadrangles else (triangles,))]
    if len(blocks[0]) == 0:
        raise MeshingFailed("no element was made; do the contours cross?")
    return _with_given_points(points, used, found, given, *blocks)


def _at(sizes: float | FloatArray | None, nodes: IntArray) -> float | FloatArray | None:
    """Keep the sizes of some nodes; one size for all stays what it is."""
    return sizes[nodes] if isinstance(sizes, np.ndarray) and sizes.ndim else sizes


def _turned(points: FloatArray, cells: IntArray, normal: FloatArray) -> IntArray:
    """Reverse the cells that turn against a normal."""
    if len(cells) == 0:
        return cells
    side = np.cross(points[cells[:, 1]] - points[cells[:, 0]], points[cells[:, 2]] - points[cells[:, 0]]) @ normal
    return np.where((side < 0)[:, None], cells[:, ::-1], cells)


def _area_vector(loop: FloatArray) -> FloatArray:
    """Return the vector area of a closed polygon."""
    centred = loop - loop.mean(axis=0)
    return np.asarray(np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0) / 2, np.float64)


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
