"""Fill a closed envelope with tetrahedra, the boundary kept as it is."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import topology
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
from gibiane_ops.kernels.remesh.inside import refined
from gibiane_ops.kernels.remesh.session import (
    gmsh_model,
    read_nodes,
    read_simplices,
)

# A mesh of fewer elements than this part of what the sizes ask for is made again by another method.
FAR_FROM_WANTED = 8.0
# Code of gmsh for its frontal mesher in space.
FRONTAL = 4


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
    check_sizes(sizes)
    shells = _shells(facets)
    filled = _filled(points, shells, sizes, frontal)
    if sizes is not None and len(filled.cells) < _wanted(filled, sizes) / FAR_FROM_WANTED:
        # Gmsh puts no point inside a coarse envelope whatever the size; its parallel mesher (HXT) does, but does not
        # give the same mesh twice.
        finer = refined(filled.points, filled.cells, facets, size_of(points, np.unique(facets), sizes), len(points))
        filled = FilledMesh(*finer, filled.rest)
    if len(filled.cells) == 0:
        raise MeshingFailed("no tetrahedron was made; does the envelope cross itself?")
    outside = topology.boundary([("TET4", filled.cells)])["TRI3"].nodes
    group, _ = topology.group_by_nodes(np.vstack([facets, outside]))
    if len(outside) != len(facets) or len(np.unique(group)) != len(facets):
        raise MeshingFailed("the mesher changed the envelope")
    return filled


def _filled(points: FloatArray, shells: list[IntArray], sizes: float | FloatArray | None, frontal: bool) -> FilledMesh:
    """Run the mesher inside closed surfaces."""
    used = np.unique(np.concatenate(shells))
    tags = np.zeros(len(points), np.int64)
    tags[used] = np.arange(1, len(used) + 1)
    extend = {"Mesh.MeshSizeExtendFromBoundary": 1 if sizes is None else 0}
    with gmsh_model(extend | ({"Mesh.Algorithm3D": FRONTAL} if frontal else {})) as gmsh:
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
        set_inner_sizes(gmsh, points[used], points[used], sizes_of(sizes, used))
        gmsh.model.mesh.generate(3)
        found, position = read_nodes(gmsh)
        cells = read_simplices(gmsh, 3, 1, position)
    return with_given_points(points, used, found, position[1 : len(used) + 1], cells)


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
