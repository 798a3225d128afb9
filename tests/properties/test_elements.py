"""Properties that every reference shape of the table must have; a new shape is tested by being listed."""

from itertools import product
from math import factorial

import gmsh
import meshio
import numpy as np
import pytest
from scipy.special import beta

from gibiane_ops.kernels import geometry, quadrature
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import BY_GMSH, BY_MESHIO, SHAPES
from gibiane_ops.kernels.quadrature import Rule

EVERY = list(SHAPES.values())
SOLID = [each for each in EVERY if each.dim > 0]


def by_name(each: Shape) -> str:
    return each.name


def inside(each: Shape, count: int = 20) -> np.ndarray:
    """Random points inside the shape, as averages of its corners."""
    weights = np.random.default_rng(2).dirichlet(np.ones(each.n_corners), count)
    return weights @ each.ref_nodes[: each.n_corners]


def monomial_integral(domain: str, powers: tuple[int, ...]) -> float:
    """Exact integral of a monomial over a reference domain."""

    def on_segment(a: int) -> float:
        return 0.0 if a % 2 else 2.0 / (a + 1)

    def on_simplex(*p: int) -> float:
        return float(np.prod([factorial(a) for a in p])) / factorial(sum(p) + len(p))

    match domain:
        case "simplex":
            return on_simplex(*powers)
        case "cube":
            return float(np.prod([on_segment(a) for a in powers]))
        case "prism":
            return on_simplex(*powers[:2]) * on_segment(powers[2])
        case "pyramid":
            a, b, c = powers
            return on_segment(a) * on_segment(b) * float(beta(c + 1, a + b + 3))
        case _:
            return 1.0


DOMAINS = {
    "POI1": "point",
    "SEG2": "cube",
    "TRI3": "simplex",
    "QUA4": "cube",
    "TET4": "simplex",
    "PYR5": "pyramid",
    "PRI6": "prism",
    "CUB8": "cube",
}
RULES: list[tuple[str, Rule]] = [
    *((DOMAINS[each.name], rule) for each in EVERY for rule in (each.stiffness_rule, each.mass_rule)),
    ("cube", quadrature.line(5)),
    ("cube", quadrature.square(3)),
    ("cube", quadrature.cube(3)),
    ("simplex", quadrature.triangle(4)),
    ("prism", quadrature.prism(4, 3)),
]


@pytest.mark.parametrize("each", EVERY, ids=by_name)
def test_partition_of_unity(each: Shape) -> None:
    xi = inside(each)
    assert np.allclose(each.N(xi).sum(axis=1), 1.0, atol=1e-14)
    assert np.allclose(each.dN(xi).sum(axis=1), 0.0, atol=1e-13)


@pytest.mark.parametrize("each", EVERY, ids=by_name)
def test_kronecker(each: Shape) -> None:
    assert np.allclose(each.N(each.ref_nodes), np.eye(each.n_nodes), atol=1e-13)


@pytest.mark.parametrize("each", SOLID, ids=by_name)
def test_linear_fields_are_reproduced(each: Shape) -> None:
    xi = inside(each)
    assert np.allclose(each.N(xi) @ each.ref_nodes, xi, atol=1e-13)


@pytest.mark.parametrize("each", SOLID, ids=by_name)
def test_derivatives_against_finite_differences(each: Shape) -> None:
    xi, step = inside(each), 1e-6
    for i in range(each.dim):
        move = step * np.eye(each.dim)[i]
        difference = (each.N(xi + move) - each.N(xi - move)) / (2 * step)
        assert np.allclose(each.dN(xi)[:, :, i], difference, atol=1e-8)


@pytest.mark.parametrize(("domain", "rule"), RULES, ids=lambda value: value if isinstance(value, str) else "")
def test_quadrature_reaches_its_degree(domain: str, rule: Rule) -> None:
    dim = rule.points.shape[1]
    degree = min(rule.degree, 9)
    for powers in product(range(degree + 1), repeat=dim):
        if sum(powers) <= degree:
            value = rule.weights @ np.prod(rule.points ** np.array(powers), axis=1)
            assert value == pytest.approx(monomial_integral(domain, powers), abs=1e-14), powers


@pytest.mark.parametrize("each", SOLID, ids=by_name)
def test_quadrature_claims_no_less_than_it_gives(each: Shape) -> None:
    """Weights are positive and points inside: no cancellation, no evaluation outside the cell."""
    for rule in (each.stiffness_rule, each.mass_rule):
        assert np.all(rule.weights > 0)
        assert np.all(each.N(rule.points) > -1e-14)


@pytest.mark.parametrize("each", [s for s in SOLID if s.dim >= 2], ids=by_name)
def test_faces_look_outward_and_close(each: Shape) -> None:
    centre = each.ref_nodes[: each.n_corners].mean(axis=0)
    total, flux = np.zeros(each.dim), 0.0
    for name, nodes in each.faces:
        face, X = SHAPES[name], each.ref_nodes[list(nodes)][None]
        assert face.dim == each.dim - 1
        points, weights = face.mass_gauss
        density = geometry.normal_densities(face, X, points)[0]
        positions = geometry.positions(face, X, points)[0]
        assert np.all((density * (positions - centre)).sum(axis=1) > 0)
        total += weights @ density
        flux += float(weights @ (density * positions).sum(axis=1))
    assert np.allclose(total, 0.0, atol=1e-14)
    # Divergence theorem on the position: dim times the volume.
    assert flux == pytest.approx(each.dim * each.stiffness_rule.weights.sum())


@pytest.mark.parametrize("each", [s for s in SOLID if s.dim >= 2], ids=by_name)
def test_edges_are_those_of_the_faces(each: Shape) -> None:
    of_faces = (
        {frozenset(nodes[i] for i in edge[:2]) for name, nodes in each.faces for edge in SHAPES[name].edges}
        if each.dim == 3
        else {frozenset(nodes[:2]) for _, nodes in each.faces}
    )
    assert {frozenset(edge[:2]) for edge in each.edges} == of_faces
    assert len(each.edges) == len(of_faces)


@pytest.mark.parametrize("each", SOLID, ids=by_name)
def test_measure_of_the_reference_shape(each: Shape) -> None:
    X = each.ref_nodes[None]
    assert geometry.measures(each, X) == pytest.approx([each.mass_rule.weights.sum()])
    geometry.check_cells(each, X)


@pytest.fixture(scope="module")
def gmsh_session():
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh
    gmsh.finalize()


@pytest.mark.parametrize("each", EVERY, ids=by_name)
def test_numbering_is_that_of_gmsh(each: Shape, gmsh_session) -> None:
    _, dim, order, n_nodes, coordinates, n_corners = gmsh_session.model.mesh.getElementProperties(each.gmsh_type)
    assert (dim, n_nodes, n_corners) == (each.dim, each.n_nodes, each.n_corners)
    assert order == each.degree
    if each.dim:
        assert np.allclose(np.reshape(coordinates, (n_nodes, dim)), each.ref_nodes)


@pytest.mark.parametrize("each", EVERY, ids=by_name)
def test_meshio_knows_the_cell(each: Shape) -> None:
    block = meshio.CellBlock(each.meshio_name, np.arange(each.n_nodes)[None])
    assert block.dim == each.dim
    assert meshio.gmsh.meshio_to_gmsh_type[each.meshio_name] == each.gmsh_type


def test_names_and_codes_are_unique() -> None:
    assert set(DOMAINS) == set(SHAPES)
    assert len(BY_GMSH) == len(BY_MESHIO) == len(SHAPES)
    assert all(name == each.name for name, each in SHAPES.items())
