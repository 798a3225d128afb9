"""Contact tractions within the law that balance nodes or bodies, the limits on their improvement, loose motions."""

import numpy as np
import pytest

from gibiane_ops.kernels.estimate.bodies import loose_motions
from gibiane_ops.kernels.estimate.contact_bound import contact_tractions
from gibiane_ops.kernels.estimate.limits import Limits

CUBE = np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 2.0], indexing="ij"), -1).reshape(-1, 3)
CELLS = np.array([[0, 4, 6, 2, 1, 5, 7, 3]])


def held(rows, directions):
    found = np.zeros((len(CUBE), 3, 3))
    for k in directions:
        found[rows, k, k] = 1.0
    return found


@pytest.mark.parametrize(
    ("supports", "left"),
    [
        (np.zeros((8, 3, 3)), 6),
        (held(CUBE[:, 2] == 0, (0, 1, 2)), 0),
        (held(CUBE[:, 2] == 0, (2,)), 3),
        # a quarter on its two planes of symmetry
        (held(CUBE[:, 0] == 0, (0,)) + held(CUBE[:, 1] == 0, (1,)), 1),
        (held([0], (0, 1, 2)), 3),
    ],
)
def test_motions_that_supports_leave(supports, left):
    motions = loose_motions(CUBE, [CELLS], supports)
    assert len(motions) == left
    assert np.abs(np.einsum("nij,qnj->qni", supports, motions)).max(initial=0.0) < 1e-12
    # rigid: edges keep their lengths
    edge = CUBE[:, None] - CUBE[None]
    stretch = np.einsum("qabi,abi->qab", motions[:, :, None] - motions[:, None], edge)
    assert np.abs(stretch).max(initial=0.0) < 1e-12
    assert np.linalg.matrix_rank(motions.reshape(left, 24)) == left


def test_two_bodies_move_alone():
    points = np.vstack([CUBE, CUBE + 5.0])
    supports = np.zeros((16, 3, 3))
    supports[:8] = np.eye(3)
    motions = loose_motions(points, [np.vstack([CELLS, CELLS + 8])], supports)
    assert len(motions) == 6
    assert np.abs(motions[:, :8]).max() == 0


