"""Constitutive relation error of two blocks, bonded, frictionless and with Tresca's friction: it bounds the error.

A cube stands centred on a cube of side 200 mm whose base is clamped; 3.125 MPa push on its top. A quarter of the scene,
with two planes of symmetry, cut into tetrahedra. Energies of the exact solutions come from three nested meshes of
bricks extrapolated, down to 3 and 6 mm (known to 0.07 and 0.0002 %).
"""

import io
from dataclasses import replace
from functools import lru_cache
from itertools import permutations

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane import Session
from gibiane_ops.kernels.assembly import assemble
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.contact.condense import condense
from gibiane_ops.kernels.contact.law import friction
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.node_pairs import node_pairs
from gibiane_ops.kernels.elasticity import element_stiffness, strains, stresses
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import NotConverged
from gibiane_ops.kernels.estimate.admissible import Admissible, admissible_stress
from gibiane_ops.kernels.estimate.bodies import loose_motions
from gibiane_ops.kernels.estimate.contact_bound import contact_tractions
from gibiane_ops.kernels.estimate.equilibrium import equilibrium_residual
from gibiane_ops.kernels.estimate.improve import improve
from gibiane_ops.kernels.estimate.joints import Joint
from gibiane_ops.kernels.estimate.pieces import balanced_stress, uniform_aim
from gibiane_ops.kernels.estimate.simplices import simplices
from gibiane_ops.kernels.estimate.tractions import Exterior
from gibiane_ops.kernels.estimate.zoom import zoomed
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.solve import factorize
from gibiane_ops.kernels.topology import boundary

TET4 = shape("TET4")
LAW = isotropic(210000.0, 0.3)
PRESSURE = 3.125
BONDED = {50.0: 10.133, 200.0: 733.087}
FRICTIONLESS = 10.570


