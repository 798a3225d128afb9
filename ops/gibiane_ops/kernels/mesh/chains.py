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
