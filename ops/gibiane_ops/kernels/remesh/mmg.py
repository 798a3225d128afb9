"""From a skeleton and a field of metrics to a raw mesh, by Mmg, which changes the old mesh."""

from __future__ import annotations

import io
import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.adapt.metric import metric_count
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import MeshingFailed, MissingPackage
from gibiane_ops.kernels.remesh.generate import RawMesh, corner_nodes, flatten
from gibiane_ops.kernels.remesh.skeleton import CELL, Skeleton

WORKER = Path(__file__).with_name("mmg_worker.py")
"""The program that runs Mmg."""

STRAY = 0.003
"""Distance allowed between a curved face and its new facets, as a share of the size of the mesh."""

SECONDS, SLOW = 30.0, 100.0
"""Time of the processor after which Mmg is given up: some seconds, and some elements a second (it makes about 5000)."""

SAME = 1e-9
"""Distance at which two places are one, as a share of the size of the mesh."""

UPPER = {2: ((0, 0, 1), (0, 1, 1)), 3: ((0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2))}
"""Rows and columns of a metric in the order of Mmg."""


def mmg_is_installed() -> bool:
    """Tell whether the bindings of Mmg can be imported."""
    return find_spec("mmgpy") is not None


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
        Mmg gave up or died, or lost a region, a patch, a curve or a corner.
    MissingPackage
        When mmgpy is not installed.

    Notes
    -----
    Cells, facets of the patches and segments of the chains carry their numbers as references of Mmg, which keeps what
    has one reference apart from what has another; corners are required nodes. The growth of the sizes is that of the
    metric. The same input gives the same mesh.

    Cost
    ----
    With all its trials 1.3 times as long as gmsh for as many elements of equal sides (1800 tetrahedra, `make bench`).

    Source
    ------
    C. Dapogny, C. Dobrzynski and P. Frey, Journal of Computational Physics 262, 2014.
    """
    if not mmg_is_installed():
        raise MissingPackage("mmgpy", 'pip install "gibiane[mmg]"')
    dim = skeleton.dim
    used, local = np.unique(cells, return_inverse=True)
    place = np.full(len(skeleton.points), -1, np.int64)
    place[used] = np.arange(len(used))
    segments = np.vstack([np.stack([chain[:-1], chain[1:]], axis=1) for chain in skeleton.chains])
    chain = np.repeat(np.arange(len(skeleton.chains)), [len(each) - 1 for each in skeleton.chains])
    corners = corner_nodes(skeleton)
    size = float(np.ptp(skeleton.points[used], axis=0).max())
    # References are numbers from 1: Mmg takes 0 for "none given".
    volumes = {"tetrahedra": _ids(local.reshape(cells.shape)), "region": region + 1} if dim == 3 else {}
    new = _run(
        {
            "vertices": np.ascontiguousarray(skeleton.points[used][:, :dim]),
            "triangles": _ids(place[skeleton.triangles]),
            "patch": skeleton.patch + 1,
            "edges": _ids(place[segments]),
            "chain": chain + 1,
            "corners": _ids(place[corners]),
            # The bindings read the memory as it lies: a transposed array would be taken for other numbers.
            "metric": np.ascontiguousarray(metric[used][:, UPPER[dim][0], UPPER[dim][1]]),
            "stray": np.float64(STRAY * size),
            "angle": np.float64(angle),
            "seconds": np.int64(SECONDS + metric_count(skeleton.points[:, :dim], [(CELL[dim], cells)], metric) / SLOW),
            **volumes,
        }
    )
    return _read(new, skeleton, corners, size)


def _ids(rows: IntArray) -> NDArray[np.int32]:
    """Copy ids as Mmg takes them."""
    return np.ascontiguousarray(rows, np.int32)


def _run(arrays: dict[str, Any]) -> dict[str, Any]:
    """Run Mmg in a process of its own, which it may end."""
    given = io.BytesIO()
    np.savez(given, **arrays)
    done = subprocess.run([sys.executable, "-P", str(WORKER)], input=given.getvalue(), capture_output=True, check=False)
    if done.returncode:
        said = [line.strip(" #") for line in done.stderr.decode(errors="replace").splitlines() if line.strip()]
        if done.returncode == -getattr(signal, "SIGXCPU", 0):
            said = [f"it did not come back in {int(arrays['seconds'])} s"]
        raise MeshingFailed("Mmg: " + (said[-1] if said else f"it ended with code {done.returncode}"))
    with np.load(io.BytesIO(done.stdout)) as found:
        return dict(found)


def _read(new: dict[str, Any], skeleton: Skeleton, corners: IntArray, size: float) -> RawMesh:
    """Collect the mesh, and put nodes of plane patches and straight chains exactly where they belong."""
    dim = skeleton.dim
    points = np.pad(new["vertices"], ((0, 0), (0, 3 - dim)))

    def referred(elements: str, number: str) -> tuple[IntArray, IntArray]:
        # Sharp edges that Mmg found beside those given carry 0.
        rows, which = new[elements].astype(np.int64), new[number].astype(np.int64)
        return rows[which > 0], which[which > 0] - 1

    cells, region = referred("tetrahedra", "region") if dim == 3 else referred("triangles", "patch")
    lines, chain = referred("edges", "chain")
    facets, limit = referred("triangles", "patch") if dim == 3 else (lines, chain)
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
