"""Properties of the assembled stiffness that hold on every shape: patch test, rigid modes, symmetry, objectivity."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from gibiane_ops.kernels import assembly, elasticity, geometry, integrals, topology
from gibiane_ops.kernels.arrays import component_of, strain_vector
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.elements.quadratic import QUADRATIC
from gibiane_ops.kernels.elements.table import SHAPES
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.rigid import rigid_modes

LINEAR = ["TRI3", "QUA4", "TET4", "PYR5", "PRI6", "CUB8"]
NAMES = [*LINEAR, *(QUADRATIC[name] for name in LINEAR)]
CORNERS = {QUADRATIC[name]: name for name in LINEAR}
E, NU = 210000.0, 0.3
# Cutting of a CUB8: six tetrahedra around the diagonal 0-6, two prisms; pyramids take the centre (8) as apex.
CUTS = {
    "QUA4": [[0, 1, 2, 3]],
    "TRI3": [[0, 1, 2], [0, 2, 3]],
    "CUB8": [[0, 1, 2, 3, 4, 5, 6, 7]],
    "PRI6": [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]],
    "TET4": [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]],
    "PYR5": [[*reversed(nodes), 8] for _, nodes in SHAPES["CUB8"].faces],
}


def box(name: str, counts: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Mesh [0, counts] with one shape, unit cells."""
    if name in CORNERS:
        return with_middles(name, *box(CORNERS[name], counts))
    dim = len(counts)
    size = [n + 1 for n in counts]
    points = np.stack(np.meshgrid(*[np.arange(n, dtype=float) for n in size], indexing="ij"), -1).reshape(-1, dim)
    number = np.arange(np.prod(size)).reshape(size)
    corners = SHAPES["QUA4" if dim == 2 else "CUB8"].ref_nodes > 0
    cells = np.stack(
        [number[tuple(slice(int(c), int(c) + n) for c, n in zip(corner, counts, strict=True))] for corner in corners],
        -1,
    ).reshape(-1, 2**dim)
    if name == "PYR5":
        cells = np.c_[cells, len(points) + np.arange(len(cells))]
        points = np.vstack([points, points[cells[:, :8]].mean(axis=1)])
    return points, cells[:, CUTS[name]].reshape(-1, SHAPES[name].n_nodes)


