"""Factorise and solve: every package gives the answer, a singular matrix is named, a wrong package is replaced."""

import numpy as np
import pytest
import scipy.sparse as sp

from gibiane_ops.kernels import iterations, packages, solve
from gibiane_ops.kernels.errors import BadValue, SingularSystem, TooLarge
from gibiane_ops.kernels.solve import factorize

PARDISO = pytest.param(
    "pardiso",
    marks=pytest.mark.skipif(
        not packages.is_installed("pardiso"), reason="PARDISO IS NOT TESTED HERE: pip install pypardiso"
    ),
)


@pytest.fixture
def two_packages(monkeypatch):
    """rslab and SuperLU, whatever else is installed."""
    monkeypatch.setattr(solve, "is_installed", lambda name: name in ("rslab", "superlu"))


def chain(n, stiffness=1.0, held=True):
    """Springs in a row; the end spring to the ground may be left out."""
    main = np.full(n, 2.0)
    main[-1] = 1.0
    if not held:
        main[0] = 1.0
    return stiffness * sp.diags([np.full(n - 1, -1.0), main, np.full(n - 1, -1.0)], [-1, 0, 1], format="csr")


def laplacian3(n):
    one = sp.diags([np.full(n - 1, -1.0), np.full(n, 2.0), np.full(n - 1, -1.0)], [-1, 0, 1])
    eye = sp.identity(n)
    plane = sp.kron(one, eye) + sp.kron(eye, one)
    return sp.csr_matrix(sp.kron(plane, eye) + sp.kron(sp.identity(n * n), one))


@pytest.mark.parametrize("method", ["auto", "single", "rslab", PARDISO, "superlu", "amg", "cg", "minres"])
@pytest.mark.parametrize("shape", [(343,), (343, 1), (343, 70)])
def test_solves_one_and_several_right_hand_sides(method, shape):
    A = laplacian3(7)
    x = np.random.default_rng(1).standard_normal(shape)
    factor = factorize(A, method=method)
    found = factor.solve(A @ x)
    assert found.shape == shape
    np.testing.assert_allclose(found, x, rtol=0, atol=1e-9)
    assert factor.residual < solve.RESIDUAL_LIMIT
    assert factor.notes == ()


def test_chain_of_springs_pulled_at_its_end():
    np.testing.assert_allclose(factorize(chain(6, 3.0)).solve(np.r_[np.zeros(5), 1.0]), np.arange(1, 7) / 3, rtol=1e-13)


@pytest.mark.parametrize("method", ["auto", "single", PARDISO, "superlu", "amg"])
@pytest.mark.parametrize("stiffness", [1e-9, 1.0, 1e12])
def test_free_chain_is_singular_whatever_the_units(method, stiffness):
    with pytest.raises(SingularSystem) as caught:
        factorize(chain(50, stiffness, held=False), method=method).solve(np.r_[np.zeros(49), 1.0])
    assert len(caught.value.unknowns) == 50


def test_the_loose_part_is_named():
    A = sp.block_diag([chain(30), chain(20, 7.0, held=False)], format="csr")
    with pytest.raises(SingularSystem) as caught:
        factorize(A)
    np.testing.assert_array_equal(caught.value.unknowns, np.arange(30, 50))


def test_unknown_without_stiffness_is_named():
    A = chain(5).tolil()
    A[3, :] = 0
    A[:, 3] = 0
    with pytest.raises(SingularSystem) as caught:
        factorize(A)
    np.testing.assert_array_equal(caught.value.unknowns, [3])


def test_stiff_but_regular_system_is_accepted():
    # a penalty spring 1e8 times stiffer than the rest: ill conditioned, yet it has one answer
    A = chain(40).tolil()
    A[9:11, 9:11] += 1e8 * np.array([[1, -1], [-1, 1]])
    x = factorize(A).solve(np.r_[np.zeros(39), 1.0])
    assert x[9] == pytest.approx(10, rel=1e-6)
    assert x[39] == pytest.approx(39, rel=1e-6)


