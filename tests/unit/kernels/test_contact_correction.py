"""Contact by the corrected small model equals contact on the exact stiffness, in scenes of every kind."""

from functools import lru_cache

import numpy as np
import pytest
import scipy.sparse as sp
from two_blocks import blocks

from gibiane_ops.kernels.assembly import assemble
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.contact.condense import condense
from gibiane_ops.kernels.contact.correction import Stalled, solve_corrected, tied_holds
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.node_pairs import node_pairs
from gibiane_ops.kernels.contact.pairs import joined
from gibiane_ops.kernels.contact.pardiso_schur import PardisoSchur
from gibiane_ops.kernels.contact.strategy import plan, solve_on_bodies
from gibiane_ops.kernels.contact.tresca import solve_tresca_sequence
from gibiane_ops.kernels.elasticity import element_stiffness
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import ContactUnbalanced, NotConverged
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.topology import boundary

TOLERANCE = 1e-8


def close(bodies, F, mu, gap=None, method=solve_coulomb):
    """Solve both ways on fresh small models and compare forces, displacements and statuses."""
    load = bodies.load(F)
    gap = bodies.gaps(load, None, gap)
    found = solve_corrected(bodies, load, gap, lambda interface: method(interface, mu))
    interface = bodies.interface_of(load, bodies.exact(), gap)
    exact = method(interface, mu)
    u = interface.expand(exact.w)
    np.testing.assert_allclose(found.state.r, exact.r, atol=TOLERANCE * np.abs(exact.r).max())
    np.testing.assert_allclose(found.displacement, u, atol=TOLERANCE * np.abs(u).max())
    assert found.state.report.worst < 1e-7
    return found


@pytest.fixture
def one_ring(monkeypatch):
    """Keep one layer of nodes only: a small scene would be kept whole."""
    monkeypatch.setattr("gibiane_ops.kernels.contact.small_model.RINGS", 1)


@lru_cache(maxsize=2)
def scene(name):
    return blocks(name)


def bodies_of(name, method="auto", contrast=1.0, held=()):
    B = scene(name)
    K = B.K
    if contrast != 1.0:
        upper = np.repeat(B.points[:, 2] > 0, 3)
        upper[(3 * B.pairs.pairs[:, :1] + np.arange(3)).ravel()] = True
        D = sp.diags_array(np.where(upper, np.sqrt(contrast), 1.0))
        K = sp.csr_array(D @ K @ D)
    return B, condense(K, B.pairs, B.reduction, points=B.points, method=method)


@pytest.mark.parametrize("method", ["auto", "amg"])
@pytest.mark.parametrize(
    ("name", "mu"), [("T1_1", 0.2), ("T1_1h", 0.05), ("T1_1h", 2.0), ("T4_4h", 0.0), ("T1_1", 0.0)]
)
def test_equals_the_exact_stiffness(name, mu, method, one_ring):
    B, bodies = bodies_of(name, method)
    close(bodies, B.F, mu)


@pytest.mark.parametrize("method", ["auto", "single", "amg"])
@pytest.mark.parametrize(("name", "mu"), [("T1_1", 0.2), ("T1_1h", 0.05)])
def test_stopped_early_within_what_was_asked(name, mu, method, one_ring):
    solutions, passes = [], []
    for share in (0.0, 1e-4, 1e-2):
        B, bodies = bodies_of(name, method)
        load = bodies.load(B.F)
        before = bodies.tied.passes
        enough = share * np.sqrt(solutions[0] @ B.K @ solutions[0]) if share else 0.0
        found = solve_corrected(
            bodies, load, bodies.gaps(load, None, None), lambda each: solve_coulomb(each, mu), enough=enough
        )
        solutions.append(found.displacement)
        passes.append(bodies.tied.passes - before)
        away = found.displacement - solutions[0]
        assert np.sqrt(away @ B.K @ away) <= enough
        assert found.left <= enough
    assert passes == sorted(passes, reverse=True)
    assert passes[-1] < passes[0]


@pytest.mark.parametrize("contrast", [1e-3, 1e3])
def test_stiffness_contrast(contrast):
    B, bodies = bodies_of("T1_1", contrast=contrast)
    close(bodies, B.F, 0.2)


