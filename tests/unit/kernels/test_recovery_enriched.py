"""Patches with equilibrium: exact on linear stresses in balance, and nearer the tractions than plain ones."""

import numpy as np
import pytest
from boxes import grid, mesh, with_middles

from gibiane_ops.kernels import geometry, recovery, topology
from gibiane_ops.kernels.arrays import traction
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.recovery import StressBlock
from gibiane_ops.kernels.recovery.enriched import Surface, enriched_recovery

AXIS = [("QUA4", 1), ("TRI3", 1), ("QUA8", 2), ("TRI6", 2)]
FLAT = [(name, shape(name).degree) for name in ("TRI3", "QUA4", "TRI6", "QUA8", "TET4", "PRI6", "PYR5", "CUB8")]
FLAT += [(name, 2) for name in ("TE10", "PR15", "PY13", "CU20")]


def surface_of(name, points, cells, stress, known=1.0):
    """Points of facets, bent or not, with the tractions of a stress."""
    parts = []
    for facet, facets in topology.boundary([(name, cells)]).items():
        of, X = shape(facet), points[facets.nodes]
        xi = recovery.surface_points(of)
        normal = geometry.normal_densities(of, X, xi)
        normal = (normal / np.linalg.norm(normal, axis=2, keepdims=True)).reshape(-1, points.shape[1])
        place = geometry.positions(of, X, xi).reshape(normal.shape)
        parts.append((np.repeat(facets.cell, len(xi)), place, normal, traction(stress(place), normal)))
    cell, place, normal, t = (np.concatenate(each) for each in zip(*parts, strict=True))
    return Surface(cell, place, normal, t, np.tile(known * np.eye(points.shape[1]), (len(t), 1, 1)))


def monomials(x, degree):
    """Values (n, m) and derivatives (n, m, d)."""
    n, d = x.shape
    values = [np.ones((n, 1)), x]
    slopes = [np.zeros((n, 1, d)), np.broadcast_to(np.eye(d), (n, d, d))]
    if degree == 2:
        for i in range(d):
            for j in range(i, d):
                values.append(x[:, [i]] * x[:, [j]])
                slopes.append((np.eye(d)[i] * x[:, [j]] + np.eye(d)[j] * x[:, [i]])[:, None])
    return np.hstack(values), np.concatenate(slopes, axis=1)


def divergence(x, p, degree, axis):
    """Divergence of the stress with the coefficients p (m, c) at points, by hand."""
    values, slopes = monomials(x, degree)
    s, ds = values @ p, np.einsum("nad,ac->ncd", slopes, p)
    if x.shape[1] == 3:
        order = [[0, 3, 4], [3, 1, 5], [4, 5, 2]]
        return np.stack([sum(ds[:, order[i][j], j] for j in range(3)) for i in range(3)], axis=1)
    div = np.stack([ds[:, 0, 0] + ds[:, 3, 1], ds[:, 3, 0] + ds[:, 1, 1]], axis=1)
    return div + axis * np.stack([s[:, 0] - s[:, 2], s[:, 3]], axis=1) / x[:, :1]


def balanced(dim, degree, body, axis=False):
    """A stress of random coefficients, put into balance with a body force."""
    rng, c = np.random.default_rng(1), {2: 4, 3: 6}[dim]
    x = rng.uniform(0.5, 1.5, (40, dim))
    m = monomials(x, degree)[0].shape[1]
    rows = np.stack([divergence(x, e.reshape(m, c), degree, axis).ravel() for e in np.eye(m * c)], axis=1)
    p = rng.normal(size=m * c)
    p -= np.linalg.lstsq(rows, rows @ p + np.tile(body, len(x)), rcond=None)[0]
    assert np.abs(rows @ p + np.tile(body, len(x))).max() < 1e-12
    assert np.abs(p).max() > 0.5
    return lambda at: (monomials(at.reshape(-1, dim), degree)[0] @ p.reshape(m, c)).reshape(*at.shape[:-1], c)


