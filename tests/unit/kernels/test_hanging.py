"""Facets of small cells that are pieces of the facet of a large one."""

import numpy as np
import pytest

from gibiane_ops.kernels.hanging import outer_boundary, pieces_of_facets


def test_halves_of_a_side():
    # a square beside two small ones: the side 1-2, its middle 4
    points = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [1, 0.5], [1.5, 0], [1.5, 0.5], [1.5, 1]])
    blocks = [("QUA4", np.array([[0, 1, 2, 3], [1, 5, 6, 4], [4, 6, 7, 2]]))]
    found = outer_boundary(points, blocks)["SEG2"].nodes
    assert sorted(map(sorted, found.tolist())) == [[0, 1], [0, 3], [1, 5], [2, 3], [2, 7], [5, 6], [6, 7]]
    piece, whole, weights = pieces_of_facets(points, np.array([[0, 1], [1, 2], [4, 1], [2, 4], [5, 6]]))
    assert (piece.tolist(), whole.tolist()) == ([2, 3], [1, 1])
    corner = points[[1, 2]]
    for k, row in enumerate(([4, 1], [2, 4])):
        np.testing.assert_allclose(weights[k] @ corner, points[row])


@pytest.mark.parametrize("turn", range(4))
def test_quarters_of_a_face(turn):
    line = np.array([0.0, 0.5, 1.0])
    points = np.array([[x, y, 0.1 * x] for y in line for x in line])
    # the large face 0 2 8 6 last, its pieces turned the other way; a facet beside it touches a middle only
    points = np.vstack([points, [[1.5, 0.5, 0.15], [1.5, 1, 0.15]]])
    small = np.roll([[0, 3, 4, 1], [1, 4, 5, 2], [3, 6, 7, 4], [4, 7, 8, 5]], turn, axis=1)
    facets = np.vstack([[[5, 9, 10, 8]], small, [[0, 2, 8, 6]]])
    piece, whole, weights = pieces_of_facets(points, facets)
    assert (piece.tolist(), whole.tolist()) == ([1, 2, 3, 4], [5] * 4)
    np.testing.assert_allclose(weights @ points[facets[5]], points[small])
