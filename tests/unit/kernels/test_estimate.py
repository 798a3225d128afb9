"""Values computed by hand for the solid and contact parts of the error, and their combination."""

import numpy as np
import pytest

from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.estimate.combine import combine, facets_to_cells, owners
from gibiane_ops.kernels.estimate.contact import contact_error
from gibiane_ops.kernels.estimate.zz import solid_error
from gibiane_ops.kernels.recovery import StressBlock

CUBE = np.array([[x, y, z] for z in (0.0, 1.0) for x, y in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))])
TET = np.vstack([np.zeros(3), np.eye(3)])
ONE = np.arange(8)[None]
# Body 1 lies on z > 0: its outward normal on the face z = 0 points down; t1 = x, t2 = -y.
FRAME = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
FACE = np.array([[0, 3, 2, 1]])


def test_energy_of_a_linear_difference_on_a_tetrahedron():
    # s* = x on one component, s_h = 0: int x^2 over the unit tetrahedron is 1/60.
    nodal = np.zeros((4, 6))
    nodal[:, 0] = TET[:, 0]
    found = solid_error(TET, StressBlock(shape("TET4"), np.arange(4)[None], np.zeros((1, 1, 6))), nodal, np.eye(6))
    assert found.error[0] == pytest.approx(1 / 60, rel=1e-13)
    assert found.sum_energy[0] == pytest.approx(1 / 60, rel=1e-13)
    assert found.energy[0] == 0.0


def test_energies_on_a_brick():
    # s* = 2, s_h = 0.5 on a shear component with compliance 3: (1.5)^2 3, (0.5)^2 3, (2.5)^2 3.
    nodal = np.full((8, 6), [0, 0, 0, 2.0, 0, 0])
    stress = np.full((1, 8, 6), [0, 0, 0, 0.5, 0, 0])
    found = solid_error(CUBE, StressBlock(shape("CUB8"), ONE, stress), nodal, 3 * np.eye(6))
    assert [found.error[0], found.energy[0], found.sum_energy[0]] == pytest.approx([6.75, 0.75, 18.75], rel=1e-13)


def on_one_face(force, relative, gap=0.0, mu=0.5, variant="DENS"):
    full = [np.tile(np.asarray(each, float), (4, 1)) for each in (force, relative)]
    frames = np.tile(FRAME, (4, 1, 1))
    return contact_error(CUBE, [("QUA4", FACE)], np.arange(4), frames, *full, np.full(4, gap), mu, variant)


@pytest.mark.parametrize("variant", ["DENS", "NODE", "DLUM"])
def test_contact_law_violations_by_hand(variant):
    # Uniform fields on a face of area 1: nodal forces are a quarter of the tractions, all variants agree.
    stuck = on_one_face([-1.0, 0.3, 0.0], [0.0, 0.0, 0.0], variant=variant)
    assert stuck.total == 0.0
    slip = on_one_face([-1.0, 0.5, 0.0], [0.0, -0.2, 0.0], variant=variant)  # sliding against the force, exact
    assert slip.total == pytest.approx(0.0, abs=1e-15)
    wrong = on_one_face([-1.0, 0.3, 0.0], [0.0, -0.2, 0.0], variant=variant)  # 0.5 x 4 x 0.2 - 1.2 x 0.2
    assert wrong.total == pytest.approx(0.16, rel=1e-12)
    held = on_one_face([-1.0, 0.0, 0.0], [-0.1, 0.0, 0.0], variant=variant)  # pressed while open: 4 x 0.1
    assert held.total == pytest.approx(0.4, rel=1e-12)
    gapped = on_one_face([-1.0, 0.0, 0.0], [0.1, 0.0, 0.0], gap=0.1, variant=variant)
    assert gapped.total == pytest.approx(0.0, abs=1e-15)
    apart = on_one_face([-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], gap=0.1, variant=variant)  # pressed across the gap: 4 x 0.1
    assert apart.total == pytest.approx(0.4, rel=1e-12)
    pulled = on_one_face([1.0, 0.5, 0.0], [-0.1, 0.2, 0.0], variant=variant)  # tension is cut to nothing
    assert pulled.total == 0.0
    assert pulled.corrected == 4


def test_density_is_the_traction():
    assert on_one_face([-1.0, 0.3, 0.0], [0.0, 0.0, 0.0]).density == pytest.approx(np.tile([-4.0, 1.2, 0.0], (4, 1)))


def test_tied_tangents_carry_no_error():
    assert on_one_face([-1.0, 7.0, 0.0], [0.0, 0.0, 0.0], mu=np.inf).total == 0.0


def test_integral_of_a_triangle():
    # R_n = -1 at every node, W_n = -x (linear): int x over the unit triangle is 1/6; lumped and consistent agree.
    points = np.array([[0.0, 0, 0], [0, 1, 0], [1, 0, 0]])
    force = np.tile([-1 / 6, 0.0, 0.0], (3, 1))
    relative = np.stack([-points[:, 0], np.zeros(3), np.zeros(3)], 1)
    for variant in ("DENS", "DLUM", "NODE"):
        found = contact_error(
            points, [("TRI3", np.array([[0, 1, 2]]))], np.arange(3), np.tile(FRAME, (3, 1, 1)),
            force, relative, np.zeros(3), 0.3, variant,
        )  # fmt: skip
        assert found.total == pytest.approx(1 / 6, rel=1e-12)