def test_a_wrong_package_is_replaced(monkeypatch, two_packages):
    monkeypatch.setattr(packages, "rslab", lambda A: lambda b: 2 * b)
    factor = factorize(chain(20))
    x = factor.solve(np.ones(20))
    np.testing.assert_allclose(chain(20) @ x, 1, rtol=1e-12)
    assert factor.name == "superlu"
    assert "rslab" in factor.notes[0]


def test_a_slightly_wrong_package_is_refined(monkeypatch):
    good = packages.superlu
    monkeypatch.setattr(packages, "rslab", lambda A: lambda b: (1 + 1e-6) * good(A)(b))
    factor = factorize(chain(20))
    np.testing.assert_allclose(chain(20) @ factor.solve(np.ones(20)), 1, rtol=1e-11)
    assert factor.name == "rslab"
    assert factor.notes == ()


@pytest.mark.parametrize("column", [0, 17, 39])
def test_one_wrong_column_among_many_is_found(monkeypatch, two_packages, column):
    good = packages.superlu

    def slips(A):
        def wrong(b):
            x = good(A)(b)
            if b.ndim == 2 and b.shape[1] == 40:
                x[3, column] *= 1.001
            return x

        return wrong

    monkeypatch.setattr(packages, "rslab", slips)
    factor = factorize(chain(20))
    b = np.random.default_rng(2).standard_normal((20, 40)) * 10.0 ** np.arange(-20, 20)
    x = factor.solve(b)
    assert factor.name == "superlu"
    assert (np.abs(chain(20) @ x - b).max(axis=0) <= 1e-9 * np.abs(b).max(axis=0)).all()


def test_a_failing_package_is_replaced(monkeypatch, two_packages):
    def fails(A):
        if A[0, 0] == 2.0:
            raise RuntimeError("zero pivot")
        return packages.superlu(A)

    monkeypatch.setattr(packages, "rslab", fails)
    factor = factorize(chain(20))
    assert factor.name == "superlu"
    assert "zero pivot" in factor.notes[0]


def test_no_package_left(monkeypatch):
    monkeypatch.setattr(packages, "superlu", lambda A: lambda b: 2 * b)
    with pytest.raises(SingularSystem, match="superlu"):
        factorize(chain(20), method="superlu").solve(np.ones(20))


def test_superlu_note_above_its_size(monkeypatch):
    monkeypatch.setattr(packages, "SUPERLU_LIMIT", 10)
    monkeypatch.setattr(solve, "is_installed", lambda name: name == "superlu")
    assert "pip install rslab" in factorize(chain(20), method="superlu").notes[0]


def indefinite(n, shift):
    return sp.csr_array(laplacian3(n) - shift * sp.identity(n**3))


@pytest.mark.parametrize("method", ["auto", "single", "rslab", PARDISO, "superlu", "amg", "cg", "minres"])
@pytest.mark.parametrize("shift", [2.0, 6.9])
def test_an_indefinite_matrix_is_solved_by_every_method(method, shift):
    # shift 6.9 makes the diagonal negative, shift 2 does not show there
    A = indefinite(8, shift)
    x = np.random.default_rng(3).standard_normal((512, 3))
    factor = factorize(A, method=method, reserve=False)
    np.testing.assert_allclose(factor.solve(A @ x), x, rtol=0, atol=1e-6)
    below = int((np.linalg.eigvalsh(A.toarray()) < 0).sum())
    if factor.name in ("rslab", "pardiso"):
        assert factor.negative == below
    if method in ("amg", "cg", "minres"):
        assert factor.name == "minres"
        assert factor.iterations > 0


@pytest.mark.parametrize("method", ["auto", "superlu", PARDISO])
def test_an_indefinite_matrix_without_a_diagonal(method):
    A = sp.csr_array(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 2.0], [0.0, 2.0, 1.0]]))
    np.testing.assert_allclose(A @ factorize(A, method=method).solve(np.r_[1.0, 2.0, 3.0]), [1, 2, 3], atol=1e-13)


@pytest.mark.parametrize("method", ["auto", PARDISO])
def test_a_singular_indefinite_matrix_is_named(method):
    A = sp.block_diag([sp.csr_array([[0.0, 1.0], [1.0, 0.0]]), chain(20, held=False)], format="csr")
    with pytest.raises(SingularSystem):
        factorize(A, method=method).solve(np.ones(22))


