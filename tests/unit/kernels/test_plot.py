import os
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from gibiane_ops.kernels.errors import BadValue, MissingPackage
from gibiane_ops.kernels.plot import (
    Arrows,
    Curve,
    Dots,
    Labels,
    Lines,
    Scale,
    Surface,
    amplification,
    beyond,
    draw_curves,
    draw_scene,
    lifts,
    outline,
    vtk_image,
    window,
)
from gibiane_ops.kernels.plot.camera import DEFAULT_VIEW, fit, look_from
from gibiane_ops.kernels.plot.image import render
from gibiane_ops.kernels.plot.layers import edges_of, facet_normals, sharp_sides
from gibiane_ops.kernels.plot.raster import rasterize, visible_runs
from gibiane_ops.kernels.plot.scales import UNDEFINED, bands_for, bar_labels, short

SMALL = (600, 450)
NEEDS_VTK = pytest.mark.skipif(
    vtk_image.obstacle() is not None, reason=f"VTK CANNOT DRAW HERE: NO {vtk_image.obstacle()}"
)
RED, GREEN, BLUE = "#ff0000", "#00ff00", "#0000ff"

CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)
CUBE_FACES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def grid(n):
    """Make a square of n x n quadrangles."""
    ticks = np.linspace(0.0, 1.0, n + 1)
    points = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    ids = np.arange(len(points)).reshape(n + 1, n + 1)
    return points, np.stack([ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]], axis=-1).reshape(-1, 4)


def picture(path):
    """Read red, green, blue from 0 to 1."""
    return matplotlib.image.imread(path)[..., :3]


def share(image, channel):
    """Measure the part of a picture in which one of red, green, blue is far above the others."""
    others = np.delete(image, channel, axis=2).max(axis=2)
    return float((image[..., channel] - others > 0.3).mean())


# ---------------------------------------------------------------- camera


def test_camera_axes_are_orthonormal_and_direct():
    axes = look_from(DEFAULT_VIEW).axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_default_view_shows_front_right_and_top():
    normals = facet_normals(CUBE, [CUBE_FACES]) @ look_from(DEFAULT_VIEW).axes.T
    seen = {
        tuple(facet_normals(CUBE, [CUBE_FACES])[k].round().astype(int)) for k in np.flatnonzero(normals[:, 2] > 0.1)
    }
    assert seen == {(0, -1, 0), (1, 0, 0), (0, 0, 1)}


def test_vertical_stays_vertical_and_from_above_y_is_upwards():
    assert look_from(DEFAULT_VIEW).project(np.array([[0.0, 0.0, 1.0]]))[0, 0] == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(look_from((0, 0, 5.0)).project(np.array([[2.0, 3.0]])), [[2.0, 3.0, 0.0]], atol=1e-15)


def test_fit_keeps_proportions_and_holds_all():
    points = np.array([[0.0, 0.0], [10.0, 1.0]])
    frame = fit(points, 400, 300)
    pixels = frame.pixels(points)
    assert (pixels > 0).all()
    assert (pixels < [400, 300]).all()
    np.testing.assert_allclose(np.diff(pixels, axis=0) * frame.pixel, [[10.0, 1.0]])
    np.testing.assert_allclose(pixels.mean(axis=0), [200, 150])


# ---------------------------------------------------------------- depth buffer


def test_rasterize_covers_the_area_of_a_triangle():
    xy = np.array([[[10.0, 10.0], [90.0, 20.0], [30.0, 70.0]]])
    hits = rasterize(xy, np.zeros((1, 3)), 100, 80)
    edge, other = xy[0, 1] - xy[0, 0], xy[0, 2] - xy[0, 0]
    area = 0.5 * abs(edge[0] * other[1] - edge[1] * other[0])
    assert (hits.triangle == 0).sum() == pytest.approx(area, rel=0.02)


