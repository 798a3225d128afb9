"""Tractions on sides of simplices that stand for facets of elements: moments, curved facets, resultants."""

import numpy as np
import pytest
from boxes import mesh

from gibiane_ops.kernels import geometry, quadrature
from gibiane_ops.kernels.arrays import stress_tensor
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.bodies import without_resultants
from gibiane_ops.kernels.estimate.cutting import CENTRES, MIDDLES, Cutting
from gibiane_ops.kernels.estimate.sides import Parts
from gibiane_ops.kernels.estimate.simplices import simplices
from gibiane_ops.kernels.estimate.tractions import Exterior
from gibiane_ops.kernels.topology import boundary

UNIFORM = {2: np.array([2.0, -1.0, 0.7]), 3: np.array([2.0, -1.0, 0.5, 0.7, 0.3, -0.4])}


def full(s: np.ndarray) -> np.ndarray:
    """Tensor of a stress of the components that tractions see."""
    return stress_tensor(np.array([s[0], s[1], 0.0, s[2]]))[:2, :2] if len(s) == 3 else stress_tensor(s)


def parts_of(name: str, bend: float, finest: int):
    """Sides of a bent box in elements, their nodes, and the nodes of their facets."""
    points, cells = mesh(name, *(2,) * shape(name).dim, distortion=0.0)
    points = points + bend * np.sin(2.0 * points[:, ::-1])
    cutting = Cutting(points, [(name, cells)], np.arange(len(points)), finest)
    ((kind, facets),) = boundary([(name, cells)]).items()
    sides, at, owner = cutting.facets(kind, facets.nodes)
    return cutting, Parts(shape(kind), points[facets.nodes[owner]], at, cutting.points[sides]), owner


@pytest.mark.parametrize(
    ("name", "finest"), [("QUA8", MIDDLES), ("TRI6", MIDDLES), ("CU20", CENTRES), ("TE10", MIDDLES)]
)
def test_chords_carry_a_uniform_stress_exactly(name, finest):
    # Tractions s.n of the arcs, and the tilt of the chords: s.n of the chords.
    dim = shape(name).dim
    _, parts, _ = parts_of(name, 0.08, finest)
    assert len(parts.bent()) > 0.5 * len(parts.at)
    p, traction = np.full(parts.X.shape[:2], 1.7), np.zeros(parts.X.shape)
    uniform = np.zeros(len(UNIFORM[dim]))
    uniform[:dim] = -1.7

    def stress(rows: np.ndarray, xi: np.ndarray) -> np.ndarray:
        return np.broadcast_to(uniform, (*xi.shape[:2], len(uniform)))

    given, _ = parts.linear(traction, stress, traction, p)
    along = parts.corners[:, 1:] - parts.corners[:, :1]
    normal = np.stack([along[:, 0, 1], -along[:, 0, 0]], -1) if dim == 2 else np.cross(along[:, 0], along[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    inside = parts.X.mean(axis=1) - 0.5
    normal *= np.sign(np.einsum("ki,ki->k", normal, inside))[:, None]
    straight = np.setdiff1d(np.arange(len(given)), parts.bent())
    # flat facets take tractions as they are given at nodes: none here
    assert np.abs(given[straight]).max(initial=0.0) == 0
    bent = parts.bent()
    assert given[bent] == pytest.approx(np.repeat(-1.7 * normal[bent, None], dim, axis=1), abs=1e-12)
    without, _ = parts.linear(traction, None, traction, p)
    assert np.abs(without[bent] - given[bent]).max() > 1e-3


@pytest.mark.parametrize(
    ("name", "finest"), [("QUA8", MIDDLES), ("CU20", CENTRES), ("CUB8", CENTRES), ("TE10", MIDDLES)]
)
def test_sides_keep_the_moments_of_quadratic_loads(name, finest):
    dim = shape(name).dim
    _, parts, owner = parts_of(name, 0.0, finest)
    assert not len(parts.bent())
    A = np.random.default_rng(2).normal(size=(dim, dim, dim))
    linear, square = parts.X @ A[0], np.einsum("ijl,knj,knl->kni", A, parts.X, parts.X)
    traction = linear if parts.of.degree == 1 else square
    given, left = parts.linear(traction)
    # linear loads are kept as they are, quadratic ones in the mean
    assert (left.max() < 1e-12) == (parts.of.degree == 1)
    mass = (np.eye(dim) + 1) / (dim * (dim + 1))
    area = parts.areas()
    force = np.einsum("k,ab,kbi->ki", area, mass, given)
    arm = np.einsum("k,ab,kbi,kaj->kij", area, mass, given, parts.corners)
    each = [np.stack([np.bincount(owner, v) for v in x.reshape(len(x), -1).T], -1) for x in (force, arm)]
    _, first = np.unique(owner, return_index=True)
    of, X, t = parts.of, parts.X[first], traction[first]
    rule = quadrature.line(4) if dim == 2 else (quadrature.square(4) if of.n_corners == 4 else quadrature.simplex(2, 4))
    weight = geometry.point_measures(of, X, (rule.points, rule.weights))
    there, x = np.matmul(of.N(rule.points), t), geometry.positions(of, X, rule.points)
    assert each[0] == pytest.approx(np.einsum("kq,kqi->ki", weight, there), abs=1e-12)
    assert each[1] == pytest.approx(np.einsum("kq,kqi,kqj->kij", weight, there, x).reshape(len(X), -1), abs=1e-12)
    assert parts.moments(traction) == pytest.approx(np.einsum("k,ab,kbi->kai", area, mass, given), abs=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_loads_lose_their_resultants(dim):
    points, cells = mesh({2: "TRI3", 3: "TET4"}[dim], *(2,) * dim)
    pieces = simplices(points, cells)
    edge = pieces.boundary
    rng = np.random.default_rng(6)
    traction, free = rng.normal(size=(len(edge), dim, dim)), np.zeros((len(edge), dim, dim))
    floor = (np.abs(points[pieces.nodes[edge]][:, :, 0]) < 1e-9).all(axis=1)
    free[floor, 0, 0] = 1.0
    body = np.tile(rng.normal(size=dim), (len(cells), 1))
    sides = ~floor
    found = without_resultants(pieces, Exterior(traction, free, body), sides)
    assert (found.traction[floor] == traction[floor]).all()
    area = np.linalg.norm(pieces.outward[pieces.cell[edge, 0], pieces.local[edge, 0]], axis=1)
    mass = (np.eye(dim) + 1) / (dim * (dim + 1))

    def work(loads: Exterior, motion) -> float:
        X = points[pieces.nodes[edge]]
        surface = np.einsum("k,ab,kbi,kai->", area, mass, loads.traction, motion(X))
        return surface + np.einsum("m,mi,mi->", pieces.volume, loads.body, motion(points[pieces.cells].mean(axis=1)))

    def slide(x):
        return np.broadcast_to(np.eye(dim)[1], x.shape)

    # the floor prevents the slide along its normal and, in a plane, the rotation; not the slide along itself
    assert abs(work(Exterior(traction, free, body), slide)) > 1e-3
    assert abs(work(found, slide)) < 1e-12
    assert abs(work(found, lambda x: np.broadcast_to(np.eye(dim)[0], x.shape))) > 1e-3
    if dim == 3:
        # nor does it prevent the rotation about its normal
        assert abs(work(found, lambda x: np.stack([0 * x[..., 0], -x[..., 2], x[..., 1]], -1))) < 1e-12
