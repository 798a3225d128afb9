"""Rigid motions left free by the supports of one or two cubes."""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels import assembly, elasticity
from gibiane_ops.kernels.bars import bar_stiffness
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.rigid import FreeMotion, dependent_motion, free_motions, rigid_modes, unseen

CUBE = (shape("CUB8").ref_nodes + 1) / 2
BOTTOM, TOP = [0, 1, 2, 3], [4, 5, 6, 7]


def cubes(n: int) -> tuple[sp.csr_array, np.ndarray]:
    """Stack n unit cubes along z, not tied; node 8 i + local, and one node that no cell uses."""
    points = np.vstack([CUBE + [0, 0, i] for i in range(n)] + [np.array([[9.0, 9, 9]])])
    cells = np.arange(8 * n).reshape(n, 8)
    Ke = elasticity.element_stiffness(shape("CUB8"), points[cells], isotropic(1.0, 0.3))
    return assembly.assemble(8 * n + 1, 3, [(cells, Ke)]), points


def rows(n_unknowns: int, *entries: dict[int, float]) -> sp.csr_array:
    C = sp.lil_array((len(entries), n_unknowns))
    for i, entry in enumerate(entries):
        for unknown, value in entry.items():
            C[i, unknown] = value
    return C.tocsr()


def held(nodes: list[int], axes: str) -> list[dict[int, float]]:
    return [{3 * node + "xyz".index(axis): 1.0} for node in nodes for axis in axes]


def motions(n: int, *entries: dict[int, float]) -> list[FreeMotion]:
    K, points = cubes(n)
    return free_motions(K, points, rows(K.shape[0], *entries))


def test_modes_carry_no_strain() -> None:
    K, points = cubes(2)
    both = rigid_modes(points[:16])
    assert both.shape == (48, 6)
    assert np.abs(K[:48][:, :48] @ both).max() < 1e-13
    assert np.linalg.matrix_rank(both) == 6


def test_rotation_turns_counterclockwise() -> None:
    x = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
    about_z = rigid_modes(x)[:, 5].reshape(3, 3)
    assert np.array_equal(about_z, np.cross([0, 0, 1], x))
    in_plane = rigid_modes(x[:2, :2])[:, 2].reshape(2, 2)
    assert np.array_equal(in_plane, about_z[:2, :2])


@pytest.mark.parametrize("stiffness", [1e-6, 1.0, 1e6])
def test_springs_stop_motions(stiffness) -> None:
    K, points = cubes(2)
    springs = np.zeros(len(points) * 3)
    springs[[3 * node for node in BOTTOM]] = stiffness
    none = sp.csr_array((0, K.shape[0]))
    left = free_motions(sp.csr_array(K + sp.diags_array(springs)), points, none)
    # x of the four nodes below: the first cube may not go along x, nor turn about z; about y it turns in their plane
    first = [m for m in left if m.solids == (0,)]
    assert [m.kind for m in first] == ["translation", "translation", "rotation", "rotation"]
    assert not any(m.translation[0] for m in first[:2])
    assert [abs(m.axis_point[2]) < 1e-9 for m in first[2:]] == [False, True]
    assert len(left) == 10
    springs[[3 * 0 + 1, 3 * 0 + 2, 3 * 1 + 2, 3 * 3 + 2]] = stiffness
    left = free_motions(sp.csr_array(K + sp.diags_array(springs)), points, none)
    assert {m.solids for m in left} == {(1,)}


def test_clamped_cube_is_held() -> None:
    assert motions(1, *held(BOTTOM, "xyz")) == []


def test_isostatic_supports_hold() -> None:
    assert motions(1, *held([0], "xyz"), *held([1], "yz"), *held([3], "z")) == []


def test_free_cube_has_six_motions() -> None:
    found = motions(1)
    assert [motion.kind for motion in found] == ["translation"] * 3 + ["rotation"] * 3
    assert sorted(str(motion) for motion in found[:3]) == [f"solid 0: translation along {axis}" for axis in "xyz"]


def test_rollers_leave_the_plane() -> None:
    found = motions(1, *held(BOTTOM, "z"))
    assert [str(motion) for motion in found[:2]] == ["solid 0: translation along x", "solid 0: translation along y"]
    assert str(found[2]).startswith("solid 0: rotation about z")


def test_hinge_is_named_with_its_axis() -> None:
    (motion,) = motions(1, *held([0, 1], "xyz"))
    assert motion.kind == "rotation"
    # Nodes 0 and 1 are on the edge y = z = 0.
    assert np.abs(motion.rotation[1:]).max() == 0
    assert motion.axis_point[1:] == pytest.approx([0, 0], abs=1e-9)
    assert motion.nodes.tolist() == list(range(8))


