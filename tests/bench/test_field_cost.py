"""Stresses, equivalent stresses, pressures, unions and merges, against a bare gather and einsum of the same size."""

import io

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gibiane.session import Session
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.values.champs import DIFFUS, ChPoint
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.nodes import node_store


def split(points, cells):
    """Cut cubes into six tetrahedra, squares into two triangles."""
    if cells.shape[1] == 4:
        return np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    six = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
    return np.concatenate([cells[:, list(corners)] for corners in six])


def session_of(name, points, cells):
    """Return a session with a mesh V, its model MO, material MA and a displacement U."""
    session = Session(out=io.StringIO(), err=io.StringIO())
    dim = points.shape[1]
    session.run_text(f"OPTI DIME {dim} ELEM {name} ;")
    store = node_store(session)
    nodes = store.add(points)
    session.globals.names["V"] = Maillage.of(store, name, nodes[cells])
    u = np.random.default_rng(1).standard_normal(points.shape)
    session.globals.names["U"] = ChPoint.from_table(store, ["UX", "UY", "UZ"][:dim], nodes, u, DIFFUS)
    text = "MO = MODE V 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.E5 'NU' 0.3 ; SI1 = SIGM MO MA U ;"
    assert session.run_text(text) == 0, session.err.getvalue()
    return session, u


def runs(session, text):
    def run():
        assert session.run_text(text) == 0, session.err.getvalue()

    return run


def bare_stress(name, points, cells, u):
    """Gather coordinates and displacements, then one einsum for the gradients of each and one for the stress."""
    of = shape(name)
    dN = of.dN(of.gauss[0])
    d = points.shape[1]
    D = np.ones((d * d, 6 if d == 3 else 4))

    def run():
        grad_x = np.einsum("mni,qnd->mqid", points[cells], dN, optimize=True)
        grad_u = np.einsum("mni,qnd->mqid", u[cells], dN, optimize=True)
        return grad_x, np.einsum("mqi,ij->mqj", grad_u.reshape(*grad_u.shape[:2], -1), D, optimize=True)

    return run


CASES = {"TRI3": (388, 388), "TET4": (37, 37, 37), "CUB8": (67, 67, 67)}


@pytest.mark.bench
@pytest.mark.parametrize("name", CASES)
def test_stresses(bench, make_grid, name):
    points, cells = make_grid(*CASES[name])
    if name != "CUB8":
        cells = split(points, cells)
        X = points[cells]
        assert (np.linalg.det(X[:, 1:] - X[:, :1]) > 0).all()
    session, u = session_of(name, points, cells)
    size = f"{len(cells)} {name}"
    bare = {"gather + einsum": bare_stress(name, points, cells, u)}
    bench.compare("SIGM", size, runs(session, "S = SIGM MO MA U ;"), bare, aim=3)
    stress = session.names()["SI1"].zones[0].values
    quadratic = np.eye(stress.shape[-1])
    quadratic_form = {"einsum": lambda: np.sqrt(np.einsum("mqi,ij,mqj->mq", stress, quadratic, stress, optimize=True))}
    bench.compare("VMIS", size, runs(session, "S = VMIS MO SI1 ;"), quadratic_form, aim=3)
    bench.compare("LISSER 'MOYE'", size, runs(session, "S = LISSER 'MOYE' MO SI1 ;"), bare, aim=3)


@pytest.mark.bench
def test_pressure(bench, make_grid):
    points, cells = make_grid(548, 548, 1)
    session, _ = session_of("CUB8", points, cells)
    faces = cells[:, [4, 5, 6, 7]]
    store = node_store(session)
    session.globals.names["TOP"] = Maillage.of(store, "QUA4", faces)
    of = shape("QUA4")
    xi = of.gauss[0]
    dN, N = of.dN(xi), of.N(xi)

    def bare():
        tangents = np.einsum("mni,qnd->mqid", points[faces], dN, optimize=True)
        return np.einsum("qn,mqid->mni", N, tangents, optimize=True)

    size = f"{len(faces)} QUA4"
    bench.compare("PRES", size, runs(session, "F = PRES 'MASS' MO 1. TOP ;"), {"gather + einsum": bare}, aim=3)


@pytest.mark.bench
def test_unions_and_merges(bench, make_grid):
    points, cells = make_grid(67, 67, 67)
    session, _ = session_of("CUB8", points, cells)
    store = node_store(session)
    session.globals.names["W"] = Maillage.of(store, "CUB8", store.add(points + [67.0, 0, 0])[cells])

    def bare():
        return np.einsum("mni->mi", np.concatenate([points[cells], points[cells]]), optimize=True)

    size = f"2 x {len(cells)} CUB8"
    bench.compare("ET", size, runs(session, "S = V ET W ;"), {"gather + einsum": bare}, aim=3)

    def by_hand():
        both = np.concatenate([points, points + 1e-9])
        return cKDTree(both).query_pairs(1e-6, output_type="ndarray")

    def copy():
        session.globals.names["C"] = Maillage.of(store, "CUB8", store.add(points + 1e-9)[cells])
        runs(session, "ELIM (V ET C) 1.E-6 ;")()

    bench.compare("ELIM", size, copy, {"gather + einsum": bare, "SciPy cKDTree": by_hand}, aim=3)
