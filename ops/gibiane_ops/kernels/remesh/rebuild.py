"""New mesh of the domain of an old one: sizes from a field, groups carried over, contact nodes in exact pairs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gibiane_ops.kernels import connectivity, geometry, topology
from gibiane_ops.kernels.adapt.sizes import predicted_count
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue, MeshingFailed
from gibiane_ops.kernels.mesh import pairing
from gibiane_ops.kernels.remesh.carry import Contact, OldMesh, carry, odd_permutations
from gibiane_ops.kernels.remesh.generate import RawMesh, generate
from gibiane_ops.kernels.remesh.mmg import generate_stretched, mmg_is_installed
from gibiane_ops.kernels.remesh.skeleton import CELL, FACET, Skeleton, build_skeleton, membership, regions

FIRST_GUESS = 0.87
"""Ratio of the sizes given to the mesher to those asked, at the first trial; the next trials measure it."""

FIRST_GUESS_MMG = 1.15
"""The same for Mmg, which stops dividing where edges are up to 1.4 times as long as wanted, but rarely joins them."""

AIM, LOWEST = 0.98, 0.95
"""The number of elements aimed at, and the least accepted, as shares of the number asked (never exceeded)."""

FLAT = 1e-16
"""Measure of an old element, over that of the box of the mesh, below which it is flat."""

TRIALS = 5


@dataclass(frozen=True, eq=False)
class Remeshed:
    """A new mesh and its groups.

    Attributes
    ----------
    points : (n, dim) float64, length
    cells : (m, dim + 1) int64
        Positive measure.
    groups : dict of str to (k, .) int64
        The groups given, on the new mesh; facets turn as the old ones did.
    pairs : list of (k, 2) int64
        For each contact: nodes of the first and of the second face, with the very same coordinates.
    asked : float
        Number of elements that the sizes ask for; nan when it was not imposed.
    counts : list of int
        Number of elements of each trial; the mesh returned has `len(cells)`.
    """

    points: FloatArray
    cells: IntArray
    groups: dict[str, IntArray]
    pairs: list[IntArray]
    asked: float
    counts: list[int]


def remesh(
    points: FloatArray,
    cells: IntArray,
    sizes: float | FloatArray,
    *,
    groups: Mapping[str, IntArray] | None = None,
    pairs: Sequence[tuple[str, str]] = (),
    count: Literal["sizes", "free"] | int = "sizes",
    angle: float = 20.0,
) -> Remeshed:
    """Mesh the domain of a simplex mesh again, with other sizes.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    cells : (m, dim + 1) int64
        TRI3 in a plane or TET4 in space; all the solids together.
    sizes : float or (n_points,) float64, length, or (n_points, dim, dim) float64, length^-2
        Edge of the regular simplex wanted, one value or one per node of the old mesh; or the metric in which the edges
        are 1 long.
    groups : dict of str to (k, c) int64, optional
        Named parts of the mesh; c tells what they hold: dim + 1 cells, dim facets, 2 edges, 1 nodes.
    pairs : list of (str, str)
        Contacts: names of two groups of facets whose nodes lie at the same places. The face is meshed once; the
        solid of the first name gets copies of its nodes.
    count : 'sizes', 'free' or int
        Number of elements wanted: the one that the sizes ask for (`adapt.sizes.predicted_count`), whatever comes, or
        the given one.
    angle : float, degrees
        Limit between smooth and sharp, for boundary facets and curves.

    Returns
    -------
    Remeshed

    Raises
    ------
    BadValue
        Sizes not positive; a group that is not made of elements of the mesh, its boundary or limits of its groups; a
        pair whose nodes do not match or that joins a solid with itself.
    MeshingFailed
        The mesher failed, its mesh does not fill the old domain, or old cells are flat or overlap.
    MissingPackage, MissingSystemLibrary
        When gmsh cannot be used, or for a metric in space Mmg.

    Notes
    -----
    The limits of the old mesh, of its groups and of its contacts are split into patches, curves and corners. Corners
    stay, plane patches and straight lines are kept exactly, curved ones are followed on the old facets.

    A mesher gives fewer elements than the sizes ask for, because regular tetrahedra do not fill space. All sizes are
    multiplied by one number, found by trial: mesh, count, correct by ``(got / wanted)^(1/dim)``, mesh again. Nothing
    in it depends on the scene; the result has at most the number asked, and at least `LOWEST` times it.

    Cost
    ----
    About two meshes of the final size with a field of sizes (three seconds for 20 000 tetrahedra).
    """
    dim = points.shape[1]
    space = np.pad(points, ((0, 0), (0, 3 - dim)))
    named = {name: np.asarray(group, np.int64) for name, group in (groups or {}).items()}
    given = np.asarray(sizes, np.float64)
    used = np.unique(cells)
    nodal = _equal_sizes(given) if given.ndim == 3 else np.broadcast_to(given, len(points))
    if not (np.isfinite(nodal[used]).all() and (nodal[used] > 0).all()):
        raise BadValue("size", float(nodal[used].min()), "finite and positive")

    signed = geometry.measures(shape(CELL[dim]), points[cells])
    volume = np.abs(signed)
    flat = np.flatnonzero(volume <= FLAT * float(np.ptp(points[used], axis=0).max()) ** dim)
    if len(flat):
        which = " ".join(str(k + 1) for k in flat[:5].tolist()) + (" ..." if len(flat) > 5 else "")
        raise MeshingFailed(f"elements of the old mesh are flat: {which}")

    _check_sides(cells, signed)
    solid = connectivity.solids([(CELL[dim], cells)], len(points))[1]
    merged, owners = pairing.merged_nodes(points, solid, named, pairs)
    contacts = [Contact(*names, both) for names, both in zip(pairs, owners, strict=True)]
    common = np.exp(_group_mean(np.log(np.where(np.isfinite(nodal), nodal, 1.0)), merged, used))
    by_dim = {k: {n: g for n, g in named.items() if g.shape[1] == k + 1} for k in range(dim + 1)}
    region = regions(cells, membership(cells, by_dim[dim]))
    new_cells = merged[cells]
    edge_groups = by_dim[1] if dim == 3 else {}
    skeleton = build_skeleton(
        space,
        new_cells,
        region,
        {name: merged[group] for name, group in by_dim[dim - 1].items()},
        {name: merged[group] for name, group in edge_groups.items()},
        merged[np.concatenate([np.zeros(0, np.int64), *(group.ravel() for group in by_dim[0].values())])],
        angle,
    )
    wanted = float("nan")
    if count == "sizes":
        wanted = predicted_count(points, [(CELL[dim], new_cells)], common)
    elif count != "free":
        wanted = float(count)
    field = common
    if given.ndim == 3:
        rows = given.reshape(len(points), -1)
        mean = np.stack([_group_mean(rows[:, k], merged, used) for k in range(dim * dim)], axis=1)
        field = mean.reshape(given.shape)

    by_mmg = given.ndim == 3 and (dim == 3 or mmg_is_installed())

    def mesher(sizes: FloatArray) -> RawMesh:
        if by_mmg:
            return generate_stretched(skeleton, new_cells, region, sizes, angle)
        return generate(skeleton, new_cells, sizes)

    raw, counts = _mesh_to_count(mesher, field, wanted, dim, FIRST_GUESS_MMG if by_mmg else FIRST_GUESS)
    volumes = geometry.measures(shape(CELL[dim]), raw.points[raw.cells][:, :, :dim])
    _check_measures(skeleton, volume, np.abs(volumes))
    turned = np.where((volumes < 0)[:, None], raw.cells[:, [1, 0, *range(2, dim + 1)]], raw.cells)
    old = OldMesh(cells, region, solid, merged, named, contacts)
    new = carry(old, skeleton, replace(raw, cells=turned))
    return Remeshed(raw.points[new.source][:, :dim], new.cells, new.groups, new.pairs, wanted, counts)


def _check_sides(cells: IntArray, signed: FloatArray) -> None:
    """Refuse two cells on one side of their common face: a mesher may end or never come back."""
    dim = cells.shape[1] - 1
    turned = np.where((signed < 0)[:, None], cells[:, [1, 0, *range(2, dim + 1)]], cells)
    faces = topology.faces_of([(CELL[dim], turned)])[FACET[dim]]
    number, _ = topology.group_by_nodes(faces.nodes)
    total = np.bincount(number)
    odd = np.bincount(number, odd_permutations(faces.nodes))
    bad = np.flatnonzero((total > 2) | ((total == 2) & (odd != 1)))
    if len(bad):
        pair = " and ".join(str(k + 1) for k in np.sort(faces.cell[number == bad[0]])[:2].tolist())
        raise MeshingFailed(f"elements {pair} of the old mesh overlap: they lie on one side of their common face")


def _equal_sizes(metric: FloatArray) -> FloatArray:
    """Return the size of the regular simplex of the same measure as one of a metric; nan where it is none."""
    values = np.linalg.eigvalsh(np.where(np.isfinite(metric), metric, -1.0))
    proper = (values > 0).all(axis=1) & np.isfinite(metric).all(axis=(1, 2))
    return np.where(proper, np.where(values > 0, values, 1.0).prod(axis=1) ** (-0.5 / metric.shape[1]), np.nan)


def _scaled(sizes: FloatArray, factor: float) -> FloatArray:
    """Multiply sizes, or those of metrics."""
    return sizes / factor**2 if sizes.ndim == 3 else factor * sizes


def _group_mean(values: FloatArray, group: IntArray, members: IntArray) -> FloatArray:
    """Replace each value by the mean over the members of its group."""
    total = np.bincount(group[members], values[members], minlength=len(values))
    number = np.bincount(group[members], minlength=len(values))
    return np.asarray((total / np.maximum(number, 1))[group], np.float64)


def _mesh_to_count(
    mesher: Callable[[FloatArray], RawMesh], sizes: FloatArray, wanted: float, dim: int, guess: float
) -> tuple[RawMesh, list[int]]:
    """Mesh, count and correct until the number of elements is in the accepted range; keep the best trial."""
    if not np.isfinite(wanted):
        raw = mesher(sizes)
        return raw, [len(raw.cells)]
    factors, counts = [guess], [0]
    best: RawMesh | None = None
    for trial in range(TRIALS):
        raw = mesher(_scaled(sizes, factors[-1]))
        counts[-1] = len(raw.cells)
        if best is None or _rank(counts[-1], wanted) < _rank(len(best.cells), wanted):
            best = raw
        if LOWEST * wanted <= counts[-1] <= wanted or trial == TRIALS - 1:
            break
        power = _measured_power(factors, counts, dim)
        factors.append(factors[-1] * (counts[-1] / (AIM * wanted)) ** (1 / power))
        counts.append(0)
    assert best is not None
    return best, counts


def _measured_power(factors: list[float], counts: list[int], dim: int) -> float:
    """Estimate p in ``count ~ size^-p`` from the last two trials; fixed limits and corners make it less than dim."""
    if len(factors) < 2 or factors[-1] == factors[-2]:
        return dim
    measured = np.log(counts[-2] / counts[-1]) / np.log(factors[-1] / factors[-2])
    return float(np.clip(measured, 0.4 * dim, 1.2 * dim))


def _rank(got: int, wanted: float) -> tuple[bool, float]:
    """Order trials: those within the number asked first, then by distance."""
    return got > wanted, abs(got - wanted)


def _check_measures(skeleton: Skeleton, old: FloatArray, new: FloatArray) -> None:
    """Refuse a mesh that does not fill the domain; on curved limits a new mesh may differ a little."""
    tolerance = 1e-9 if skeleton.polyhedral else 0.2
    if abs(new.sum() - old.sum()) > tolerance * old.sum():
        raise MeshingFailed(f"the new mesh measures {new.sum():g}, the old one {old.sum():g}")
