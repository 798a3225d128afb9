"""Error of two cubes in contact, against values of an independent program, and its decrease with the size."""

from functools import lru_cache

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels import recovery
from gibiane_ops.kernels.assembly import assemble, assemble_vector
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.contact.condense import condense
from gibiane_ops.kernels.contact.newton import solve_coulomb, solve_tied
from gibiane_ops.kernels.contact.node_pairs import node_pairs
from gibiane_ops.kernels.elasticity import element_stiffness, strains, stresses
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.combine import combine, facets_to_cells
from gibiane_ops.kernels.estimate.contact import contact_error
from gibiane_ops.kernels.estimate.zz import solid_error
from gibiane_ops.kernels.integrals import pressure_load
from gibiane_ops.kernels.materials import compliance, isotropic
from gibiane_ops.kernels.recovery import StressBlock
from gibiane_ops.kernels.topology import boundary

CUB8, QUA4 = shape("CUB8"), shape("QUA4")
E, NU = 210000.0, 0.3


def brick(low, high, n, start):
    """Nodes and CUB8 of a box with n elements along each side."""
    axes = [np.linspace(low[i], high[i], n + 1) for i in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = start + np.arange((n + 1) ** 3).reshape(n + 1, n + 1, n + 1)
    corner = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    return points, np.stack([number[i : n + i, j : n + j, k : n + k].ravel() for i, j, k in corner], axis=1)


class Scene:
    """Cube of the given side centred on a cube of side 200, base clamped, 3.125 down on the top."""

    def __init__(self, side, n_low, n_high):
        half = side / 2
        low, cells_low = brick((-100, -100, -200), (100, 100, 0), n_low, 0)
        high, cells_high = brick((-half, -half, 0), (half, half, side), n_high, len(low))
        self.points = points = np.vstack([low, high])
        self.solids = [cells_low, cells_high]
        D = isotropic(E, NU, "TRID")
        blocks = []
        for cells in self.solids:
            one = element_stiffness(CUB8, points[cells[:1]], D)
            blocks.append((cells, np.broadcast_to(one, (len(cells), 24, 24))))
        K = assemble(len(points), 3, blocks)
        skins = [boundary([("CUB8", cells)])["QUA4"].nodes for cells in self.solids]

        def at(skin, z):
            return skin[np.abs(points[skin][:, :, 2] - z).max(axis=1) < 1e-6]

        top = at(skins[1], side)
        F = assemble_vector(len(points), 3, [(top, pressure_load(QUA4, points[top], 3.125))]).ravel()
        self.slave = at(skins[1], 0)
        self.pairs = node_pairs(points, [("QUA4", self.slave)], [("QUA4", at(skins[0], 0))])
        base = np.flatnonzero(np.abs(points[:, 2] + 200) < 1e-6)
        dofs = (3 * base[:, None] + np.arange(3)).ravel()
        C = sp.csr_array((np.ones(len(dofs)), (np.arange(len(dofs)), dofs)), shape=(len(dofs), 3 * len(points)))
        self.interface = condense(K, self.pairs, reduce_conditions(C)).interface(F)

    def solve(self, mu):
        state = solve_tied(self.interface) if mu is None else solve_coulomb(self.interface, mu)
        U = self.interface.expand(state.w).reshape(-1, 3)
        D = isotropic(E, NU, "TRID")
        xi = CUB8.gauss[0]
        blocks = [
            StressBlock(CUB8, cells, stresses(strains(CUB8, self.points[cells], U[cells], xi), D))
            for cells in self.solids
        ]
        return state, blocks

    def contact(self, state, mu, variant="DENS"):
        return contact_error(
            self.points, [("QUA4", self.slave)], self.pairs.pairs[:, 0], self.interface.frames,
            state.r, state.w, self.pairs.gap, mu, variant,
        )  # fmt: skip

    def error(self, mu, method="MOYE", norm="THES"):
        state, blocks = self.solve(mu)
        S = compliance(E, NU, "TRID")
        parts = [
            solid_error(self.points, block, recovery.recover(self.points, [block], method).nodal, S) for block in blocks
        ]
        if mu is None:
            return combine(parts, norm=norm)
        partner = np.full(len(self.points), -1)
        partner[self.pairs.pairs[:, 0]] = self.pairs.pairs[:, 1]
        cells = [("CUB8", each) for each in self.solids]
        facets = [("QUA4", self.slave)]
        return combine(parts, facets_to_cells(cells, facets, self.contact(state, mu).facet, partner), norm)


@lru_cache
def small_cube(n):
    """Upper side 50, elements of size 25 / n."""
    return Scene(50.0, 8 * n, 2 * n)


@lru_cache
def equal_cubes(n):
    return Scene(200.0, n, n)


@pytest.mark.parametrize(
    ("mu", "n", "total", "contact"),
    [
        (0.01, 1, 8.83, 0.63), (0.1, 1, 8.82, 1.69), (0.2, 1, 8.83, 1.87), (0.3, 1, 8.90, 1.51),
        (0.5, 1, 8.91, 0.0), (0.01, 2, 6.06, 0.48), (0.2, 2, 6.13, 1.40), (0.3, 2, 6.17, 1.17),
    ],
)  # fmt: skip
def test_published_percentages(mu, n, total, contact):
    found = small_cube(n).error(mu)
    assert 100 * found.total == pytest.approx(total, abs=0.0051)
    assert 100 * found.contact == pytest.approx(contact, abs=0.0051)
    assert found.total**2 == pytest.approx(found.solid**2 + found.contact**2, rel=1e-12)
    assert sum((each**2).sum() for each in found.total_map) == pytest.approx(found.total**2, rel=1e-12)


def test_equal_cubes_in_contact():
    # They stick everywhere: no contact error, and a mesh error known to three digits.
    for n, percent in ((2, 2.49), (4, 2.02), (8, 1.40)):
        found = equal_cubes(n).error(0.2)
        assert 100 * found.solid == pytest.approx(percent, abs=0.0051)
        assert found.contact < 1e-8


def test_sum_over_the_nodes_vanishes_for_an_exact_solution():
    scene = small_cube(2)
    state, _ = scene.solve(0.2)
    reference = scene.contact(state, 0.2).total
    assert scene.contact(state, 0.2, "NODE").total < 1e-10 * reference
    assert 0 < scene.contact(state, 0.2, "DLUM").total < reference


def test_contact_error_decreases_with_the_size():
    errors = [small_cube(n).error(0.2).contact for n in (1, 2)]
    assert errors[1] < 0.8 * errors[0]


@pytest.mark.slow
@pytest.mark.parametrize("mu", [0.01, 0.1, 0.2, 0.3])
def test_contact_error_decreases_on_fine_meshes(mu):
    errors = [small_cube(n).error(mu).contact for n in (1, 2, 3, 4)]
    assert errors[0] > errors[1] > errors[2] > errors[3]
    assert errors[3] < 0.5 * errors[0]


# Energies of the exact solutions, extrapolated from three nested meshes down to 3 mm (about 1 % on the error).
@pytest.mark.parametrize(
    ("scene", "n", "exact", "method", "theta"),
    [
        (small_cube, 1, 10.133, "MOYE", 0.58), (small_cube, 1, 10.133, "PROJ", 0.53),
        (small_cube, 1, 10.133, "SPR", 0.81), (small_cube, 1, 10.133, "MOYC", 0.85),
        (small_cube, 1, 10.133, "FULL", 0.69),
        (small_cube, 2, 10.133, "MOYE", 0.61), (small_cube, 2, 10.133, "PROJ", 0.57),
        (small_cube, 2, 10.133, "SPR", 0.78), (small_cube, 2, 10.133, "MOYC", 0.84),
        (small_cube, 2, 10.133, "FULL", 0.68),
        (equal_cubes, 2, 733.087, "MOYE", 0.43), (equal_cubes, 2, 733.087, "PROJ", 0.37),
        (equal_cubes, 2, 733.087, "SPR", 0.84), (equal_cubes, 2, 733.087, "MOYC", 0.91),
        (equal_cubes, 2, 733.087, "FULL", 0.73),
        (equal_cubes, 4, 733.087, "MOYE", 0.55), (equal_cubes, 4, 733.087, "PROJ", 0.49),
        (equal_cubes, 4, 733.087, "SPR", 0.78), (equal_cubes, 4, 733.087, "MOYC", 0.93),
        (equal_cubes, 4, 733.087, "FULL", 0.67),
        (equal_cubes, 8, 733.087, "MOYE", 0.60), (equal_cubes, 8, 733.087, "PROJ", 0.54),
        (equal_cubes, 8, 733.087, "SPR", 0.81), (equal_cubes, 8, 733.087, "MOYC", 0.93),
        (equal_cubes, 8, 733.087, "FULL", 0.68),
    ],
)  # fmt: skip
def test_effectivity_on_tied_cubes(scene, n, exact, method, theta):
    found = scene(n).error(None, method, "USUE")
    true = np.sqrt(exact - found.energy)
    assert found.absolute / true == pytest.approx(theta, abs=0.011)
