"""Groups and contact pairs carried from an old mesh to a new one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import IntArray
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.remesh.generate import RawMesh
from gibiane_ops.kernels.remesh.skeleton import CELL, FACET, Skeleton


@dataclass(frozen=True, eq=False)
class Contact:
    """Two named faces meshed as one.

    Attributes
    ----------
    first, second : str
        Groups of facets.
    solids : (int, int)
        Solid that each belongs to; the first one gets copies of the nodes.
    """

    first: str
    second: str
    solids: tuple[int, int]


@dataclass(frozen=True, eq=False)
class OldMesh:
    """What the new mesh takes over from the old one.

    Attributes
    ----------
    cells : (m, dim + 1) int64
    region : (m,) int64
        Region of each cell.
    solid : (n_points,) int64
        Solid of each node.
    merged : (n_points,) int64
        Number of each node once the contacts are closed.
    groups : dict of str to (k, c) int64
        c = dim + 1 for cells, dim for facets, 2 for lines, 1 for nodes.
    contacts : list of Contact
    """

    cells: IntArray
    region: IntArray
    solid: IntArray
    merged: IntArray
    groups: dict[str, IntArray]
    contacts: list[Contact]


@dataclass(frozen=True, eq=False)
class Carried:
    """Cells, groups and pairs of the new mesh, contacts opened.

    Attributes
    ----------
    source : (n,) int64
        Node of the raw mesh that gives its coordinates to each node.
    cells : (m, dim + 1) int64
    groups : dict of str to (k, c) int64
    pairs : list of (k, 2) int64
    """

    source: IntArray
    cells: IntArray
    groups: dict[str, IntArray]
    pairs: list[IntArray]


def carry(old: OldMesh, skeleton: Skeleton, raw: RawMesh) -> Carried:
    """Open the contacts of a raw mesh and find the groups of the old mesh in it.

    Parameters
    ----------
    old : OldMesh
    skeleton : Skeleton
        Of the old mesh, contacts closed.
    raw : RawMesh
        New mesh of the skeleton; cells of positive measure.

    Returns
    -------
    Carried

    Raises
    ------
    BadValue
        A group of nodes that are neither corners nor named before meshing.
    """
    dim = skeleton.dim
    solid_of_region = np.zeros(int(old.region.max()) + 1, np.int64)
    solid_of_region[old.region] = old.solid[old.cells[:, 0]]
    limits = {name: _old_faces(old, skeleton, rows) for name, rows in old.groups.items() if rows.shape[1] == dim}

    # One numbering for each solid: its own copies on the contacts where it comes first.
    n = len(raw.points)
    shared = [np.unique(raw.facets[np.isin(raw.limit, limits[each.first][:, 0])]) for each in old.contacts]
    table = np.tile(np.arange(n), (int(old.solid.max()) + 1, 1))
    source = [np.arange(n)]
    start = n
    for owner in sorted({each.solids[0] for each in old.contacts}):
        parts = [nodes for nodes, each in zip(shared, old.contacts, strict=True) if each.solids[0] == owner]
        nodes = np.unique(np.concatenate(parts))
        table[owner, nodes] = start + np.arange(len(nodes))
        source.append(nodes)
        start += len(nodes)
    solid = solid_of_region[raw.region]
    cells = table[solid[:, None], raw.cells]

    faces = topology.faces_of([(CELL[dim], raw.cells)])[FACET[dim]]
    limit = _pick(raw.limit, _match(raw.facets, faces.nodes))
    groups = {}
    for name, rows in old.groups.items():
        kind = rows.shape[1] - 1
        if kind == dim:
            inside = np.unique(old.region[_match(old.cells, rows)])
            groups[name] = cells[np.isin(raw.region, inside)]
        elif kind == dim - 1:
            groups[name] = _new_faces(
                limits[name], limit, raw.region[faces.cell], table, solid[faces.cell], faces.nodes
            )
        elif kind == 1:
            chains = _segments(skeleton)
            wanted = np.unique(_pick(chains[1], _match(chains[0], old.merged[rows])))
            groups[name] = table[old.solid[rows[0, 0]], raw.lines[np.isin(raw.chain, wanted)]]
        else:
            groups[name] = _new_nodes(name, old, raw, rows[:, 0], table)[:, None]
    pairs = [
        np.stack([table[each.solids[0], nodes], table[each.solids[1], nodes]], axis=1)
        for nodes, each in zip(shared, old.contacts, strict=True)
    ]
    # Nodes that only the copies replaced, or that no cell uses, drop out.
    keep, number = np.unique(cells, return_inverse=True)
    compact = np.full(start, -1, np.int64)
    compact[keep] = np.arange(len(keep))
    return Carried(
        np.concatenate(source)[keep],
        number.reshape(cells.shape).astype(np.int64),
        {name: compact[rows] for name, rows in groups.items()},
        [compact[each] for each in pairs],
    )


def _match(table: IntArray, rows: IntArray) -> IntArray:
    """Find each set of nodes in a table of different sets; -1 when it is not there."""
    number, _ = topology.group_by_nodes(np.vstack([table, rows]))
    place = np.full(int(number.max(initial=0)) + 1, -1, np.int64)
    place[number[: len(table)]] = np.arange(len(table))
    return place[number[len(table) :]]


def _pick(values: IntArray, places: IntArray) -> IntArray:
    """Take values at places, -1 where the place is -1."""
    return np.asarray(np.where(places >= 0, values[places], -1), np.int64)


def odd_permutations(rows: IntArray) -> IntArray:
    """Tell the sense of each facet.

    Parameters
    ----------
    rows : (k, c) int64

    Returns
    -------
    (k,) int64
        1 when an odd permutation sorts its nodes, else 0.
    """
    a = rows[:, :, None] > rows[:, None, :]
    return np.asarray(np.triu(a, 1).sum(axis=(1, 2)) % 2, np.int64)


def _segments(skeleton: Skeleton) -> tuple[IntArray, IntArray]:
    """List the old segments of the chains, with the chain of each."""
    segments = [np.stack([chain[:-1], chain[1:]], axis=1) for chain in skeleton.chains]
    return np.vstack(segments), np.repeat(np.arange(len(segments)), [len(each) for each in segments])


def _old_faces(old: OldMesh, skeleton: Skeleton, rows: IntArray) -> IntArray:
    """Describe a group of facets by the (limit, region, sense) that it covers, each once.

    The sense is 0 when the facets leave the region, 1 when they enter it.
    """
    facets, limit = (skeleton.triangles, skeleton.patch) if skeleton.dim == 3 else _segments(skeleton)
    faces = topology.faces_of([(CELL[skeleton.dim], old.cells)])[FACET[skeleton.dim]]
    number, _ = topology.group_by_nodes(np.vstack([faces.nodes, rows]))
    key = 2 * number + odd_permutations(np.vstack([faces.nodes, rows]))
    there, mine = key[: len(faces.nodes)], key[len(faces.nodes) :]
    place = np.full(int(key.max()) + 2, -1, np.int64)
    place[there] = faces.cell
    leaving, entering = place[mine], place[mine ^ 1]
    cell = np.where(leaving >= 0, leaving, entering)
    covered = [_pick(limit, _match(facets, old.merged[rows])), old.region[cell], (leaving < 0).astype(np.int64)]
    return np.unique(np.stack(covered, axis=1), axis=0)


def _new_faces(
    wanted: IntArray, limit: IntArray, region: IntArray, table: IntArray, solid: IntArray, nodes: IntArray
) -> IntArray:
    """Collect the new facets of a group; limit, region, solid and nodes describe every facet of every cell."""
    found = []
    for which, side, turned in wanted.tolist():
        rows = np.flatnonzero((limit == which) & (region == side))
        each = table[solid[rows][:, None], nodes[rows]]
        found.append(each[:, ::-1] if turned else each)
    return np.vstack(found)


def _new_nodes(name: str, old: OldMesh, raw: RawMesh, nodes: IntArray, table: IntArray) -> IntArray:
    """Find named nodes, which must be corners."""
    merged = old.merged[nodes]
    lost = [int(node) for node in merged if int(node) not in raw.corners]
    if lost:
        raise BadValue(f"group {name}", f"{len(lost)} nodes inside a face or a volume", "nodes on limiting curves")
    return table[old.solid[nodes], [raw.corners[int(node)] for node in merged]]
