"""The nodes of a session: merges of any order and number, and what refers to merged nodes."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gibiane_ops.values.champs import DISCRET, ChPoint
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.nodes import NodeStore

PAIRS = st.lists(st.tuples(st.integers(0, 19), st.integers(0, 19)), max_size=30)


def smallest_linked(pairs):
    """The smallest node linked to each of twenty, by repeated passes."""
    label = list(range(20))
    for _ in range(20):
        for a, b in pairs:
            label[a] = label[b] = min(label[a], label[b])
    return label


@given(PAIRS, st.integers(0, 30))
@settings(max_examples=200, deadline=None)
def test_merges_in_two_steps_are_one_merge(pairs, cut):
    store = NodeStore()
    store.add(np.zeros((20, 3)))
    for part in (pairs[:cut], pairs[cut:]):
        kept, dropped = np.array(part, np.int64).reshape(-1, 2).T
        store.merge(kept, dropped)
    assert store.canonical(np.arange(20)).tolist() == smallest_linked(pairs)


def test_meshes_and_fields_follow():
    store = NodeStore()
    ids = store.add(np.arange(12.0).reshape(4, 3))
    line = Maillage.of(store, "SEG2", np.array([[0, 1], [2, 3]]))
    load = ChPoint(store, {"FX": (ids, np.array([1.0, 2.0, 4.0, 8.0]))}, DISCRET)
    store.merge(np.array([1]), np.array([2]))
    assert line.blocks[0].cells.tolist() == [[0, 1], [1, 3]]
    assert line.nodes.tolist() == [0, 1, 3]
    assert load.parts["FX"][1].tolist() == [1.0, 6.0, 8.0]
    # Nodes added later are nobody's copies.
    assert store.canonical(store.add(np.zeros((100, 3)))).tolist() == list(range(4, 104))