@pytest.mark.parametrize("variant", ["DENS", "DLUM"])
def test_integral_once_round_the_axis(variant):
    # A pressure of 5 on the ring 1 < r < 2, whose faces are 0.1 apart: 5 x 0.1 x pi (4 - 1).
    points = np.array([[1.0, 0.0], [2.0, 0.0]])
    frames = np.tile([[0.0, -1.0], [1.0, 0.0]], (2, 1, 1))
    force = np.array([[-5 * 2 * np.pi * share, 0.0] for share in (4 / 6, 5 / 6)])  # int N r dr over the ring
    found = contact_error(
        points, [("SEG2", np.array([[1, 0]]))], np.arange(2), frames,
        force, np.full((2, 2), [-0.1, 0.0]), np.zeros(2), 0.3, variant, axisymmetric=True,
    )  # fmt: skip
    assert found.total == pytest.approx(5 * 0.1 * np.pi * 3, rel=1e-12)


def test_contact_error_is_never_negative():
    rng = np.random.default_rng(0)
    for variant in ("DENS", "NODE", "DLUM"):
        for _ in range(50):
            force, relative = rng.normal(size=(4, 3)), rng.normal(size=(4, 3))
            found = contact_error(
                CUBE, [("QUA4", FACE)], np.arange(4), np.tile(FRAME, (4, 1, 1)),
                force, relative, np.zeros(4), 0.4, variant,
            )  # fmt: skip
            assert (found.facet[0] >= 0).all()


def test_the_tangents_chosen_do_not_matter():
    rng = np.random.default_rng(5)
    force, relative = rng.normal(size=(4, 3)) - [2, 0, 0], rng.normal(size=(4, 3))
    frames = np.tile(FRAME, (4, 1, 1))
    angle = rng.uniform(0, 6, 4)
    turn = np.zeros((4, 3, 3))
    turn[:, 0, 0] = 1
    turn[:, 1, 1] = turn[:, 2, 2] = np.cos(angle)
    turn[:, 1, 2], turn[:, 2, 1] = np.sin(angle), -np.sin(angle)
    reference = contact_error(CUBE, [("QUA4", FACE)], np.arange(4), frames, force, relative, np.zeros(4), 0.3)
    turned = [np.einsum("nij,nj->ni", turn, each) for each in (force, relative)]
    found = contact_error(CUBE, [("QUA4", FACE)], np.arange(4), turn @ frames, *turned, np.zeros(4), 0.3)
    assert found.total == pytest.approx(reference.total, rel=1e-12)


def two_bricks():
    """Brick 0 above brick 1, contact nodes doubled: 8 + 8 nodes, the upper one first."""
    points = np.vstack([CUBE, CUBE - [0, 0, 1]])
    partner = np.full(16, -1)
    partner[[0, 1, 2, 3]] = [12, 13, 14, 15]
    return points, [("CUB8", ONE), ("CUB8", ONE + 8)], partner


def test_a_facet_is_shared_by_its_two_cells():
    _, blocks, partner = two_bricks()
    assert owners(blocks, FACE, "QUA4").tolist() == [0]
    assert owners(blocks, partner[FACE], "QUA4").tolist() == [1]
    assert owners(blocks, np.array([[0, 1, 2, 9]]), "QUA4").tolist() == [-1]
    parts = facets_to_cells(blocks, [("QUA4", FACE)], [np.array([3.0])], partner)
    assert [part.tolist() for part in parts] == [[1.5], [1.5]]
    alone = facets_to_cells(blocks, [("QUA4", FACE)], [np.array([3.0])])
    assert [part.tolist() for part in alone] == [[3.0], [0.0]]


@pytest.mark.parametrize("norm", ["USUE", "THES"])
def test_relative_errors_add_up(norm):
    nodal = np.full((8, 6), [0, 0, 0, 2.0, 0, 0])
    stress = np.full((1, 8, 6), [0, 0, 0, 0.5, 0, 0])
    part = solid_error(CUBE, StressBlock(shape("CUB8"), ONE, stress), nodal, np.eye(6))  # 2.25, 0.25, 6.25
    found = combine([part, part], [np.array([0.5]), np.array([1.5])], norm)
    denominator = 12.5 if norm == "THES" else 0.5 + 4.5 + 2.0
    assert found.solid**2 == pytest.approx(4.5 / denominator)
    assert found.contact**2 == pytest.approx(2.0 / denominator)
    assert found.total**2 == pytest.approx(6.5 / denominator)
    assert found.absolute**2 == pytest.approx(6.5)
    assert sum(float((each**2).sum()) for each in found.total_map) == pytest.approx(found.total**2, rel=1e-14)
    assert [float(each[0] ** 2) * denominator for each in found.total_map] == pytest.approx([2.75, 3.75])


def test_no_stress_no_error():
    part = solid_error(CUBE, StressBlock(shape("CUB8"), ONE, np.zeros((1, 8, 6))), np.zeros((8, 6)), np.eye(6))
    assert combine([part]).total == 0.0
    assert combine([part], norm="THES").total == 0.0


def test_unknown_words_are_refused():
    with pytest.raises(BadValue):
        combine([], norm="L2")
    with pytest.raises(BadValue):
        on_one_face([0, 0, 0], [0, 0, 0], variant="MEAN")
