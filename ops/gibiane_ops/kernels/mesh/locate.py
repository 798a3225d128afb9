"""Which elements hold a point, and which points are inside a contour or a mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.topology import Block

BoolArray = NDArray[np.bool_]
# Steps of Newton's method for the reference coordinates; bilinear maps of sound elements need four or five.
STEPS = 12
# A jacobian below this share of the product of its columns is that of a flat element.
FLAT = 1e-12


def reference_coordinates(name: str, X: FloatArray, x: FloatArray) -> FloatArray:
    """Find the reference coordinates of one point in each of several elements.

    Parameters
    ----------
    name : str
        Shape.
    X : (m, n_nodes, space_dim) float64, length
        Corners of the elements.
    x : (m, space_dim) float64, length
        A point per element.

    Returns
    -------
    (m, dim) float64
        By Newton's method (least squares for lines and surfaces in a larger space); far outside an element they mean
        no more than "outside".
    """
    kind = shape(name)
    centre = kind.ref_nodes[: kind.n_corners].mean(axis=0)
    xi = np.repeat(centre[None], len(X), axis=0)
    affine = kind.degree == 1 and kind.n_nodes == kind.dim + 1
    rows = np.arange(len(X))
    for _ in range(1 if affine else STEPS):
        own, XT = xi[rows], X[rows].transpose(0, 2, 1)
        gap = x[rows] - np.matmul(XT, kind.N(own)[:, :, None])[..., 0]
        step = solve_small(np.matmul(XT, kind.dN(own)), gap)
        moved = np.clip(own + step, centre - 10.0, centre + 10.0)
        xi[rows] = moved
        rows = rows[np.abs(moved - own).max(axis=1, initial=0.0) > 1e-13]
        if not len(rows):
            break
    return np.asarray(xi, np.float64)


def solve_small(jacobian: FloatArray, gap: FloatArray) -> FloatArray:
    """Solve small systems, (m, space_dim, dim) by (m, space_dim), in the sense of least squares.

    A flat element has no inverse: the result is then very large or without meaning, and its points are found outside.
    """
    dim = jacobian.shape[2]
    if jacobian.shape[1] != dim:
        gap = np.matmul(jacobian.transpose(0, 2, 1), gap[..., None])[..., 0]
        jacobian = np.matmul(jacobian.transpose(0, 2, 1), jacobian)
    columns = [jacobian[:, :, j] for j in range(dim)]
    if dim == 1:
        adjugate = [np.ones_like(gap)]
    elif dim == 2:
        (a, c), (b, d) = columns[0].T, columns[1].T
        adjugate = [np.stack([d, -b], axis=1), np.stack([-c, a], axis=1)]
    else:
        adjugate = [
            np.cross(columns[1], columns[2]),
            np.cross(columns[2], columns[0]),
            np.cross(columns[0], columns[1]),
        ]
    det = (adjugate[0] * columns[0]).sum(axis=1)
    least = FLAT * np.prod([np.linalg.norm(column, axis=1) for column in columns], axis=0)
    det = np.where(np.abs(det) > least, det, np.where(least > 0, least, np.inf))
    return np.stack([(row * gap).sum(axis=1) / det for row in adjugate], axis=1)


def overshoot(name: str, xi: FloatArray) -> FloatArray:
    """Tell how far reference points lie outside the reference element.

    Parameters
    ----------
    name : str
        Shape.
    xi : (k, dim) float64

    Returns
    -------
    (k,) float64
        The largest violation of the inequalities of the element; negative or zero inside.
    """
    kind = shape(name)
    out = np.maximum(kind.ref_nodes.min(axis=0) - xi, xi - kind.ref_nodes.max(axis=0)).max(axis=1, initial=-np.inf)
    if name.startswith(("TRI", "TET", "TE1")):
        out = np.maximum(out, xi.sum(axis=1) - 1)
    elif name.startswith(("PRI", "PR1")):
        out = np.maximum(out, xi[:, :2].sum(axis=1) - 1)
    elif name.startswith(("PYR", "PY1")):
        out = np.maximum(out, np.abs(xi[:, :2]).max(axis=1) - 1 + xi[:, 2])
    return np.asarray(out, np.float64)


def _in_reference(name: str, xi: FloatArray, tolerance: float) -> BoolArray:
    """Tell which reference points are in the reference element, up to a tolerance."""
    return np.asarray(overshoot(name, xi) <= tolerance, np.bool_)


def containing(name: str, X: FloatArray, x: FloatArray, tolerance: float = 1e-9) -> IntArray:
    """Find the elements that hold a point.

    Parameters
    ----------
    name : str
        Shape.
    X : (m, n_nodes, space_dim) float64, length
    x : (space_dim,) float64, length
    tolerance : float
        In reference coordinates; the distance to a line or surface is measured by the size of the element.

    Returns
    -------
    (k,) int64
        Their rows, increasing.
    """
    size = np.linalg.norm(np.ptp(X, axis=1), axis=1)
    margin = 1e-9 * size[:, None]
    near = np.flatnonzero(((x >= X.min(axis=1) - margin) & (x <= X.max(axis=1) + margin)).all(axis=1))
    if len(near) == 0 or shape(name).dim == 0:
        return near.astype(np.int64)
    xi = reference_coordinates(name, X[near], np.repeat(x[None], len(near), axis=0))
    image = np.einsum("mn,mni->mi", shape(name).N(xi), X[near])
    on = np.linalg.norm(image - x, axis=1) <= 1e-8 * size[near]
    return np.asarray(near[_in_reference(name, xi, tolerance) & on], np.int64)


def in_contours(points: FloatArray, a: FloatArray, b: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Tell which points of the plane are inside closed contours, and which are on them.

    Parameters
    ----------
    points : (k, 2) float64, length
    a, b : (n, 2) float64, length
        Ends of the segments of closed contours, in any order and direction; contours inside others are holes.

    Returns
    -------
    inside : (k,) bool
        By the parity of crossings.
    on : (k,) bool
        Up to round-off; `inside` means nothing there.

    Cost
    ----
    The product of the numbers of points and segments.
    """
    inside, on = np.zeros(len(points), bool), np.zeros(len(points), bool)
    along = b - a
    square = np.maximum((along * along).sum(axis=1), 1e-300)
    height = np.where(along[:, 1] == 0, 1.0, along[:, 1])
    scale = 1e-9 * float(np.abs(np.concatenate([a, b]) - a[0]).max())
    step = max(1, 2_000_000 // max(len(a), 1))
    for start in range(0, len(points), step):
        p = points[start : start + step, None, :]
        above = (a[:, 1] > p[..., 1]) != (b[:, 1] > p[..., 1])
        crossing = a[:, 0] + (p[..., 1] - a[:, 1]) * along[:, 0] / height
        inside[start : start + step] = (above & (p[..., 0] < crossing)).sum(axis=1) % 2 == 1
        t = np.clip(((p - a) * along).sum(axis=2) / square, 0.0, 1.0)
        distance = np.linalg.norm(p - a - t[..., None] * along, axis=2).min(axis=1)
        on[start : start + step] = distance <= scale
    return inside, on


def in_mesh(points: FloatArray, coords: FloatArray, blocks: Sequence[Block], tolerance: float = 0.0) -> BoolArray:
    """Tell which points are inside a mesh that fills the space.

    Parameters
    ----------
    points : (k, dim) float64, length
    coords : (n_points, dim) float64, length
        Nodes of the mesh.
    blocks : sequence of (str, (m, n_nodes) int64)
    tolerance : float
        In reference coordinates: points slightly outside an element are caught by a positive one, points near its
        faces are left out by a negative one.

    Returns
    -------
    (k,) bool

    Cost
    ----
    For each point, the elements whose circumscribed sphere about their centre holds it.
    """
    from scipy.spatial import cKDTree

    inside = np.zeros(len(points), bool)
    tree = cKDTree(points) if len(points) else None
    for name, cells in blocks:
        if tree is None:
            break
        X = coords[cells]
        centre = X.mean(axis=1)
        radius = np.linalg.norm(X - centre[:, None], axis=2).max(axis=1)
        found = tree.query_ball_point(centre, radius * (1 + 2 * max(tolerance, 1e-9)))
        count = np.array([len(each) for each in found])
        if not count.any():
            continue
        row = np.repeat(np.arange(len(cells)), count)
        point = np.concatenate([np.asarray(each, np.int64) for each in found if len(each)])
        xi = reference_coordinates(name, X[row], points[point])
        inside[point[_in_reference(name, xi, tolerance)]] = True
    return inside
