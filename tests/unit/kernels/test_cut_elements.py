"""Equilibrated stresses on elements that are cut: fit, fields inside elements, the identity of Prager and Synge."""

import numpy as np
import pytest
from boxes import cut, grid, mesh, with_middles

from gibiane_ops.kernels import elasticity, geometry, quadrature
from gibiane_ops.kernels.arrays import strain_vector, stress_tensor
from gibiane_ops.kernels.elements.quadratic import LINEAR
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.estimate.admissible import admissible_stress, plane_compliance
from gibiane_ops.kernels.estimate.cutting import CENTRES, CORNERS, MIDDLES, Cutting
from gibiane_ops.kernels.estimate.equilibrium import stress_at_corners
from gibiane_ops.kernels.estimate.fields import field_of
from gibiane_ops.kernels.estimate.macro import STATIC
from gibiane_ops.kernels.estimate.pieces import Source, balanced_stress
from gibiane_ops.kernels.estimate.simplices import simplices
from gibiane_ops.kernels.estimate.target import Target
from gibiane_ops.kernels.estimate.tractions import Exterior
from gibiane_ops.kernels.estimate.zoom import zoomed
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.quadrature import Rule
from gibiane_ops.kernels.topology import boundary, group_by_nodes

PLANE = ["TRI3", "QUA4", "TRI6", "QUA8"]
SOLID = ["TET4", "PYR5", "PRI6", "CUB8", "TE10", "PY13", "PR15", "CU20"]


def skewed(name, n, bend=0.25):
    """The unit box in elements whose quadrangular faces are plane, yet not parallelograms."""
    linear, dim = LINEAR.get(name, name), shape(name).dim
    points, cells = cut(linear, *grid(*(n,) * dim, distortion=0.0))
    points[:, :2] += bend / n * np.sin(np.pi * points[:, :2]) * np.cos(2.3 * points[:, 1::-1])
    points[:, 0] *= 1 + bend * points[:, 1]
    return with_middles(linear, points, cells) if name in LINEAR else (points, cells)


def finest_of(name):
    return [CORNERS, CENTRES, MIDDLES] if shape(name).dim == 2 else [CORNERS, CENTRES]


@pytest.mark.parametrize("finest", [CORNERS, CENTRES, MIDDLES])
@pytest.mark.parametrize("name", PLANE + SOLID)
def test_pieces_fit_and_fill(name, finest):
    points, cells = skewed(name, 2)
    found = Cutting(points, [(name, cells)], np.random.default_rng(0).permutation(len(points)), finest)
    pieces = simplices(found.points, found.cells)
    measure = np.bincount(found.owner[0], pieces.volume)
    assert measure == pytest.approx(geometry.measures(shape(name), points[cells]), rel=1e-12)
    assert found.points[found.node >= 0] == pytest.approx(points[found.node[found.node >= 0]], abs=0)
    # the boundary is that of the box, and facets are cut as their elements are
    (*skin,) = boundary([(name, cells)]).items()
    sides = []
    for kind, facets in skin:
        children, at, owner = found.facets(kind, facets.nodes)
        N = shape(kind).N(at.reshape(-1, at.shape[2])).reshape(*at.shape[:2], -1)
        where = np.einsum("kan,kni->kai", N, points[facets.nodes[owner]])
        assert where == pytest.approx(found.points[children], abs=1e-12)
        sides.append(children)
    sides = np.concatenate(sides)
    _, first = group_by_nodes(np.vstack([pieces.nodes[pieces.boundary], sides]))
    assert len(first) == len(sides) == len(pieces.boundary)
    # reference coordinates lead back to the points; those of pyramids do so to no more than the centre
    inside = shape(name).N(found.at.reshape(-1, found.at.shape[2])).reshape(*found.at.shape[:2], -1)
    assert np.einsum("kan,kni->kai", inside, points[cells[found.owner[0]]]) == pytest.approx(
        found.points[found.cells], abs=1e-12
    )


