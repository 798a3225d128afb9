"""RESO chooses by the memory there is, says what it chose, and takes another package when one is missing or wrong."""

import io

import pytest

from gibiane.session import Session
from gibiane_ops.kernels import choice, packages, solve

SCENE = """OPTI DIME 3 ELEM CUB8 ;
B = (DROI 4 (0 0 0) (1 0 0)) TRAN 4 (0 1 0) ; V = B VOLU 4 'TRAN' (0 0 1) ;
MO = MODE V 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 1. 'NU' 0.3 ;
K = (RIGI MO MA) ET (BLOQ 'DEPL' B) ; F = FORC (0 0 -1.) (V FACE 2) ; OPTI 'ECHO' 1 ;
"""


@pytest.fixture
def session():
    found = Session(out=io.StringIO(), err=io.StringIO())
    assert found.run_text(SCENE) == 0, found.err.getvalue()
    return found


def test_what_does_not_fit_is_iterated(session, monkeypatch):
    monkeypatch.setattr(packages, "available_memory", lambda: 1e3)
    monkeypatch.setattr(solve, "is_installed", lambda name: name == "rslab")
    assert session.run_text("U = RESO K F ;") == 0, session.err.getvalue()
    said = session.out.getvalue()
    assert "sparse LDLt" in said
    assert "algebraic multigrid" in said
    assert "iterations" in said


def test_a_factorisation_that_the_user_wants_and_that_does_not_fit(session, monkeypatch):
    monkeypatch.setattr(packages, "available_memory", lambda: 1e3)
    monkeypatch.setattr(solve, "is_installed", lambda name: name == "rslab")
    assert session.run_text("OPTI 'RESO' 'DIRE' ; U = RESO K F ;") != 0
    assert "error[G414]" in session.err.getvalue()
    assert "'ITER'" in session.err.getvalue()


def test_superlu_is_the_last_resort_and_says_so(session, monkeypatch):
    for module in (choice, solve):
        monkeypatch.setattr(module, "is_installed", lambda name: name == "superlu")
    monkeypatch.setattr(packages, "SUPERLU_LIMIT", 100)
    assert session.run_text("OPTI 'RESO' 'DIRE' ; U = RESO K F ;") == 4
    assert "pip install rslab" in session.err.getvalue()


def test_a_wrong_package_gives_way_with_a_warning(session, monkeypatch):
    monkeypatch.setattr(packages, "rslab", lambda A, single=False: packages.Factored(lambda b: 2 * b, 0))
    monkeypatch.setattr(solve, "is_installed", lambda name: name in ("rslab", "superlu"))
    assert session.run_text("U = RESO K F ; MESS ((MAXI (EXCO 'UZ' U) 'ABS') > 0.) ;") == 4
    assert "warning[G201]" in session.err.getvalue()
    assert "answer discarded" in session.err.getvalue()
    assert "VRAI" in session.out.getvalue()


def test_one_factorisation_serves_further_calls(session, monkeypatch):
    calls = []
    good = packages.rslab
    monkeypatch.setattr(packages, "rslab", lambda A, single=False: (calls.append(A), good(A, single=single))[1])
    text = "U = RESO K F ; U1 U2 = RESO K F (2. * F) ; L = RESO K (SUIT F F F) ;"
    assert session.run_text(text) == 0, session.err.getvalue()
    assert len(calls) == 1
    assert session.run_text("W = RESO ((2. * (RIGI MO MA)) ET (BLOQ 'DEPL' B)) F ;") == 0
    assert len(calls) == 2
