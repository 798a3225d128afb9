"""Scene of two flat surfaces that face each other with different meshes, alone or as faces of elastic boxes."""

import numpy as np
from two_blocks import brick

from gibiane_ops.kernels.assembly import assemble
from gibiane_ops.kernels.elasticity import element_stiffness
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.integrals import element_mass
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.topology import boundary

BENT = 0.2
"""Displacement of the inner nodes of bent meshes, over the size of the elements."""

TETRAHEDRA = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
"""Kuhn's six tetrahedra of a cube."""


def grid(kind, n, up, seed=None, z=0.0, start=0):
    """Points and facets of the unit square; inner nodes moved at random within the plane when a seed is given."""
    g = np.linspace(0, 1, n + 1)
    points = np.stack([*np.meshgrid(g, g, indexing="ij"), np.full((n + 1, n + 1), z)], axis=-1)
    if seed is not None:
        move = np.random.default_rng(seed).uniform(-BENT, BENT, (n - 1, n - 1, 2)) / n
        points[1:-1, 1:-1, :2] += move
    number = start + np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    cells = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    if kind in ("TRI3", "TRI6"):
        cells = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    points = points.reshape(-1, 3)
    if kind in ("TRI6", "QUA8"):
        points, cells = quadratic(points, cells, kind, start)
    return points, [(kind, cells if up else turned(kind, cells))]


def quadratic(points, cells, kind, start):
    """Add the middles of the sides."""
    n = cells.shape[1]
    sides = np.stack([cells, np.roll(cells, -1, axis=1)], axis=-1).reshape(-1, 2)
    unique, place = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    middles = points[unique - start].mean(axis=1)
    return np.vstack([points, middles]), np.hstack([cells, start + len(points) + place.reshape(-1, n)])


def turned(kind, cells):
    """Turn facets over."""
    order = {
        "TRI3": [0, 2, 1],
        "QUA4": [0, 3, 2, 1],
        "TRI6": [0, 2, 1, 5, 4, 3],
        "QUA8": [0, 3, 2, 1, 7, 6, 5, 4],
        "SEG2": [1, 0],
        "SEG3": [1, 0, 2],
    }
    return cells[:, order[kind]]


def areas(points, facets):
    """Integral of every shape function."""
    total = np.zeros(len(points))
    for name, cells in facets:
        np.add.at(total, cells, element_mass(shape(name), points[cells]).sum(axis=2))
    return total


class Boxes:
    """Two unit cubes, n1 elements along the sides of the upper one, n2 of the lower one; CUB8 or TET4."""

    def __init__(self, kind, n1, n2, seed=None, turn=0.0):
        points, blocks, self.solids = [], [], []
        D = isotropic(1000.0, 0.3, "TRID")
        start = 0
        for i, (n, low) in enumerate(((n1, 0.0), (n2, -1.0))):
            x, cells = brick(np.array([0, 0, low]), np.array([1, 1, low + 1.0]), n, start)
            if seed is not None:
                inner = ((x[:, :2] > 1e-9) & (x[:, :2] < 1 - 1e-9)).all(axis=1)
                face = inner & (np.abs(x[:, 2]) < 1e-9)
                x[face, :2] += np.random.default_rng(seed + i).uniform(-BENT, BENT, (face.sum(), 2)) / n
            if kind == "TET4":
                cells = np.concatenate([cells[:, list(t)] for t in TETRAHEDRA])
            points.append(x)
            self.solids.append([(kind, cells)])
            start += len(x)
        flat = np.vstack(points)
        c, s = np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn))
        self.rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        self.flat, self.points = flat, flat @ self.rotation.T
        for solid in self.solids:
            for name, cells in solid:
                blocks.append((cells, element_stiffness(shape(name), self.points[cells], D)))
        self.K = assemble(len(flat), 3, blocks)
        self.D = D
        self.slave, self.master = (self.face(i, 0.0) for i in (0, 1))
        self.top, self.base = self.face(0, 1.0), self.face(1, -1.0)

    def face(self, solid, z):
        """Facets of a solid at a height."""
        found = []
        for name, facets in boundary(self.solids[solid]).items():
            on = np.abs(self.flat[facets.nodes][:, :, 2] - z).max(axis=1) < 1e-9
            if on.any():
                found.append((name, facets.nodes[on]))
        return found