def test_neighbours_of_both_degrees_fit():
    points, cells = grid(4, 3)
    left = points[cells].mean(axis=1)[:, 0] < 0.5
    points, quadratic = with_middles("QUA4", points, cells[left])
    found = Cutting(points, [("QUA8", quadratic), ("QUA4", cells[~left])], np.arange(len(points)), MIDDLES)
    pieces = simplices(found.points, found.cells)
    assert pieces.volume.sum() == pytest.approx(1.0)
    X = found.points[pieces.nodes[pieces.boundary]]
    assert ((np.abs(X) < 1e-9) | (np.abs(X - 1) < 1e-9)).all(axis=1).any(axis=1).all()


def test_facets_of_another_mesh_are_refused():
    points, cells = mesh("QUA8", 2, 2)
    found = Cutting(points, [("QUA8", cells)], np.arange(len(points)), MIDDLES)
    with pytest.raises(BadValue):
        found.facets("SEG3", np.array([[0, 8, 9]]))


def fine_rule(name):
    """A rule of high degree for the element."""
    match LINEAR.get(name, name):
        case "QUA4":
            return quadrature.square(9)
        case "CUB8":
            return quadrature.cube(8)
        case "TRI3":
            return quadrature.simplex(2, 6)
        case "TET4":
            return quadrature.simplex(3, 6)
        case "PYR5":
            return quadrature.pyramid(9)
    flat, tall = quadrature.simplex(2, 7), quadrature.line(7)
    points = np.hstack([np.tile(flat.points, (7, 1)), np.repeat(tall.points, len(flat.points), 0)])
    return Rule(points, np.outer(tall.weights, flat.weights).ravel(), 7, "product")


def curved(dim):
    """A quadratic displacement, its gradient, the stress and the body force that balances it."""
    A = np.random.default_rng(1).normal(size=(dim,) * 3)
    A = A + A.swapaxes(1, 2)
    law = isotropic(1.0, 0.3, "TRID" if dim == 3 else "DEFO")

    def displacement(x):
        return np.einsum("ijk,...j,...k->...i", A, x, x) / 2

    def stress(x):
        strain, gradient = np.zeros((*x.shape[:-1], 3, 3)), np.einsum("ijk,...k->...ij", A, x)
        strain[..., :dim, :dim] = (gradient + gradient.swapaxes(-1, -2)) / 2
        return strain_vector(strain, 6 if dim == 3 else 4) @ law

    body = -sum(stress_tensor(stress(np.eye(dim)[k]))[:dim, k] for k in range(dim))
    return law, displacement, stress, body


@pytest.mark.parametrize("skew", [False, True])
@pytest.mark.parametrize("name", PLANE + SOLID)
def test_strains_come_back_at_any_point(name, skew):
    of = shape(name)
    points, cells = skewed(name, 2, 0.25 if skew else 0.0)
    U = np.random.default_rng(3).normal(size=points.shape)
    exact = elasticity.strains(of, points[cells], U[cells], of.gauss[0])[..., STATIC[of.dim]]
    one = np.broadcast_to(np.eye(exact.shape[2]), (len(cells), *[exact.shape[2]] * 2))
    field = field_of(of, points[cells], exact, one)
    assert field.misfit < 1e-10
    xi = fine_rule(name).points[::5]
    x = geometry.positions(of, points[cells], xi)
    guess = np.where(field.affine[:, None, None], xi, 0.9 * xi + 0.1 * of.ref_nodes.mean(axis=0))
    wanted = elasticity.strains(of, points[cells], U[cells], xi)[..., STATIC[of.dim]]
    assert field.strains(np.arange(len(cells)), x, guess) == pytest.approx(wanted, abs=1e-8 * np.abs(wanted).max())
    # values that are no strains of a displacement are seen, where there are more of them than freedoms, and kept
    noisy = exact + np.random.default_rng(5).normal(size=exact.shape)
    more = exact[0].size > points[cells][0].size - 3 * (of.dim - 1)
    field = field_of(of, points[cells], noisy, one)
    assert (field.misfit > 1e-3) == more == (field.rest is not None)
    x = geometry.positions(of, points[cells], of.gauss[0])
    again = field.strains(np.arange(len(cells)), x, np.broadcast_to(of.gauss[0], x.shape))
    assert again == pytest.approx(noisy, abs=1e-8 * np.abs(noisy).max())


