"""Tetrahedra made to a metric by Mmg: long where the metric says so, on the same domain, with the same groups."""

import numpy as np
import pytest
from simplices import grid, outer, round_block, two_blocks

from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.adapt import metric
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import MeshingFailed, MissingPackage
from gibiane_ops.kernels.remesh import mmg, remesh
from gibiane_ops.kernels.remesh.skeleton import build_skeleton

TET, TRI, FINE = shape("TET4"), shape("TRI3"), shape("TE10")
PAIR = [("FC2", "FC1")]
WIDTH = 0.05


@pytest.fixture(autouse=True)
def package():
    pytest.importorskip("mmgpy", reason="SKIPPED: METRICS IN SPACE ARE NOT TESTED, pip install 'gibiane[mmg]'")


def front(points):
    """A thin layer across the cube, oblique."""
    return np.tanh((points @ [1.0, 0.3, 0.0] - 0.1) / WIDTH)


def interpolation_error(points, cells):
    """Root of the mean square of the distance of the front to its interpolation."""
    xi, weights = FINE.mass_gauss
    at = np.einsum("qn,mnd->mqd", TET.N(xi), points[cells])
    gap = front(at) - np.einsum("qn,mn->mq", TET.N(xi), front(points)[cells])
    return float(np.sqrt((geometry.measures(TET, points[cells]) @ (gap**2 @ weights)) / weights.sum()))


def adapted(stretch, count):
    """Two passes on the unit cube, from a coarse mesh; the last of a given number of elements, or of any."""
    points, cells = grid(5, 1.0, -0.5)
    for wanted in ("free", count):
        blocks = [("TET4", cells)]
        H = metric.hessians(points, blocks, front(points)[:, None])
        M = metric.metric_map(points, blocks, H, 600.0, smallest=0.002, stretch=stretch)
        new = remesh(points, cells, M if stretch > 1 else np.linalg.det(M) ** (-1 / 6), count=wanted)
        points, cells = new.points, new.cells
    return new


def test_a_layer_costs_less_with_long_elements():
    long = adapted(30.0, "free")
    equal = adapted(1.0, int(1.2 * len(long.cells)))
    assert len(equal.cells) > len(long.cells)
    assert geometry.measures(TET, long.points[long.cells]).min() > 0
    assert geometry.measures(TET, long.points[long.cells]).sum() == pytest.approx(1.0, rel=1e-12)
    one, two = (interpolation_error(new.points, new.cells) for new in (long, equal))
    assert one < 0.1 * two


@pytest.fixture(scope="module")
def blocks():
    pytest.importorskip("mmgpy")
    points, cells, groups = two_blocks()
    # Long along x, and finer near the contact.
    size = 0.2 + 0.2 * np.abs(points[:, 2])
    M = np.einsum("n,ij->nij", size**-2, np.diag([1 / 9, 1.0, 1.0]))
    return points, cells, groups, M, remesh(points, cells, M, groups=groups, pairs=PAIR)


def test_contacts_planes_edges_and_groups_are_kept(blocks):
    points, _, groups, _, new = blocks
    first, second = new.pairs[0].T
    assert np.array_equal(new.points[first], new.points[second])
    assert set(first) == set(np.unique(new.groups["FC2"]))
    assert set(second) == set(np.unique(new.groups["FC1"]))
    for name, z, side, normal in (("FC1", 0.0, 0.5, 1.0), ("FC2", 0.0, 0.5, -1.0), ("BASE", -2.0, 1.0, -1.0)):
        x = new.points[new.groups[name]]
        assert np.abs(x[:, :, 2] - z).max() < 1e-14
        assert np.abs(x[:, :, :2]).max() == pytest.approx(side, abs=1e-14)
        assert geometry.measures(TRI, x).sum() == pytest.approx(4 * side**2, rel=1e-12)
        assert geometry.facet_normals(TRI, x)[:, 2] == pytest.approx(normal)
    assert geometry.measures(TET, new.points[new.groups["UP"]]).sum() == pytest.approx(1.0, rel=1e-12)
    assert geometry.measures(TET, new.points[new.groups["LOW"]]).sum() == pytest.approx(8.0, rel=1e-12)
    assert np.array_equal(new.points[new.groups["POINT"][:, 0]], points[groups["POINT"][:, 0]])
    line = new.points[new.groups["EDGE"]]
    assert np.linalg.norm(line[:, 1] - line[:, 0], axis=1).sum() == pytest.approx(1.0, rel=1e-12)