def disc(n, slide=0.9):
    """A square of 2 n^2 triangles: nodes slip away from its corner, with the friction of Tresca's bound 1."""
    axis = np.linspace(0, 1, n + 1)
    points = np.stack(np.meshgrid(axis, axis, [0.0], indexing="ij"), -1).reshape(-1, 3)
    number = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = (number[i : n + i, j : n + j].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    facets = np.vstack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    area = np.bincount(facets.ravel(), minlength=len(points)) / (6 * n * n)
    frames = np.tile(np.array([[0, 0, -1.0], [1, 0, 0], [0, 1, 0]]), (len(points), 1, 1))
    away = points - [0.0, 0.5, 0.0]
    length = np.linalg.norm(away, axis=1)[:, None]
    direction = np.divide(away, length, out=np.zeros_like(away), where=length > 0)
    force = np.column_stack([-10 * area, -direction[:, :2] * area[:, None]])
    relative = np.column_stack([np.zeros(len(points)), slide * away[:, :2]])
    return points, facets, np.arange(len(points)), frames, force, relative


def test_turning_slips_balance_the_body():
    points, facets, nodes, frames, force, relative = disc(3)
    zero, one = np.zeros(len(nodes)), np.ones(len(nodes))
    alone = contact_tractions(points, facets, nodes, frames, force, relative, zero, zero, one)
    assert not alone.admissible
    assert alone.nodal
    # the body above may rise, slide along x and turn about y
    modes = np.zeros((3, len(nodes), 3))
    modes[0, :, 2] = modes[1, :, 0] = 1.0
    modes[2, :, 2] = points[:, 0]
    found = contact_tractions(points, facets, nodes, frames, force, relative, zero, zero, one, modes=modes)
    assert found.admissible
    assert not found.nodal
    slide = np.linalg.norm(found.traction[..., :2], axis=2)
    assert slide.max() <= 1 + 1e-8
    assert (found.traction[..., 2] >= 0).all()
    # resultants of the nodal forces, to round-off
    mass = (np.eye(3) + 1) / 12 / (2 * 9)
    given = np.einsum("ab,mbi->mai", mass, found.traction)
    work = np.einsum("qmai,mai->q", modes[:, facets], given)
    asked = np.einsum("qni,nij,nj->q", modes, frames.swapaxes(1, 2), force)
    np.testing.assert_allclose(work, asked, atol=1e-12)
    # the contact error is that of the slips, from a fine rule, or a little more
    rule = np.random.default_rng(0).dirichlet(np.ones(3), 20000)
    w = np.einsum("pa,mai->mpi", rule, np.pad(relative[facets][..., 1:], ((0, 0), (0, 0), (0, 1))))
    R = np.einsum("pa,mai->mpi", rule, found.traction)
    exact = (np.linalg.norm(w, axis=2) + (w * R).sum(axis=2)).mean(axis=1) / 18
    assert (found.facet >= exact - 3e-3 * exact.max()).all()
    assert found.facet.sum() <= 1.3 * exact.sum()


def test_error_does_not_depend_on_the_tangents():
    # each node may have its own tangents: what is interpolated is a vector
    points, facets, nodes, frames, force, relative = disc(3)
    zero, one = np.zeros(len(nodes)), np.ones(len(nodes))
    first = contact_tractions(points, facets, nodes, frames, force, relative, zero, zero, one)
    angle = np.random.default_rng(1).uniform(0, 6, len(nodes))
    turn = np.zeros((len(nodes), 3, 3))
    turn[:, 0, 0] = 1.0
    turn[:, 1, 1] = turn[:, 2, 2] = np.cos(angle)
    turn[:, 1, 2], turn[:, 2, 1] = np.sin(angle), -np.sin(angle)
    force, relative = (np.einsum("nij,nj->ni", turn, v) for v in (force, relative))
    again = contact_tractions(points, facets, nodes, turn @ frames, force, relative, zero, zero, one)
    np.testing.assert_allclose(again.facet, first.facet, rtol=1e-6, atol=1e-9)


def limits():
    normal = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    bound = np.array([[1.0, 1.0, np.inf], [np.inf] * 3])
    return Limits(normal, np.array([0.1, 0.0]), bound, np.zeros((2, 3, 3)), 0.01)


def test_what_leaves_the_law():
    tau = np.array([[[0.6, 0.8, -1.0], [0.1, 0.0, -0.05], [5.0, 0.0, -1.0]], [[9.0, 9.0, 9.0]] * 3])
    row, corner, kind, direction, over = limits().passed(tau, np.arange(2))
    assert list(zip(row, corner, kind, strict=True)) == [(0, 1, 0), (0, 0, 1)]
    np.testing.assert_allclose(direction, [[0, 0, 1], [0.6, 0.8, 0]])
    np.testing.assert_allclose(over, [0.05, 0.01])
    assert limits().excess(tau) == pytest.approx(0.0, abs=1e-15)
    tau[0, 0, 0] = 0.7
    assert limits().excess(tau) > 0.01
    tau[0, 0] = [0.0, 0.0, 0.5]
    assert limits().excess(tau) == pytest.approx(0.5 / 5)


def test_how_far_the_law_lets_go():
    tau = np.zeros((2, 3, 3))
    tau[0, :, 2] = -1.0
    change = np.zeros((2, 3, 3))
    change[0, 0, 0] = 4.0
    np.testing.assert_allclose(limits().step(tau, change, np.arange(2)), [0.25, 1.0])
    change[0, 1, 2] = 10.0
    change[1] = 1e3
    np.testing.assert_allclose(limits().step(tau, change, np.arange(2)), [0.1, 1.0])
    # on the circle, straight across and along the tangent
    tau[0, 0, 0], change[:] = 1.0, 0.0
    change[0, 0, 0] = -2.0
    assert limits().step(tau, change, np.arange(2))[0] == 1.0
    change[0, 0, :2] = [0.0, 0.1]
    assert limits().step(tau, change, np.arange(2))[0] < 1e-6
