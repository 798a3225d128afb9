"""Maps that keep angles, polynomial curves, seams."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import SHAPES
from gibiane_ops.kernels.errors import BadValue, MeshingFailed
from gibiane_ops.kernels.mesh import charts, curves, levels, quality, seams, simplices

Z = np.array([0.0, 0.0, 1.0])
O = np.zeros(3)  # noqa: E741


def turn(n: int, radius: float, z: float, start: float = 0.0, end: float = 2 * np.pi) -> np.ndarray:
    t = start + (end - start) * np.arange(n) / n
    return np.stack([radius * np.cos(t), radius * np.sin(t), np.full(n, z)], axis=1)


PATCH = [(1.0, 0.2), (1.2, 0.2), (1.3, 0.5), (1.1, 0.6)]
SURFACES = {
    "sphere": lambda a, b: np.array([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)]) * 2,
    "cylinder": lambda a, b: np.array([2 * np.cos(a), 2 * np.sin(a), b]),
    "cone": lambda a, b: np.array([b * np.cos(a), b * np.sin(a), 2 * b]),
    "torus": lambda a, b: np.array([(3 + np.cos(b)) * np.cos(a), (3 + np.cos(b)) * np.sin(a), np.sin(b)]),
}
MAKE = {
    "sphere": lambda x: charts.Sphere(O, x),
    "cylinder": lambda x: charts.Cylinder(O, Z, x),
    "cone": lambda x: charts.Cone(O, Z, x),
    "torus": lambda x: charts.Torus(O, Z, np.array([3.0, 0.0, 0.0]), x),
}


@pytest.mark.parametrize("name", SURFACES)
def test_charts_come_back_and_keep_angles(name: str) -> None:
    x = np.array([SURFACES[name](a, b) for a, b in PATCH])
    chart = MAKE[name](x)
    (plane,) = chart.flat([x])
    assert np.allclose(chart.space(plane), x, atol=1e-12)
    assert np.allclose(chart.nearest(x), x, atol=1e-12)
    step = 1e-6
    tangents = [(chart.space(plane + step * e) - chart.space(plane - step * e)) / (2 * step) for e in np.eye(2)]
    lengths = [np.linalg.norm(t, axis=1) for t in tangents]
    assert np.allclose(lengths[0], chart.scale(plane), rtol=1e-7)
    assert np.allclose(lengths[1], chart.scale(plane), rtol=1e-7)
    assert np.allclose((tangents[0] * tangents[1]).sum(axis=1), 0.0, atol=1e-7)


@pytest.mark.parametrize("name", ["cylinder", "cone"])
def test_contours_round_the_axis_become_rings(name: str) -> None:
    loops = [turn(12, 1.0, 2.0), turn(12, 1.0 if name == "cylinder" else 2.0, 4.0)[::-1]]
    chart = MAKE[name](np.concatenate(loops))
    plane = chart.flat(loops)
    for flat, loop in zip(plane, loops, strict=True):
        assert np.ptp(np.hypot(*flat.T)) < 1e-12
        assert np.allclose(chart.space(flat), loop, atol=1e-12)


def test_charts_refuse_what_they_cannot_map() -> None:
    ring = turn(12, 1.0, 0.0)
    with pytest.raises(BadValue):
        charts.Sphere(np.array([0.5, 0.0, 0.0]), ring)
    with pytest.raises(MeshingFailed):
        charts.Cylinder(O, Z, ring).flat([ring])
    long = [ring, turn(12, 1.0, 100.0)[::-1]]
    with pytest.raises(MeshingFailed):
        charts.Cylinder(O, Z, np.concatenate(long)).flat(long)


def test_a_curve_knows_its_length_and_divides_it() -> None:
    """Y = x^2 from -1 to 1, forwards and backwards; the length is sqrt(5) + asinh(2)/2."""
    exact = np.sqrt(5) + np.arcsinh(2) / 2
    c = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    for curve in (curves.Curve(c, -1, 1), curves.Curve(c, 1, -1)):
        assert curve.length == pytest.approx(exact, rel=1e-13)
        fine = curve.by_length(np.linspace(0, 1, 5))
        assert fine[2] == pytest.approx([0, 0, 0], abs=1e-12)
        dense = [curve.by_length(np.linspace(a, a + 0.25, 400)) for a in (0, 0.25, 0.5, 0.75)]
        quarters = [np.linalg.norm(np.diff(x, axis=0), axis=1).sum() for x in dense]
        assert quarters == pytest.approx([exact / 4] * 4, rel=1e-5)


def test_cubics_pass_where_they_must() -> None:
    p = np.random.default_rng(1).standard_normal((4, 3))
    curve = curves.cubic_through(p)
    chords = np.linalg.norm(np.diff(p, axis=0), axis=1)
    u = np.concatenate([[0], np.cumsum(chords) / chords.sum()])
    assert np.allclose(curve.at(u), p, atol=1e-12)
    h = curves.hermite(*p)
    assert np.allclose(h.at(np.array([0.0, 1.0])), p[[0, 3]], atol=1e-12)
    assert np.allclose((h.at(np.array([1e-7])) - p[0]) / 1e-7, p[1], atol=1e-5)
    tip = curves.parabola(p[0], p[1], p[2])
    assert np.allclose(np.cross(tip.at(np.array([1e-7]))[0] - p[0], p[1] - p[0]), 0, atol=1e-11)
    # halfway it is halfway between its tip and the middle of its ends
    assert np.allclose(tip.at(np.array([0.0, 0.5, 1.0])), [p[0], (p[0] + 2 * p[1] + p[2]) / 4, p[2]], atol=1e-12)
    with pytest.raises(BadValue):
        curves.cubic_through(p[[0, 0, 1, 2]])


@pytest.mark.parametrize(("m", "n"), [(2, 2), (2, 7), (5, 9), (1, 4)])
def test_a_seam_fills_the_strip_once(m: int, n: int) -> None:
    a = np.stack([np.linspace(0, 1, m) if m > 1 else np.array([0.5]), np.zeros(m), np.zeros(m)], axis=1)
    b = np.stack([np.linspace(0, 1, n), np.ones(n), np.zeros(n)], axis=1)
    x = np.concatenate([a, b])
    cells = seams.seam(a, b)
    area = np.cross(x[cells[:, 1]] - x[cells[:, 0]], x[cells[:, 2]] - x[cells[:, 0]])[:, 2] / 2
    assert len(cells) == m + n - 2
    assert (area > 0).all()
    assert area.sum() == pytest.approx(1.0 if m > 1 else 0.5)


@pytest.mark.parametrize("name", ["TRI3", "TET4"])
def test_levels_of_a_linear_field_are_plane_and_closed(name: str) -> None:
    """The level of a linear field lies in its plane, looks to higher values, and its ends are on the boundary."""
    dim = SHAPES[name].dim
    rng = np.random.default_rng(4)
    points = np.zeros((40, 3))
    points[:, :dim] = rng.uniform(0, 1, (40, dim))
    cells = np.asarray(Delaunay(points[:, :dim]).simplices, np.int64)
    way = np.array([0.3, 0.5, 0.8 if dim == 3 else 0.0])
    places, made = levels.level(points, cells, points @ way, 0.5 * way.sum())
    assert np.allclose(places @ way, 0.5 * way.sum(), atol=1e-14)
    X = places[made]
    side = X[:, 1] - X[:, 0]
    normal = np.cross(side, X[:, 2] - X[:, 0]) if dim == 3 else np.cross([0, 0, 1.0], side)
    assert (normal @ way > -1e-16).all()
    # inner edges (ends) of the level belong to two of its elements
    ends = np.sort(made[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1) if dim == 3 else made.reshape(-1, 1)
    _, count = np.unique(ends, axis=0, return_counts=True)
    assert set(count.tolist()) <= {1, 2}


@pytest.mark.parametrize("name", quality.PERFECT)
def test_the_worst_corner_of_perfect_and_bad_elements(name: str) -> None:
    ideal = quality.PERFECT[name]
    Q, _ = np.linalg.qr(np.random.default_rng(2).standard_normal((ideal.shape[1],) * 2))
    Q *= np.sign(np.linalg.det(Q)) if ideal.shape[1] == 3 else 1.0
    if np.linalg.det(Q) < 0:
        Q = Q[::-1]
    turned = 7.0 * ideal @ Q.T
    assert quality.corner_ratio(name, turned[None]) == pytest.approx([1.0])
    mirrored = turned * np.array([-1.0, 1.0, 1.0])[: turned.shape[1]]
    assert quality.corner_ratio(name, mirrored[None]) == pytest.approx([0.0])
    stretched = quality.corner_ratio(name, (ideal * ([3.0] + [1.0] * (ideal.shape[1] - 1)))[None])
    assert 0.1 < stretched[0] < 0.9


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_parts_of_simplices_fill_them_and_fit(d: int) -> None:
    rng = np.random.default_rng(d)
    if d == 4:
        grid = np.array([[i, j, k] for k in range(3) for j in range(3) for i in range(3)], float)
        at = [i + 3 * j + 9 * k for k in range(2) for j in range(2) for i in range(2)]
        cells = simplices.tetrahedra(
            "CUB8", np.array([[a, a + 1, a + 4, a + 3, *(a + np.array([9, 10, 13, 12]))] for a in at])
        )[0]
        points = grid + 0.1 * rng.standard_normal(grid.shape)
    else:
        points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
        cells = {1: np.arange(4)[:, None], 2: np.array([[0, 1], [2, 1], [2, 3]]), 3: np.array([[0, 1, 2], [2, 3, 0]])}[
            d
        ]

    def measure(x: FloatArray, c: IntArray) -> FloatArray:
        """Signed for tetrahedra and triangles of the plane z = 0."""
        if d == 1:
            return np.ones(len(c))
        sides = x[c[:, 1:]] - x[c[:, :1]]
        if d == 2:
            return np.linalg.norm(sides[:, 0], axis=1)
        if d == 3:
            return np.cross(sides[:, 0], sides[:, 1])[:, 2] / 2
        return np.linalg.det(sides) / 6

    for _ in range(20):
        # Whole numbers: the value is often that of a node.
        values = rng.integers(0, 4, len(points)).astype(float)
        total = 0.0
        for sign in (1.0, -1.0):
            places, kept = levels.clip(points, cells, sign * values, sign * 1.5)
            x = np.vstack([points, places])
            parts = measure(x, kept)
            assert (parts > 0).all()
            total += parts.sum()
            if d == 4 and len(kept):
                faces = np.sort(kept[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3), axis=1)
                unique, owners = np.unique(faces, axis=0, return_counts=True)
                assert owners.max() <= 2
                once = unique[owners == 1]
                edges = np.sort(once[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
                assert (np.unique(edges, axis=0, return_counts=True)[1] % 2 == 0).all()  # a closed skin
        assert total == pytest.approx(measure(points, cells).sum())
        at_node, kept = levels.clip(points, cells, values, 2.0)
        assert (measure(np.vstack([points, at_node]), kept) > 0).all()


def test_direction_of_parts_of_segments_is_kept() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0]], float)
    for cells in (np.array([[0, 1]]), np.array([[1, 0]])):
        for sign in (1.0, -1.0):
            places, kept = levels.clip(points, cells, sign * points[:, 0], sign * 0.25)
            x = np.vstack([points, places])[kept[0], 0]
            assert np.sign(x[1] - x[0]) == np.sign(cells[0, 1] - cells[0, 0])