@pytest.mark.parametrize(
    ("name", "degree", "axis"), [(*each, False) for each in FLAT] + [(*each, True) for each in AXIS]
)
def test_stress_in_balance_is_reproduced(name, degree, axis):
    d = shape(name).dim
    points, cells = mesh(name, *(3 if d == 3 else 4,) * d)
    points[:, 0] += axis
    body = np.array([2.0, -1.0, 0.5])[:d]
    stress = balanced(d, degree, body, axis)
    of = shape(name)
    raw = stress(geometry.positions(of, points[cells], of.gauss[0]))
    if degree == 1:
        raw = np.repeat(stress(geometry.centroids(of, points[cells]))[:, None], raw.shape[1], axis=1)
    block, surface = StressBlock(of, cells, raw), surface_of(name, points, cells, stress)
    found = enriched_recovery(points, [block], body, surface, axisymmetric=axis)
    assert (found.fallbacks, found.flattened) == (0, 0)
    assert found.nodal == pytest.approx(stress(points), abs=1e-9)
    # A body force of the wrong sign is not in balance with it, nor is it elsewhere than round an axis.
    wrong = enriched_recovery(points, [block], -body, surface, axisymmetric=axis)
    assert np.abs(wrong.nodal - stress(points)).max() > 1e-2
    if d == 2:
        other = enriched_recovery(points, [block], body, surface, axisymmetric=not axis)
        assert np.abs(other.nodal - stress(points)).max() > 1e-2


def test_tractions_of_a_bent_surface():
    # triangles of second degree with bent sides: positions are exact, so is a quadratic stress
    points, cells = mesh("TRI6", 4, 4)
    points = points + 0.04 * np.sin(4 * points[:, ::-1])
    body = np.array([1.0, 2.0])
    stress = balanced(2, 2, body)
    of = shape("TRI6")
    block = StressBlock(of, cells, stress(geometry.positions(of, points[cells], of.gauss[0])))
    found = enriched_recovery(points, [block], body, surface_of("TRI6", points, cells, stress))
    assert found.nodal == pytest.approx(stress(points), abs=1e-9)


def test_both_degrees_together():
    # QUA8 below, QUA4 above: the patches where they meet are linear
    corners, boxes = grid(4, 4)
    low = corners[boxes][:, :, 1].mean(axis=1) < 0.5
    points, cells = with_middles("QUA4", corners, boxes[low])
    body = np.array([1.0, 2.0])
    stress = balanced(2, 1, body)
    blocks = []
    for name, some in (("QUA8", cells), ("QUA4", boxes[~low])):
        of = shape(name)
        blocks.append(StressBlock(of, some, stress(geometry.positions(of, points[some], of.gauss[0]))))
    nothing = Surface(np.zeros(0, np.int64), *(np.zeros((0, 2)) for _ in range(3)), np.zeros((0, 2, 2)))
    found = enriched_recovery(points, blocks, body, nothing)
    assert found.nodal == pytest.approx(stress(points), abs=1e-9)


@pytest.mark.parametrize("name", ["QUA8", "CU20"])
def test_one_layer_says_what_it_does_not_see(name):
    d = shape(name).dim
    points, cells = mesh(name, *(3,) * (d - 1), 1)
    body = np.ones(d)
    stress = balanced(d, 1, body)
    of = shape(name)
    block = StressBlock(of, cells, stress(geometry.positions(of, points[cells], of.gauss[0])))
    found = enriched_recovery(points, [block], body, surface_of(name, points, cells, stress))
    assert found.nodal == pytest.approx(stress(points), abs=1e-9)
    assert found.flattened > 0


def test_tractions_are_nearer_than_with_plain_patches():
    # The stress of a tube under pressure, sampled with a disturbance.
    points, cells = mesh("QUA4", 6, 6, distortion=0.1)
    points = points + [1.0, 0.0]

    def stress(x):
        r2 = (x**2).sum(axis=-1)
        q = 1 / (r2 * r2)
        xx, yy = x[..., 0] ** 2, x[..., 1] ** 2
        s = np.stack([1 - q * (xx - yy), 1 + q * (xx - yy), 0.6 + 0 * q, -2 * q * x[..., 0] * x[..., 1]], -1)
        return s

    of = shape("QUA4")
    raw = stress(geometry.centroids(of, points[cells]))
    raw = raw + 0.02 * np.random.default_rng(3).normal(size=raw.shape)
    block = StressBlock(of, cells, np.repeat(raw[:, None], 4, axis=1))
    surface = surface_of("QUA4", points, cells, stress)
    plain = recovery.patch_recovery(points, [block]).nodal
    enriched = enriched_recovery(points, [block], np.zeros(2), surface).nodal
    edge = np.unique(next(iter(topology.boundary([("QUA4", cells)]).values())).nodes)
    true = stress(points)
    assert np.linalg.norm((enriched - true)[edge]) < 0.8 * np.linalg.norm((plain - true)[edge])
    # Unknown tractions do not weigh.
    blind = surface_of("QUA4", points, cells, lambda x: 5 * stress(x), known=0.0)
    same = surface_of("QUA4", points, cells, stress, known=0.0)
    one = enriched_recovery(points, [block], np.zeros(2), blind).nodal
    assert one == pytest.approx(enriched_recovery(points, [block], np.zeros(2), same).nodal, abs=1e-14)