@pytest.mark.parametrize("mu", [0.2, 1.0])
def test_push_close_to_the_limit(mu):
    B, bodies = bodies_of("T1_1", "amg")
    F, slave = B.F.copy(), B.pairs.pairs[:, 0]
    F[3 * slave] += 0.99 * mu * -B.F.sum() / len(slave)
    close(bodies, F, mu)


def test_gaps():
    B, bodies = bodies_of("T1_1")
    gap = 10 * B.interface.length_scale * np.random.default_rng(0).random(len(B.pairs.pairs))
    found = close(bodies, B.F, 0.3, gap)
    assert 0 < found.state.report.n_open < len(gap)


def test_other_methods_learn_from_newton():
    B, bodies = bodies_of("T1_1h")
    close(bodies, B.F, 0.2, method=solve_tresca_sequence)


def tetrahedra(seed, n=4, quarter=False, bodies=2):
    """Return stacked boxes of distorted TET4, held below (and on two planes), pressed and pushed above."""
    rng = np.random.default_rng(seed)
    axes = np.linspace(0, 1, n + 1)
    grid = np.stack(np.meshgrid(axes, axes, axes, indexing="ij"), -1).reshape(-1, 3)
    inside = ((grid > 0.01) & (grid < 0.99)).all(axis=1)
    number = np.arange((n + 1) ** 3).reshape(n + 1, n + 1, n + 1)
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cube = np.stack([number[i : n + i, j : n + j, k : n + k].ravel() for i, j, k in corners], axis=1)
    kuhn = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
    one = np.concatenate([cube[:, list(t)] for t in kuhn])
    cells = [one + i * len(grid) for i in range(bodies)]
    moved = np.where(inside[:, None], 0.2 / n * rng.uniform(-1, 1, (bodies, *grid.shape)), 0.0)
    points = (grid + moved + np.arange(bodies)[:, None, None] * [0, 0, 1]).reshape(-1, 3)
    D = isotropic(1e3, 0.3, "TRID")
    whole = np.concatenate(cells)
    K = assemble(len(points), 3, [(whole, element_stiffness(shape("TET4"), points[whole], D))])

    def facets(block, z):
        skin = boundary([("TET4", block)])["TRI3"].nodes
        return [("TRI3", skin[np.abs(points[skin][:, :, 2] - z).max(axis=1) < 1e-9])]

    pairs = joined([node_pairs(points, facets(cells[i], i), facets(cells[i - 1], i)) for i in range(1, bodies)])
    dofs = [(3 * np.flatnonzero(points[:, 2] < 0.01)[:, None] + np.arange(3)).ravel()]
    if quarter:
        dofs += [3 * np.flatnonzero(points[:, i] < 1e-9) + i for i in (0, 1)]
    dofs = np.unique(np.concatenate(dofs))
    C = sp.csr_array((np.ones(len(dofs)), (np.arange(len(dofs)), dofs)), (len(dofs), 3 * len(points)))
    F = np.zeros((len(points), 3))
    top = (points[:, 2] > bodies - 0.01) & (points[:, 0] > 0.4)
    F[top] = rng.uniform([-0.5, -0.4, -2.0], [0.5, 0.4, 0.0], (top.sum(), 3))
    return points, K, pairs, reduce_conditions(C), F.ravel()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("quarter", [False, True])
@pytest.mark.parametrize("bodies", [2, 3])
def test_tetrahedra_planes_of_symmetry_and_zones(seed, quarter, bodies, one_ring):
    points, K, pairs, reduction, F = tetrahedra(seed, quarter=quarter, bodies=bodies)
    tied = condense(K, pairs, reduction, points=points, method="amg" if seed == 1 else "auto")
    found = close(tied, F, 0.05 if quarter else 0.4)
    assert found.corrections > 1  # the small model is not the exact one here