def test_rasterize_leaves_no_hole_between_neighbours_whatever_their_turn():
    rng = np.random.default_rng(1)
    points, quads = grid(9)
    inner = (points > 0.01).all(axis=1) & (points < 0.99).all(axis=1)
    points[inner] += rng.uniform(-0.03, 0.03, (inner.sum(), 2))
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 3, 2]]])
    hits = rasterize(points[triangles] * 97.3 + 1.2, np.zeros((len(triangles), 3)), 100, 100)
    assert (hits.triangle[2:98, 2:98] >= 0).all()


def test_rasterize_resolves_triangles_that_cross_pixel_by_pixel():
    square = np.array([[0.0, 0.0], [200.0, 0.0], [0.0, 200.0]])
    # one rises to the right, the other falls: they cross at x = 50
    depth = np.array([[0.0, 200.0, 0.0], [100.0, -100.0, 100.0]])
    hits = rasterize(np.array([square, square]), depth, 100, 100)
    assert (hits.triangle[:, :50] == 1).all()
    assert (hits.triangle[:, 50:] == 0).all()
    np.testing.assert_allclose(hits.depth[10, [10, 90]], [100.0 - 10.5, 90.5])


def test_rasterize_ignores_triangles_seen_edge_on_and_those_outside():
    xy = np.array([[[5.0, 5.0], [15.0, 15.0], [10.0, 10.0]], [[-50.0, -50.0], [-40.0, -50.0], [-45.0, -40.0]]])
    assert (rasterize(xy, np.zeros((2, 3)), 20, 20).triangle == -1).all()


def test_visible_runs_cut_what_a_surface_hides():
    depth = np.full((100, 100), -np.inf)
    depth[:, 40:60] = 5.0
    start, end = np.array([[0.0, 50.0, 0.0]]), np.array([[100.0, 50.0, 0.0]])
    first, last = visible_runs(start, end, depth, slack=0.1)
    np.testing.assert_allclose(first[:, 0], [0.0, 60.0], atol=2.0)
    np.testing.assert_allclose(last[:, 0], [40.0, 100.0], atol=2.0)
    first, last = visible_runs(start + [0, 0, 9], end + [0, 0, 9], depth, slack=0.1)
    np.testing.assert_allclose([first[0, 0], last[0, 0], len(first)], [0.0, 100.0, 1])


# ---------------------------------------------------------------- geometry of surfaces


def test_sides_of_a_facet_follow_one_another():
    sides, owner = edges_of([np.array([[0, 1, 2]]), np.array([[2, 1, 3, 4]])])
    np.testing.assert_array_equal(sides, [[0, 1], [1, 2], [2, 0], [2, 1], [1, 3], [3, 4], [4, 2]])
    np.testing.assert_array_equal(owner, [0, 0, 0, 1, 1, 1, 1])


def test_outline_of_a_cube_has_twelve_edges_and_of_a_square_its_rim():
    assert len(outline(CUBE, [CUBE_FACES])) == 12
    points, quads = grid(5)
    assert len(outline(points, [quads])) == 20


def test_outline_does_not_depend_on_the_turn_of_facets():
    points, quads = grid(4)
    quads[::2] = quads[::2, ::-1]
    assert len(outline(points, [quads])) == 16


def test_a_slight_bend_is_no_outline_and_a_sharp_one_is():
    facets = [np.array([[0, 1, 2], [1, 0, 3]])]

    def folded(angle):
        return np.array([[0, 0, 0], [0, 1, 0], [-1, 0, 0], [np.cos(angle), 0, np.sin(angle)]])

    assert sharp_sides(folded(np.radians(20)), facets).sum() == 4
    assert sharp_sides(folded(np.radians(40)), facets).sum() == 6


def test_amplification_is_round_and_gives_a_visible_displacement():
    factor = amplification(CUBE, 3.1e-5 * CUBE)
    assert factor == 2000.0
    assert 0.03 < factor * 3.1e-5 <= 0.08
    assert amplification(CUBE, 0.0 * CUBE) == 1.0


