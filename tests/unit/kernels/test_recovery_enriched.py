"""Patches with equilibrium: exact on linear stresses in balance, and nearer the tractions than plain ones."""

import numpy as np
import pytest

from gibiane_ops.kernels import geometry, recovery, topology
from gibiane_ops.kernels.arrays import stress_tensor
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.recovery import StressBlock
from gibiane_ops.kernels.recovery.enriched import Surface, enriched_recovery


def grid(name, n):
    """Square or cube of side 1, n elements a side, inner nodes moved."""
    dim = {"QUA4": 2, "CUB8": 3}[name]
    points = np.stack(np.meshgrid(*[np.linspace(0, 1, n + 1)] * dim, indexing="ij"), -1).reshape(-1, dim)
    number = np.arange(len(points)).reshape((n + 1,) * dim)
    corner = shape(name).ref_nodes > 0
    cells = np.stack([number[tuple(slice(int(c), int(c) + n) for c in row)].ravel() for row in corner], -1)
    inside = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    points[inside] += 0.1 / n * np.random.default_rng(0).uniform(-1, 1, (inside.sum(), dim))
    return points, cells


def surface_of(name, points, cells, stress, known=1.0):
    (facets,) = topology.boundary([(name, cells)]).values()
    of = shape(facets.name)
    X = points[facets.nodes]
    normal = geometry.facet_normals(of, X)
    middle = X.mean(axis=1)
    d = points.shape[1]
    t = np.einsum("kij,kj->ki", stress_tensor(stress(middle))[:, :d, :d], normal)
    return Surface(facets.cell, middle, normal, t, np.tile(known * np.eye(d), (len(t), 1, 1)))


@pytest.mark.parametrize("name", ["QUA4", "CUB8"])
def test_linear_stress_in_balance_is_reproduced(name):
    points, cells = grid(name, 4)
    d, c = points.shape[1], 4 if points.shape[1] == 2 else 6
    value, slope = np.random.default_rng(1).normal(size=c), np.random.default_rng(2).normal(size=(c, d))

    def stress(x):
        return value + x @ slope.T

    body = -sum(stress_tensor(slope[:, k])[:d, k] for k in range(d))
    of = shape(name)
    block = StressBlock(of, cells, stress(geometry.positions(of, points[cells], of.gauss[0])))
    found = enriched_recovery(points, [block], body, surface_of(name, points, cells, stress))
    assert found.fallbacks == 0
    assert found.nodal == pytest.approx(stress(points), abs=1e-10)
    # A body force of the wrong sign is not in balance with it: equilibrium does weigh.
    wrong = enriched_recovery(points, [block], -body, surface_of(name, points, cells, stress))
    assert np.abs(wrong.nodal - stress(points)).max() > 1e-2


def test_tractions_are_nearer_than_with_plain_patches():
    # The stress of a tube under pressure, sampled with a disturbance.
    points, cells = grid("QUA4", 6)
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


def test_second_degree_is_refused():
    of = shape("TRI6")
    X = np.array([[0.0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    block = StressBlock(of, np.arange(6)[None], np.zeros((1, len(of.gauss[1]), 4)))
    empty = Surface(np.zeros(0, np.int64), *(np.zeros((0, 2)) for _ in range(3)), np.zeros((0, 2, 2)))
    with pytest.raises(BadValue):
        enriched_recovery(X, [block], np.zeros(2), empty)