def brick(low, high, counts, start):
    """Nodes of a box and its cells, six tetrahedra a brick, all cut along the same diagonal."""
    axes = [np.linspace(low[i], high[i], counts[i] + 1) for i in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = start + np.arange(len(points)).reshape([n + 1 for n in counts])
    base = np.stack(np.meshgrid(*[np.arange(n) for n in counts], indexing="ij"), axis=-1).reshape(-1, 3)
    cells = []
    for order in permutations(range(3)):
        corners = np.cumsum([np.zeros(3, int)] + [np.eye(3, dtype=int)[k] for k in order], axis=0)
        cells.append(np.stack([number[tuple((base + c).T)] for c in corners], axis=1))
    cells = np.concatenate(cells)
    X = points[cells - start]
    wrong = np.linalg.det(X[:, 1:] - X[:, :1]) < 0
    cells[wrong, :2] = cells[wrong, 1::-1]
    return points, cells


class Scene:
    """Quarter of the two blocks; `merged`: the nodes of the interface are shared."""

    def __init__(self, side, h, merged):
        half = side / 2
        low, below = brick((0, 0, -200), (100, 100, 0), [round(100 / h), round(100 / h), round(200 / h)], 0)
        high, above = brick(
            (0, 0, 0), (half, half, side), [round(half / h), round(half / h), round(side / h)], len(low)
        )
        points, cells = np.vstack([low, high]), np.vstack([below, above])
        skin = [boundary([("TET4", c)])["TRI3"].nodes for c in (below, above)]
        flat = [s[(np.abs(points[s][:, :, 2]) < 1e-9).all(axis=1)] for s in skin]
        self.pairs = node_pairs(points, [("TRI3", flat[1])], [("TRI3", flat[0])])
        self.slave = flat[1]
        if merged:
            name = np.arange(len(points))
            name[self.pairs.pairs[:, 0]] = self.pairs.pairs[:, 1]
            used, place = np.unique(name, return_inverse=True)
            points, cells = points[used], place[cells]
        self.points, self.cells, self.merged = points, cells, merged
        self.mesh = simplices(points, cells)
        edge = self.mesh.boundary
        self.nodes, X = self.mesh.nodes[edge], points[self.mesh.nodes[edge]]
        area = np.linalg.norm(self.mesh.outward[self.mesh.cell[edge, 0], self.mesh.local[edge, 0]], axis=1)
        self.traction, self.free = np.zeros((len(edge), 3, 3)), np.zeros((len(edge), 3, 3))
        self.traction[(np.abs(X[:, :, 2] - side) < 1e-9).all(axis=1), :, 2] = -PRESSURE
        held = np.zeros(points.shape, bool)
        for k in (0, 1):
            self.free[(np.abs(X[:, :, k]) < 1e-9).all(axis=1), k, k] = 1.0
            held[np.abs(points[:, k]) < 1e-9, k] = True
        self.free[(np.abs(X[:, :, 2] + 200) < 1e-9).all(axis=1)] = np.eye(3)
        held[np.abs(points[:, 2] + 200) < 1e-9] = True
        self.is_held, self.held = held, np.flatnonzero(held.ravel())
        self.K = assemble(len(points), 3, [(cells, element_stiffness(TET4, points[cells], LAW))])
        self.F = np.zeros(points.shape)
        np.add.at(self.F, self.nodes, (self.traction.mean(axis=1) * area[:, None] / 3)[:, None])

    def stress(self, u):
        return stresses(strains(TET4, self.points[self.cells], u[self.cells], TET4.gauss[0]), LAW)[:, 0]

    def bonded(self):
        free = np.setdiff1d(np.arange(self.K.shape[0]), self.held)
        u = np.zeros(self.K.shape[0])
        u[free] = factorize(self.K.tocsr()[free][:, free]).solve(self.F.ravel()[free])
        return u.reshape(-1, 3)

    def contact(self, law):
        k = len(self.held)
        C = sp.csr_array((np.ones(k), (np.arange(k), self.held)), shape=(k, self.K.shape[0]))
        self.interface = condense(self.K, self.pairs, reduce_conditions(C)).interface(self.F.ravel())
        state = solve_coulomb(self.interface, law)
        return self.interface.expand(state.w).reshape(-1, 3), state

    def estimate(self, u, traction, sweeps=2, joint=None, nodal=True) -> Admissible:
        loads = Exterior(traction, self.free, np.zeros((len(self.cells), 3)))
        stress, start, aim = self.stress(u), self.stress(u), None
        if not nodal:
            laws, held = np.broadcast_to(LAW, (len(self.cells), 6, 6)), np.zeros((len(self.points), 3, 3))
            held[:, range(3), range(3)] = self.is_held
            start, aim = balanced_stress(self.mesh, stress, laws, loads, held), uniform_aim(stress, 3)
        return admissible_stress(
            self.points, self.cells, start, LAW, loads, sweeps=sweeps, mesh=self.mesh, joint=joint, aim=aim
        )

    def joint(self, state, threshold=None, error=0.0):
        """Facets that are closed at their three nodes; with a threshold, of Tresca, their slips."""
        slave, master = self.pairs.pairs[np.abs(state.w[:, 0]) < 1e-12].T
        name = np.arange(len(self.points))
        name[slave] = master
        closed = self.slave[np.isin(self.slave, slave).all(axis=1)]
        if threshold is None:
            return Joint(name, name[closed])
        slip = np.zeros(self.points.shape)
        slip[self.pairs.pairs[:, 0]] = np.einsum("nij,ni->nj", self.interface.frames[:, 1:], state.w[:, 1:])
        return Joint(name, name[closed], np.full(closed.shape, threshold), slip[closed], error)

    def with_contact(self, found):
        """Tractions of the boundary, those of contact included, opposite on the two bodies."""
        traction = self.traction.copy()
        row = {tuple(nodes): i for i, nodes in enumerate(self.nodes)}
        partner = dict(self.pairs.pairs)
        for nodes, values in zip(self.slave, found.traction, strict=True):
            for facet, sign in ((nodes, 1), (np.array([partner[i] for i in nodes]), -1)):
                order = np.argsort(facet)
                traction[row[tuple(facet[order])]] += sign * values[order]
        return traction

    def tractions(self, state, mu=0.0, threshold=0.0):
        n, held = len(self.pairs.pairs), np.zeros((len(self.points), 3, 3))
        held[:, range(3), range(3)] = self.is_held
        motions = loose_motions(self.points, [self.cells], held)
        modes = motions[:, self.pairs.pairs[:, 0]] - motions[:, self.pairs.pairs[:, 1]]
        return contact_tractions(
            self.points, self.slave, self.pairs.pairs[:, 0], self.interface.frames, state.r, state.w, self.pairs.gap,
            np.full(n, mu), np.full(n, threshold), modes=modes,
        )  # fmt: skip


@lru_cache
def scene(side, h, merged):
    return Scene(side, h, merged)


def effectivity(of, found, exact, contact=0.0):
    true = np.sqrt(exact / 4 - found.energy.sum())
    return np.sqrt(np.array(found.history) ** 2 + 2 * contact) / true


@pytest.mark.parametrize(
    ("side", "h"),
    [
        (200.0, 100.0), (200.0, 50.0), (50.0, 25.0),
        pytest.param(200.0, 25.0, marks=pytest.mark.slow), pytest.param(50.0, 12.5, marks=pytest.mark.slow),
        pytest.param(50.0, 25.0 / 3, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_bonded_blocks(side, h):
    of = scene(side, h, True)
    found = of.estimate(of.bonded(), of.traction)
    assert found.residual < 1e-10
    start, once, twice = effectivity(of, found, BONDED[side])
    assert 1 <= twice < once < start
    # The edge of the small punch is singular: measured 1.16 and 1.04 at 25 mm, 1.21 and 1.06 at 12.5 mm, 1.23 and 1.06
    # at 8.33 mm (theta is known to 2 %), where the parts that are improved together are smaller than the mesh.
    assert once <= 1.25
    assert twice <= 1.1
    assert 4 * found.energy.sum() < BONDED[side] < 4 * (found.energy.sum() + found.total**2)


@pytest.mark.parametrize("h", [25.0, *(pytest.param(h, marks=pytest.mark.slow) for h in (12.5, 25.0 / 3))])
def test_blocks_without_friction(h):
    of = scene(50.0, h, False)
    u, state = of.contact(0.0)
    pressures = of.tractions(state)
    assert pressures.facet.sum() < 1e-12
    # One brick under a quarter of the punch: the force of its outer corners is too large for two triangles. Pressures
    # that balance the bodies rather than each node push everywhere.
    assert pressures.admissible
    assert pressures.nodal == (h < 20)
    found = of.estimate(u, of.with_contact(pressures), joint=of.joint(state), nodal=pressures.nodal)
    assert found.residual < 1e-10
    assert found.excess < 0
    _, once, twice = effectivity(of, found, FRICTIONLESS)
    assert 1 <= twice < once <= 1.3
    assert twice <= 1.15
    # Pressures that stay those of the nodes keep the bound far from the error.
    if h < 20:
        fixed = of.estimate(u, of.with_contact(pressures), sweeps=1)
        assert fixed.total > 1.1 * found.total


TRESCA = """
OPTI DIME 2 ELEM QUA4 MODE PLAN DEFO ;
DEBP BLOCS N*ENTIER ;
  T = TABLE ; S1 = (DROI N (0. 0.) (1. 0.)) TRAN N (0. 1.) ; S2 = (DROI N (0. -1.) (1. -1.)) TRAN N (0. 1.) ;
  T1 = CHAN TRI3 S1 ; T2 = CHAN TRI3 S2 ; MO = (MODE T1 'MECANIQUE' 'ELASTIQUE') ET (MODE T2 'MECANIQUE' 'ELASTIQUE') ;
  MA = (MATE (REDU MO T1) 'YOUN' 1. 'NU' 0.3) ET (MATE (REDU MO T2) 'YOUN' 10. 'NU' 0.1) ;
  CL = (BLOQ 'DEPL' (COTE 1 S2)) ET (BLOQ 'UX' (COTE 4 S1)) ET (BLOQ 'UX' (COTE 4 S2)) ;
  MC = MODE (COTE 3 S2) (COTE 1 S1) 'CONTACT' 'FROTTANT' 'TRESCA' ; MATC = MATE MC 'SEUI' SEUIL ; RC J = RIGI MC MATC ;
  U = RESO ((RIGI MO MA) ET CL ET RC) ((PRES 'MASS' MO 1.E-2 (COTE 3 S1)) ET J) ; REA = REAC RC U ;
  SIG = SIGM MO MA U ; T.'E' = ERREUR 'CONTACT' 'RDC' 'TABL' MO SIG MA MC MATC U REA CL 'PRES' 1.E-2 (COTE 3 S1) ;
  T.'U' = U ; T.'MO' = MO ; T.'MA' = MA ; T.'T1' = T1 ; T.'T2' = T2 ; T.'ETAT' = EXCO 'ETAT' (COFR MC MATC U REA) ;
FINP T ;
TC = BLOCS 6 ; TF = BLOCS 24 ; L = MOTS 'T1' 'T2' ; EN = 0. ;
REPE B 2 ;
  GF = TF.(EXTR L &B) ; GC = TC.(EXTR L &B) ; M1 = REDU (TF.'MO') GF ; UC = REDU (TC.'U') GC ;
  D = (REDU (TF.'U') GF) - (PROI GF (CHAN 'CHAM' UC (REDU (TC.'MO') GC))) ;
  EN = EN + (INTG M1 (ENER M1 (SIGM M1 (TF.'MA') D) (EPSI M1 D))) ;
FIN B ;
SURE = (TC.'E'.'GARANTI') ET (TF.'E'.'GARANTI') ; EC = TC.'E'.'ABSOLUE' ; EF = TF.'E'.'ABSOLUE' ;
BAS = MINI (TC.'ETAT') ; HAUT = MAXI (TC.'ETAT') ;
"""


@pytest.mark.parametrize(
    ("threshold", "states", "most"),
    [
        (5e-4, (1, 2), 1.05),
        pytest.param(1e-4, (1, 2), 1.05, marks=pytest.mark.slow),
        pytest.param(2e-3, (1, 2), 1.05, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_threshold_of_tresca(threshold, states, most):
    # Sliding here and there, nearly everywhere, nearly nowhere, and nowhere.
    assert_bounded(TRESCA, threshold, states, most)


@pytest.mark.slow
@pytest.mark.parametrize(("threshold", "states"), [(1e-4, (1, 2)), (5e-4, (1, 2)), (2e-3, (1, 2))])
def test_threshold_of_tresca_against_a_fine_mesh(threshold, states):
    # measured 1.010, 1.011, 1.021; the fine mesh leaves about 0.005 of it
    assert_bounded(TRESCA.replace("BLOCS 24", "BLOCS 96"), threshold, states, 1.03)


# Energy of the tied blocks, extrapolated from 6, 12, 24, 48 and 96 triangles a side (its error falls by 2.8 each time).
TIED = 97.720e-6


def test_blocks_that_stick():
    # The friction bound is never reached: the solution is that of tied blocks, whose energy is known.
    out = io.StringIO()
    session = Session(out=out, err=out)
    session.globals.names["SEUIL"] = 1.0
    script = TRESCA[: TRESCA.index("TC = BLOCS")]
    assert (
        session.run_text(script + "T = BLOCS 6 ; E = T.'E' ; S = E.'GARANTI' ; A = E.'ABSOLUE' ; W = E.'ENERGIE' ;")
        == 0
    )
    found = session.names()
    assert found["S"]
    assert 1 <= found["A"] / np.sqrt(TIED - found["W"]) <= 1.1


def assert_bounded(script, threshold, states, most):
    out = io.StringIO()
    session = Session(out=out, err=out)
    session.globals.names["SEUIL"] = threshold
    assert session.run_text(script) == 0, out.getvalue()
    found = session.names()
    assert found["SURE"], out.getvalue()
    assert (found["BAS"], found["HAUT"]) == states
    # The squared error is nearly EN, to a finer solution, and the squared error of that one, between (EF / most)^2 and
    # EF^2: with friction the two are not orthogonal (EN of 6 and 96 triangles a side is 4 % less than those of 6 and
    # 24, 24 and 96 together).
    assert found["EC"] >= np.sqrt(found["EN"])
    assert found["EC"] / np.sqrt(found["EN"] + (found["EF"] / most) ** 2) <= most


def touching(target):
    """Cells with a side in contact."""
    found = np.zeros(len(target.cell), bool)
    found[target.mesh.cell[target.facet >= 0]] = True
    return found


def test_slips_of_several_directions():
    # Nodes that slip all carry the bound times their area; their directions differ, so that no traction within the
    # bound has these nodal forces. Tractions that balance the bodies are within the law, and go on to be.
    of, g = scene(100.0, 50.0, False), 0.2
    area = of.pairs.area
    u, state = of.contact(friction(len(area), cohesion=g * area))
    assert (np.linalg.norm(state.w[:, 1:], axis=1) > 1e-9).sum() >= 3
    found = of.tractions(state, threshold=g)
    assert found.admissible
    assert not found.nodal
    joint = of.joint(state, g, 2 * found.facet.sum())
    bound = of.estimate(u, of.with_contact(found), joint=joint, nodal=False)
    assert bound.residual < 1e-10
    assert bound.excess <= 1e-9
    assert (np.diff(bound.history) < 0).all()
    assert 2 * found.facet.sum() + bound.contact.sum() > 0
    assert bound.total**2 + 2 * found.facet.sum() + bound.contact.sum() == pytest.approx(bound.history[-1] ** 2)
    fixed = of.estimate(u, of.with_contact(found), nodal=False)
    assert np.hypot(fixed.total, np.sqrt(2 * found.facet.sum())) > bound.history[-1]
    # Tractions that differ on the two sides, or leave the bound, are seen.
    with pytest.raises(NotConverged):
        of.estimate(u, of.with_contact(replace(found, traction=1.01 * found.traction)), nodal=False)
    assert bound.target.limits.excess(bound.tau) <= 1e-9
    assert bound.target.limits.excess(1.03 * bound.tau) > 1e-6
    # Smaller cells on both sides of the contact: the same tractions, the same work, the same law.
    bound = of.estimate(u, of.with_contact(found), 1, joint, nodal=False)
    fine, tau, k = bound.target, bound.tau, len(joint.closed)
    for _ in range(3):
        fine, tau, _ = zoomed(fine, tau, touching(fine))
    assert (fine.facet >= 0).sum() >= 4 * (bound.target.facet >= 0).sum()
    assert fine.work(tau, k) == pytest.approx(bound.target.work(bound.tau, k), rel=1e-12)
    assert np.abs(fine.work(tau, k)).max() > 0
    assert fine.residual(tau) < 1e-10
    assert fine.limits.excess(tau) <= 1e-9
    assert fine.limits.excess(1.03 * tau) > 1e-6
    before = fine.distance(tau).sum() + 2 * fine.work(tau, k).sum()
    improve(fine, tau, np.arange(len(fine.cell)))
    assert fine.distance(tau).sum() + 2 * fine.work(tau, k).sum() < before
    assert fine.residual(tau) < 1e-10
    assert fine.limits.excess(tau) <= 1e-9
    # With friction of another law pressures alone may change: what slides stays as it was given.
    held = of.estimate(u, of.with_contact(found), 1, replace(joint, bound=None, slip=None), nodal=False)
    fine, tau = held.target, held.tau
    for _ in range(3):
        fine, tau, _ = zoomed(fine, tau, touching(fine))
    assert np.abs(fine.given[fine.facet >= 0]).max() > 0
    assert fine.residual(tau) < 1e-10
    one_side = of.traction.copy()
    row = {tuple(nodes): i for i, nodes in enumerate(of.nodes)}
    for nodes, values in zip(of.slave, found.traction, strict=True):
        one_side[row[tuple(np.sort(nodes))]] += values[np.argsort(nodes)]
    loads = Exterior(one_side, of.free, np.zeros((len(of.cells), 3)))
    once = of.estimate(u, of.with_contact(found), sweeps=1, nodal=False)
    assert equilibrium_residual(of.mesh, once.tau, loads) > 1e-3


SOLIDS = """
OPTI DIME 3 ELEM CUB8 MODE TRID ; PZ = 0. 0. 0. ; PX = 1. 0. 0. ; PY = 0. 1. 0. ; PT = 0. 0. 1. ;
DEBP BLOCS N*ENTIER ;
  T = TABLE ; S1 = (DROI N PZ PX) TRAN N PY ; S2 = S1 PLUS PZ ;
  T1 = CHAN TET4 (S1 VOLU N 'TRAN' PT) ; T2 = CHAN TET4 (S2 VOLU N 'TRAN' (PZ MOIN PT)) ; E1 = ENVE T1 ; E2 = ENVE T2 ;
  F1 = E1 ELEM 'APPU' 'STRI' (T1 POIN 'PLAN' PZ PX PY 1.E-6) ;
  F2 = E2 ELEM 'APPU' 'STRI' (T2 POIN 'PLAN' PZ PX PY 1.E-6) ;
  HAUT = E1 ELEM 'APPU' 'STRI' (T1 POIN 'PLAN' (PZ PLUS PT) (PX PLUS PT) (PY PLUS PT) 1.E-6) ;
  MO = (MODE T1 'MECANIQUE' 'ELASTIQUE') ET (MODE T2 'MECANIQUE' 'ELASTIQUE') ; TT = T1 ET T2 ;
  MA = (MATE (REDU MO T1) 'YOUN' 1. 'NU' 0.3) ET (MATE (REDU MO T2) 'YOUN' 10. 'NU' 0.1) ;
  CL = (BLOQ 'DEPL' (T2 POIN 'PLAN' (PZ MOIN PT) (PX MOIN PT) (PY MOIN PT) 1.E-6))
    ET (BLOQ 'UX' (TT POIN 'PLAN' PZ PY PT 1.E-6)) ET (BLOQ 'UY' (TT POIN 'PLAN' PZ PX PT 1.E-6)) ;
  MC = MODE F2 F1 'CONTACT' 'FROTTANT' 'TRESCA' ; MATC = MATE MC 'SEUI' SEUIL ; RC J = RIGI MC MATC ;
  U = RESO ((RIGI MO MA) ET CL ET RC) ((PRES 'MASS' MO 1.E-2 HAUT) ET J) ; REA = REAC RC U ;
  SIG = SIGM MO MA U ; T.'E' = ERREUR 'CONTACT' 'RDC' 'TABL' MO SIG MA MC MATC U REA CL 'PRES' 1.E-2 HAUT ;
  T.'U' = U ; T.'MO' = MO ; T.'MA' = MA ; T.'T1' = T1 ; T.'T2' = T2 ; T.'ETAT' = EXCO 'ETAT' (COFR MC MATC U REA) ;
FINP T ;
TC = BLOCS 2 ; TF = BLOCS 4 ;
"""


@pytest.mark.slow
@pytest.mark.parametrize(("threshold", "states"), [(1e-4, (1, 2)), (5e-4, (1, 2)), (2e-3, (1, 2)), (1.0, (1, 1))])
def test_threshold_of_tresca_in_space(threshold, states):
    # A quarter of two cubes, the upper one soft: it spreads, and slips turn about the middle.
    assert_bounded(SOLIDS + TRESCA[TRESCA.index("L = MOTS") :], threshold, states, 1.2)