def test_lifts_move_parts_along_the_line_of_their_centres():
    up = lifts([CUBE, CUBE + [0, 0, 1.0]], 0.5)
    np.testing.assert_allclose(up, [[0, 0, 0], [0, 0, 0.5]])


def test_beyond_selects_by_the_centre():
    points, quads = grid(4)
    chosen = beyond(points, quads, np.array([0.5, 0.0]), np.array([1.0, 0.0]))
    np.testing.assert_array_equal(chosen, points[quads].mean(axis=1)[:, 0] > 0.5)


# ---------------------------------------------------------------- scales


def test_bands_have_round_limits_that_hold_the_values():
    bands = bands_for(Scale(bands=10), np.array([0.13, 9.7]))
    np.testing.assert_allclose(bands.limits, np.arange(11.0))
    assert (bands.low, bands.high) == (0.13, 9.7)


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-3.7e-9, 2.1e-8), (1e6, 1.001e6), (-5.0, -4.0)])
@pytest.mark.parametrize("count", [3, 8, 12])
def test_bands_are_at_most_as_many_as_asked_and_hold_the_range(low, high, count):
    limits = bands_for(Scale(bands=count), np.array([low, high])).limits
    assert 1 <= len(limits) - 1 <= count
    slack = 1e-6 * (high - low)
    assert limits[0] <= low + slack
    assert limits[-1] >= high - slack


def test_a_constant_field_has_one_band_around_it():
    bands = bands_for(Scale(), np.full(5, 3.0) * (1 + 1e-14 * np.arange(5)))
    assert len(bands.colors) == 1
    assert bands.limits[0] < 3.0 < bands.limits[1]


def test_logarithmic_bands_have_equal_ratios_and_skip_zero():
    limits = bands_for(Scale(log=True, bands=8), np.array([0.0, 1e-3, 10.0])).limits
    np.testing.assert_allclose(limits[1:] / limits[:-1], limits[1] / limits[0])
    assert limits[0] <= 1.001e-3
    assert limits[-1] >= 9.99


def test_colours_follow_the_limits_and_the_ends_take_what_lies_beyond():
    bands = bands_for(Scale(limits=np.array([0.0, 1.0, 2.0, 3.0])), np.array([0.0, 3.0]))
    painted = bands.paint(np.array([-9.0, 0.5, 1.0, 1.99, 99.0, np.nan]))
    np.testing.assert_array_equal(painted[:5], bands.colors[[0, 0, 1, 1, 2]])
    np.testing.assert_array_equal(painted[5], UNDEFINED)


@pytest.mark.parametrize(
    ("scale", "values"),
    [
        (Scale(), [np.nan, np.nan]),
        (Scale(log=True), [-1.0, 0.0]),
        (Scale(log=True, low=0.0), [1.0, 2.0]),
        (Scale(limits=np.array([1.0, 1.0])), [1.0, 2.0]),
    ],
)
def test_scales_without_meaning_are_refused(scale, values):
    with pytest.raises(BadValue):
        bands_for(scale, np.array(values))


def test_numbers_are_written_briefly():
    assert [short(x, 3) for x in (0.0, 0.25, 1430.0, 123456.0, 3e-7, -0.5)] == [
        "0",
        "0.25",
        "1430",
        "1.23e5",
        "3e-7",
        "-0.5",
    ]
    assert bar_labels(np.arange(0.0, 220.1, 20.0))[4:7] == ["80", "100", "120"]
    assert bar_labels(np.arange(0.0, 1.1e5, 1e4))[-2:] == ["9e4", "1e5"]
    assert bar_labels(np.array([1000.25, 1000.5])) == ["1000.2", "1000.5"]


# ---------------------------------------------------------------- whole pictures


