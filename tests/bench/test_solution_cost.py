"""RESO on the two bonded blocks, against packages called by hand on the same matrix to the same residual."""

import io
from importlib.util import find_spec

import numpy as np
import pytest

from gibiane.session import Session
from gibiane_ops.kernels import choice
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.rigid import rigid_modes
from gibiane_ops.values.system import build

SCENE = """OPTI DIME 3 ELEM CUB8 ;
N1 = 8 * {n} ; N2 = 2 * {n} ;
B = (DROI N1 (-100. -100. -200.) (100. -100. -200.)) TRAN N1 (0. 200. 0.) ; V1 = B VOLU N1 'TRAN' (0. 0. 200.) ;
T = (DROI N2 (-25. -25. 0.) (25. -25. 0.)) TRAN N2 (0. 50. 0.) ; V2 = T VOLU N2 'TRAN' (0. 0. 50.) ;
V = V1 ET V2 ; ELIM V 1.E-3 ;
MO = MODE V 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 210000. 'NU' 0.3 ;
K = (RIGI MO MA) ET (BLOQ 'DEPL' B) ; F = PRES 'MASS' MO 3.125 (FACE 2 V2) ;
"""
TOLERANCE = 1e-10


class Asked:
    """The little of a context that numbering a system asks for."""

    def __init__(self, session):
        self.session = session
        self.state = session.state

    def option(self, name):
        return self.session.options[name]


def scene(n):
    """Return the session, and matrix, load, blocks and rigid modes of the reduced system."""
    session = Session(out=io.StringIO(), err=io.StringIO())
    assert session.run_text(SCENE.format(n=n)) == 0, session.err.getvalue()
    names = session.names()
    system = build(Asked(session), names["K"])
    F, imposed = system.load(Asked(session), names["F"])
    reduction = reduce_conditions(system.C, imposed)
    modes = rigid_modes(system.points, system.points.mean(axis=0))
    modes[np.setdiff1d(np.arange(reduction.n), reduction.free)] = 0.0
    b = np.zeros(reduction.n)
    b[reduction.free] = reduction.load(system.K, F)
    return session, reduction.matrix(system.K), b[reduction.free], reduction.whole_matrix(system.K, 3), b, modes


def by_rslab(A, b):
    import rslab

    return rslab.ldlt(A.tocsc()).solve(b)


def by_pyamg(A, b, modes):
    import pyamg

    smoother = ("block_gauss_seidel", {"sweep": "symmetric"})
    hierarchy = pyamg.smoothed_aggregation_solver(
        A, B=modes, strength=("symmetric", {"theta": 0.0}), presmoother=smoother, postsmoother=smoother, max_coarse=40
    )
    return hierarchy.solve(b, tol=TOLERANCE, accel="cg", maxiter=200)


def by_pardiso(A, b):
    import scipy.sparse as sp
    from pypardiso import PyPardisoSolver

    solver, upper = PyPardisoSolver(mtype=2), sp.triu(A, format="csr")
    solver.factorize(upper)
    return solver.solve(upper, b)


def by_cholmod(A, b):
    from sksparse.cholmod import cholesky

    return cholesky(A.tocsc())(b)


@pytest.mark.bench
def test_one_solution_and_the_next(bench, sizes):
    for n in sizes:
        session, A, b, whole, padded, modes = scene(n)
        size = f"T1 n={n}, {len(b)} unknowns"

        def fresh(session=session):
            session.state.get("factors", {}).clear()
            assert session.run_text("U = RESO K F ;") == 0

        def again(session=session):
            assert session.run_text("U = RESO K F ;") == 0

        peers = {}
        for name, module, run in (
            ("rslab", "rslab", lambda A=A, b=b: by_rslab(A, b)),
            ("pyamg CG", "pyamg", lambda A=whole, b=padded, modes=modes: by_pyamg(A, b, modes)),
            ("PARDISO", "pypardiso", lambda A=A, b=b: by_pardiso(A, b)),
            ("CHOLMOD", "sksparse", lambda A=A, b=b: by_cholmod(A, b)),
        ):
            if find_spec(module):
                peers[name] = run
            else:
                bench.skipped(name, module)
        bench.compare("RESO, first", size, fresh, peers, aim=1.2, best_of=True, rounds=2)
        fresh()
        bench.compare("RESO, same matrix", size, again, {}, rounds=2)
        method = choice.choose(len(b), A.nnz, 3, 1).method
        bench.notes.append(f"{size}: RESO chose {'direct' if method == 'auto' else method}")
