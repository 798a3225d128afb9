"""From a skeleton and a field of sizes to a raw mesh, through one gmsh model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import MeshingFailed
from gibiane_ops.kernels.remesh.session import (
    ELEMENT_TYPES,
    gmsh_model,
    read_nodes,
    read_simplices,
    set_metric_field,
    set_size_field,
)
from gibiane_ops.kernels.remesh.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class RawMesh:
    """A mesh with the entities of the skeleton that each element lies on.

    Attributes
    ----------
    points : (n, 3) float64, length
    cells : (m, dim + 1) int64
    region : (m,) int64
    facets : (k, dim) int64
        Triangles on the patches (3D) or segments on the chains (2D).
    limit : (k,) int64
        Patch or chain of each.
    lines : (l, 2) int64
        Segments on the chains.
    chain : (l,) int64
    corners : dict of int to int
        New node of each corner of the skeleton.
    """

    points: FloatArray
    cells: IntArray
    region: IntArray
    facets: IntArray
    limit: IntArray
    lines: IntArray
    chain: IntArray
    corners: dict[int, int]


def generate(skeleton: Skeleton, cells: IntArray, sizes: FloatArray) -> RawMesh:
    """Mesh the regions of a skeleton.

    Parameters
    ----------
    skeleton : Skeleton
    cells : (m, dim + 1) int64
        Old cells, which carry the sizes.
    sizes : (n_points,) float64, length, or in a plane (n_points, 2, 2) float64, length^-2
        Edges wanted, or metrics.

    Returns
    -------
    RawMesh

    Raises
    ------
    MeshingFailed
    """
    with gmsh_model() as gmsh:
        if skeleton.polyhedral:
            _plane_entities(gmsh, skeleton)
        else:
            _discrete_entities(gmsh, skeleton)
        if skeleton.dim == 3:
            _volumes(gmsh, skeleton)
        if sizes.ndim == 3:
            set_metric_field(gmsh, skeleton.points, cells, sizes)
        else:
            set_size_field(gmsh, skeleton.points, cells, sizes)
        gmsh.model.mesh.generate(skeleton.dim)
        return _read(gmsh, skeleton)


def corner_nodes(skeleton: Skeleton) -> IntArray:
    """List the ends of the chains.

    Parameters
    ----------
    skeleton : Skeleton

    Returns
    -------
    (k,) int64
        Increasing.
    """
    return np.unique([node for chain in skeleton.chains for node in (chain[0], chain[-1])])


def _plane_entities(gmsh: Any, skeleton: Skeleton) -> None:
    """Describe plane patches by their straight limits; tags are numbers of the skeleton plus one."""
    geo = gmsh.model.geo
    for node in corner_nodes(skeleton):
        geo.addPoint(*skeleton.points[node], 0, int(node) + 1)
    for k, chain in enumerate(skeleton.chains):
        geo.addLine(int(chain[0]) + 1, int(chain[-1]) + 1, k + 1)
    for p, border in enumerate(skeleton.borders):
        loops = _loops(skeleton, border)
        tags = [geo.addCurveLoop([k + 1 if forward else -k - 1 for k, forward in loop]) for loop in loops]
        geo.addPlaneSurface(tags, p + 1)
    geo.synchronize()


def _loops(skeleton: Skeleton, border: list[int]) -> list[list[tuple[int, bool]]]:
    """Order the chains of a patch in closed loops, the one that encloses the largest area first."""
    around: dict[int, list[int]] = {}
    for k in border:
        around.setdefault(int(skeleton.chains[k][0]), []).append(k)
        around.setdefault(int(skeleton.chains[k][-1]), []).append(k)
    left = dict.fromkeys(border)
    loops = []
    while left:
        first = next(iter(left))
        loop, k, node = [], first, int(skeleton.chains[first][0])
        start = node
        while True:
            del left[k]
            chain = skeleton.chains[k]
            forward = node == int(chain[0])
            loop.append((k, forward))
            node = int(chain[-1] if forward else chain[0])
            if node == start:
                break
            following = [each for each in around[node] if each in left]
            if not following:
                raise MeshingFailed(f"the limit of a face is open at {skeleton.points[node]}")
            k = following[0]
        loops.append(loop)
    corners = [[skeleton.points[skeleton.chains[k][0 if forward else -1]] for k, forward in loop] for loop in loops]
    areas = [np.linalg.norm(geometry.vector_area(np.array(polygon))) for polygon in corners]
    return [loops[i] for i in np.argsort(-np.array(areas), kind="stable")]


def _discrete_entities(gmsh: Any, skeleton: Skeleton) -> None:
    """Describe every patch and chain by its old elements, and let gmsh parametrise them."""
    model, points = gmsh.model, skeleton.points
    owned = np.zeros(len(points), bool)

    def add(dim: int, tag: int, border: list[int], elements: IntArray) -> None:
        model.addDiscreteEntity(dim, tag, border)
        nodes = np.unique(elements)
        nodes = nodes[~owned[nodes]]
        owned[nodes] = True
        model.mesh.addNodes(dim, tag, nodes + 1, points[nodes].ravel())
        model.mesh.addElementsByType(tag, ELEMENT_TYPES[dim], [], (elements + 1).ravel())

    for node in corner_nodes(skeleton):
        add(0, int(node) + 1, [], np.array([[node]]))
    for k, chain in enumerate(skeleton.chains):
        add(1, k + 1, [int(chain[0]) + 1, int(chain[-1]) + 1], np.stack([chain[:-1], chain[1:]], axis=1))
    for p, border in enumerate(skeleton.borders):
        add(2, p + 1, [k + 1 for k in border], skeleton.triangles[skeleton.patch == p])
    model.mesh.createGeometry()


def _volumes(gmsh: Any, skeleton: Skeleton) -> None:
    """Describe each region by the shells around it, the outer one first."""
    geo = gmsh.model.geo
    for region in range(int(skeleton.sides.max()) + 1):
        patches = [int(p) for p in np.flatnonzero((skeleton.sides == region).any(axis=1))]
        shells = _connected(patches, skeleton)
        nodes = [skeleton.points[skeleton.triangles[np.isin(skeleton.patch, shell)]] for shell in shells]
        order = np.argsort([-np.ptp(each, axis=(0, 1)).prod() for each in nodes], kind="stable")
        geo.addVolume([geo.addSurfaceLoop([p + 1 for p in shells[i]]) for i in order], region + 1)
    geo.synchronize()


def _connected(patches: list[int], skeleton: Skeleton) -> list[list[int]]:
    """Split a list of patches into those that hold together through chains."""
    left, shells = set(patches), []
    while left:
        shell, front = [], {min(left)}
        while front:
            left -= front
            shell += sorted(front)
            chains = {k for p in front for k in skeleton.borders[p]}
            front = {p for p in left if not chains.isdisjoint(skeleton.borders[p])}
        shells.append(shell)
    return shells


def _read(gmsh: Any, skeleton: Skeleton) -> RawMesh:
    """Collect the mesh, and put nodes of plane patches and straight chains exactly where they belong."""
    points, position = read_nodes(gmsh)
    dim = skeleton.dim
    n_regions = int(skeleton.sides.max()) + 1
    cells = [read_simplices(gmsh, dim, r + 1, position) for r in range(n_regions)]
    empty = [r for r, each in enumerate(cells) if len(each) == 0]
    if empty:
        raise MeshingFailed(f"{len(empty)} regions stayed empty")
    lines = [read_simplices(gmsh, 1, k + 1, position) for k in range(len(skeleton.chains))]
    corners = {}
    for node in corner_nodes(skeleton):
        corners[int(node)] = int(position[int(gmsh.model.mesh.getNodes(0, int(node) + 1)[0][0])])
        points[corners[int(node)]] = skeleton.points[node]
    faces = lines
    if dim == 3:
        faces = [read_simplices(gmsh, 2, p + 1, position) for p in range(len(skeleton.borders))]
        if not skeleton.polyhedral:
            flatten(points, faces, lines, skeleton)
    return RawMesh(
        points,
        np.vstack(cells),
        np.repeat(np.arange(n_regions), [len(each) for each in cells]),
        np.vstack(faces),
        np.repeat(np.arange(len(faces)), [len(each) for each in faces]),
        np.vstack(lines),
        np.repeat(np.arange(len(lines)), [len(each) for each in lines]),
        corners,
    )


def flatten(points: FloatArray, faces: list[IntArray], lines: list[IntArray], skeleton: Skeleton) -> None:
    """Move nodes of plane patches into their plane, and nodes of straight chains onto their line, in place.

    Parameters
    ----------
    points : (n, 3) float64, length
        Changed.
    faces : list of (k, 3) int64
        New triangles of each patch.
    lines : list of (l, 2) int64
        New segments of each chain.
    skeleton : Skeleton
    """
    on_chain = np.unique(np.vstack(lines)) if lines else np.zeros(0, np.int64)
    for p in np.flatnonzero(skeleton.plane) if faces else ():
        nodes = np.setdiff1d(faces[p], on_chain)
        old = skeleton.points[np.unique(skeleton.triangles[skeleton.patch == p])]
        centre = old.mean(axis=0)
        normal = np.linalg.svd(old - centre, full_matrices=False)[2][2]
        points[nodes] -= ((points[nodes] - centre) @ normal)[:, None] * normal
    for k in np.flatnonzero(skeleton.straight):
        ends = skeleton.points[skeleton.chains[k][[0, -1]]]
        direction = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        nodes = np.unique(lines[k])
        points[nodes] = ends[0] + ((points[nodes] - ends[0]) @ direction)[:, None] * direction
