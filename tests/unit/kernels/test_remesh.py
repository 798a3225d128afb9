"""Filling of boundaries and remeshing: what must be kept is kept, counts are met, the same twice gives the same."""

import builtins

import numpy as np
import pytest
from simplices import grid, outer, round_block, two_blocks

from gibiane_ops.kernels import connectivity, geometry, topology
from gibiane_ops.kernels.adapt.sizes import predicted_count
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue, MeshingFailed, MissingPackage, MissingSystemLibrary
from gibiane_ops.kernels.remesh import mesh_surface, mesh_volume, remesh
from gibiane_ops.kernels.remesh.session import load_gmsh, missing_library

TET, TRI = shape("TET4"), shape("TRI3")


def square(side, n, z=None):
    """Nodes and segments of a square contour about the origin."""
    t = np.linspace(-side / 2, side / 2, n + 1)[:-1]
    low = np.full(n, -side / 2)
    points = np.vstack([np.stack(pair, 1) for pair in ((t, low), (-low, t), (-t, -low), (low, -t))])
    i = np.arange(4 * n)
    if z is not None:
        points = np.hstack([points, np.full((4 * n, 1), z)])
    return points, np.stack([i, (i + 1) % (4 * n)], 1)


PAIR = [("FC2", "FC1")]


@pytest.fixture(scope="module")
def remeshed():
    points, cells, groups = two_blocks()
    sizes = 0.12 + 0.15 * np.linalg.norm(points, axis=1)
    return sizes, remesh(points, cells, sizes, groups=groups, pairs=PAIR)


def test_contact_nodes_pair_bit_for_bit(remeshed):
    _, new = remeshed
    first, second = new.pairs[0].T
    assert np.array_equal(new.points[first], new.points[second])
    assert set(first) == set(np.unique(new.groups["FC2"]))
    assert set(second) == set(np.unique(new.groups["FC1"]))
    assert not set(np.unique(new.groups["UP"])) & set(np.unique(new.groups["LOW"]))
    partner = np.full(len(new.points), -1)
    partner[first] = second
    assert {frozenset(f) for f in partner[new.groups["FC2"]].tolist()} == {
        frozenset(f) for f in new.groups["FC1"].tolist()
    }


def test_planes_edges_and_corners_are_exact(remeshed):
    _, new = remeshed
    for name, z, side in (("FC1", 0.0, 0.5), ("FC2", 0.0, 0.5), ("BASE", -2.0, 1.0)):
        x = new.points[new.groups[name]]
        assert (x[:, :, 2] == z).all()
        assert np.abs(x[:, :, :2]).max() == side
        assert geometry.measures(TRI, x).sum() == pytest.approx(4 * side**2, rel=1e-12)
    assert geometry.measures(TET, new.points[new.groups["UP"]]).sum() == pytest.approx(1.0, rel=1e-12)
    assert geometry.measures(TET, new.points[new.groups["LOW"]]).sum() == pytest.approx(8.0, rel=1e-12)
    points, _, groups = two_blocks()
    assert np.array_equal(new.points[new.groups["POINT"][:, 0]], points[groups["POINT"][:, 0]])
    line = new.points[new.groups["EDGE"]]
    assert (line[:, :, 1:] == points[groups["EDGE"][0, 0], 1:]).all()
    assert np.linalg.norm(line[:, 1] - line[:, 0], axis=1).sum() == pytest.approx(1.0, rel=1e-12)


def test_facets_of_groups_keep_their_sense():
    points, cells, groups = two_blocks()
    groups["BASE"] = groups["BASE"][:, ::-1]
    new = remesh(points, cells, 0.4, groups=groups, pairs=PAIR)
    for name, normal in (("FC1", 1.0), ("FC2", -1.0), ("BASE", 1.0)):
        assert geometry.facet_normals(TRI, new.points[new.groups[name]])[:, 2] == pytest.approx(normal)


def test_the_number_of_elements_follows_the_sizes(remeshed):
    sizes, new = remeshed
    points, cells, _ = two_blocks()
    # Both nodes of a pair carry the same size here: the field is the one that the mesher saw.
    assert new.asked == pytest.approx(predicted_count(points, [("TET4", cells)], sizes), rel=1e-12)
    assert 0.95 * new.asked <= len(new.cells) <= new.asked


def test_a_given_number_of_elements_is_met():
    points, cells, groups = two_blocks()
    new = remesh(points, cells, 0.3, groups=groups, pairs=PAIR, count=3000)
    assert 2850 <= len(new.cells) <= 3000