def test_small_model_is_stiffer_and_free_of_rigid_motions():
    B, bodies = bodies_of("T1_1")
    S = bodies.exact()
    bodies.small()
    difference = bodies.learned.S - S.S
    assert np.linalg.eigvalsh(difference).min() > -1e-9 * S.kref
    assert bodies.learned.rigid.shape == S.rigid.shape == (27, 6)
    assert np.abs(bodies.learned.S @ S.rigid).max() < 1e-9 * S.kref
    # forces of iterations do no work on rigid motions either
    _, iterated = bodies_of("T1_1", "amg")
    load = iterated.load(B.F)
    np.testing.assert_allclose(S.rigid.T @ load.f, S.rigid.T @ bodies.load(B.F).f, atol=1e-11 * np.abs(load.f).max())


def test_a_second_coefficient_starts_from_what_the_first_taught():
    B, bodies = bodies_of("T1_1h")
    load = bodies.load(B.F)
    assert bodies.load(B.F) is load
    gap = bodies.gaps(load)
    counts = [
        solve_corrected(bodies, load, gap, lambda i, mu=mu: solve_coulomb(i, mu)).corrections for mu in (0.2, 0.2)
    ]
    assert counts[1] == 1 < counts[0]


def test_tied_bodies_are_recognised_without_any_model():
    B, bodies = bodies_of("T1_1")
    load = bodies.load(B.F)
    gap = bodies.gaps(load)
    law = Friction.of(len(gap), 1.0)
    frame = bodies.interface_of(load, bodies.unloaded_stiffness(), gap)
    assert tied_holds(frame, law, None)
    assert not tied_holds(frame, Friction.of(len(gap), 0.05), None)
    found = solve_on_bodies(
        bodies, load, gap, law, lambda i: solve_coulomb(i, law), newton=None, exact=False, tied_first=True
    )
    assert found.corrections == 0
    assert bodies.learned is None
    exact = solve_coulomb(bodies.interface_of(load, bodies.exact(), gap), 1.0)
    np.testing.assert_allclose(found.state.r, exact.r, atol=1e-12 * np.abs(exact.r).max())


def test_stall_falls_back_on_the_exact_stiffness(monkeypatch):
    """A model that cannot learn stalls; the exact stiffness takes over, and the reason is said."""
    B, bodies = bodies_of("T1_1h")
    load = bodies.load(B.F)
    gap = bodies.gaps(load)
    law = Friction.of(len(gap), 0.2)
    monkeypatch.setattr(type(bodies.exact()), "learned", lambda self, dw, dy, noise=0.0: self)
    bodies._exact = None
    monkeypatch.setattr("gibiane_ops.kernels.contact.correction.MOST", 3)
    monkeypatch.setattr("gibiane_ops.kernels.contact.correction.AGREEMENT", 1e-13)
    with pytest.raises(Stalled):
        solve_corrected(bodies, load, gap, lambda i: solve_coulomb(i, law))
    said = []
    found = solve_on_bodies(
        bodies, load, gap, law, lambda i: solve_coulomb(i, law), newton=None, exact=False, tied_first=True,
        say=said.append,
    )  # fmt: skip
    assert found.exact
    assert "3 corrections" in said[0]
    bodies._exact = None
    monkeypatch.setattr("gibiane_ops.kernels.contact.strategy.LONGEST", 0.0)
    with pytest.raises(NotConverged):
        solve_on_bodies(
            bodies, load, gap, law, lambda i: solve_coulomb(i, law), newton=None, exact=False, tied_first=True
        )


def test_a_load_that_slides_is_refused_on_the_exact_stiffness():
    B, bodies = bodies_of("T1_1")
    F, slave = B.F.copy(), B.pairs.pairs[:, 0]
    F[3 * slave] += 1.05 * 0.2 * -B.F.sum() / len(slave)
    load = bodies.load(F)
    law = Friction.of(len(slave), 0.2)
    with pytest.raises(ContactUnbalanced):
        solve_on_bodies(
            bodies, load, bodies.gaps(load), law, lambda i: solve_coulomb(i, law), newton=None, exact=False,
            tied_first=True,
        )  # fmt: skip
    assert bodies.is_exact


