"""The unit square or cube in elements of every shape, with inner corners moved at random."""

import numpy as np

from gibiane_ops.kernels.elements.quadratic import LINEAR
from gibiane_ops.kernels.elements.table import shape


def grid(*counts, distortion=0.15):
    """Corners and cells (QUA4 or CUB8) of the unit box, the inner nodes moved at random."""
    dim = len(counts)
    axes = [np.linspace(0, 1, n + 1) for n in counts]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dim)
    inside = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    points[inside] += np.random.default_rng(4).uniform(-1, 1, (inside.sum(), dim)) * distortion / max(counts)
    number = np.arange(len(points)).reshape([n + 1 for n in counts])
    around = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    if dim == 3:
        around = np.vstack([np.c_[around, np.zeros(4, int)], np.c_[around, np.ones(4, int)]])
    slices = [tuple(slice(a, a + n) for a, n in zip(corner, counts, strict=True)) for corner in around]
    return points, np.stack([number[s].ravel() for s in slices], axis=1)


def cut(name, points, boxes):
    """Divide quadrangles or bricks into elements with the corners of a linear shape."""
    if name == "TRI3":
        return points, np.vstack([boxes[:, [0, 1, 2]], boxes[:, [0, 2, 3]]])
    if name == "TET4":
        paths = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
        return points, np.vstack([boxes[:, list(path)] for path in paths])
    if name == "PRI6":
        return points, np.vstack([boxes[:, [0, 1, 2, 4, 5, 6]], boxes[:, [0, 2, 3, 4, 6, 7]]])
    if name == "PYR5":
        apex = len(points) + np.arange(len(boxes))
        faces = shape("CUB8").faces
        cells = [np.c_[boxes[:, list(reversed(nodes))], apex] for _, nodes in faces]
        return np.vstack([points, points[boxes].mean(axis=1)]), np.vstack(cells)
    return points, boxes


def with_middles(name, points, cells):
    """Add the middles of the edges to a mesh of linear elements."""
    local = np.array(shape(name).edges)
    ends = np.sort(cells[:, local], axis=2).reshape(-1, 2)
    unique, number = np.unique(ends, axis=0, return_inverse=True)
    middles = len(points) + number.reshape(len(cells), -1)
    return np.vstack([points, points[unique].mean(axis=1)]), np.hstack([cells, middles])


def mesh(name, *counts, distortion=0.15):
    """Points and cells of the unit box in elements of any shape, inner corners moved at random."""
    linear = LINEAR.get(name, name)
    points, cells = cut(linear, *grid(*counts, distortion=distortion))
    return with_middles(linear, points, cells) if name in LINEAR else (points, cells)
