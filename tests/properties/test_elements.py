"""Properties that every reference shape of the table must have; a new shape is tested by being listed."""

from itertools import product
from math import factorial

import gmsh
import meshio
import numpy as np
import pytest
from scipy.special import beta

from gibiane_ops.kernels import geometry, quadrature
from gibiane_ops.kernels.elements.quadratic import QUADRATIC
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import BY_MESHIO, SHAPES, quadratic
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.quadrature import Rule

EVERY = list(SHAPES.values())
SOLID = [each for each in EVERY if each.dim > 0]
LINEAR = {quadratic(name).name: SHAPES[name] for name in QUADRATIC}


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
    **dict.fromkeys(("SEG2", "SEG3", "QUA4", "QUA8", "CUB8", "CU20"), "cube"),
    **dict.fromkeys(("TRI3", "TRI6", "TET4", "TE10"), "simplex"),
    **dict.fromkeys(("PYR5", "PY13"), "pyramid"),
    **dict.fromkeys(("PRI6", "PR15"), "prism"),
}
RULES: list[tuple[str, Rule]] = [
    *((DOMAINS[each.name], rule) for each in EVERY for rule in (each.stiffness_rule, each.mass_rule)),
    ("cube", quadrature.line(5)),
    ("cube", quadrature.square(3)),
    ("cube", quadrature.cube(3)),
    ("simplex", quadrature.triangle(4)),
    ("simplex", quadrature.tetrahedron(5)),
    ("prism", quadrature.prism(4, 3)),
    ("pyramid", quadrature.pyramid(4)),
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
def test_polynomials_of_the_degree_are_reproduced(each: Shape) -> None:
    xi = inside(each)
    for powers in product(range(each.degree + 1), repeat=each.dim):
        if sum(powers) <= each.degree:
            nodal = np.prod(each.ref_nodes ** np.array(powers), axis=1)
            assert np.allclose(each.N(xi) @ nodal, np.prod(xi ** np.array(powers), axis=1), atol=1e-13)


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
    corners = LINEAR.get(each.name, each)
    for rule in (each.stiffness_rule, each.mass_rule):
        assert np.all(rule.weights > 0)
        assert np.all(corners.N(rule.points) > -1e-14)


@pytest.mark.parametrize("each", EVERY, ids=by_name)
def test_mass_rule_is_exact_for_the_products(each: Shape) -> None:
    """The products of shape functions are integrated as by a much finer rule."""
    fine = {"point": quadrature.point, "simplex": _fine_simplex, "cube": _fine_cube, "prism": _fine_prism,
            "pyramid": lambda: quadrature.pyramid(6)}[DOMAINS[each.name]]  # fmt: skip
    rule = fine(each.dim) if DOMAINS[each.name] in ("simplex", "cube") else fine()
    (points, weights), N = each.mass_gauss, each.N
    assert np.allclose(
        (N(points).T * weights) @ N(points), (N(rule.points).T * rule.weights) @ N(rule.points), atol=1e-13
    )


def _fine_cube(dim: int) -> Rule:
    return (quadrature.line, quadrature.square, quadrature.cube)[dim - 1](6)


def _fine_simplex(dim: int) -> Rule:
    """Fold the square or the cube onto the simplex (Duffy): exact for polynomials of moderate degree."""
    t = (_fine_cube(dim).points + 1) / 2
    weights = _fine_cube(dim).weights / 2**dim
    if dim == 2:
        return Rule(np.c_[t[:, 0], t[:, 1] * (1 - t[:, 0])], weights * (1 - t[:, 0]), 9, "Duffy")
    x, y = t[:, 0], t[:, 1] * (1 - t[:, 0])
    z = t[:, 2] * (1 - x - y)
    return Rule(np.c_[x, y, z], weights * (1 - x) * (1 - x - y), 9, "Duffy")


def _fine_prism() -> Rule:
    flat, tall = _fine_simplex(2), quadrature.line(6)
    points = np.hstack([np.tile(flat.points, (6, 1)), np.repeat(tall.points, len(flat.points), 0)])
    return Rule(points, np.outer(tall.weights, flat.weights).ravel(), 9, "product")


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


GMSH_ORDER = {
    "CU20": (0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15),
    "PR15": (0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11),
    "PY13": (0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12),
    "TE10": (0, 1, 2, 3, 4, 5, 6, 7, 9, 8),
}
"""Where a node stands in the numbering of gmsh, for the shapes that it numbers otherwise."""


@pytest.mark.parametrize("each", EVERY, ids=by_name)
def test_numbering_is_that_of_gmsh(each: Shape, gmsh_session) -> None:
    _, dim, order, n_nodes, coordinates, n_corners = gmsh_session.model.mesh.getElementProperties(each.gmsh_type)
    assert (dim, n_nodes, n_corners) == (each.dim, each.n_nodes, each.n_corners)
    assert order == each.degree
    if each.dim:
        order_of_gmsh = list(GMSH_ORDER.get(each.name) or range(each.n_nodes))
        assert np.allclose(np.reshape(coordinates, (n_nodes, dim))[order_of_gmsh], each.ref_nodes)


@pytest.mark.parametrize("each", EVERY, ids=by_name)
def test_meshio_knows_the_cell(each: Shape) -> None:
    assert meshio.gmsh.meshio_to_gmsh_type[each.meshio_name] == each.gmsh_type
    assert meshio._mesh.topological_dimension.get(each.meshio_name, 3) == each.dim


@pytest.mark.parametrize("each", [s for s in SOLID if s.degree == 2], ids=by_name)
def test_numbering_is_that_of_vtk(each: Shape) -> None:
    """The numbering of meshio is that of VTK, to which it turns the one of gmsh."""
    cells = np.arange(each.n_nodes)[None]
    turned = meshio.gmsh.common._gmsh_to_meshio_order(each.meshio_name, cells)[0]
    assert tuple(turned) == (GMSH_ORDER.get(each.name) or tuple(range(each.n_nodes)))


@pytest.mark.parametrize("name", QUADRATIC)
def test_mid_nodes_are_in_the_middle_of_the_edges(name: str) -> None:
    linear, each = SHAPES[name], quadratic(name)
    assert each.n_corners == linear.n_nodes
    assert np.array_equal(each.ref_nodes[: each.n_corners], linear.ref_nodes)
    for a, b, middle in each.edges:
        assert np.allclose(each.ref_nodes[middle], (each.ref_nodes[a] + each.ref_nodes[b]) / 2)
    for face, nodes in each.faces:
        if each.dim > 1:
            face_nodes = each.ref_nodes[list(nodes)]
            for a, b, middle in SHAPES[face].edges:
                assert np.allclose(face_nodes[middle], (face_nodes[a] + face_nodes[b]) / 2)


def test_a_quadratic_shape_has_no_quadratic_shape() -> None:
    with pytest.raises(BadValue):
        quadratic("CU20")


@pytest.mark.parametrize("each", [s for s in SOLID if s.dim == 3], ids=by_name)
def test_the_trace_on_a_face_is_that_of_the_face(each: Shape) -> None:
    """Neighbours of different shapes meet without a gap: on a face only its nodes count, with its own functions."""
    for name, nodes in each.faces:
        face = SHAPES[name]
        eta = inside(face)
        xi = face.N(eta) @ each.ref_nodes[list(nodes)]
        values = each.N(xi)
        assert np.allclose(values[:, list(nodes)], face.N(eta), atol=1e-12)
        assert np.allclose(np.delete(values, list(nodes), axis=1), 0.0, atol=1e-12)


def test_names_and_codes_are_unique() -> None:
    assert set(DOMAINS) == set(SHAPES)
    assert len({each.gmsh_type for each in EVERY}) == len(BY_MESHIO) == len(SHAPES)
    assert all(name == each.name for name, each in SHAPES.items())
