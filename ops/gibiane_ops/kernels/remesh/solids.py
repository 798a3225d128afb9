"""Meshes of simple solids, of their unions and differences, and of files that gmsh reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue, MeshingFailed
from gibiane_ops.kernels.mesh.orientation import reversed_cells
from gibiane_ops.kernels.remesh.session import gmsh_model, read_nodes, read_simplices, set_constant_size

CELL = {1: "SEG2", 2: "TRI3", 3: "TET4"}


@dataclass(frozen=True, eq=False)
class Solid:
    """A simple solid and what it does to those before it.

    Attributes
    ----------
    kind : str
        PAVE (box between two corners, or rectangle), CYLI (axis, radius), SPHE (ball or disc: centre, radius),
        DEMI (the half of a ball or disc on the side of a vector: centre, vector, radius).
    points : tuple of (3,) float64, length
        The corners, the ends of the axis, the centre, or the centre and the vector.
    radius : float, length
        Not used by PAVE.
    how : str
        UNION or MOINS; of no effect on the first.
    """

    kind: str
    points: tuple[FloatArray, ...]
    radius: float = 0.0
    how: str = "UNION"


@dataclass(frozen=True, eq=False)
class MeshedSolid:
    """Simplices of a solid, and its parts.

    Attributes
    ----------
    points : (n, 3) float64, length
    cells : (m, dim + 1) int64
        Positive measure.
    faces : list of (k, dim) int64
        The boundary, face by face of the geometry; the solid lies behind.
    named : dict of str to list of (k, c) int64
        The groups that a file names: c - 1 is their dimension.
    edges : (e, 2) int64
        Every edge once, when mid-nodes were asked for.
    middles : (e, 3) float64, length
        Places of their mid-nodes, on the curved faces where there are any.
    """

    points: FloatArray
    cells: IntArray
    faces: list[IntArray]
    named: dict[str, IntArray] = field(default_factory=dict)
    edges: IntArray = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    middles: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))


def _rotation_to(vector: FloatArray) -> tuple[float, FloatArray]:
    """Return the angle (radians) and the axis of a rotation that brings the third axis onto a vector."""
    size = float(np.linalg.norm(vector))
    if size == 0:
        raise BadValue("direction", 0.0, "a vector that is not zero")
    axis = np.cross([0.0, 0.0, 1.0], vector)
    sine = float(np.linalg.norm(axis)) / size
    angle = float(np.arctan2(sine, vector[2] / size))
    return angle, np.asarray(axis / (sine * size), np.float64) if sine > 0 else np.array([1.0, 0.0, 0.0])


def _add(occ: Any, solid: Solid, dim: int) -> tuple[int, int]:
    """Add a solid to the geometry; return its entity."""
    first = solid.points[0]
    if solid.kind == "PAVE":
        low, high = np.minimum(*solid.points), np.maximum(*solid.points)
        if not (high - low)[:dim].min() > 0:
            raise BadValue("side of the box", float((high - low)[:dim].min()), "two corners that differ in every axis")
        return (2, occ.addRectangle(*low, *(high - low)[:2])) if dim == 2 else (3, occ.addBox(*low, *(high - low)))
    if not solid.radius > 0:
        raise BadValue("radius", solid.radius, "radius > 0")
    if solid.kind == "CYLI" and dim == 3:
        along = solid.points[1] - first
        if not np.linalg.norm(along) > 0:
            raise BadValue("axis of the cylinder", 0.0, "two different points")
        return 3, occ.addCylinder(*first, *along, solid.radius)
    if solid.kind == "SPHE":
        return (
            (2, occ.addDisk(*first, solid.radius, solid.radius))
            if dim == 2
            else (3, occ.addSphere(*first, solid.radius))
        )
    if solid.kind == "DEMI":
        return _add_half(occ, first, solid.points[1], solid.radius, dim)
    raise BadValue("solid", solid.kind, "one of the solids of this dimension")


def _add_half(occ: Any, centre: FloatArray, vector: FloatArray, radius: float, dim: int) -> tuple[int, int]:
    """Add the half of a ball or disc on the side of a vector."""
    angle, axis = _rotation_to(vector)
    if dim == 3:
        half = occ.addSphere(*centre, radius, -1, 0.0, np.pi / 2)
        occ.rotate([(3, half)], *centre, *axis, angle)
        return 3, half
    disc = occ.addDisk(*centre, radius, radius)
    box = occ.addRectangle(centre[0], centre[1] - 2 * radius, 0.0, 2 * radius, 4 * radius)
    occ.rotate([(2, box)], *centre, 0.0, 0.0, 1.0, float(np.arctan2(vector[1], vector[0])))
    return tuple(occ.intersect([(2, disc)], [(2, box)])[0][0])


def mesh_solid(solids: Sequence[Solid], size: float, dim: int, degree: int = 1) -> MeshedSolid:
    """Mesh a solid made of simple ones with simplices.

    Parameters
    ----------
    solids : sequence of Solid
        Each is joined to the union of those before it, or taken away from it.
    size : float, length
        Edge wanted.
    dim : int
        3, or 2 for plane figures.
    degree : int
        2 to have mid-nodes too.

    Returns
    -------
    MeshedSolid
        Nodes of curved faces lie on them.

    Raises
    ------
    BadValue
        A size, radius or side that is not positive.
    MeshingFailed
        Nothing is left, or the mesher fails.
    MissingPackage, MissingSystemLibrary
        When gmsh cannot be used.

    Cost
    ----
    About 30 000 tetrahedra a second.
    """
    if not size > 0:
        raise BadValue("size", size, "size > 0")
    with gmsh_model() as gmsh:
        occ = gmsh.model.occ
        whole = [_add(occ, solids[0], dim)]
        for solid in solids[1:]:
            other = [_add(occ, solid, dim)]
            if not whole:
                raise MeshingFailed("nothing is left to add to or to take from")
            whole = (occ.cut if solid.how == "MOINS" else occ.fuse)(whole, other)[0]
        if not whole:
            raise MeshingFailed("nothing is left of the solid")
        occ.synchronize()
        set_constant_size(gmsh, size)
        gmsh.model.mesh.generate(dim)
        return _read(gmsh, dim, degree)


def mesh_file(path: Path, size: float | None, dim: int, degree: int = 1) -> MeshedSolid:
    """Read a file of gmsh (geometry or mesh) or of a CAD system (STEP, BREP), and mesh it if it holds no mesh.

    Parameters
    ----------
    path : Path
    size : float, length, optional
        Edge wanted, instead of what the file says.
    dim : int
        3 or 2.
    degree : int
        2 to have mid-nodes too.

    Returns
    -------
    MeshedSolid

    Raises
    ------
    MeshingFailed
        gmsh cannot read the file or mesh it, or it holds nothing of this dimension.
    MissingPackage, MissingSystemLibrary
        When gmsh cannot be used.
    """
    with gmsh_model({"Mesh.MeshSizeFromPoints": 1, "Mesh.MeshSizeExtendFromBoundary": 1}) as gmsh:
        gmsh.merge(str(path))
        if not gmsh.model.mesh.getElementTypes(dim).size:
            if size is not None:
                set_constant_size(gmsh, size)
            gmsh.model.mesh.generate(dim)
        return _read(gmsh, dim, degree)


def _read(gmsh: Any, dim: int, degree: int) -> MeshedSolid:
    """Read the mesh of the model."""
    points, position = read_nodes(gmsh)
    cells = read_simplices(gmsh, dim, -1, position)
    if len(cells) == 0:
        raise MeshingFailed("no triangle or tetrahedron was made")
    name = CELL[dim]
    wrong = geometry.measures(shape(name), points[cells][:, :, :dim]) < 0
    cells[wrong] = reversed_cells(name, cells[wrong])
    entities = sorted(gmsh.model.getBoundary(gmsh.model.getEntities(dim), combined=True, oriented=False))
    skin = topology.boundary([(name, cells)])[CELL[dim - 1]].nodes
    faces = [_outward(read_simplices(gmsh, dim - 1, tag, position), skin) for _, tag in entities]
    named = {}
    for group_dim, tag in gmsh.model.getPhysicalGroups():
        title = gmsh.model.getPhysicalName(group_dim, tag)
        parts = [
            read_simplices(gmsh, group_dim, entity, position)
            for entity in gmsh.model.getEntitiesForPhysicalGroup(group_dim, tag)
        ]
        if title and group_dim > 0:
            group = np.concatenate(parts)
            named[title] = _outward(group, skin) if group_dim == dim - 1 else group
    used, compact = np.unique(cells, return_inverse=True)
    new = np.full(len(points), -1, np.int64)
    new[used] = np.arange(len(used))
    kept = {title: new[group] for title, group in named.items() if (new[group] >= 0).all()}
    edges, middles = _middles(gmsh, dim, points) if degree == 2 else (np.zeros((0, 2), np.int64), np.zeros((0, 3)))
    return MeshedSolid(
        points[used], compact.reshape(cells.shape), [new[face] for face in faces], kept, new[edges], middles
    )


# Elements of second degree of gmsh by dimension: their code, and the corners that each mid-node stands between.
_SECOND = {
    2: (9, ((0, 1), (1, 2), (2, 0))),
    3: (11, ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3))),
}


def _middles(gmsh: Any, dim: int, points: FloatArray) -> tuple[IntArray, FloatArray]:
    """Let gmsh put mid-nodes on its geometry; return the edges (rows of the points read before) and their places."""
    from scipy.spatial import cKDTree

    gmsh.model.mesh.setOrder(2)
    every, place = read_nodes(gmsh)
    code, local = _SECOND[dim]
    tags = gmsh.model.mesh.getElementsByType(code)[1].astype(np.int64).reshape(-1, dim + 1 + len(local))
    # Gmsh numbers the nodes again; the corners stand where they stood.
    corners = np.unique(tags[:, : dim + 1])
    gap, row = cKDTree(points).query(every[place[corners]])
    if gap.max() > 1e-9 * np.ptp(points, axis=0).max():
        raise MeshingFailed("the mesher moved the corners of the elements")
    number = np.zeros(int(corners.max()) + 1, np.int64)
    number[corners] = row
    ends = number[tags[:, np.array(local)]].reshape(-1, 2)
    edges, first = np.unique(np.sort(ends, axis=1), axis=0, return_index=True)
    return edges, every[place[tags[:, dim + 1 :].ravel()[first]]]


def _outward(facets: IntArray, skin: IntArray) -> IntArray:
    """Turn facets as they turn on the boundary; those inside stay."""
    group, first = topology.group_by_nodes(np.vstack([skin, facets]))
    own = first[group[len(skin) :]]
    on = own < len(skin)
    result = facets.copy()
    result[on] = skin[own[on]]
    return result