@pytest.mark.parametrize("skew", [False, True])
@pytest.mark.parametrize(("name", "finest"), [(name, f) for name in PLANE + SOLID for f in finest_of(name)])
def test_identity(name, finest, skew):
    # Any admissible displacement will do: the exact one at the nodes, disturbed.
    of, dim = shape(name), shape(name).dim
    law, displacement, exact, body = curved(dim)
    points, cells = skewed(
        name, 1 if dim == 3 and (name.startswith("P") or of.degree > 1) else 2, 0.25 if skew else 0.0
    )
    U = displacement(points)
    U = U + 0.05 * np.random.default_rng(2).normal(size=U.shape)
    given = elasticity.strains(of, points[cells], U[cells], of.gauss[0])[..., STATIC[dim]]
    cutting = Cutting(points, [(name, cells)], np.arange(len(points)), finest)
    pieces = simplices(cutting.points, cutting.cells)
    m = len(pieces.cells)
    compliance = np.broadcast_to(plane_compliance(law, dim), (m, *[len(STATIC[dim])] * 2))
    order = np.argsort(cutting.cells, axis=1)
    one = np.broadcast_to(compliance[0], (len(cells), *compliance[0].shape))
    field = field_of(of, points[cells], given @ np.linalg.inv(one[0]), one)
    source = Source([field], np.zeros(m, np.int64), cutting.owner[0], cutting.at).turned(order)
    aim = source.aim(pieces.points[pieces.cells], compliance)
    edge = pieces.boundary
    outward = pieces.outward[pieces.cell[edge, 0], pieces.local[edge, 0]]
    outward = outward / np.linalg.norm(outward, axis=1)[:, None]
    X = pieces.points[pieces.nodes[edge]]
    traction = np.einsum("kaij,kj->kai", stress_tensor(exact(X))[..., :dim, :dim], outward)
    loads = Exterior(traction, np.zeros((len(edge), dim, dim)), np.tile(body, (m, 1)))
    start, free = np.zeros((m, len(law))), np.zeros((len(pieces.points), dim, dim))
    start[:, STATIC[dim]] = aim.mean
    start = balanced_stress(pieces, start, np.broadcast_to(law, (m, *law.shape)), loads, free)
    found = admissible_stress(cutting.points, cutting.cells, start, law, loads, sweeps=0, mesh=pieces, aim=aim)
    assert found.residual < 1e-11
    assert (found.remainder == 0) == bool(field.affine.all())

    # |s_hat - s_h|^2 = |s - s_hat|^2 + |s - s_h|^2: the first is linear in parts, the second integrated over elements
    at = stress_at_corners(pieces, pieces.sign[..., None, None] * found.tau[pieces.side])
    corners = np.repeat(pieces.points[pieces.cells][:, None], dim + 1, axis=1)
    corners[:, range(dim + 1), range(dim + 1)] = corners[:, 0].mean(axis=1, keepdims=True)
    left = exact(corners)[..., STATIC[dim]] - at
    mass = (np.eye(dim + 1) + 1) / ((dim + 1) * (dim + 2)) / (dim + 1)
    hat = float(np.einsum("m,pq,mkps,st,mkqt->", pieces.volume, mass, left, compliance[0], left, optimize=True))
    rule = fine_rule(name)
    raw = elasticity.strains(of, points[cells], U[cells], rule.points) @ law
    gap = (exact(geometry.positions(of, points[cells], rule.points)) - raw)[..., STATIC[dim]]
    weight = geometry.point_measures(of, points[cells], (rule.points, rule.weights))
    true = float(np.einsum("mq,mqs,st,mqt->", weight, gap, compliance[0], gap, optimize=True))
    assert hat + true == pytest.approx(found.error.sum() - found.remainder, rel=1e-9, abs=1.01 * found.remainder)
    assert min(hat, found.error.sum() - true) > 1e-3 * true
    # the improvement goes on to be above the error, and falls
    better = admissible_stress(cutting.points, cutting.cells, start, law, loads, sweeps=1, mesh=pieces, aim=aim)
    assert better.residual < 1e-11
    assert found.error.sum() > better.error.sum() >= (1 - 1e-12) * true


