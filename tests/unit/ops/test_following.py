"""Contact pairs of middles that conditions tie to the ends of their side."""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels.contact.law import friction
from gibiane_ops.kernels.contact.node_pairs import node_pairs, with_surface
from gibiane_ops.kernels.contact.obstacle import obstacle_pairs
from gibiane_ops.values.following import carried, without_followers
from gibiane_ops.values.nodes import NodeStore
from gibiane_ops.values.rigidite import ContactPart

# two quadratic segments 0-2 and 2-4, their middles 1 and 3; another body has 5 to 9, an obstacle 10 and 11
POINTS = np.array([[x, 0.0, 0.0] for x in (0, 1, 2, 3, 4)] * 2 + [[-5.0, 0, 0], [9.0, 0, 0]])
SLAVE = [("SEG3", np.array([[0, 2, 1], [2, 4, 3]]))]
MASTER = [("SEG3", np.array([[7, 5, 6], [9, 7, 8]]))]


def tie(*triples, components=(0, 1), half=-0.5):
    """Conditions u_m + half (u_a + u_b) = 0 of twelve nodes."""
    rows = []
    for m, a, b in triples:
        for c in components:
            row = np.zeros(24)
            row[[2 * a + c, 2 * m + c, 2 * b + c]] = 3 * half, 3.0, 3 * half
            rows.append(row)
    return sp.csr_array(np.array(rows).reshape(-1, 24))


def left(C, rigid=False):
    store = NodeStore()
    store.add(POINTS)
    x = POINTS[:, :2]
    if rigid:
        pairs = with_surface(obstacle_pairs(x, SLAVE, [("SEG2", np.array([[11, 10]]))]), x, SLAVE, False)
    else:
        pairs = node_pairs(x, SLAVE, MASTER)
    n = len(pairs.pairs)
    assert pairs.pairs[:, 0].tolist() == [0, 1, 2, 3, 4]
    law = friction(n, mu=0.3, cohesion=np.arange(1.0, n + 1))
    part = ContactPart(None, pairs, law, 100 + np.arange(n), np.zeros((n, 2), np.int64))
    (found,), out = without_followers(store, np.arange(12), 2, C, [part])
    assert sorted([*found.multipliers, *out]) == list(range(100, 105))
    assert len(found.law.mu) == len(found.pairs.pairs) == len(found.vectors)
    return found, out.tolist()


def test_a_middle_tied_on_both_bodies_is_no_pair():
    found, out = left(tie((1, 0, 2), (6, 7, 5)))
    assert out == [101]
    assert found.pairs.pairs[:, 0].tolist() == [0, 2, 3, 4]
    # the middle left is that of 2 and 4; half of the bound of node 1 goes to either end
    assert found.pairs.middles.tolist() == [[2, 1, 3]]
    assert found.law.cohesion.tolist() == [2.0, 4.0, 4.0, 5.0]


@pytest.mark.parametrize(
    "C",
    [
        tie(),
        tie((1, 0, 2)),  # the other body bends there
        tie((1, 0, 2), (8, 7, 9)),
        tie((1, 0, 2), (6, 7, 5), components=(0,)),
        tie((1, 0, 2), (6, 7, 5), half=-0.4),
    ],
)
def test_other_middles_stay_pairs(C):
    found, out = left(C)
    assert out == []
    assert len(found.pairs.pairs) == 5


def test_before_an_obstacle_one_tie_is_enough():
    found, out = left(tie((3, 4, 2)), rigid=True)
    assert out == [103]
    assert found.pairs.pairs[:, 0].tolist() == [0, 1, 2, 4]


def test_forces_tell_which_middles_follow():
    pairs = node_pairs(POINTS[:, :2], SLAVE, MASTER)
    assert carried(pairs, np.array([0, 2, 3, 4])).pairs[:, 0].tolist() == [0, 2, 3, 4]
    # without forces at the ends nothing can be told
    assert len(carried(pairs, np.array([0, 3, 4])).pairs) == 5
    assert carried(pairs, np.arange(5)) is pairs
