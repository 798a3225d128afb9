"""Adaptive meshes of two cubes in contact: prescribed error, number of elements and number of passes."""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels import recovery
from gibiane_ops.kernels.adapt.orders import singular_orders
from gibiane_ops.kernels.adapt.sizes import size_map
from gibiane_ops.kernels.assembly import assemble, assemble_vector
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.contact.condense import condense
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.node_pairs import node_pairs
from gibiane_ops.kernels.elasticity import element_stiffness, strains, stresses
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.combine import combine, facets_to_cells
from gibiane_ops.kernels.estimate.contact import contact_error
from gibiane_ops.kernels.estimate.zz import solid_error
from gibiane_ops.kernels.geometry import measures
from gibiane_ops.kernels.integrals import pressure_load
from gibiane_ops.kernels.materials import compliance, isotropic
from gibiane_ops.kernels.recovery import StressBlock
from gibiane_ops.kernels.remesh import mesh_surface, mesh_volume, remesh

E, NU, MU, PRESSURE = 210000.0, 0.3, 0.2, 3.125
TET4, TRI3 = shape("TET4"), shape("TRI3")


class Outline:
    """Points and segments of box faces, each edge of a box cut once and shared by its two faces."""

    def __init__(self, points=()):
        self.points = np.array(points, float).reshape(-1, 3)

    def node(self, x):
        near = np.flatnonzero(np.abs(self.points - x).max(axis=1) < 1e-9)
        if len(near) == 0:
            self.points = np.vstack([self.points, x])
            return len(self.points) - 1
        return int(near[0])

    def contour(self, corners, n):
        corners = np.array(corners, float)
        share = np.arange(n)[:, None] / n
        ids = [
            self.node(x)
            for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)
            for x in a + share * (b - a)
        ]
        return np.stack([ids, np.roll(ids, -1)], axis=1)

    def fill(self, edges, outward):
        filled = mesh_surface(self.points, edges)
        self.points = filled.points
        corner = self.points[filled.cells[0]]
        along = np.cross(corner[1] - corner[0], corner[2] - corner[0]) @ outward
        return filled.cells if along > 0 else filled.cells[:, ::-1]


def square(half, z):
    return [(-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z)]


def sides(outline, half, low, high, n):
    a, b = square(half, low), square(half, high)
    faces = []
    for k, out in enumerate([(0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0)]):
        m = (k + 1) % 4
        faces.append(outline.fill(outline.contour([a[k], a[m], b[m], b[k]], n), out))
    return faces


def start_mesh(n_low, n_high, inner=None):
    """Cube of side 100 on a cube of side 200; the contact face is meshed once and copied for the upper cube."""
    lower = Outline()
    contact = lower.contour(square(50, 0), n_high)
    face = lower.fill(contact, (0, 0, 1))
    ring = lower.fill(np.vstack([lower.contour(square(100, 0), n_low), contact]), (0, 0, 1))
    base = lower.fill(lower.contour(square(100, -200), n_low), (0, 0, -1))
    envelope = np.vstack([face, ring, base, *sides(lower, 100, -200, 0, n_low)])
    low = mesh_volume(lower.points, envelope, inner)
    nodes, copy = np.unique(face, return_inverse=True)
    upper = Outline(low.points[nodes])
    bottom = copy.reshape(face.shape)[:, ::-1]
    top = upper.fill(upper.contour(square(50, 100), n_high), (0, 0, 1))
    envelope = np.vstack([bottom, top, *sides(upper, 50, 0, 100, n_high)])
    high = mesh_volume(upper.points, envelope, inner)
    n = len(low.points)
    groups = {
        "LOWER": low.cells, "UPPER": high.cells + n, "FACE1": face, "FACE2": bottom + n, "BASE": base, "TOP": top + n,
    }  # fmt: skip
    return np.vstack([low.points, high.points]), np.vstack([low.cells, high.cells + n]), groups


