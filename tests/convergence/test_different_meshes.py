"""Contact between different meshes: exact cases, coincident meshes, and the rate of the error in energy."""

import numpy as np
import pytest
from two_blocks import blocks, fixing
from two_grids import Boxes

from gibiane_ops.kernels.assembly import assemble, assemble_vector
from gibiane_ops.kernels.contact.condense import condense
from gibiane_ops.kernels.contact.mortar import mortar_pairs
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.node_facet import node_facet_pairs
from gibiane_ops.kernels.elasticity import element_stiffness
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.integrals import pressure_load
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.quadrature import line


@pytest.mark.parametrize("make", [mortar_pairs, node_facet_pairs])
@pytest.mark.parametrize(("name", "mu"), [("T1_1", 0.2), ("T1_2", 0.1), ("T4_4", 0.05)])
def test_coincident_meshes_have_the_solution_of_node_pairs(make, name, mu) -> None:
    scene = blocks(name)
    pairs = make(scene.points, [("QUA4", scene.slave)], [("QUA4", scene.master)])
    order = np.argsort(scene.pairs.pairs[:, 0])
    np.testing.assert_array_equal(pairs.pairs[:, 0], scene.pairs.pairs[order, 0])
    interface = condense(scene.K, pairs, scene.reduction).interface(scene.F)
    state, plain = solve_coulomb(interface, mu), solve_coulomb(scene.interface, mu)
    u, v = interface.expand(state.w), scene.interface.expand(plain.w)
    assert np.abs(u - v).max() < 1e-8 * np.abs(v).max()
    assert np.abs(state.r - plain.r[order]).max() < 1e-8 * np.abs(plain.r).max()


@pytest.mark.parametrize(("kind", "n1", "n2"), [("TET4", 3, 4), ("TET4", 4, 3), ("CUB8", 3, 4), ("CUB8", 5, 3)])
@pytest.mark.parametrize("turn", [0.0, 15.0])
def test_uniform_stress_through_bent_meshes(kind, n1, n2, turn) -> None:
    boxes = Boxes(kind, n1, n2, seed=4, turn=turn)
    pairs = mortar_pairs(boxes.points, boxes.slave, boxes.master)
    loads = [(c, pressure_load(shape(n), boxes.points[c], 1.0)) for n, c in boxes.top]
    loads += [(c, pressure_load(shape(n), boxes.points[c], 1.0)) for n, c in boxes.base]
    F = assemble_vector(len(boxes.points), 3, loads).ravel()
    # three corners of the base hold the rigid motions, without reaction
    corner = [int(np.abs(boxes.flat - x).sum(axis=1).argmin()) for x in ([0, 0, -1], [1, 0, -1], [0, 1, -1])]
    held = [3 * corner[0] + np.arange(3), 3 * corner[1] + 1, 3 * corner[2] + 2, 3 * corner[1] + 2]
    reduction = fixing(np.concatenate([np.ravel(h) for h in held]), len(F))
    interface = condense(boxes.K, pairs, reduction).interface(F)
    state = solve_coulomb(interface, 0.3)
    U = interface.expand(state.w).reshape(-1, 3)
    for solid in boxes.solids:
        nodes = np.unique(solid[0][1])
        linear = np.column_stack([np.ones(len(nodes)), boxes.points[nodes]])
        fitted = np.linalg.lstsq(linear, U[nodes], rcond=None)[0]
        strain = (fitted[1:] + fitted[1:].T) / 2
        normal = boxes.rotation @ [0, 0, 1.0]
        exact = (0.3 * np.eye(3) - 1.3 * np.outer(normal, normal)) / 1000.0
        np.testing.assert_allclose(strain, exact, atol=1e-10 * 1e-3)
        assert np.abs(linear @ fitted - U[nodes]).max() < 1e-10 * np.abs(U).max()
    np.testing.assert_allclose(-state.r[:, 0] / pairs.area, 1.0, rtol=1e-10)


def column(n1, n2):
    """Energy of two unit squares, one on the other, between rollers, pressed by 1 + cos(pi x) / 2 without friction."""
    points, cells, start = [], [], 0
    for n, low in ((n1, 0.0), (n2, -1.0)):
        g = np.linspace(0, 1, n + 1)
        points.append(np.stack(np.meshgrid(g, low + g, indexing="ij"), axis=-1).reshape(-1, 2))
        number = start + np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
        cells.append(np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], -1).reshape(-1, 4))
        start += (n + 1) ** 2
    x = np.vstack(points)
    D = isotropic(1000.0, 0.3, "DEFO")
    K = assemble(len(x), 2, [(c, element_stiffness(shape("QUA4"), x[c], D)) for c in cells])

    def row(first, n, y):
        nodes = first + np.flatnonzero(np.abs(x[first : first + (n + 1) ** 2, 1] - y) < 1e-9)
        return np.column_stack([nodes[:-1], nodes[1:]])

    upper, lower, top = row(0, n1, 0.0), row((n1 + 1) ** 2, n2, 0.0)[:, ::-1], row(0, n1, 1.0)
    F = np.zeros(len(x) * 2)
    xi, w = line(4).points, line(4).weights
    N = shape("SEG2").N(xi)
    for a, b in top:
        at = N @ x[[a, b], 0]
        F[[2 * a + 1, 2 * b + 1]] -= N.T @ (w * (1 + 0.5 * np.cos(np.pi * at))) / (2 * n1)
    sides = np.flatnonzero((x[:, 0] < 1e-9) | (x[:, 0] > 1 - 1e-9))
    base = np.flatnonzero(np.abs(x[:, 1] + 1) < 1e-9)
    reduction = fixing(np.concatenate([2 * sides, 2 * base + 1]), len(F))
    pairs = mortar_pairs(x, [("SEG2", upper)], [("SEG2", lower)])
    interface = condense(K, pairs, reduction).interface(F)
    state = solve_coulomb(interface, 0.0)
    assert (state.r[:, 0] < 0).all()
    return float(interface.expand(state.w) @ F)


def test_error_in_energy_falls_as_with_matching_meshes() -> None:
    matching = {n: column(n, n) for n in (4, 8, 16, 32)}
    # Richardson: the energy of an exact solution without singularity is of order h^2 away
    exact = matching[32] + (matching[32] - matching[16]) / 3

    def rate(energies):
        errors = np.sqrt(np.abs(exact - np.array(energies)))
        return np.log2(errors[0] / errors[1])

    plain = rate([matching[8], matching[16]])
    assert plain == pytest.approx(1.0, abs=0.1)
    for ratio in (1.5, 0.5, 3.0):
        found = rate([column(8, int(8 * ratio)), column(16, int(16 * ratio))])
        assert found == pytest.approx(plain, abs=0.1)
