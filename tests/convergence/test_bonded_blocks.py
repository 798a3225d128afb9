"""Energy of two bonded cubes, against reference values computed independently.

A cube of side 50 mm stands centred on a cube of side 200 mm whose base is clamped; 3.125 MPa push on its top.
E = 210000 MPa, nu = 0.3; (2n)^3 and (8n)^3 CUB8 of side h = 25 mm / n.
"""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels import assembly, elasticity, integrals
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.solve import factorize


def cube(side: float, bottom: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    across, up = np.linspace(-side / 2, side / 2, n + 1), np.linspace(bottom, bottom + side, n + 1)
    points = np.stack(np.meshgrid(across, across, up, indexing="ij"), -1).reshape(-1, 3)
    number = np.arange((n + 1) ** 3).reshape((n + 1,) * 3)
    corners = shape("CUB8").ref_nodes > 0
    cells = np.stack([number[tuple(slice(int(c), int(c) + n) for c in corner)] for corner in corners], -1)
    return points, cells.reshape(-1, 8)


def blocks(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, cells, and the pairs of coincident contact nodes (upper, lower)."""
    lower, lower_cells = cube(200.0, -200.0, 8 * n)
    upper, upper_cells = cube(50.0, 0.0, 2 * n)
    points = np.vstack([lower, upper])
    below = {tuple(np.round(points[i], 6)): i for i in np.flatnonzero(lower[:, 2] == 0)}
    above = np.flatnonzero(points[len(lower) :, 2] == 0) + len(lower)
    pairs = np.array([(i, below[tuple(np.round(points[i], 6))]) for i in above])
    return points, np.vstack([lower_cells, upper_cells + len(lower)]), pairs


def energy(n: int, merged: bool) -> float:
    points, cells, pairs = blocks(n)
    top = cells[:, [4, 5, 6, 7]]
    top = top[np.all(points[top][:, :, 2] == 50.0, axis=1)]
    D = isotropic(210000.0, 0.3)
    blocks_of = [(cells, elasticity.element_stiffness(shape("CUB8"), points[cells], D))]
    forces = integrals.pressure_load(shape("QUA4"), points[top], 3.125)
    base = np.flatnonzero(points[:, 2] == -200.0)
    unknowns = (base[:, None] * 3 + np.arange(3)).ravel()
    if merged:
        name = np.arange(len(points))
        name[pairs[:, 0]] = pairs[:, 1]
        used, place = np.unique(name, return_inverse=True)
        blocks_of = [(place[c], Ke) for c, Ke in blocks_of]
        top, unknowns, size = place[top], (place[base][:, None] * 3 + np.arange(3)).ravel(), len(used)
        ties = sp.csr_array((0, 3 * size))
    else:
        size = len(points)
        entries = (pairs[:, :, None] * 3 + np.arange(3)).transpose(0, 2, 1)
        rows = np.repeat(np.arange(3 * len(pairs)), 2)
        ties = sp.csr_array(
            (np.tile([1.0, -1.0], 3 * len(pairs)), (rows, entries.ravel())), shape=(3 * len(pairs), 3 * size)
        )
    K = assembly.assemble(size, 3, blocks_of)
    F = assembly.assemble_vector(size, 3, [(top, forces)])
    clamped = (np.ones(len(unknowns)), (np.arange(len(unknowns)), unknowns))
    C = sp.vstack([sp.csr_array(clamped, shape=(len(unknowns), 3 * size)), ties])
    reduction = reduce_conditions(C)
    u = reduction.expand(factorize(reduction.matrix(K)).solve(reduction.load(K, F)))
    r = reduction.reactions(K, u, F).reshape(-1, 3)
    assert r.sum(axis=0) == pytest.approx([0, 0, 3.125 * 2500], abs=1e-6)
    return float(u @ (K @ u))


@pytest.mark.parametrize(("n", "reference"), [(1, 9.295589), (2, 9.7342468)])
def test_energy_with_merged_nodes(n: int, reference: float) -> None:
    assert energy(n, merged=True) == pytest.approx(reference, rel=1e-7)


def test_energy_with_ties_instead_of_merged_nodes() -> None:
    assert energy(1, merged=False) == pytest.approx(energy(1, merged=True), rel=1e-11)