@pytest.mark.parametrize("skew", [False, True])
@pytest.mark.parametrize("name", ["QUA4", "TRI6", "QUA8", "CUB8", "CU20"])
def test_smaller_cells_see_the_same_stress(name, skew):
    of, dim = shape(name), shape(name).dim
    law, _, _, _ = curved(dim)
    points, cells = skewed(name, 2 if dim == 2 else 1, 0.25 if skew else 0.0)
    given = np.random.default_rng(8).normal(size=points.shape)[cells]
    one = np.broadcast_to(plane_compliance(law, dim), (len(cells), *[len(STATIC[dim])] * 2))
    strain = elasticity.strains(of, points[cells], given, of.gauss[0])[..., STATIC[dim]]
    field = field_of(of, points[cells], strain @ np.linalg.inv(one[0]), one)
    cutting = Cutting(points, [(name, cells)], np.arange(len(points)), CENTRES)
    pieces = simplices(cutting.points, cutting.cells)
    m, n = len(pieces.cells), len(pieces.nodes)
    compliance = np.broadcast_to(plane_compliance(law, dim), (m, *[len(STATIC[dim])] * 2))
    source = Source([field], np.zeros(m, np.int64), cutting.owner[0], cutting.at)
    source = source.turned(np.argsort(cutting.cells, axis=1))
    aim = source.aim(pieces.points[pieces.cells], compliance)
    free, none = np.broadcast_to(np.eye(dim), (n, dim, dim)), np.zeros((n, dim, dim))
    target = Target(pieces, aim, compliance, np.zeros((m, dim)), free, none, np.arange(m), source=source)
    marked, tau = np.zeros(m, bool), none.copy()
    marked[::5] = True
    fine, tau, _ = zoomed(target, tau, marked)
    fine, tau, _ = zoomed(fine, tau, np.arange(len(fine.cell)) % 7 == 0)
    assert len(fine.cell) > m + 3

    def summed(of: Target, aim, values) -> np.ndarray:
        return np.stack([np.bincount(of.cell, each, m) for each in np.moveaxis(values(of, aim), -1, 0)], -1)

    def forces(of: Target, aim) -> np.ndarray:
        return of.mesh.volume[:, None] * aim.mean

    def energies(of: Target, aim) -> np.ndarray:
        uniform = of.mesh.volume * np.einsum("ms,mst,mt->m", aim.mean, of.compliance, aim.mean)
        return (uniform + aim.constant)[:, None]

    assert (aim.check is None) == (fine.aim.check is None) == bool(field.affine.all())
    # exact, or as near as the coarser rule says
    for values in (forces, energies):
        whole, parts = summed(target, aim, values), summed(fine, fine.aim, values)
        left = np.abs(summed(target, aim.check, values) - whole).max() if aim.check is not None else 0.0
        assert parts == pytest.approx(whole, rel=1e-11, abs=1e-12 + left)
    assert (fine.source.element == source.element[fine.cell]).all()
    if field.affine.all():
        N = of.N(fine.source.at.reshape(-1, dim)).reshape(*fine.source.at.shape[:2], -1)
        where = np.einsum("kan,kni->kai", N, points[cells][fine.source.element])
        assert where == pytest.approx(fine.mesh.points[fine.mesh.cells], abs=1e-12)


@pytest.mark.parametrize("quadratic", [False, True])
@pytest.mark.parametrize("finest", [CORNERS, CENTRES, MIDDLES])
def test_bricks_prisms_and_pyramids_fit(finest, quadratic):
    points, boxes = grid(3, 1, 1, distortion=0.0)
    blocks = []
    for name, box in zip(("CUB8", "PRI6", "PYR5"), boxes, strict=True):
        points, cells = cut(name, points, box[None])
        blocks.append((name, cells))
    if quadratic:
        second = []
        for name, cells in blocks:
            points, more = with_middles(name, points, cells)
            second.append(({v: k for k, v in LINEAR.items()}[name], more))
        blocks = second
    found = Cutting(points, blocks, np.random.default_rng(3).permutation(len(points)), finest)
    pieces = simplices(found.points, found.cells)
    assert pieces.volume.sum() == pytest.approx(1.0)
    X = found.points[pieces.nodes[pieces.boundary]]
    assert ((np.abs(X) < 1e-9) | (np.abs(X - 1) < 1e-9)).all(axis=1).any(axis=1).all()