def relative_error(points, groups):
    """Solve, smooth by nodal means, estimate; the pairs come with the error."""
    D, S = isotropic(E, NU, "TRID"), compliance(E, NU, "TRID")
    solids = [groups["LOWER"], groups["UPPER"]]
    K = assemble(len(points), 3, [(cells, element_stiffness(TET4, points[cells], D)) for cells in solids])
    top = groups["TOP"]
    F = assemble_vector(len(points), 3, [(top, pressure_load(TRI3, points[top], PRESSURE))]).ravel()
    dofs = (3 * np.unique(groups["BASE"])[:, None] + np.arange(3)).ravel()
    C = sp.csr_array((np.ones(len(dofs)), (np.arange(len(dofs)), dofs)), shape=(len(dofs), 3 * len(points)))
    contact = node_pairs(points, [("TRI3", groups["FACE2"])], [("TRI3", groups["FACE1"])])
    interface = condense(K, contact, reduce_conditions(C)).interface(F)
    state = solve_coulomb(interface, MU)
    U = interface.expand(state.w).reshape(-1, 3)
    parts = []
    for cells in solids:
        block = StressBlock(TET4, cells, stresses(strains(TET4, points[cells], U[cells], TET4.gauss[0]), D))
        parts.append(solid_error(points, block, recovery.mean_of_nodes(len(points), [block]), S))
    facets = [("TRI3", groups["FACE2"])]
    partner = np.full(len(points), -1)
    partner[contact.pairs[:, 0]] = contact.pairs[:, 1]
    violation = contact_error(
        points, facets, contact.pairs[:, 0], interface.frames, state.r, state.w, contact.gap, MU
    )  # fmt: skip
    shares = facets_to_cells([("TET4", cells) for cells in solids], facets, violation.facet, partner)
    return combine(parts, shares, "THES"), contact.pairs


def adapt(start, caps, singular=False):
    """Run the loop at a prescribed error of 4 %; return (number of elements, error in %) before and after each pass."""
    points, cells, groups = start
    history = []
    for cap in [*caps, None]:
        error, pairs = relative_error(points, groups)
        history.append((len(cells), 100 * error.total))
        if cap is None:
            return history
        blocks = [("TET4", groups["LOWER"]), ("TET4", groups["UPPER"])]
        each = np.concatenate(error.total_map)
        order = 1.0
        if singular:
            volumes = np.concatenate([measures(TET4, points[part]) for _, part in blocks])
            order = singular_orders(len(points), blocks, each**2, volumes, 1.0)
        wanted = size_map(points, blocks, each, 0.04, order=order, max_count=cap, pairs=pairs)
        new = remesh(points, cells, wanted.nodal, groups=groups, pairs=[("FACE2", "FACE1")])
        first, second = new.pairs[0].T
        assert np.array_equal(new.points[first], new.points[second])
        assert len(new.cells) <= min(wanted.count, cap)
        points, cells, groups = new.points, new.cells, new.groups
    raise AssertionError


def test_one_pass_follows_its_prediction():
    start = start_mesh(5, 4, 40.0)
    (n0, e0), (n1, e1) = adapt(start, [21_000])
    assert 1300 < n0 < 1550
    assert e0 > 9.0
    assert 8000 < n1 < 11000
    assert e1 < 6.5


@pytest.mark.slow
@pytest.mark.parametrize(("start", "slack"), [((5, 4, 40.0), 1.0), ((4, 4, 50.0), 1.05), ((6, 5), 1.05)])
def test_prescribed_error_is_approached_in_two_and_three_passes(start, slack):
    history = adapt(start_mesh(*start), [21_000, 21_000, 32_000])
    assert history[2][0] <= slack * 21_000
    assert history[2][1] <= slack * 5.2
    assert history[3][0] <= slack * 32_000
    assert history[3][1] <= slack * 4.6


@pytest.mark.slow
def test_orders_by_element_ask_for_more_beside_singular_edges():
    history = adapt(start_mesh(5, 4, 40.0), [21_000, 21_000, 32_000], singular=True)
    assert history[2][1] <= 5.2
    assert history[3][0] <= 32_000
    assert history[3][1] <= 4.5