def test_schur_complement_of_pardiso(monkeypatch):
    pytest.importorskip("pypardiso")
    for name in ("T1_1", "T4_4h"):
        _, bodies = bodies_of(name)
        S = bodies.exact().S
        b = np.random.default_rng(0).random((bodies.tied.A.shape[0], 2))
        partial = PardisoSchur(bodies.tied.A, bodies._Kvw, sp.csr_array(bodies._fields.Bw.T @ bodies._KBw))
        np.testing.assert_allclose(partial.S, S, atol=1e-12 * np.abs(S).max())
        np.testing.assert_allclose(bodies.tied.A @ partial.solve(b), b, atol=1e-10)
        monkeypatch.setattr("gibiane_ops.kernels.contact.condensation.SCHUR_UNKNOWNS", 0)
        monkeypatch.setattr("gibiane_ops.kernels.contact.condensation.SCHUR_COMPONENTS", 0)
        monkeypatch.setattr("gibiane_ops.kernels.contact.condensation.schur", None)  # not called
        _, other = bodies_of(name)
        np.testing.assert_allclose(other.exact().S, S, atol=1e-12 * np.abs(S).max())
        monkeypatch.undo()


def test_plan_by_size_and_memory(monkeypatch):
    monkeypatch.setattr("gibiane_ops.kernels.choice.available_memory", lambda: 8e9)
    assert plan(2_000, 100_000, 75, 3).exact
    large = plan(1_170_000, 90_000_000, 1083, 3)
    assert (large.method, large.exact) == ("amg", False)
    assert large.memory < 8e9
    assert plan(100_000, 8_000_000, 243, 3, wish="DIRE").method in ("auto", "single")
    assert plan(100_000, 8_000_000, 243, 3, coordinates=False).exact
    assert plan(100_000, 8_000_000, 243, 3, all_exact=True).exact


def single_bodies():
    B, _ = bodies_of("T1_1")
    return B, condense(B.K, B.pairs, B.reduction, points=B.points, method="single")


def test_a_factor_in_single_precision_gives_what_the_exact_stiffness_gives():
    """One substitution a correction; what it leaves goes into the next, and nothing of it into the result."""
    B, bodies = single_bodies()
    assert bodies.factor.name == "single"
    load = bodies.load(B.F)
    gap = bodies.gaps(load)
    for mu in (0.05, 0.2, 0.4):
        law = Friction.of(len(gap), mu)
        found = solve_corrected(bodies, load, gap, lambda i, law=law: solve_coulomb(i, law))
        exact = solve_coulomb(B.interface, law)
        assert np.abs(found.state.r - exact.r).max() <= 1e-8 * np.abs(exact.r).max()
        assert np.abs(found.state.w - exact.w).max() <= 1e-8 * B.interface.length_scale
        u = B.interface.expand(exact.w)
        assert np.abs(found.displacement - u).max() <= 1e-9 * np.abs(u).max()


def test_repeated_coefficients_give_what_fresh_bodies_give():
    """What the small model has learned from other coefficients changes the path, not the result."""
    B, kept = single_bodies()
    for mu in (0.01, 0.1, 0.3, 0.5, 0.1):
        states = []
        for bodies in (kept, single_bodies()[1]):
            load = bodies.load(B.F)
            gap = bodies.gaps(load)
            found = solve_corrected(bodies, load, gap, lambda i, mu=mu: solve_coulomb(i, mu))
            states.append((found.state, found.corrections))
        (one, few), (two, many) = states
        assert np.array_equal(one.status, two.status)
        assert np.abs(one.r - two.r).max() <= 1e-8 * np.abs(two.r).max()
        assert np.abs(one.w - two.w).max() <= 1e-8 * B.interface.length_scale
        assert few <= many


def test_errors_of_a_solution_are_not_learned():
    """A change of force below what may be wrong with it says nothing about the stiffness."""
    bodies = bodies_of("T1_1")[1]
    bodies.small()
    S = bodies.learned
    rng = np.random.default_rng(3)
    dw = S.still(rng.standard_normal(len(S.S)))
    d = 1e-6 * (S.S @ dw)
    assert S.learned(dw, S.S @ dw - d, float(np.linalg.norm(d))) is S
    assert S.learned(dw, S.S @ dw - d, 1e-3 * float(np.linalg.norm(d))) is not S