def test_element_quality(remeshed):
    _, new = remeshed
    x = new.points[new.cells]
    volume = geometry.measures(TET, x)
    i, j = np.triu_indices(4, 1)
    squares = ((x[:, i] - x[:, j]) ** 2).sum(axis=(1, 2))
    quality = 12 * (3 * volume) ** (2 / 3) / squares  # mean ratio, 1 for the regular tetrahedron
    assert quality.min() > 0.25
    assert quality.mean() > 0.75


def test_same_input_same_mesh_bit_for_bit(remeshed):
    sizes, new = remeshed
    points, cells, groups = two_blocks()
    again = remesh(points, cells, sizes, groups=groups, pairs=PAIR)
    assert np.array_equal(again.points, new.points)
    assert np.array_equal(again.cells, new.cells)
    assert all(np.array_equal(again.groups[name], new.groups[name]) for name in groups)


def test_tied_volumes_share_their_nodes():
    points, cells = grid(3, 1.0, 0.0)
    lower = cells[points[cells].mean(axis=1)[:, 2] < 1 / 3]
    new = remesh(points, cells, 0.25, groups={"SOFT": lower})
    soft = new.groups["SOFT"]
    assert geometry.measures(TET, new.points[soft]).sum() == pytest.approx(1 / 3, rel=1e-12)
    assert len(outer(new.cells)) < len(outer(soft)) + len(outer(new.cells)) - 2
    assert connectivity.solids([("TET4", new.cells)], len(new.points))[0] == 1


def test_a_cavity_stays_empty():
    points, cells = grid(6, 3.0, -1.5)
    inside = (np.abs(points[cells].mean(axis=1)) < 0.5).all(axis=1)
    new = remesh(points, cells[~inside], 0.5)
    assert geometry.measures(TET, new.points[new.cells]).sum() == pytest.approx(26.0, rel=1e-12)
    assert not (np.abs(new.points) < 0.5 - 1e-9).all(axis=1).any()


def test_a_round_boundary_is_followed():
    solid, top = round_block()
    new = remesh(solid.points, solid.cells, 0.2, groups={"TOP": top})
    assert np.abs(new.points[new.groups["TOP"]][:, :, 2] - 0.5).max() < 1e-12
    curved = new.points[np.unique(outer(new.cells))]
    curved = curved[(curved[:, 2] > 1e-9) & (curved[:, 2] < 0.5 - 1e-9)]
    assert np.abs(np.hypot(curved[:, 0], curved[:, 1]) - 1).max() < 0.002  # chords of 6 degrees: 1 - cos 3 = 0.0014
    assert geometry.measures(TET, new.points[new.cells]).sum() == pytest.approx(0.5 * np.pi, rel=0.01)


def test_plane_mesh_with_a_contact():
    def plane(nx, x0, x1, y0, y1):
        x, y = np.meshgrid(np.linspace(x0, x1, nx + 1), np.linspace(y0, y1, 3))
        a = (np.arange(2)[:, None] * (nx + 1) + np.arange(nx)).ravel()
        cells = np.vstack([np.stack([a, a + 1, a + nx + 2], 1), np.stack([a, a + nx + 2, a + nx + 1], 1)])
        return np.stack([x.ravel(), y.ravel()], 1), cells

    low, low_cells = plane(4, 0, 2, -1, 0)
    up, up_cells = plane(2, 0.5, 1.5, 0, 1)
    points, cells = np.vstack([low, up]), np.vstack([low_cells, up_cells + len(low)])
    groups = {
        "UP": up_cells + len(low),
        "F2": np.array([[0, 1], [1, 2]]) + len(low),
        "F1": np.array([[13, 12], [12, 11]]),
    }
    new = remesh(points, cells, 0.1, groups=groups, pairs=[("F2", "F1")])
    first, second = new.pairs[0].T
    assert np.array_equal(new.points[first], new.points[second])
    assert len(first) > 8
    assert (new.points[first][:, 1] == 0).all()
    assert geometry.measures(TRI, new.points[new.groups["UP"]]).sum() == pytest.approx(1.0, rel=1e-12)
    assert 0.95 * new.asked <= len(new.cells) <= new.asked
    assert (geometry.facet_normals(shape("SEG2"), new.points[new.groups["F2"]])[:, 1] < 0).all()
    assert (geometry.facet_normals(shape("SEG2"), new.points[new.groups["F1"]])[:, 1] > 0).all()


