"""Lines that meet surfaces and meshes; grids of quadrangles and the inside of blocks."""

import numpy as np
import pytest

from gibiane_ops.kernels.mesh import blocks, rays

RANDOM = np.random.default_rng(5)


def torus_level(p):
    return (np.hypot(p[:, 0], p[:, 1]) - 2.0) ** 2 + p[:, 2] ** 2 - 0.25


def test_the_meeting_with_a_torus_is_the_nearest_one():
    x = RANDOM.uniform(-2.2, 2.2, (200, 3))
    d = RANDOM.normal(size=(200, 3))
    o = np.zeros(3)
    t = rays.to_torus(x, d, o, np.array([0, 0, 3.0]), np.array([2.0, 0, 0]), np.array([2.0, 0, 0.5]))
    hit = np.isfinite(t)
    assert 60 < hit.sum() < 140
    np.testing.assert_allclose(torus_level((x + t[:, None] * d)[hit]), 0, atol=1e-9)
    # No sign change nearer than t, seen by sampling; and no meeting at all where none was found.
    samples = np.linspace(-1, 1, 401)[1:-1] * 0.99
    for i in np.flatnonzero(hit)[:60]:
        level = torus_level(x[i] + samples[:, None] * abs(t[i]) * d[i])
        assert (np.sign(level) == np.sign(level[0])).all()
    for i in np.flatnonzero(~hit):
        level = torus_level(x[i] + np.linspace(-20, 20, 4001)[:, None] * d[i] / np.linalg.norm(d[i]))
        assert (level > 0).all()


def test_a_line_along_the_cone_and_one_that_misses():
    apex, b, on = np.zeros(3), np.array([0, 0, 1.0]), np.array([1.0, 0, 1.0])
    x = np.array([[0.5, 0, 1.0], [3.0, 0, 1.0], [0, 0, 2.0]])
    d = np.array([[1.0, 0, 1.0], [0, 1.0, 0], [1.0, 0, 0]])
    t = rays.to_cone(x, d, apex, b, on)
    # The first direction is a generator: one meeting only, of the line with the other side of the cone.
    np.testing.assert_allclose(t, [-0.75, np.nan, 2.0])


@pytest.mark.parametrize("name", ["QUA4", "TRI6", "QUA8", "TRI3"])
def test_lines_meet_the_nearest_sheet_of_a_mesh(name):
    from gibiane_ops.kernels.elements.table import shape

    flat = shape(name).ref_nodes
    coords = np.concatenate([np.column_stack([flat, np.full(len(flat), z)]) for z in (1.0, -3.0)])
    cells = np.arange(len(coords)).reshape(2, -1)
    x = np.array([[0.2, 0.1, 0.0], [0.2, 0.1, -1.5], [7.0, 0.0, 0.0]])
    t = rays.to_mesh(x, np.repeat([[0.0, 0, 2.0]], 3, axis=0), coords, [(name, cells)])
    np.testing.assert_allclose(t, [0.5, -0.75, np.nan])


def patch(rows, columns):
    ids = RANDOM.permutation((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
    cells = np.stack([ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]], axis=-1).reshape(-1, 4)
    return ids, np.stack([np.roll(c, RANDOM.integers(4)) for c in cells[RANDOM.permutation(len(cells))]])


@pytest.mark.parametrize("size", [(1, 1), (3, 5), (4, 1)])
def test_the_rows_and_columns_of_a_patch_are_found(size):
    ids, cells = patch(*size)
    np.testing.assert_array_equal(blocks.grid(cells, ids[0, 0], ids[0, -1]), ids)
    np.testing.assert_array_equal(blocks.grid(cells, ids[-1, -1], ids[0, -1]), ids[::-1, ::-1].T)
    assert sorted(blocks.corners(cells)) == sorted(ids[[0, 0, -1, -1], [0, -1, 0, -1]])
    assert blocks.grid(cells, ids[0, 0], ids[-1, -1]) is None


def test_the_inside_of_a_block_of_linear_faces_is_linear():
    axes = [np.sort(np.concatenate([[0.0, 1.0], RANDOM.uniform(0.1, 0.9, n)])) for n in (2, 3, 1)]
    w, v, u = np.meshgrid(*axes, indexing="ij")
    matrix = np.array([[2.0, 0.3, 0.1], [0.2, 1.5, -0.4], [0.0, 0.5, 1.0]])
    exact = np.stack([u, v, w], axis=-1) @ matrix.T
    hull = np.full_like(exact, np.nan)
    for axis in range(3):
        for end in (0, -1):
            side = (slice(None),) * axis + (end,)
            hull[side] = exact[side]
    np.testing.assert_allclose(blocks.inside(hull), exact, atol=1e-14)