def test_a_plane_mesh_is_centred_and_has_its_proportions(tmp_path):
    path = tmp_path / "sub" / "mesh.png"
    draw_scene(path, [Surface(SQUARE * [2.0, 1.0], [np.array([[0, 1, 2, 3]])], color=RED)], size=SMALL)
    image = picture(path)
    assert image.shape == (450, 600, 3)
    rows, columns = np.nonzero((image[..., 0] > 0.8) & (image[..., 1] < 0.2))
    assert (np.ptp(columns) + 1) / (np.ptp(rows) + 1) == pytest.approx(2.0, rel=0.02)


def test_a_flat_mesh_seen_from_above_is_drawn_as_in_the_plane(tmp_path):
    cells = [np.array([[0, 1, 2, 3]])]
    raised = np.column_stack([SQUARE, np.full(len(SQUARE), 7.0)])
    draw_scene(tmp_path / "plane.png", [Surface(SQUARE, cells, color=RED)], size=SMALL)
    draw_scene(tmp_path / "above.png", [Surface(raised, cells, color=RED)], view=(1.0, -2.0, 1e6), size=SMALL)
    draw_scene(tmp_path / "aside.png", [Surface(raised, cells, color=RED)], view=(1.0, -2.0, 3.0), size=SMALL)
    plane, above, aside = (picture(tmp_path / f"{name}.png") for name in ("plane", "above", "aside"))
    np.testing.assert_array_equal(above, plane)
    assert (aside != plane).any()


def test_what_lies_behind_is_hidden(tmp_path):
    # the blue square is wholly behind the cube, drawn last
    behind = np.array([[0.3, 3.0, 0.1], [0.7, 3.0, 0.1], [0.7, 3.0, 0.4], [0.3, 3.0, 0.4]])
    square = np.array([[0, 1, 2, 3]])
    front = (0.0, -1.0, 0.0)
    draw_scene(
        tmp_path / "a.png",
        [Surface(CUBE, [CUBE_FACES], color=RED), Surface(behind, [square], color=BLUE)],
        view=front,
        size=SMALL,
    )
    draw_scene(
        tmp_path / "b.png",
        [Surface(CUBE, [CUBE_FACES], color=RED), Surface(behind - [0, 9, 0], [square], color=BLUE)],
        view=front,
        size=SMALL,
    )
    assert share(picture(tmp_path / "a.png")[:, 150:], 2) == 0.0
    assert share(picture(tmp_path / "b.png")[:, 150:], 2) > 0.02


def test_a_transparent_solid_shows_what_is_inside(tmp_path):
    inside = Surface(0.3 * CUBE + 0.35, [CUBE_FACES], color=BLUE)
    for alpha in (1.0, 0.3):
        draw_scene(
            tmp_path / f"{alpha}.png", [Surface(CUBE, [CUBE_FACES], color="#ffffff", alpha=alpha), inside], size=SMALL
        )
    assert share(picture(tmp_path / "1.0.png")[:330, 150:450], 2) == 0.0
    assert share(picture(tmp_path / "0.3.png")[:330, 150:450], 2) > 0.005


def test_nodal_bands_follow_the_field(tmp_path):
    points, quads = grid(6)
    scale = Scale(limits=np.array([0.0, 0.5, 1.0]), colormap="bwr")
    draw_scene(tmp_path / "f.png", [Surface(points, [quads], nodal=points[:, 0], edges=False)], scale=scale, size=SMALL)
    image = picture(tmp_path / "f.png")[48:420, :485]
    blue = np.nonzero(image[..., 2] - image[..., 0] > 0.3)[1]
    red = np.nonzero(image[..., 0] - image[..., 2] > 0.3)[1]
    assert len(blue) == pytest.approx(len(red), rel=0.03)
    assert blue.max() <= red.min() + 1


