"""Tetrahedra to mesh again: two cubes in contact, a slice of a cylinder."""

import numpy as np

from gibiane_ops.kernels import topology
from gibiane_ops.kernels.remesh import mesh_surface, mesh_volume


def grid(n, size, z0, height=None):
    """n^3 bricks of a box standing on z0, each cut in six tetrahedra."""
    axis = np.linspace(-size / 2, size / 2, n + 1)
    tall = z0 + np.linspace(0, size if height is None else height, n + 1)
    z, y, x = np.meshgrid(tall, axis, axis, indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], 1)
    k, j, i = np.meshgrid(np.arange(n), np.arange(n), np.arange(n), indexing="ij")
    s = n + 1
    a = ((k * s + j) * s + i).ravel()
    hexes = np.stack([a, a + 1, a + 1 + s, a + s, a + s * s, a + 1 + s * s, a + 1 + s + s * s, a + s + s * s], 1)
    paths = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
    return points, np.vstack([hexes[:, list(path)] for path in paths])


def outer(cells):
    return topology.boundary([("TET4", cells)])["TRI3"].nodes


def on_plane(points, facets, z):
    return facets[np.abs(points[facets][:, :, 2] - z).max(axis=1) < 1e-9]


def two_blocks():
    """A cube of side 1 on a cube of side 2, with matching nodes on the contact face z = 0, not merged."""
    low, low_cells = grid(4, 2.0, -2.0)
    up, up_cells = grid(2, 1.0, 0.0)
    points = np.vstack([low, up])
    up_cells = up_cells + len(low)
    first = on_plane(points, outer(up_cells), 0.0)
    # The grids are cut alike, so the faces of the two cubes match triangle by triangle.
    top = on_plane(points, outer(low_cells), 0.0)
    second = top[np.abs(points[top][:, :, :2]).max(axis=(1, 2)) < 0.5 + 1e-9]
    groups = {
        "LOW": low_cells,
        "UP": up_cells,
        "FC1": second,
        "FC2": first,
        "BASE": on_plane(points, outer(low_cells), -2.0),
        "EDGE": np.array([[len(low) + 18, len(low) + 19], [len(low) + 19, len(low) + 20]]),
        "POINT": np.array([[len(low) + 26]]),
    }
    return points, np.vstack([low_cells, up_cells]), groups


def round_block():
    """A disc of 60 segments swept: plane ends, curved side; the mesh, and the facets of its upper end."""
    angle = np.linspace(0, 2 * np.pi, 61)[:-1]
    ring = np.stack([np.cos(angle), np.sin(angle)], 1)
    i = np.arange(60)
    disc = mesh_surface(ring, np.stack([i, (i + 1) % 60], 1), 0.25)
    n = len(disc.points)
    layers = [np.hstack([disc.points, np.full((n, 1), z)]) for z in (0.0, 0.25, 0.5)]
    side = np.vstack([[[k * n + a, k * n + b, (k + 1) * n + b], [k * n + a, (k + 1) * n + b, (k + 1) * n + a]]
                      for k in (0, 1) for a, b in np.stack([i, (i + 1) % 60], 1)])  # fmt: skip
    envelope = np.vstack([disc.cells[:, ::-1], disc.cells + 2 * n, side])
    solid = mesh_volume(np.vstack(layers), envelope, 0.25)
    return solid, disc.cells + 2 * n
