"""From a skeleton and a field of metrics to a raw mesh, by Mmg, which changes the old mesh."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import MeshingFailed, MissingPackage
from gibiane_ops.kernels.remesh.generate import RawMesh, corner_nodes, flatten
from gibiane_ops.kernels.remesh.skeleton import Skeleton

STRAY = 0.003
"""Distance allowed between a curved face and its new facets, as a share of the size of the mesh."""

SAME = 1e-9
"""Distance at which two places are one, as a share of the size of the mesh."""

UPPER = {2: ((0, 0, 1), (0, 1, 1)), 3: ((0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2))}
"""Rows and columns of a metric in the order of Mmg."""


def mmg_is_installed() -> bool:
    """Tell whether the bindings of Mmg can be imported."""
    return find_spec("mmgpy") is not None


def load_mmg() -> Any:
    """Import the bindings of Mmg.

    Returns
    -------
    module

    Raises
    ------
    MissingPackage
        mmgpy is not installed.
    """
    try:
        import mmgpy
    except ImportError as error:
        raise MissingPackage("mmgpy", 'pip install "gibiane[mmg]"') from error
    return mmgpy


def generate_stretched(
    skeleton: Skeleton, cells: IntArray, region: IntArray, metric: FloatArray, angle: float
) -> RawMesh:
    """Mesh the regions of a skeleton with simplices that are long where a metric says so.

    Parameters
    ----------
    skeleton : Skeleton
    cells : (m, dim + 1) int64
        Old cells, which Mmg changes and which carry the metric.
    region : (m,) int64
        Region of each.
    metric : (n_points, dim, dim) float64, length^-2
        An edge e is as long as wanted when ``e.M.e = 1``.
    angle : float, degrees
        Facets that turn by more meet at a sharp edge.

    Returns
    -------
    RawMesh

    Raises
    ------
    MeshingFailed
        Mmg gave up, or lost a region, a patch, a curve or a corner.
    MissingPackage
        When mmgpy is not installed.

    Notes
    -----
    Cells, facets of the patches and segments of the chains carry their numbers as references of Mmg, which keeps what
    has one reference apart from what has another; corners are required nodes. The growth of the sizes is that of the
    metric. The same input gives the same mesh.

    Source
    ------
    C. Dapogny, C. Dobrzynski and P. Frey, Journal of Computational Physics 262, 2014.
    """
    mmgpy = load_mmg()
    dim = skeleton.dim
    used, local = np.unique(cells, return_inverse=True)
    place = np.full(len(skeleton.points), -1, np.int64)
    place[used] = np.arange(len(used))
    segments = np.vstack([np.stack([chain[:-1], chain[1:]], axis=1) for chain in skeleton.chains])
    chain = np.repeat(np.arange(len(skeleton.chains)), [len(each) - 1 for each in skeleton.chains])
    corners = corner_nodes(skeleton)
    fixed = _int32(place[corners])

    mesh = mmgpy.MmgMesh3D() if dim == 3 else mmgpy.MmgMesh2D()
    volumes = {"tetrahedra": len(cells)} if dim == 3 else {}
    triangles = len(skeleton.triangles)
    mesh.set_mesh_size(vertices=len(used), triangles=triangles, edges=len(segments), **volumes)
    mesh.set_vertices(np.ascontiguousarray(skeleton.points[used][:, :dim]))
    # References are numbers from 1: Mmg takes 0 for "none given".
    if dim == 3:
        mesh.set_tetrahedra(_int32(local.reshape(cells.shape)), region + 1)
    mesh.set_triangles(_int32(place[skeleton.triangles]), skeleton.patch + 1)
    mesh.set_edges(_int32(place[segments]), chain + 1)
    mesh.set_corners(fixed)
    mesh.set_required_vertices(fixed)
    # The bindings read the memory as it lies: a view or a transposed array would be taken for other numbers.
    mesh["tensor"] = np.ascontiguousarray(metric[used][:, UPPER[dim][0], UPPER[dim][1]])
    size = float(np.ptp(skeleton.points[used], axis=0).max())
    try:
        mesh.remesh(hgrad=-1.0, hgradreq=-1.0, hausd=STRAY * size, ar=angle, verbose=-1)
    except RuntimeError as error:
        raise MeshingFailed(f"Mmg: {error}") from error
    return _read(mesh, skeleton, corners, size)


def _int32(rows: IntArray) -> Any:
    """Copy ids as Mmg takes them."""
    return np.ascontiguousarray(rows, np.int32)


def _read(mesh: Any, skeleton: Skeleton, corners: IntArray, size: float) -> RawMesh:
    """Collect the mesh, and put nodes of plane patches and straight chains exactly where they belong."""
    dim = skeleton.dim
    points = np.pad(np.asarray(mesh.get_vertices(), np.float64), ((0, 0), (0, 3 - dim)))

    def referred(pair: tuple[Any, Any]) -> tuple[IntArray, IntArray]:
        # Sharp edges that Mmg found beside those given carry 0.
        elements, number = (np.asarray(each, np.int64) for each in pair)
        return elements[number > 0], number[number > 0] - 1

    cells, region = referred(mesh.get_tetrahedra_with_refs() if dim == 3 else mesh.get_triangles_with_refs())
    lines, chain = referred(mesh.get_edges_with_refs())
    facets, limit = referred(mesh.get_triangles_with_refs()) if dim == 3 else (lines, chain)
    for what, kept, number in (
        ("regions", region, int(skeleton.sides.max()) + 1),
        ("faces", limit, len(skeleton.borders if dim == 3 else skeleton.chains)),
        ("curves", chain, len(skeleton.chains)),
    ):
        lost = np.setdiff1d(np.arange(number), kept)
        if len(lost):
            raise MeshingFailed(f"Mmg lost {len(lost)} of {number} {what}")
    from scipy.spatial import cKDTree

    # Mmg works in a box of size 1: what it gives back may differ in the last digit.
    gap, kept = cKDTree(points).query(skeleton.points[corners])
    moved = int((gap > SAME * size).sum())
    if moved:
        raise MeshingFailed(f"Mmg moved {moved} of {len(corners)} corners")
    points[kept] = skeleton.points[corners]
    flatten(
        points,
        [facets[limit == p] for p in range(len(skeleton.borders))] if dim == 3 else [],
        [lines[chain == k] for k in range(len(skeleton.chains))],
        skeleton,
    )
    by_corner = dict(zip(corners.tolist(), kept.tolist(), strict=True))
    return RawMesh(points, cells, region, facets, limit, lines, chain, by_corner)
