"""Contact forces of nodes that several zones share."""

import numpy as np

from gibiane_ops.kernels.contact.node_pairs import node_pairs
from gibiane_ops.kernels.contact.sharing import forces_by_zone


def zones():
    """A line 0-1-2 above two others, 3-4 and 5-6: node 1 stands on 4 and 5."""
    points = np.array([[0, 0], [1, 0], [2, 0], [0, 0], [1, 0], [1, 0], [2, 0]], float)
    left = node_pairs(points, [("SEG2", np.array([[0, 1]]))], [("SEG2", np.array([[4, 3]]))])
    right = node_pairs(points, [("SEG2", np.array([[1, 2]]))], [("SEG2", np.array([[6, 5]]))])
    return left, right


FORCE = np.array([[1, 10], [5, 50], [3, 30], [-1, -10], [-2, -20], [-3, -30], [-3, -30]], float)


def by_node(pairs, force):
    return {int(slave): f.tolist() for (slave, _), f in zip(pairs.pairs, force, strict=True)}


def test_partners_tell_the_forces_apart():
    left, right = zones()
    one, two = forces_by_zone([left, right], lambda nodes: FORCE[nodes])
    assert by_node(left, one) == {0: [1, 10], 1: [2, 20]}
    assert by_node(right, two) == {1: [3, 30], 2: [3, 30]}


def test_one_zone_keeps_its_forces():
    left, _ = zones()
    (one,) = forces_by_zone([left], lambda nodes: FORCE[nodes])
    assert by_node(left, one) == {0: [1, 10], 1: [5, 50]}


def test_what_no_partner_tells_counts_once():
    # the same pairs twice: neither the node nor its partner stands in one of them only
    left, _ = zones()
    found = forces_by_zone([left, left], lambda nodes: FORCE[nodes])
    assert np.allclose(found[0] + found[1], FORCE[left.pairs[:, 0]])
    assert not found[1].any()