def test_unit_square_of_two_triangles():
    points = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    new = remesh(points, np.array([[0, 1, 2], [0, 2, 3]]), 0.1, count="free")
    x = new.points[new.cells]
    sides = ((x - np.roll(x, 1, axis=1)) ** 2).sum(axis=(1, 2))
    quality = 4 * np.sqrt(3) * geometry.measures(TRI, x) / sides
    assert quality.min() > 0.64
    assert quality.mean() > 0.90
    assert new.asked != new.asked  # nothing was imposed


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"sizes": 0.0}, "size"),
        ({"pairs": [("FC2", "NONE")]}, "NONE"),
        ({"pairs": [("FC2", "BASE")]}, "same places"),
        ({"pairs": [("FC1", "FC1")]}, "two different solids"),
        ({"groups": {"IN": np.array([[0, 1, 124]])}, "pairs": []}, "group IN"),
    ],
)
def test_impossible_requests_are_refused(change, words):
    points, cells, groups = two_blocks()
    arguments = {"sizes": 0.5, "groups": groups, "pairs": PAIR} | change
    with pytest.raises(BadValue, match=words):
        remesh(points, cells, arguments["sizes"], groups=arguments["groups"], pairs=arguments["pairs"])


def test_an_envelope_is_filled_and_kept():
    points, cells = grid(3, 1.0, 0.0)
    facets = outer(cells)
    for sizes in (None, 0.15, np.full(len(points), 0.2)):
        filled = mesh_volume(points, facets, sizes)
        assert np.array_equal(filled.points[: len(points)], points)
        assert {frozenset(f) for f in outer(filled.cells).tolist()} == {frozenset(f) for f in facets.tolist()}
        assert geometry.measures(TET, filled.points[filled.cells]).sum() == pytest.approx(1.0, rel=1e-12)
        assert geometry.measures(TET, filled.points[filled.cells]).min() > 0


def test_contours_with_a_hole_are_filled_and_kept():
    outside, edges = square(2.0, 10, z=0.3)
    inside, hole = square(0.8, 4, z=0.3)
    points, edges = np.vstack([outside, inside]), np.vstack([edges, hole[:, ::-1] + len(outside)])
    few = mesh_surface(points, edges)
    many = mesh_surface(points, edges, 0.05)
    graded = mesh_surface(points, edges, np.where(np.arange(len(points)) < len(outside), 0.2, 0.05))
    assert len(few.cells) < len(graded.cells) < len(many.cells)
    for filled in (few, many, graded):
        assert np.array_equal(filled.points[: len(points)], points)
        assert geometry.measures(TRI, filled.points[filled.cells]).sum() == pytest.approx(4 - 0.64, rel=1e-12)
        assert (geometry.facet_normals(TRI, filled.points[filled.cells])[:, 2] > 0.99).all()
        made = {frozenset(e) for e in topology.boundary([("TRI3", filled.cells)])["SEG2"].nodes.tolist()}
        assert made == {frozenset(e) for e in edges.tolist()}


def test_the_sense_of_the_contour_is_that_of_the_cells():
    points, edges = square(1.0, 3)
    turning = mesh_surface(points, edges)
    assert (geometry.measures(TRI, turning.points[turning.cells]) > 0).all()
    reversed_ = mesh_surface(points, edges[:, ::-1])
    assert (geometry.measures(TRI, reversed_.points[reversed_.cells]) < 0).all()


def test_quadrangles_on_request():
    points, edges = square(1.0, 4)
    filled = mesh_surface(points, edges, quadrangles=True)
    total = geometry.measures(shape("QUA4"), filled.points[filled.cells]).sum()
    rest = geometry.measures(TRI, filled.points[filled.rest]).sum() if len(filled.rest) else 0.0
    assert total + rest == pytest.approx(1.0, rel=1e-12)
    assert total > 0.8


def test_open_boundaries_are_refused():
    points, cells = grid(2, 1.0, 0.0)
    with pytest.raises(MeshingFailed, match="not closed"):
        mesh_volume(points, outer(cells)[1:])
    contour, edges = square(1.0, 3)
    with pytest.raises(MeshingFailed, match="open contour"):
        mesh_surface(contour, edges[1:])
    bent = np.hstack([contour, contour[:, :1] ** 2])
    with pytest.raises(MeshingFailed, match="plane"):
        mesh_surface(bent, edges)


def test_a_missing_library_is_named(monkeypatch):
    found = missing_library("libGLU.so.1: cannot open shared object file: No such file or directory")
    assert isinstance(found, MissingSystemLibrary)
    assert (found.library, found.debian_package) == ("libGLU.so.1", "libglu1-mesa")
    assert isinstance(missing_library("invalid ELF header"), MissingPackage)

    real = builtins.__import__

    def broken(name, *rest, **more):
        if name == "gmsh":
            raise OSError("libXft.so.2: cannot open shared object file")
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", broken)
    with pytest.raises(MissingSystemLibrary, match="libxft2"):
        load_gmsh()