def with_middles(name: str, points: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add the mid-nodes that shape `name` wants to a mesh of linear cells."""
    ends = np.array([edge[:2] for edge in SHAPES[name].edges])
    pairs = np.sort(cells[:, ends].reshape(-1, 2), axis=1)
    unique, number = np.unique(pairs, axis=0, return_inverse=True)
    middles = len(points) + number.reshape(len(cells), -1)
    return np.vstack([points, points[unique].mean(axis=1)]), np.hstack([cells, middles])


def mesh(name: str, seed: int = 0, distortion: float = 0.15, counts: tuple[int, ...] | None = None):
    """Mesh a box with cells out of shape; those of second degree keep straight edges, mid-nodes in the middle."""
    dim = SHAPES[name].dim
    points, cells = box(CORNERS.get(name, name), counts or (3, 2, 2)[:dim])
    points = points + distortion * np.random.default_rng(seed).uniform(-1, 1, points.shape)
    return with_middles(name, points, cells) if name in CORNERS else (points, cells)


def law(name: str, mode: str = "DEFO") -> np.ndarray:
    return isotropic(E, NU, "TRID" if SHAPES[name].dim == 3 else mode)


# Every element in each of its modes: space, plane strain, plane stress (AXIS has its own patch test below).
IN_MODES = [(name, mode) for name in NAMES for mode in (("TRID",) if SHAPES[name].dim == 3 else ("DEFO", "CONT"))]


def stiffness(name: str, points: np.ndarray, cells: np.ndarray, D: np.ndarray | None = None) -> sp.csr_array:
    Ke = elasticity.element_stiffness(SHAPES[name], points[cells], law(name) if D is None else D)
    return assembly.assemble(len(points), points.shape[1], [(cells, Ke)])


def fixed(unknowns: np.ndarray, n: int) -> sp.csr_array:
    return sp.csr_array((np.ones(len(unknowns)), (np.arange(len(unknowns)), unknowns)), shape=(len(unknowns), n))


@pytest.mark.parametrize(("name", "mode"), IN_MODES)
@settings(max_examples=8, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10_000))
def test_patch(name: str, mode: str, seed: int) -> None:
    """A linear field prescribed on the boundary of a distorted mesh is found inside, with constant stress."""
    points, cells = mesh(name, seed)
    dim = points.shape[1]
    A = np.random.default_rng(seed + 1).standard_normal((dim, dim))
    exact = points @ A.T
    skin = np.unique(np.concatenate([f.nodes.ravel() for f in topology.boundary([(name, cells)]).values()]))
    unknowns = (skin[:, None] * dim + np.arange(dim)).ravel()
    K = stiffness(name, points, cells, law(name, mode))
    reduction = reduce_conditions(fixed(unknowns, points.size), exact[skin].ravel())
    load = reduction.load(K, np.zeros(points.size))
    u = reduction.expand(np.linalg.solve(reduction.matrix(K).toarray(), load)).reshape(-1, dim)
    assert len(skin) < len(points)
    assert np.allclose(u, exact, atol=1e-12 * np.abs(exact).max())
    each = SHAPES[name]
    stress = elasticity.stresses(elasticity.strains(each, points[cells], u[cells], each.gauss[0]), law(name, mode))
    H = np.zeros((3, 3))
    H[:dim, :dim] = A
    constant = law(name, mode) @ strain_vector((H + H.T) / 2, stress.shape[-1])
    assert np.abs(stress - constant).max() < 1e-11 * np.abs(constant).max()


@pytest.mark.parametrize(("name", "mode"), IN_MODES)
def test_rigid_modes_and_nothing_else(name: str, mode: str) -> None:
    points, cells = mesh(name, 4, counts=(2, 1, 1)[: SHAPES[name].dim])
    K = stiffness(name, points, cells, law(name, mode)).toarray()
    values = np.linalg.eigvalsh(K)
    n_rigid = 6 if points.shape[1] == 3 else 3
    assert np.abs(values[:n_rigid]).max() < 1e-12 * values[-1]
    assert values[n_rigid] > 1e-6 * values[-1]
    assert np.abs(K @ rigid_modes(points)).max() < 1e-11 * values[-1]


@pytest.mark.parametrize(("name", "mode"), IN_MODES)
def test_single_elements_have_no_spurious_mode(name: str, mode: str) -> None:
    each = SHAPES[name]
    values = np.linalg.eigvalsh(elasticity.element_stiffness(each, each.ref_nodes[None], law(name, mode))[0])
    assert np.count_nonzero(values < 1e-9 * values[-1]) == (6 if each.dim == 3 else 3)


@pytest.mark.parametrize("name", NAMES)
def test_symmetry(name: str) -> None:
    K = stiffness(name, *mesh(name, 5))
    assert np.abs((K - K.T).data).max() <= 1e-14 * np.abs(K.data).max()


@pytest.mark.parametrize("name", NAMES)
def test_a_large_turn_has_no_strain_of_second_order(name: str) -> None:
    """x = Q F X with Q a rotation: the strain is (F^T F - 1) / 2 whatever Q, in every element and at every point."""
    points, cells = mesh(name, 4)
    dim = points.shape[1]
    rng = np.random.default_rng(2)
    Q, _ = np.linalg.qr(rng.standard_normal((dim, dim)))
    Q[0] *= np.sign(np.linalg.det(Q))
    F = np.eye(dim) + 0.3 * rng.standard_normal((dim, dim))
    u = points @ (Q @ F).T - points
    found = elasticity.strains(SHAPES[name], points[cells], u[cells], SHAPES[name].gauss[0], quadratic=True)
    E = (F.T @ F - np.eye(dim)) / 2
    expected = np.zeros(found.shape[2])
    for i in range(dim):
        for j in range(i, dim):
            expected[component_of(i, j)] = E[i, j] * (1 if i == j else 2)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-11)


@pytest.mark.parametrize("name", NAMES)
def test_numbering_changes_nothing(name: str) -> None:
    points, cells = mesh(name, 6)
    dim = points.shape[1]
    rng = np.random.default_rng(8)
    order = rng.permutation(len(points))
    place = np.argsort(order)
    K = stiffness(name, points, cells)
    renumbered = stiffness(name, points[order], place[rng.permutation(cells)])
    unknowns = (order[:, None] * dim + np.arange(dim)).ravel()
    assert np.abs(renumbered - K[unknowns][:, unknowns]).max() < 1e-13 * np.abs(K.data).max()


@pytest.mark.parametrize("name", NAMES)
def test_turning_the_body_turns_the_stiffness(name: str) -> None:
    points, cells = mesh(name, 7)
    dim = points.shape[1]
    Q, _ = np.linalg.qr(np.random.default_rng(9).standard_normal((dim, dim)))
    Q *= np.sign(np.linalg.det(Q)) if dim == 3 else 1.0
    if dim == 2 and np.linalg.det(Q) < 0:
        Q = Q[::-1]
    turn = sp.kron(sp.eye_array(len(points)), Q).tocsr()
    K = stiffness(name, points, cells)
    assert np.abs(stiffness(name, points @ Q.T, cells) - turn @ K @ turn.T).max() < 1e-13 * np.abs(K.data).max()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("mode", ["DEFO", "CONT"])
def test_bar_under_traction(name: str, mode: str) -> None:
    """A traction s on the end of a bar on rollers gives u = s L / E (E / (1 - nu^2) in plane strain), exactly."""
    each = SHAPES[name]
    dim, s = each.dim, 50.0
    points, cells = box(name, (4, 1, 1)[:dim])
    inner = np.all((points > 0) & (points < np.array([4, 1, 1][:dim])), axis=1)
    points[inner] += 0.1
    slide = (points[:, 0] > 0) & (points[:, 0] < 4)
    points[slide, 0] += 0.1 * np.random.default_rng(3).uniform(-1, 1, slide.sum())
    D = isotropic(E, NU) if dim == 3 else isotropic(E, NU, mode)
    K = stiffness(name, points, cells, D)
    supports = np.concatenate([np.flatnonzero(points[:, i] == 0) * dim + i for i in range(dim)])
    load = np.zeros(points.size)
    for face_name, facets in topology.boundary([(name, cells)]).items():
        end = facets.nodes[np.all(points[facets.nodes][:, :, 0] == 4, axis=1)]
        forces = integrals.pressure_load(SHAPES[face_name], points[end], -s)
        load += assembly.assemble_vector(len(points), dim, [(end, forces)])
    assert load.reshape(-1, dim).sum(axis=0)[0] == pytest.approx(s)
    reduction = reduce_conditions(fixed(supports, points.size))
    u = reduction.expand(np.linalg.solve(reduction.matrix(K).toarray(), reduction.load(K, load)))
    stretch = s / E * (1 - NU**2 if dim == 2 and mode == "DEFO" else 1.0)
    assert np.allclose(u.reshape(-1, dim)[:, 0], stretch * points[:, 0], atol=1e-11 * stretch)
    stress = elasticity.stresses(elasticity.strains(each, points[cells], u.reshape(-1, dim)[cells], each.gauss[0]), D)
    assert np.allclose(stress[..., 0], s, rtol=1e-11)
    r = reduction.reactions(K, u, load).reshape(-1, dim)
    assert r.sum(axis=0) == pytest.approx([-s, 0, 0][:dim], abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_closed_boundary_under_pressure_is_in_balance(name: str) -> None:
    points, cells = mesh(name, 10)
    total, moment = np.zeros(3), np.zeros(3)
    for face_name, facets in topology.boundary([(name, cells)]).items():
        X = points[facets.nodes]
        forces = np.zeros((*X.shape[:2], 3))
        forces[..., : points.shape[1]] = integrals.pressure_load(SHAPES[face_name], X, 7.0)
        arms = np.zeros_like(forces)
        arms[..., : points.shape[1]] = X
        total += forces.sum(axis=(0, 1))
        moment += np.cross(arms, forces).sum(axis=(0, 1))
    assert np.abs(total).max() < 1e-11
    assert np.abs(moment).max() < 1e-11


@pytest.mark.parametrize("name", NAMES)
def test_volumes_fill_the_box(name: str) -> None:
    points, cells = box(name, (3, 2, 2)[: SHAPES[name].dim])
    assert geometry.measures(SHAPES[name], points[cells]).sum() == pytest.approx(12.0 if points.shape[1] == 3 else 6.0)


PLANE = [name for name in NAMES if SHAPES[name].dim == 2]


def meridian(name: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    points, cells = mesh(name, seed)
    return points + [1.0, 0.0], cells


@pytest.mark.parametrize("name", PLANE)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_axisymmetric_patch(name: str, seed: int) -> None:
    """u_r = a r, u_z = b z prescribed on the boundary of a distorted section is found inside, with constant stress."""
    points, cells = meridian(name, seed)
    each, D, a, b = SHAPES[name], isotropic(E, NU, "AXIS"), 1.3, -0.7
    exact = points * [a, b]
    skin = np.unique(np.concatenate([f.nodes.ravel() for f in topology.boundary([(name, cells)]).values()]))
    K = assembly.assemble(
        len(points), 2, [(cells, elasticity.element_stiffness(each, points[cells], D, axisymmetric=True))]
    )
    reduction = reduce_conditions(fixed((skin[:, None] * 2 + [0, 1]).ravel(), points.size), exact[skin].ravel())
    load = reduction.load(K, np.zeros(points.size))
    u = reduction.expand(np.linalg.solve(reduction.matrix(K).toarray(), load)).reshape(-1, 2)
    assert np.allclose(u, exact, atol=1e-12 * np.abs(exact).max())
    strain = elasticity.strains(each, points[cells], u[cells], each.gauss[0], axisymmetric=True)
    assert np.allclose(strain, [a, b, a, 0], atol=1e-11)


@pytest.mark.parametrize("name", PLANE)
def test_axisymmetric_rigid_mode_and_forces(name: str) -> None:
    """Only the translation along the axis is free; internal forces are the stiffness times the displacement."""
    points, cells = meridian(name, 4)
    each, D, X = SHAPES[name], isotropic(E, NU, "AXIS"), points[cells]
    Ke = elasticity.element_stiffness(each, X, D, axisymmetric=True)
    K = assembly.assemble(len(points), 2, [(cells, Ke)]).toarray()
    values, vectors = np.linalg.eigh(K)
    assert abs(values[0]) < 1e-12 * values[-1]
    assert values[1] > 1e-6 * values[-1]
    assert np.allclose(np.abs(vectors[:, 0].reshape(-1, 2)), [0, 1 / np.sqrt(len(points))], atol=1e-9)
    u = np.random.default_rng(6).standard_normal(points.shape)
    stress = elasticity.stresses(elasticity.strains(each, X, u[cells], each.gauss[0], axisymmetric=True), D)
    forces = elasticity.internal_forces(each, X, stress, axisymmetric=True)
    expected = (Ke @ u[cells].reshape(len(cells), -1, 1)).reshape(forces.shape)
    assert np.allclose(forces, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("name", PLANE)
def test_axisymmetric_pressure_and_volume(name: str) -> None:
    """Under pressure all round, the force along the axis vanishes; volume, mass and body force agree with Guldin."""
    points, cells = meridian(name, 8)
    each = SHAPES[name]
    total = np.zeros(2)
    for face, facets in topology.boundary([(name, cells)]).items():
        total += integrals.pressure_load(SHAPES[face], points[facets.nodes], 3.0, axisymmetric=True).sum(axis=(0, 1))
    assert abs(total[1]) < 1e-11
    points, cells = box(name, (3, 2))
    points = points + [1.0, 0.0]
    volume = np.pi * (4.0**2 - 1.0**2) * 2.0
    X = points[cells]
    mass = integrals.element_mass(each, X, 2.0, axisymmetric=True)
    assert mass.sum() == pytest.approx(2 * volume)
    assert integrals.lumped_mass(each, X, 2.0, axisymmetric=True).sum() == pytest.approx(2 * volume)
    weight = integrals.distributed_load(each, X, np.array([0.0, -1.0]), axisymmetric=True)
    assert weight.sum(axis=(0, 1)) == pytest.approx([0.0, -volume])


def test_a_negative_radius_is_refused() -> None:
    points, cells = mesh("QUA4", 1)
    with pytest.raises(BadValue):
        elasticity.element_stiffness(
            SHAPES["QUA4"], points[cells] - [1.0, 0.0], isotropic(E, NU, "AXIS"), axisymmetric=True
        )


@pytest.mark.parametrize("name", NAMES)
def test_lumped_masses_are_positive_and_whole(name: str) -> None:
    points, cells = mesh(name, 9)
    lumped = integrals.lumped_mass(SHAPES[name], points[cells], 3.0)
    assert np.all(lumped > 0)
    assert np.allclose(lumped.sum(axis=1), 3.0 * geometry.measures(SHAPES[name], points[cells]))


@pytest.mark.parametrize(
    ("name", "shares"),
    [
        ("SEG3", [1 / 6, 1 / 6, 2 / 3]),
        ("TRI6", [0, 0, 0, 1 / 3, 1 / 3, 1 / 3]),
        ("QUA8", [-1 / 12] * 4 + [1 / 3] * 4),
    ],
)
def test_shares_of_a_uniform_pressure_on_quadratic_facets(name: str, shares: list[float]) -> None:
    """Flat facets: corners of QUA8 are pulled, those of TRI6 feel nothing."""
    each = SHAPES[name]
    X = np.zeros((1, each.n_nodes, each.dim + 1))
    X[0, :, : each.dim] = each.ref_nodes
    forces = integrals.pressure_load(each, X, 1.0)[0]
    normal = forces @ forces.sum(axis=0) / np.linalg.norm(forces.sum(axis=0))
    assert np.allclose(normal, np.array(shares) * geometry.measures(each, X)[0], atol=1e-14)