def test_ball_joint_leaves_rotations_through_it() -> None:
    found = motions(1, *held([6], "xyz"))
    assert [motion.kind for motion in found] == ["rotation"] * 3
    for motion in found:
        arm = CUBE[6] - motion.axis_point
        assert np.cross(motion.rotation, arm) == pytest.approx(np.zeros(3), abs=1e-9)


def test_oblique_slide() -> None:
    # Nothing but the direction (1, 1, 0) is free.
    oblique = [{3 * node: 1.0, 3 * node + 1: -1.0} for node in BOTTOM]
    (motion,) = motions(1, *held(BOTTOM, "z"), *oblique)
    assert str(motion) == "solid 0: translation along (0.707, 0.707, 0)"


def test_upper_cube_on_a_held_one() -> None:
    found = motions(2, *held(BOTTOM, "xyz"))
    assert len(found) == 6
    assert all(motion.solids == (1,) and motion.nodes.tolist() == list(range(8, 16)) for motion in found)


def test_closed_contact_stops_the_fall_and_the_tipping() -> None:
    normal = [{3 * (8 + b) + 2: 1.0, 3 * t + 2: -1.0} for b, t in zip(BOTTOM, TOP, strict=True)]
    found = motions(2, *held(BOTTOM, "xyz"), *normal)
    assert [motion.kind for motion in found] == ["translation", "translation", "rotation"]


def test_tied_cubes_move_together() -> None:
    ties = [{3 * (8 + b) + i: 1.0, 3 * t + i: -1.0} for b, t in zip(BOTTOM, TOP, strict=True) for i in range(3)]
    found = motions(2, *ties)
    assert [motion.solids for motion in found] == [(0, 1)] * 6
    assert motions(2, *ties, *held(BOTTOM, "xyz")) == []


def test_conditions_on_a_node_without_stiffness_hold_nothing() -> None:
    assert len(motions(1, *held([8], "xyz"))) == 6


def test_plane_solid() -> None:
    square = shape("QUA4").ref_nodes
    Ke = elasticity.element_stiffness(shape("QUA4"), square[None], isotropic(1.0, 0.3, "DEFO"))
    K = assembly.assemble(4, 2, [(np.array([[0, 1, 2, 3]]), Ke)])
    assert len(free_motions(K, square, sp.csr_array((0, 8)))) == 3
    pinned = rows(8, {0: 1.0}, {1: 1.0})
    (motion,) = free_motions(K, square, pinned)
    assert str(motion) == "solid 0: rotation about z through (-1, -1)"
    assert free_motions(K, square, rows(8, {0: 1.0}, {1: 1.0}, {3: 1.0})) == []


@pytest.mark.parametrize(
    ("points", "n_free"),
    [
        (np.random.default_rng(0).uniform(size=(7, 3)), 6),
        (np.random.default_rng(0).uniform(size=(5, 2)), 3),
        (np.outer(np.arange(4.0), [1.0, 2.0, 3.0]), 5),
        (np.ones((3, 3)), 3),
        (1e-6 * np.random.default_rng(0).uniform(size=(6, 3)) + 1e3, 6),
    ],
)
def test_dependent_motion_holds_for_every_rigid_motion(points, n_free):
    masters, followers, coefficients = dependent_motion(points)
    assert len(masters) == n_free
    np.testing.assert_array_equal(np.sort(np.r_[masters, followers]), np.arange(points.size))
    modes = rigid_modes(points - points.mean(axis=0))
    np.testing.assert_allclose(coefficients @ modes[masters], modes[followers], atol=1e-9 * np.abs(modes).max())
    # a stretch is not a rigid motion
    if n_free > 3:
        stretch = (points - points.mean(axis=0)).ravel()
        assert np.abs(coefficients @ stretch[masters] - stretch[followers]).max() > 0.1 * np.abs(stretch).max()


def test_the_rotation_of_a_bar_about_itself_moves_nothing() -> None:
    """A bar along x held across it and at one end: what is left turns no node."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    cells = np.array([[0, 1], [1, 2]])
    Ke = bar_stiffness(shape("SEG2"), points[cells], np.array([[3.0]]))
    K = assembly.assemble(3, 3, [(cells, Ke)])
    assert free_motions(K, points, rows(9, *held([0, 1, 2], "yz"), *held([0], "x"))) == []
    (slide,) = free_motions(K, points, rows(9, *held([0, 1, 2], "yz")))
    assert str(slide) == "solid 0: translation along x"


def test_unseen_combinations_are_those_the_rows_do_not_see() -> None:
    rng = np.random.default_rng(3)
    directions = np.linalg.qr(rng.normal(size=(6, 6)))[0]
    for n, known in ((4000, 4), (5, 4), (2, 2), (0, 0)):
        A = rng.normal(size=(n, known)) @ directions[:known]
        found = unseen(A, 1e-9)
        assert found.shape == (6 - known, 6)
        assert found @ found.T == pytest.approx(np.eye(6 - known), abs=1e-12)
        assert np.abs(A @ found.T).max(initial=0.0) < 1e-12