def test_the_elements_are_as_long_as_asked(blocks):
    _, _, _, _, new = blocks
    ends = topology.edges([("TET4", new.cells)])
    x = new.points[ends]
    extent = np.abs(x[:, 1] - x[:, 0]).mean(axis=0)
    assert extent[0] > 1.5 * extent[1:].max()
    assert len(new.cells) <= new.asked


def test_same_input_same_mesh_bit_for_bit_in_any_unit(blocks):
    points, cells, groups, M, _ = blocks
    one, again = (remesh(points, cells, M, groups=groups, pairs=PAIR, count="free") for _ in range(2))
    # A power of two, so that not even the last digit changes.
    small = remesh(2.0**-10 * points, cells, 2.0**20 * M, groups=groups, pairs=PAIR, count="free")
    for new, unit in ((again, 1.0), (small, 2.0**-10)):
        assert np.array_equal(new.points, unit * one.points)
        assert np.array_equal(new.cells, one.cells)
        assert all(np.array_equal(new.groups[name], one.groups[name]) for name in groups)


def test_a_round_boundary_is_followed():
    solid, top = round_block()
    M = np.broadcast_to(np.diag([0.2**-2, 0.2**-2, 0.5**-2]), (len(solid.points), 3, 3))
    new = remesh(solid.points, solid.cells, M, groups={"TOP": top}, count="free")
    assert np.abs(new.points[new.groups["TOP"]][:, :, 2] - 0.5).max() < 1e-12
    curved = new.points[np.unique(outer(new.cells))]
    curved = curved[(curved[:, 2] > 1e-9) & (curved[:, 2] < 0.5 - 1e-9)]
    assert np.abs(np.hypot(curved[:, 0], curved[:, 1]) - 1).max() < 0.0075  # old facets 0.0014, new ones STRAY
    assert geometry.measures(TET, new.points[new.cells]).sum() == pytest.approx(0.5 * np.pi, rel=0.01)


def test_long_facets_of_a_plane_stay_one_face(blocks):
    # Triangles that lean along their common edge are not folded upon each other.
    points, cells, _, _, new = blocks

    def faces(points, cells):
        none = np.zeros(0, np.int64)
        return len(build_skeleton(points, cells, np.zeros(len(cells), np.int64), {}, {}, none, 20.0).borders)

    assert faces(new.points, new.cells) == faces(points, cells) == 12


def test_a_missing_package_is_named(monkeypatch):
    points, cells = grid(1, 1.0, 0.0)
    monkeypatch.setattr(mmg, "find_spec", lambda name: None)
    with pytest.raises(MissingPackage, match=r"gibiane\[mmg\]"):
        remesh(points, cells, np.broadcast_to(np.eye(3), (len(points), 3, 3)))


def test_what_ends_mmg_is_told(monkeypatch, tmp_path):
    points, cells = grid(1, 1.0, 0.0)
    M = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    monkeypatch.setattr(mmg, "WORKER", tmp_path / "worker.py")
    for program, words in (
        ("import sys; sys.exit('## Error: no luck')", "no luck"),
        ("import os; os.abort()", "ended with code"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGXCPU)", "did not come back in 3. s"),
    ):
        mmg.WORKER.write_text(program)
        with pytest.raises(MeshingFailed, match=words):
            remesh(points, cells, M)


def test_overlapping_elements_are_refused():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.2, 0.2, 0.9]])
    with pytest.raises(MeshingFailed, match="elements 1 and 2 of the old mesh overlap"):
        remesh(points, np.array([[0, 1, 2, 3], [0, 1, 2, 4]]), np.broadcast_to(9 * np.eye(3), (5, 3, 3)))
