"""Lines as chains of segments: putting segments end to end."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import IntArray


def is_chain(segments: IntArray) -> bool:
    """Say whether each segment starts where the one before it ends.

    Parameters
    ----------
    segments : (m, 2) int64

    Returns
    -------
    bool
        False when there is no segment.
    """
    return len(segments) > 0 and bool((segments[1:, 0] == segments[:-1, 1]).all())


def chain_nodes(segments: IntArray) -> IntArray:
    """List the nodes along a chain.

    Parameters
    ----------
    segments : (m, 2) int64
        A chain, see `is_chain`.

    Returns
    -------
    (m + 1,) int64
        The first and the last are equal on a closed line.
    """
    return np.concatenate([segments[:1, 0], segments[:, 1]])


def segments_of(nodes: IntArray) -> IntArray:
    """Join consecutive nodes by segments.

    Parameters
    ----------
    nodes : (m + 1,) int64

    Returns
    -------
    (m, 2) int64
    """
    return np.stack([nodes[:-1], nodes[1:]], axis=1)


def branches(segments: IntArray) -> bool:
    """Say whether more than two segments meet at a node.

    Parameters
    ----------
    segments : (m, 2) int64
    """
    return len(segments) > 0 and int(np.unique(segments, return_counts=True)[1].max()) > 2


def path(segments: IntArray, first: int, last: int) -> IntArray:
    """Find the way along segments from a node to another that takes the fewest segments.

    Parameters
    ----------
    segments : (m, 2) int64
        In any order and direction.
    first, last : int
        Nodes.

    Returns
    -------
    (k,) int64
        The nodes on the way, ends included; none when there is no way.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order

    nodes, ends = np.unique(segments, return_inverse=True)
    ends = ends.reshape(-1, 2)
    if not np.isin([first, last], nodes).all():
        return np.zeros(0, np.int64)
    start, goal = np.searchsorted(nodes, [first, last])
    links = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (len(nodes), len(nodes))).tocsr()
    _, before = breadth_first_order(links, int(start), directed=False)
    way = [int(goal)]
    while way[-1] != start:
        if before[way[-1]] < 0:
            return np.zeros(0, np.int64)
        way.append(int(before[way[-1]]))
    return np.asarray(nodes[way[::-1]], np.int64)


def walk(segments: IntArray) -> IntArray:
    """Order segments so that they follow one another, keeping their directions.

    Parameters
    ----------
    segments : (m, 2) int64

    Returns
    -------
    (m,) int64
        Rows in walking order: each chain is followed to its end before the next begins. Open chains start where
        nothing arrives; among equal choices the first row given comes first.

    Cost
    ----
    One step of Python per segment: lines are the smallest part of a mesh, and a walk is sequential.
    """
    leaving: dict[int, list[int]] = {}
    for row, (a, _) in enumerate(segments.tolist()):
        leaving.setdefault(a, []).append(row)
    for rows in leaving.values():
        rows.reverse()
    arrivals = set(segments[:, 1].tolist())
    starts = [row for row, (a, _) in enumerate(segments.tolist()) if a not in arrivals]
    ends = segments[:, 1].tolist()
    used = [False] * len(segments)
    order: list[int] = []
    for start in [*starts, *range(len(segments))]:
        row = start
        while not used[row]:
            used[row] = True
            order.append(row)
            waiting = leaving.get(ends[row], [])
            while waiting and used[waiting[-1]]:
                waiting.pop()
            if not waiting:
                break
            row = waiting.pop()
    return np.array(order, np.int64)


def follow(cells: IntArray) -> tuple[IntArray, IntArray]:
    """Order lines of any degree from end to end, turning elements over where they must be.

    Parameters
    ----------
    cells : (m, n) int64
        First and last column are the ends. No node ends more than two elements (otherwise a walk stops there).

    Returns
    -------
    order : (m,) int64
        Rows in walking order. Each piece starts at the end from which its first element is met in its own
        direction; a closed one starts with that element.
    turned : (m,) bool
        For each row of `order`, whether it is met from its last node.

    Cost
    ----
    One step of Python per element.
    """
    ends = cells[:, [0, -1]].tolist()
    touching: dict[int, list[int]] = {}
    for row, (a, b) in enumerate(ends):
        touching.setdefault(a, []).append(row)
        touching.setdefault(b, []).append(row)
    used = [False] * len(ends)
    order: list[int] = []
    turned: list[bool] = []

    def walk_from(row: int, entry: int) -> list[tuple[int, bool]]:
        passed: list[tuple[int, bool]] = []
        while not used[row]:
            used[row] = True
            backwards = ends[row][0] != entry
            passed.append((row, backwards))
            entry = ends[row][0] if backwards else ends[row][1]
            row = next((r for r in touching[entry] if not used[r]), row)
        return passed

    for first, (a, _) in enumerate(ends):
        if used[first]:
            continue
        ahead = walk_from(first, a)
        before = next((r for r in touching[a] if not used[r]), None)
        behind = walk_from(before, a) if before is not None else []
        for row, backwards in [*((r, not back) for r, back in reversed(behind)), *ahead]:
            order.append(row)
            turned.append(backwards)
    return np.array(order, np.int64), np.array(turned, bool)