def test_flat_values_colour_whole_facets_and_undefined_ones_grey(tmp_path):
    points, quads = grid(2)
    values = np.array([0.0, 1.0, np.nan, 1.0])
    scale = Scale(limits=np.array([0.0, 0.5, 1.0]), colormap="bwr")
    draw_scene(tmp_path / "f.png", [Surface(points, [quads], flat=values, edges=False)], scale=scale, size=SMALL)
    image = picture(tmp_path / "f.png")[48:420, :485]
    blue = (image[..., 2] - image[..., 0] > 0.3).sum()
    red = (image[..., 0] - image[..., 2] > 0.3).sum()
    grey = (np.abs(image - np.array(UNDEFINED) * 1.0).max(axis=2) < 0.06).sum()
    assert red == pytest.approx(2 * blue, rel=0.03)
    assert grey == pytest.approx(blue, rel=0.1)


def test_lines_stop_at_surfaces_unless_on_top(tmp_path):
    line = np.array([[0.5, 2.0, -1.0], [0.5, 2.0, 2.0]])
    cube = Surface(CUBE, [CUBE_FACES], color="#ffffff", edges=False)
    counts = []
    for on_top in (False, True):
        layer = Lines(line, np.array([[0, 1]]), color=GREEN, width=3.0, on_top=on_top)
        draw_scene(tmp_path / "l.png", [cube, layer], view=(0, -1, 0), size=SMALL)
        counts.append(share(picture(tmp_path / "l.png")[:, 150:], 1))
    assert counts[0] == pytest.approx(counts[1] * 2 / 3, rel=0.1)


def test_arrows_dots_and_offsets_are_drawn(tmp_path):
    layers = [
        Surface(CUBE, [CUBE_FACES], label="lower"),
        Surface(CUBE, [CUBE_FACES], offset=np.array([0.0, 0.0, 2.0]), label="upper"),
        Arrows(CUBE[4:], np.tile([0.0, 0.0, 3.0], (4, 1)), color=RED, label="forces"),
        Dots(CUBE[:4] + [0, 0, 1.5], color=GREEN, size=8, label="points"),
    ]
    draw_scene(tmp_path / "a.png", layers, title="All", caption="of them", size=SMALL)
    image = picture(tmp_path / "a.png")[50:360, 150:450]
    assert share(image, 0) > 1e-3
    assert share(image, 1) > 1e-3
    # between the two cubes the sheet is white
    assert (image.min(axis=2) > 0.99).all(axis=1).any() or (image[100:200].min(axis=2) > 0.99).mean() > 0.5


@pytest.mark.parametrize("by_vtk", [False, pytest.param(True, marks=NEEDS_VTK)])
def test_what_a_solid_hides_is_not_written_nor_drawn_over_it(tmp_path, by_vtk):
    cube = Surface(CUBE, [CUBE_FACES], color="#ffffff")
    hidden = [
        Labels(np.array([[0.5, 0.9, 0.2]]), ["88"], size=20, color=RED),
        Arrows(np.array([[0.5, 0.5, 0.4]]), np.array([[0.0, 0.0, 1.0]]), color=RED, longest=0.1),
    ]
    shown = [Labels(np.array([[0.5, 0.0, 0.5]]), ["88"], size=20, color=GREEN)]
    draw_scene(tmp_path / "l.png", [cube, *hidden, *shown], size=SMALL, by_vtk=by_vtk)
    image = picture(tmp_path / "l.png")[50:360, 150:450]
    assert share(image, 0) == 0.0
    assert share(image, 1) > 1e-4


# ---------------------------------------------------------------- VTK


