"""Mid-nodes by edge, and the order in which scripts see the nodes of an element."""

from __future__ import annotations

import numpy as np
import pytest

from gibiane_ops.kernels.elements.table import SHAPES
from gibiane_ops.values.maillage import IN_TURN, cells_from_turn, cells_in_turn
from gibiane_ops.values.middles import Middles
from gibiane_ops.values.nodes import NodeStore


def store_of(n: int) -> NodeStore:
    store = NodeStore()
    store.add(np.column_stack([np.arange(n), np.zeros(n), np.zeros(n)]), np.arange(n, dtype=float))
    return store


def test_one_node_per_edge_whatever_its_direction() -> None:
    store = store_of(4)
    middles = Middles(store)
    first = middles.of(np.array([[0, 1], [1, 2], [1, 0]]))
    assert first.tolist() == [4, 5, 4]
    again = middles.of(np.array([[2, 1], [2, 3]]))
    assert again.tolist() == [5, 6]
    assert np.allclose(store.coords[[4, 5, 6], 0], [0.5, 1.5, 2.5])
    assert np.allclose(store.density[[4, 5, 6]], [0.5, 1.5, 2.5])


def test_the_last_record_counts_and_edges_of_one_node_do_not() -> None:
    store = store_of(6)
    middles = Middles(store)
    middles.record(np.array([[0, 1], [3, 3]]), np.array([4, 2]))
    middles.record(np.array([[1, 0], [0, 1], [1, 2]]), np.array([2, 5, 3]))
    assert middles.of(np.array([[0, 1], [2, 1]])).tolist() == [5, 3]
    assert middles.known(np.array([[1, 0], [0, 2], [3, 3]])).tolist() == [True, False, False]


def test_merged_nodes_leave_one_middle_per_edge() -> None:
    store = store_of(8)
    middles = Middles(store)
    middles.record(np.array([[0, 1], [2, 3], [4, 5]]), np.array([6, 7, 7]))
    store.merge(np.array([0, 1, 4]), np.array([2, 3, 5]))
    assert middles.of(np.array([[0, 1]])).tolist() == [6]
    assert not middles.known(np.array([[4, 4]])).any()


@pytest.mark.parametrize("name", IN_TURN)
def test_mid_nodes_stand_between_their_corners_on_the_first_face(name: str) -> None:
    shape, turn = SHAPES[name], IN_TURN[name]
    assert sorted(turn) == list(range(shape.n_nodes))
    # Round the first face (or along the line) every other node is the middle of its two neighbours.
    length = 3 if shape.dim == 1 else 2 * len({"TRI6": "abc", "TE10": "abc", "PR15": "abc"}.get(name, "abcd"))
    ring = shape.ref_nodes[list(turn[:length])]
    nodes = ring if shape.dim == 1 else np.vstack([ring, ring[:1]])
    assert np.allclose(nodes[1::2], (nodes[:-1:2] + nodes[2::2]) / 2)
    cells = np.arange(2 * shape.n_nodes).reshape(2, -1)
    assert (cells_from_turn(name, cells_in_turn(name, cells)) == cells).all()
