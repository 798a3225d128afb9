"""Quadratic elements at a contact: one degree on both sides, mid-nodes that pair or follow their corners."""

import numpy as np
import pytest

from gibiane_ops.kernels import assembly, integrals, topology
from gibiane_ops.kernels.adapt.contact_degrees import contact_facets, paired_degrees
from gibiane_ops.kernels.contact import facets as contact_surfaces
from gibiane_ops.kernels.contact.node_pairs import all_partners, node_pairs
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.contact import densities, with_following

CUT = {
    "TRI3": [[0, 1, 2], [0, 2, 3]],
    "TET4": [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]],
}


def stacked(name, n=3):
    """Put a box on a box, cut into simplices; return points, cells and the pairs of nodes between them."""
    dim = shape(name).dim
    lines = [np.arange(n + 1.0)] * (dim - 1) + [np.arange(3.0)]
    box = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, dim)
    index = np.arange(len(box)).reshape([len(line) for line in lines])
    offsets = np.round((shape({2: "QUA4", 3: "CUB8"}[dim]).ref_nodes + 1) / 2).astype(int)
    cells = np.stack(
        [index[tuple(slice(o, len(line) - 1 + o) for o, line in zip(at, lines, strict=True))] for at in offsets], -1
    ).reshape(-1, 2**dim)[:, CUT[name]]
    cells = cells.reshape(-1, dim + 1)
    top = np.flatnonzero(box[:, -1] == 2)
    mirror = box * np.r_[np.ones(dim - 1), -1] + np.r_[np.zeros(dim - 1), 4.0]
    return np.vstack([box, mirror]), np.vstack([cells, cells + len(box)]), np.stack([top, top + len(box)], axis=1)


def curved_sides(name, cells, pairs, degree):
    """Return the sides, on the first nodes of pairs, all of whose facets in contact are quadratic."""
    beside, nodes = contact_facets(name, cells, [pairs])
    sides = np.sort(nodes[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    high = (degree[beside] == 2).all(axis=1)
    return {tuple(s) for s in sides[high].reshape(-1, 2)} - {tuple(s) for s in sides[~high].reshape(-1, 2)}


@pytest.mark.parametrize("name", ["TRI3", "TET4"])
def test_the_facets_of_a_contact_and_not_those_inside(name):
    points, cells, pairs = stacked(name)
    beside, nodes = contact_facets(name, cells, [pairs])
    assert len(beside) == {"TRI3": 3, "TET4": 18}[name]
    assert (points[nodes][..., -1] == 2).all()
    half = len(cells) // 2
    assert ((beside < half).sum(axis=1) == 1).all()


@pytest.mark.parametrize("name", ["TRI3", "TET4"])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_wanted_rises_with_its_partner(name, seed):
    _, cells, pairs = stacked(name)
    rng = np.random.default_rng(seed)
    wanted = 1 + (rng.random(len(cells)) < 0.3)
    found = paired_degrees(name, cells, [pairs], wanted, np.ones(len(cells), bool))
    assert (found >= wanted).all()
    beside, _ = contact_facets(name, cells, [pairs])
    assert (found[beside[:, 0]] == found[beside[:, 1]]).all()
    assert (found == wanted).sum() > 0.7 * len(cells)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("share", [0.0, 0.1])
def test_no_linear_element_touches_the_side_of_quadratic_facets_only(seed, share):
    _, cells, pairs = stacked("TET4")
    rng = np.random.default_rng(seed)
    able = rng.random(len(cells)) >= share
    found = paired_degrees("TET4", cells, [pairs], 1 + (rng.random(len(cells)) < 0.6), able)
    assert (found[~able] == 1).all()
    beside, _ = contact_facets("TET4", cells, [pairs])
    assert (found[beside[:, 0]] == found[beside[:, 1]]).all()
    curved = curved_sides("TET4", cells, pairs, found)
    assert curved
    first = np.arange(cells.max() + 1)
    first[pairs[:, 1]] = pairs[:, 0]
    edges = np.sort(first[cells[found == 1]][:, np.array([e[:2] for e in shape("TET4").edges])], axis=2)
    assert not curved & {tuple(e) for e in edges.reshape(-1, 2)}


def mixed_square():
    """Cut a square into two linear and two quadratic triangles about its centre: two of five mid-nodes follow."""
    points = np.array(
        [[0, 0], [2, 0], [2, 2], [0, 2], [1, 1], [1, 0], [1.5, 0.5], [0.5, 0.5], [0, 1], [0.5, 1.5]], float
    )
    points = np.column_stack([points, np.zeros(10)])
    return points, [
        ("TRI3", np.array([[1, 2, 4], [2, 3, 4]])),
        ("TRI6", np.array([[0, 1, 4, 5, 6, 7], [3, 0, 4, 8, 7, 9]])),
    ]


def test_areas_of_mixed_facets_add_up_and_middles_that_follow_have_none():
    points, facets = mixed_square()
    assert topology.middles_on_linear(facets)[:, 2].tolist() == [6, 9]
    area = contact_surfaces.integrals(points, contact_surfaces.surface_of(points, facets))
    assert area.sum() == pytest.approx(4.0)
    assert (area[[6, 9]] == 0).all()
    assert (np.delete(area, [6, 9]) > 0).all()


def test_mixed_facets_pair_without_the_middles_that_follow():
    points, facets = mixed_square()
    other = [(name, (cells + len(points))[:, [0, 2, 1, 5, 4, 3][: cells.shape[1]]]) for name, cells in facets]
    found = node_pairs(np.vstack([points, points]), facets, other)
    assert sorted(found.pairs[:, 0].tolist()) == [0, 1, 2, 3, 4, 5, 7, 8]
    assert (found.pairs[:, 1] == found.pairs[:, 0] + len(points)).all()
    assert not len(found.unpaired_slave)
    assert not len(found.unpaired_master)
    assert sorted(found.pairs[found.middles[:, 0], 0].tolist()) == [5, 7, 8]
    # their partners are known all the same
    every = all_partners(found.pairs, facets, other)
    assert every[:8].tolist() == found.pairs.tolist()
    assert sorted(every[8:].tolist()) == [[6, 16], [9, 19]]


@pytest.mark.parametrize("lumped", [False, True])
def test_a_uniform_traction_on_mixed_facets_is_found_again(lumped):
    points, facets = mixed_square()
    nodes = np.array([3, 0, 8, 1, 2, 4, 5, 7])
    every, follow = with_following(facets, nodes)
    assert every[8:].tolist() == [6, 9]
    place = np.empty(10, np.int64)
    place[every] = np.arange(10)
    ones = [
        (place[cells], integrals.face_mass(shape(name), points[cells]).sum(axis=2)[:, :, None])
        for name, cells in facets
    ]
    force = follow.T @ assembly.assemble_vector(10, 1, ones)
    R = densities(points, facets, nodes, np.outer(force, [1.0, -2.0, 0.5]), lumped=lumped)
    assert np.broadcast_to([1.0, -2.0, 0.5], (8, 3)) == pytest.approx(R, rel=1e-12)