@NEEDS_VTK
def test_vtk_draws_what_the_depth_buffer_of_ours_draws():
    """Two renderers that share no line: the same pixels are covered, at the same depth, in the same colours."""
    points, quads = grid(12)
    bent = np.column_stack([points, 0.3 * np.sin(5 * points[:, 0]) * np.cos(4 * points[:, 1])])
    undefined = np.where(points[:, 0] > 0.9, np.nan, bent[:, 2])
    camera = look_from(DEFAULT_VIEW)
    frame = fit(camera.project(np.concatenate([bent, CUBE])), 320, 240)
    limits = bands_for(Scale(limits=np.array([-0.3, -0.1, 0.05, 0.2, 1.0])), np.array([-0.3, 1.0]))
    for surfaces in (
        [Surface(CUBE, [CUBE_FACES], nodal=CUBE[:, 2], edges=False)],
        [
            Surface(bent, [quads], nodal=bent[:, 2], edges=False),
            Surface(0.4 * CUBE, [CUBE_FACES], color=RED, edges=False),
        ],
        [Surface(bent, [quads], nodal=undefined, edges=False)],
        [Surface(CUBE, [CUBE_FACES], flat=np.array([0.0, 1.0, 0.1, np.nan, 0.0, 0.0]), edges=False)],
        [Surface(bent, [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]], edges=False)],
    ):
        (ours, our_depth), (theirs, their_depth) = (
            draw(surfaces, camera, frame, limits) for draw in (render, vtk_image.render)
        )
        covered = np.isfinite(our_depth)
        assert (covered == np.isfinite(their_depth)).mean() > 0.998
        both = covered & np.isfinite(their_depth)
        assert np.quantile(np.abs(our_depth[both] - their_depth[both]), 0.99) < 1e-4
        inside = (ours[..., 3] == 1.0) & (theirs[..., 3] == 1.0)
        gap = np.abs(ours[..., :3] - theirs[..., :3])[inside]
        # the outlines are smoothed in two ways; ours lights a bent facet as a whole
        assert np.median(gap) < 0.003
        assert np.quantile(gap, 0.9) < 0.03


@NEEDS_VTK
def test_vtk_leaves_no_word_on_the_descriptors_of_the_process(tmp_path, capfd):
    draw_scene(tmp_path / "v.png", [Surface(CUBE, [CUBE_FACES], alpha=0.5), Dots(CUBE)], size=SMALL, by_vtk=True)
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb: windows are not tested")
@NEEDS_VTK
def test_windows_open_on_a_screen_and_close(tmp_path):
    script = (
        "import sys, numpy as np; from pathlib import Path\n"
        "from gibiane_ops.kernels.plot import Arrows, Dots, Labels, Lines, Surface, draw_curves, Curve, window\n"
        "assert window.screen_exists()\n"
        "C = np.array([[0., 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]); F = [np.array([[0, 1, 2, 3]])]\n"
        "parts = [Surface(C, F, nodal=C[:, 0]), Arrows(C, C + 1), Dots(C), Labels(C, list('abcd'))]\n"
        "window.show_scene([*parts, Lines(C, np.array([[0, 2]]))], title='t', seconds=0.1)\n"
        "draw_curves('c.png', [Curve(C[:2, 0], C[:2, 0])])\n"
        "window.show_picture(Path('c.png'), seconds=0.1)\n"
        "print('shown')"
    )
    with subprocess.Popen(["Xvfb", "-displayfd", "1", "-screen", "0", "1400x1000x24"], stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL, text=True) as screen:  # fmt: skip
        try:
            environment = os.environ | {"DISPLAY": f":{screen.stdout.readline().strip()}"}
            environment["PYTHONPATH"] = os.pathsep.join(p for p in sys.path if p)
            done = subprocess.run(
                [sys.executable, "-c", script],
                env=environment,
                cwd=tmp_path,
                capture_output=True,
                text=True,
                timeout=60,
            )
        finally:
            screen.terminate()
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "shown", "")


def test_no_window_without_a_screen_that_answers(monkeypatch):
    if sys.platform != "linux":
        pytest.skip("other systems always have a screen")
    for display in ("", ":6543"):
        monkeypatch.setenv("DISPLAY", display)
        assert not window.screen_exists()


