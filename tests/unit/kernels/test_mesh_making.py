"""Kernels that make meshes without a mesher: exact geometry, conforming cuts, orientation, searches."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.elements.table import SHAPES, shape
from gibiane_ops.kernels.errors import BadValue, MeshingFailed
from gibiane_ops.kernels.mesh import (
    arcs,
    chains,
    degenerate,
    distances,
    edges,
    grids,
    locate,
    orientation,
    project,
    quality,
    simplices,
    subdivision,
    sweep,
    transfinite,
    transforms,
    unions,
)

LENGTH = st.floats(0.01, 100.0)
RNG = np.random.default_rng(5)


# ---------------------------------------------------------------- subdivision


@given(LENGTH, LENGTH, LENGTH)
@settings(max_examples=200, deadline=None)
def test_a_line_is_cut_in_a_geometric_progression(length, start, end):
    start, end = min(start, length), min(end, length)
    count = subdivision.count_elements(length, start, end)
    if count > 20_000:
        return
    places = subdivision.abscissas(length, start, end)
    sizes = np.diff(places)
    assert len(sizes) == count
    assert places[0] == 0
    assert places[-1] == 1
    assert (sizes > 0).all()
    if count > 1:
        ratio = math.exp(2 * math.asinh((end - start) / (2 * length)))
        assert sizes[1:] / sizes[:-1] == pytest.approx(np.full(count - 1, ratio), rel=1e-5)


def test_sizes_at_the_ends_are_those_asked_when_they_fit():
    # Ten equal elements of exactly the size asked.
    assert subdivision.abscissas(1.0, 0.1, 0.1) == pytest.approx(np.linspace(0, 1, 11))
    # x = ln 3 / ln r = 5.50 lies nearer to 6 than to 5 in ratio: 5.50 / 5 > 6 / 5.50.
    assert subdivision.count_elements(1.0, 0.1, 0.3) == 6
    sizes = np.diff(subdivision.abscissas(1.0, 0.1, 0.3))
    ratio = math.exp(2 * math.asinh(0.1))
    assert sizes[0] == pytest.approx((1 - ratio) / (1 - ratio**6))


def test_reversed_sizes_give_the_mirror_image():
    there, back = subdivision.abscissas(2.0, 0.1, 0.7), subdivision.abscissas(2.0, 0.7, 0.1)
    assert there == pytest.approx(1 - back[::-1], abs=1e-14)


def test_counts_given():
    assert np.array_equal(subdivision.abscissas(3.0, 0.0, 0.0, 4), [0, 0.25, 0.5, 0.75, 1])
    assert len(subdivision.abscissas(1.0, 0.1, 0.3, -9)) == 10
    with pytest.raises(BadValue, match="density"):
        subdivision.abscissas(1.0, 0.0, 0.1)
    with pytest.raises(BadValue, match="length"):
        subdivision.abscissas(0.0, 0.1, 0.1)


# ---------------------------------------------------------------- lines


def test_walk_follows_chains_whatever_their_order():
    ring = np.stack([np.arange(6), (np.arange(6) + 1) % 6], 1)
    open_line = np.array([[10, 11], [11, 12], [12, 13]])
    mixed = np.concatenate([ring, open_line])
    shuffled = mixed[RNG.permutation(len(mixed))]
    walked = shuffled[chains.walk(shuffled)]
    assert sorted(map(tuple, walked.tolist())) == sorted(map(tuple, mixed.tolist()))
    # The open line first, from its free end, then the ring.
    assert np.array_equal(walked[:3], open_line)
    assert chains.is_chain(walked[3:])
    assert walked[3, 0] == walked[-1, 1]


def test_arc_through_three_points_has_its_centre_at_equal_distances():
    a, b, c = RNG.normal(size=(3, 3))
    arc = arcs.through(a, b, c)
    assert arc is not None
    on = arc(np.linspace(0, 1, 7))
    assert np.linalg.norm(on - arc.centre, axis=1) == pytest.approx(np.full(7, arc.radii[0]))
    assert on[0] == pytest.approx(a)
    assert on[-1] == pytest.approx(c)
    # The middle point is on the arc, not on the rest of the circle.
    fine = arc(np.linspace(0, 1, 20001))
    assert np.linalg.norm(fine - b, axis=1).min() < 1e-3 * arc.radii[0]
    assert arcs.through(a, (a + c) / 2, c) is None


def test_shorter_arc_and_half_circle():
    o, x, y = np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    arc = arcs.about(x, o, y)
    assert arc is not None
    assert arc.length == pytest.approx(math.pi / 2)
    assert arc(np.array([0.5]))[0] == pytest.approx([math.sqrt(0.5), math.sqrt(0.5), 0])
    assert arcs.about(x, o, -x) is None


# ---------------------------------------------------------------- surfaces and volumes


def test_patch_of_straight_sides_is_bilinear_for_equal_spacing():
    corners = np.array([[0, 0, 0], [2, 0, 1], [3, 2, 0], [0, 1, 0]], float)
    t = np.linspace(0, 1, 5)[:, None]
    s = np.linspace(0, 1, 4)[:, None]
    bottom, top = (1 - t) * corners[0] + t * corners[1], (1 - t) * corners[3] + t * corners[2]
    left, right = (1 - s) * corners[0] + s * corners[3], (1 - s) * corners[1] + s * corners[2]
    grid = transfinite.patch(bottom, right, top, left)
    assert grid == pytest.approx((1 - s[:, None]) * bottom + s[:, None] * top)


def test_patch_keeps_the_spacing_of_its_sides():
    u = np.array([0, 0.1, 0.3, 1.0])
    v = np.array([0, 0.7, 1.0])
    zero = np.zeros_like
    grid = transfinite.patch(
        np.stack([u, zero(u)], 1),
        np.stack([zero(v) + 1, v], 1),
        np.stack([u, zero(u) + 1], 1),
        np.stack([zero(v), v], 1),
    )
    assert grid == pytest.approx(np.stack(np.broadcast_arrays(u[None, :], v[:, None]), 2))


def test_swept_elements_have_the_volume_of_the_prism():
    base = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    layers = np.arange(12).reshape(3, 4)
    points = sweep.ruled_layers(base, base + [0.2, 0.1, 2.0], np.array([0, 0.3, 1.0])).reshape(-1, 3)
    for name, cells, area in (("QUA4", [[0, 1, 2, 3]], 1.0), ("TRI3", [[0, 1, 2], [0, 2, 3]], 1.0)):
        solid, nodes = sweep.sweep_cells(name, np.array(cells), layers)
        volume = geometry.measures(shape(solid), points[nodes])
        assert (volume > 0).all()
        assert volume.sum() == pytest.approx(2.0 * area)
    name, nodes = sweep.sweep_cells("SEG2", np.array([[0, 1]]), layers)
    assert name == "QUA4"
    assert nodes.tolist() == [[0, 1, 5, 4], [4, 5, 9, 8]]


@pytest.mark.parametrize("name", ["PYR5", "PRI6", "CUB8"])
def test_cuts_into_tetrahedra_fit_whatever_the_numbering(name):
    """The pieces fill the element, and each quadrangular face is cut as `triangles_of_quadrangles` says."""
    kind = shape(name)
    for _ in range(300):
        numbers = RNG.permutation(kind.n_nodes)
        points = np.zeros_like(kind.ref_nodes)
        points[numbers] = kind.ref_nodes
        pieces, owner = simplices.tetrahedra(name, numbers[None])
        volume = geometry.measures(shape("TET4"), points[pieces])
        assert (volume > 0).all()
        assert volume.sum() == pytest.approx(geometry.measures(kind, kind.ref_nodes[None])[0])
        assert (owner == 0).all()
        faces = topology.boundary([(name, numbers[None])])
        wanted = [simplices.triangles_of_quadrangles(faces["QUA4"].nodes)]
        if "TRI3" in faces:
            wanted.append(faces["TRI3"].nodes)
        got = topology.boundary([("TET4", pieces)])["TRI3"].nodes
        assert {frozenset(f) for f in got.tolist()} == {frozenset(f) for f in np.concatenate(wanted).tolist()}


@pytest.mark.parametrize("name", [n for n in SHAPES if SHAPES[n].dim > 0])
def test_turning_over_changes_the_sign_and_turning_back_restores(name):
    kind = shape(name)
    cells = np.arange(kind.n_nodes)[None]
    over = orientation.reversed_cells(name, cells)
    assert sorted(over[0].tolist()) == cells[0].tolist()
    assert np.array_equal(orientation.reversed_cells(name, over), cells)
    X = kind.ref_nodes[None]
    assert geometry.measures(kind, X[:, over[0]])[0] == pytest.approx(-geometry.measures(kind, X)[0])
    assert np.array_equal(orientation.negative(name, X[:, over[0]]), [0])


def collapse(name, pairs):
    nodes = np.arange(shape(name).n_nodes)
    for a, b in pairs:
        nodes[nodes == b] = a
    return nodes[None]


@pytest.mark.parametrize(
    ("name", "pairs", "lower"),
    [
        ("SEG2", [(0, 1)], "POI1"),
        ("TRI3", [(1, 2)], "SEG2"),
        ("QUA4", [(0, 1)], "TRI3"),
        ("QUA4", [(3, 0)], "TRI3"),
        ("QUA4", [(0, 1), (2, 3)], "SEG2"),
        ("CUB8", [(0, 3), (4, 7)], "PRI6"),
        ("CUB8", [(0, 4), (1, 5)], "PRI6"),
        ("CUB8", [(4, 5), (4, 6), (4, 7)], "PYR5"),
        ("PRI6", [(0, 3)], "PYR5"),
        ("PRI6", [(0, 3), (1, 4)], "TET4"),
        ("PRI6", [(3, 4), (3, 5)], "TET4"),
        ("PYR5", [(0, 1)], "TET4"),
    ],
)
def test_collapsed_elements_become_lower_ones_of_the_same_measure(name, pairs, lower):
    kind = shape(name)
    cells = collapse(name, pairs)
    by_shape, hopeless = degenerate.lowered(name, cells)
    assert len(hopeless) == 0
    assert list(by_shape) == [lower]
    made, rows = by_shape[lower]
    assert rows.tolist() == [0]
    assert len(set(made[0].tolist())) == shape(lower).n_nodes
    if kind.dim == 3:
        points = kind.ref_nodes.copy()
        got = geometry.measures(shape(lower), points[made])[0]
        # The same body, measured by the flux through its faces.
        flux = 0.0
        for face, facets in topology.faces_of([(name, cells)]).items():
            X = points[facets.nodes]
            xi, w = shape(face).mass_gauss
            at = (geometry.positions(shape(face), X, xi) * geometry.normal_densities(shape(face), X, xi)).sum(axis=2)
            flux += float((at @ w).sum()) / 3
        assert got == pytest.approx(flux)
        assert got > 0


def test_impossible_collapse_is_told():
    _, hopeless = degenerate.lowered("CUB8", collapse("CUB8", [(0, 6)]))
    assert hopeless.tolist() == [0]
    by_shape, hopeless = degenerate.lowered("QUA4", np.array([[0, 1, 2, 3], [5, 5, 5, 5], [0, 0, 2, 3]]))
    assert by_shape["QUA4"][1].tolist() == [0]
    assert by_shape["TRI3"][1].tolist() == [2]
    assert by_shape["POI1"][1].tolist() == [1]
    assert len(hopeless) == 0


# ---------------------------------------------------------------- transformations


def test_transformations_keep_what_they_should():
    a, b, c, p = RNG.normal(size=(4, 3))
    points = RNG.normal(size=(20, 3))
    turn = transforms.rotation(37.0, a, b)
    assert turn(np.stack([a, b])) == pytest.approx(np.stack([a, b]))
    assert np.linalg.norm(turn(points) - p, axis=1) == pytest.approx(
        np.linalg.norm(points - transforms.rotation(-37.0, a, b)(p[None]), axis=1)
    )
    for mirror, over in (
        (transforms.symmetry_plane(a, b, c), True),
        (transforms.symmetry_line(a, b), False),
        (transforms.symmetry_point(a), True),
    ):
        assert mirror(mirror(points)) == pytest.approx(points)
        assert mirror.turns_over == over
    assert transforms.symmetry_plane(a, b, c)(np.stack([a, b, c])) == pytest.approx(np.stack([a, b, c]))
    stretched = transforms.affinity(3.0, a, b)(points)
    u = (b - a) / np.linalg.norm(b - a)
    assert (stretched - a) @ u == pytest.approx(3 * ((points - a) @ u))
    with pytest.raises(BadValue):
        transforms.rotation(10.0, a, a)
    with pytest.raises(BadValue):
        transforms.symmetry_plane(a, b, (a + b) / 2)


def test_quarter_turns_are_exact():
    turn = transforms.rotation(90.0, np.zeros(3), np.array([0, 0, 1.0]))
    assert np.array_equal(turn(np.array([[1.0, 0, 0], [0, 2.0, 5.0]])), [[0, 1, 0], [-2, 0, 5]])


def test_projections_land_on_the_surface():
    centre, b, on = np.array([1.0, 2, 3]), np.array([1.0, 2, 5]), np.array([2.0, 3, 4])
    points = RNG.normal(size=(30, 3)) + [4, 4, 4]
    assert distances.to_sphere(project.to_sphere(points, centre, on), centre, on).max() < 1e-13
    assert distances.to_cylinder(project.to_cylinder(points, centre, b, on), centre, b, on).max() < 1e-13
    above = points[points[:, 2] > 3.1]
    assert distances.to_cone(project.to_cone(above, centre, b, on), centre, b, on).max() < 1e-12


def test_distances_of_points_at_known_places():
    o, x, z = np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    points = np.array([[3.0, 0, 4.0], [0, 0, -2.0]])
    assert distances.to_line(points, o, z) == pytest.approx([3, 0])
    assert distances.to_plane(points, o, x, np.array([0, 1.0, 0])) == pytest.approx([4, 2])
    assert distances.to_sphere(points, o, x) == pytest.approx([4, 1])
    assert distances.to_cylinder(points, o, z, x) == pytest.approx([2, 1])
    # Half angle 45 degrees: (3, 4) is at |3 - 4| / sqrt 2; on the axis the distance is the height over sqrt 2.
    assert distances.to_cone(points, o, z, x + z) == pytest.approx([math.sqrt(0.5), math.sqrt(2)])
    # Ring of radius 2, small radius 1: (3, 4) is at sqrt 17 from the ring.
    assert distances.to_torus(points, o, z, 2 * x, x) == pytest.approx([math.sqrt(17) - 1, math.sqrt(8) - 1])


# ---------------------------------------------------------------- searches and unions


def bricks(n):
    axis = np.arange(n + 1.0)
    points = np.array(list(product(axis, axis, axis)))
    i = np.arange((n + 1) ** 3).reshape((n + 1,) * 3)
    corners = [i[:-1, :-1, :-1], i[1:, :-1, :-1], i[1:, 1:, :-1], i[:-1, 1:, :-1]]
    corners += [i[:-1, :-1, 1:], i[1:, :-1, 1:], i[1:, 1:, 1:], i[:-1, 1:, 1:]]
    return points, np.stack([c.ravel() for c in corners], 1)


def test_points_in_distorted_bricks():
    points, cells = bricks(4)
    inner = (points > 0).all(axis=1) & (points < 4).all(axis=1)
    points[inner] += RNG.uniform(-0.2, 0.2, (inner.sum(), 3))
    probe = RNG.uniform(-1, 5, (500, 3))
    expected = ((probe >= 0) & (probe <= 4)).all(axis=1)
    assert np.array_equal(locate.in_mesh(probe, points, [("CUB8", cells)]), expected)
    for x in probe[expected][:50]:
        found = locate.containing("CUB8", points[cells], x)
        assert len(found) == 1
        xi = locate.reference_coordinates("CUB8", points[cells[found]], x[None])
        assert shape("CUB8").N(xi)[0] @ points[cells[found[0]]] == pytest.approx(x, abs=1e-10)
    tets, _ = simplices.tetrahedra("CUB8", cells)
    assert np.array_equal(locate.in_mesh(probe, points, [("TET4", tets)]), expected)


def test_points_in_contours_with_a_hole():
    def square(side):
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * side / 2
        return corners, np.roll(corners, -1, axis=0)

    a, b = (np.concatenate(each) for each in zip(square(4.0), square(2.0), strict=True))
    probe = np.array([[0, 0], [1.5, 0], [3, 0], [0, -1.5], [1.0, 0.3], [2.0, 2.0]])
    inside, on = locate.in_contours(probe, a, b)
    assert (inside & ~on).tolist() == [False, True, False, True, False, False]
    assert on.tolist() == [False, False, False, False, True, True]


def test_elements_in_common_whatever_their_order():
    _, cells = bricks(3)
    shuffled = cells[RNG.permutation(len(cells))][:10]
    shuffled = shuffled[:, RNG.permutation(8)]
    assert unions.is_in(shuffled, cells).all()
    assert unions.is_in(cells, shuffled).sum() == 10
    assert len(unions.not_in(cells, shuffled)) == 17
    assert not unions.is_in(cells, cells + 1000).any()


def test_close_and_facing_pairs():
    points = np.array([[0, 0, 0], [1, 0, 0], [1.05, 0, 0], [0, 0.04, 0]], float)
    assert distances.close_pairs(points, 0.06).tolist() == [[0, 3], [1, 2]]
    assert distances.facing_pairs(points[:2], points[2:], 0.06).tolist() == [[1, 0], [0, 1]]
    with pytest.raises(BadValue):
        distances.close_pairs(points, -1.0)


@pytest.mark.parametrize("kind", ["cloud", "plane", "line", "grid", "sphere", "crowd", "same"])
@pytest.mark.parametrize("tolerance", [0.0, 1e-9, 1e-3, 0.3])
def test_close_pairs_are_those_of_a_tree(kind, tolerance):
    rng = np.random.default_rng(7)
    points = rng.uniform(-3, 5, (900, 3))
    if kind == "plane":
        points[:, 1] = 2.0
    elif kind == "line":
        points[:] = points[:, :1] * [1.0, 2.0, 0.0]
    elif kind == "grid":
        points = np.stack(np.meshgrid(*[np.arange(9.0)] * 3), -1).reshape(-1, 3) / 3
    elif kind == "sphere":
        points /= np.linalg.norm(points, axis=1)[:, None]
    elif kind == "crowd":
        points[100:] = points[0] + 1e-4 * rng.standard_normal((800, 3))
    elif kind == "same":
        points[:] = 1.0
        points = points[:60]
    points = np.concatenate([points, points[::3] + tolerance * rng.uniform(-0.6, 0.6, points[::3].shape)])
    expected = np.sort(cKDTree(points).query_pairs(tolerance, output_type="ndarray"), axis=1)
    expected = expected[np.lexsort((expected[:, 1], expected[:, 0]))]
    np.testing.assert_array_equal(distances.close_pairs(points, tolerance), expected)


def test_contours_and_sharp_edges_of_a_box():
    points, cells = bricks(2)
    skin = topology.boundary([("CUB8", cells)])["QUA4"].nodes
    assert len(edges.contour([("QUA4", skin)], "EXTE")) == 0
    assert len(edges.sharp(points, [("QUA4", skin)], 20.0)) == 12 * 2
    top = skin[(points[skin][:, :, 2] == 2).all(axis=1)]
    border = edges.contour([("QUA4", top)], "EXTE")
    walked = border[chains.walk(border)]
    assert len(walked) == 8
    assert chains.is_chain(walked)
    # Counterclockwise seen from outside: positive area about +z.
    ring = points[walked[:, 0]][:, :2]
    assert np.cross(np.c_[ring, np.zeros(8)], np.c_[np.roll(ring, -1, 0), np.zeros(8)])[
        :, 2
    ].sum() / 2 == pytest.approx(4)
    three = np.array([[0, 1, 4, 3], [0, 1, 10, 9], [0, 1, 5, 6]])
    assert np.sort(edges.contour([("QUA4", three)], "INTE")).tolist() == [[0, 1]]


# ---------------------------------------------------------------- quality


@pytest.mark.parametrize("d", [2, 3])
def test_quality_in_a_metric_is_that_of_the_element_where_lengths_are_measured_so(d):
    triangle = np.array([[0, 0], [1, 0], [0.5, math.sqrt(0.75)]])
    tetrahedron = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]], float) / math.sqrt(2)
    unit = triangle if d == 2 else tetrahedron
    rng = np.random.default_rng(d)
    A = rng.standard_normal((d, d))
    M = np.linalg.inv(A).T @ np.linalg.inv(A)
    assert quality.metric_quality((unit @ A.T)[None], M[None]) == pytest.approx([1])
    # Twice as large or as small: s = 1/2.
    for factor in (4.0, 0.25):
        assert quality.metric_quality((unit @ A.T)[None], factor * M[None]) == pytest.approx([0.75**3])
    some = rng.standard_normal((1, d + 1, d))
    assert 0 < quality.metric_quality(some, np.eye(d)[None])[0] < quality.mean_ratio(some)[0]
    some[..., -1] = 0.0
    # A volume is the root of a determinant of rounding errors, and taken to the power 2/3.
    assert quality.metric_quality(some, np.eye(d)[None]) == pytest.approx([0], abs=2 * np.finfo(float).eps ** (1 / 3))


def test_quality_of_equilateral_right_and_flat_elements():
    triangle = np.array([[0, 0], [1, 0], [0.5, math.sqrt(0.75)]])
    tetrahedron = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]], float)
    for regular in (triangle, tetrahedron):
        X = 3.0 * regular[None]
        assert quality.mean_ratio(X) == pytest.approx([1])
        assert quality.aspect(X) == pytest.approx([1])
        assert quality.skewness(X) == pytest.approx([0], abs=1e-12)
        flat = X.copy()
        flat[:, -1] = flat[:, :-1].mean(axis=1)
        assert quality.mean_ratio(flat) == pytest.approx([0], abs=1e-6)
        assert quality.skewness(flat) == pytest.approx([1], abs=1e-6)
    # Right isosceles triangle of legs 1: area 1/2, squares 1 + 1 + 2, height 1/sqrt 2, radius 1/sqrt 2.
    right = np.array([[[0, 0], [1, 0], [0, 1]]], float)
    assert quality.mean_ratio(right) == pytest.approx([math.sqrt(3) / 2])
    assert quality.aspect(right) == pytest.approx([math.sqrt(3)])
    assert quality.skewness(right) == pytest.approx([1 - 0.5 / (3 * math.sqrt(3) / 8)])
    # Corner of a cube: volume 1/6, squares 3 + 6, largest face sqrt 3 / 2, radius sqrt 3 / 2.
    corner = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]], float)
    assert quality.mean_ratio(corner) == pytest.approx([12 * 0.5 ** (2 / 3) / 9])
    assert quality.aspect(corner) == pytest.approx([math.sqrt(2 / 3) * math.sqrt(2) * math.sqrt(3)])
    assert quality.skewness(corner) == pytest.approx([1 - (1 / 6) / (8 * math.sqrt(3) / 27 * (math.sqrt(3) / 2) ** 3)])


# ---------------------------------------------------------------- layers between grids


@pytest.mark.parametrize(("n", "m"), [(1, 1), (1, 3), (3, 1), (2, 4), (4, 2), (3, 5), (2, 10), (7, 3), (5, 15), (1, 9)])
def test_quadrangles_between_sides_of_different_numbers_fill_the_square_and_fit(n, m):
    x, cells = grids.transition(n, m)
    assert x[: n + 1] == pytest.approx(np.stack([np.linspace(0, 1, n + 1), np.zeros(n + 1)], axis=1))
    assert x[n + 1 : n + m + 2] == pytest.approx(np.stack([np.linspace(0, 1, m + 1), np.ones(m + 1)], axis=1))
    sides = np.roll(x[cells], -1, axis=1) - x[cells]
    before = np.roll(sides, 1, axis=1)
    corners = before[..., 0] * sides[..., 1] - before[..., 1] * sides[..., 0]
    assert (corners > 0).all()  # convex
    one, two = x[cells[:, 2]] - x[cells[:, 0]], x[cells[:, 3]] - x[cells[:, 1]]
    assert (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum() / 2 == pytest.approx(1)
    edges = np.sort(np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() <= 2
    assert (count == 1).sum() == n + m + 2


def test_an_odd_number_of_sides_has_no_quadrangles():
    with pytest.raises(BadValue, match="even"):
        grids.transition(2, 3)


@pytest.mark.parametrize("corner", [(0, 0), (0, 4), (3, 0), (3, 4)])
def test_a_grid_is_found_from_any_corner_whatever_the_order_of_its_quadrangles(corner):
    ids = np.random.default_rng(1).permutation(20).reshape(4, 5)
    cells = np.stack([ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]], axis=2).reshape(-1, 4)
    rng = np.random.default_rng(2)
    cells = np.array([np.roll(c, rng.integers(4)) for c in rng.permutation(cells)])
    found = grids.grid_of(cells, int(ids[corner]))
    ways = [np.rot90(ids, k) for k in range(4)]
    assert any(found.shape == way.shape and (found == way).all() for way in ways)
    assert found[0, 0] == ids[corner]
    with pytest.raises(MeshingFailed, match="no corner"):
        grids.grid_of(cells, int(ids[1, 1]))
    for damaged in (cells[1:], np.vstack([cells, cells[:1] + 20])):
        with pytest.raises(MeshingFailed):
            grids.grid_of(damaged, int(ids[corner]))


def test_interpolation_between_nodes_of_a_grid():
    y, x = np.meshgrid([0.0, 1.0, 3.0], [0.0, 2.0, 3.0, 7.0], indexing="ij")
    points = np.stack([x, y, x * 0], axis=2)
    found = grids.interpolated(points, np.array([0.0, 0.5, 1.0, 1 / 3]), np.array([0.0, 0.5, 1.0, 0.75]))
    assert found == pytest.approx(np.array([[0, 0, 0], [2.5, 1, 0], [7, 3, 0], [2, 2, 0]]))