def test_single_precision_gives_double_precision():
    A = laplacian3(9)
    b = np.random.default_rng(4).standard_normal((729, 3))
    factor = factorize(A, method="single")
    assert np.abs(A @ factor.solve(b) - b).max() < 1e-13 * np.abs(b).max()
    assert (factor.name, factor.notes) == ("single", ())
    assert 2 <= factor.iterations <= 5


def test_what_is_too_stiff_for_single_precision_goes_to_double_without_a_note(two_packages):
    A = chain(40).tolil()
    A[9:11, 9:11] += 1e10 * np.array([[1, -1], [-1, 1]])
    factor = factorize(A, method="single")
    assert (factor.name, factor.notes) == ("rslab", ())
    assert factor.solve(np.r_[np.zeros(39), 1.0])[39] == pytest.approx(39, rel=1e-5)


def test_what_does_not_fit_into_memory_is_refused_before_it_starts(monkeypatch):
    monkeypatch.setattr(packages, "available_memory", lambda: 1e3)
    with pytest.raises(TooLarge) as caught:
        factorize(laplacian3(7), method="rslab")
    assert caught.value.limit == 1e3 < caught.value.needed


def test_multigrid_that_does_not_converge_gives_way_to_a_factorisation(monkeypatch, two_packages):
    monkeypatch.setattr(iterations, "FEW_ITERATIONS", 2)
    factor = factorize(laplacian3(12), method="amg")
    factor.solve(np.ones(1728))
    assert factor.name == "rslab"
    assert "2 iterations leave" in factor.notes[0]


def test_a_trial_that_takes_too_long_gives_way_without_a_note(two_packages):
    matrix = sp.kron(laplacian3(6), sp.eye_array(3), format="csr")
    patient = factorize(matrix, method="amg", block=3, reserve=True)
    assert patient.name == "amg"
    factor = factorize(matrix, method="amg", block=3, reserve=True, trial=1)
    assert factor.name not in ("amg", "cg")
    assert factor.notes == ()
    b = np.random.default_rng(3).standard_normal(matrix.shape[0])
    np.testing.assert_allclose(matrix @ factor.solve(b), b, atol=1e-9)


@pytest.mark.skipif(not packages.is_installed("pardiso"), reason="PARDISO IS NOT TESTED HERE: pip install pypardiso")
def test_pardiso_gives_its_memory_back():
    from pypardiso import PyPardisoSolver

    freed = []
    solver = PyPardisoSolver.free_memory
    try:
        PyPardisoSolver.free_memory = lambda self: (freed.append(self), solver(self))
        factor = factorize(laplacian3(5), method="pardiso")
        factor.solve(np.ones(125))
        assert freed == []
        del factor
        assert len(freed) == 1
    finally:
        PyPardisoSolver.free_memory = solver


def test_bad_input():
    with pytest.raises(BadValue):
        factorize(chain(4), method="gauss")
    with pytest.raises(BadValue):
        factorize(np.nan * chain(4))
    with pytest.raises(BadValue):
        factorize(chain(4)).solve(np.full(4, np.inf))


def test_nothing_to_solve():
    assert factorize(sp.csr_matrix((0, 0))).solve(np.zeros(0)).shape == (0,)
    assert factorize(chain(4)).solve(np.zeros((4, 0))).shape == (4, 0)
    np.testing.assert_array_equal(factorize(chain(4)).solve(np.zeros(4)), 0)


@pytest.mark.parametrize("method", ["amg", "cg", "single", "auto"])
def test_a_mechanism_that_the_load_leaves_alone_is_found(method):
    # the loose part is not loaded: every residual looks right
    A = sp.block_diag([laplacian3(9), chain(600, held=False)], format="csr")
    b = np.r_[np.ones(729), np.zeros(600)]
    with pytest.raises(SingularSystem) as caught:
        factorize(A, method=method).solve(b)
    np.testing.assert_array_equal(caught.value.unknowns, np.arange(729, 1329))