def test_zero_vectors_and_a_single_point_still_make_a_picture(tmp_path):
    draw_scene(tmp_path / "z.png", [Arrows(CUBE, 0 * CUBE, label="forces"), Dots(CUBE[:1])], size=SMALL)
    draw_scene(tmp_path / "p.png", [Dots(CUBE[:1], color=RED, size=12)], size=SMALL)
    assert share(picture(tmp_path / "p.png")[:330], 0) > 1e-4


def test_the_same_picture_gives_the_same_bytes(tmp_path):
    for name in ("a.svg", "b.svg", "a.png", "b.png", "a.pdf", "b.pdf"):
        draw_scene(tmp_path / name, [Surface(CUBE, [CUBE_FACES], nodal=CUBE[:, 2])], title="t", size=SMALL)
    for kind in ("svg", "png", "pdf"):
        content = [(tmp_path / f"{name}.{kind}").read_bytes() for name in "ab"]
        assert content[0] == content[1]
    assert (tmp_path / "a.svg").read_text().startswith("<?xml")
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("name", "layers", "options"),
    [
        ("a.bmp", [Dots(CUBE)], {}),
        ("a.png", [], {}),
        ("a.png", [Surface(CUBE, [np.zeros((0, 3), int)])], {}),
        ("a.png", [Dots(np.array([[0.0, np.nan, 0.0]]))], {}),
        ("a.png", [Dots(CUBE)], {"view": (0.0, 0.0, 0.0)}),
    ],
)
def test_pictures_that_cannot_be_are_refused_and_leave_no_file(tmp_path, name, layers, options):
    with pytest.raises(BadValue):
        draw_scene(tmp_path / name, layers, **options)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_matplotlib_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingPackage) as caught:
        draw_scene(tmp_path / "a.png", [Dots(CUBE)])
    assert caught.value.install == 'pip install "gibiane[viz]"'
    with pytest.raises(MissingPackage):
        draw_curves(tmp_path / "a.png", [Curve(np.arange(3.0), np.arange(3.0))])


# ---------------------------------------------------------------- curves


def test_curves_are_drawn_in_their_colours_within_bounds(tmp_path):
    x = np.linspace(0.0, 1.0, 50)
    curves = [
        Curve(x, x, "up", color=RED),
        Curve(x, 1 - x, "down", color=BLUE, style="--"),
        Curve(x, 5 + x, color=GREEN),
    ]
    draw_curves(tmp_path / "c.png", curves, title="t", x_title="x", y_title="y", y_bounds=(0.0, 1.0), size=SMALL)
    image = picture(tmp_path / "c.png")
    assert share(image, 0) > 2e-3
    assert share(image, 2) > 1e-3
    assert share(image, 1) == 0.0


def test_logarithmic_axes_turn_a_power_into_a_straight_line(tmp_path):
    x = np.geomspace(1.0, 100.0, 200)
    draw_curves(tmp_path / "c.png", [Curve(x, x**-2, color=RED)], x_log=True, y_log=True, grid=False, size=SMALL)
    rows, columns = np.nonzero(picture(tmp_path / "c.png")[..., 0] - picture(tmp_path / "c.png")[..., 1] > 0.5)
    line = np.polyfit(columns, rows, 1)
    assert np.abs(np.polyval(line, columns) - rows).max() < 4


@pytest.mark.parametrize(
    ("curves", "options"),
    [
        ([], {}),
        ([Curve(np.zeros(0), np.zeros(0))], {}),
        ([Curve(np.arange(3.0), np.arange(2.0))], {}),
        ([Curve(np.arange(3.0), np.arange(3.0))], {"x_log": True}),
        ([Curve(np.arange(1.0, 3.0), np.arange(1.0, 3.0))], {"y_log": True, "y_bounds": (0.0, 1.0)}),
    ],
)
def test_curves_that_cannot_be_are_refused(tmp_path, curves, options):
    with pytest.raises(BadValue):
        draw_curves(tmp_path / "c.png", curves, **options)
    assert list(Path(tmp_path).iterdir()) == []
