"""What RESO keeps between calls: found again for other coefficients, loads and methods, never for another matrix."""

import io

import pytest

from gibiane.session import Session
from gibiane_ops.kernels.contact import condense as condensing

SCENE = """OPTI DIME 2 ELEM QUA4 MODE PLAN DEFO ;
BAS = (DROI 4 (0. 0.) (2. 0.)) TRAN 2 (0. 1.) ; HAUT = (DROI 4 (0. 1.) (2. 1.)) TRAN 2 (0. 1.) ;
MO = MODE (BAS ET HAUT) 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 1000. 'NU' 0.3 ;
K = RIGI MO MA ; CL = BLOQ 'DEPL' (COTE 1 BAS) ;
F = (PRES 'MASS' MO 10. (COTE 3 HAUT)) ET (FORC 'FX' 1. (COTE 3 HAUT)) ;
MC = MODE (COTE 3 BAS) (COTE 1 HAUT) 'CONTACT' 'FROTTANT' 'COULOMB' ;
DEBP ETUDE MO*'MMODEL' MA*'MCHAML' B*'MAILLAGE' MC*'MMODEL' MU*'FLOTTANT' F*'CHPOINT' ;
  RC JC = RIGI MC (MATE MC 'MU' MU) ;
  U = RESO ((RIGI MO MA) ET (BLOQ 'DEPL' B) ET RC) (F ET JC) ;
FINP U ;
"""


@pytest.fixture
def session(monkeypatch):
    """Return a session with the scene, and a list that grows by one at each factorisation of tied bodies."""
    found = Session(out=io.StringIO(), err=io.StringIO())
    assert found.run_text(SCENE) == 0, found.err.getvalue()
    made = []
    tied = condensing.tied_solver

    def counted(*arguments, **options):
        made.append(1)
        return tied(*arguments, **options)

    monkeypatch.setattr(condensing, "tied_solver", counted)
    found.made = made
    return found


def run(session, text):
    assert session.run_text(text) == 0, session.err.getvalue()
    return len(session.made)


def test_coefficients_gaps_loads_and_methods_share_one_factorisation(session):
    first = "RC JC = RIGI MC (MATE MC 'MU' 0.2) ; U1 = RESO (K ET CL ET RC) (F ET JC) ;"
    assert run(session, first) == 1
    assert (
        run(
            session,
            "REPE B 3 ; RC JC = RIGI MC (MATE MC 'MU' (0.1 * &B)) ; U = RESO (K ET CL ET RC) (F ET JC) ; FIN B ;",
        )
        == 1
    )
    assert run(session, "RC JC = RIGI MC (MATE MC 'MU' 0.2 'JEU' 1.E-4) ; U = RESO (K ET CL ET RC) (F ET JC) ;") == 1
    assert run(session, "U = RESO (K ET CL ET RC) ((0.5 * F) ET JC) 'TRES' ;") == 1
    assert run(session, "V = RESO (K ET CL ET RC) (F ET JC) 'NOUN' ;") == 1


def test_procedures_that_make_the_matrices_anew_find_it(session):
    for mu in (0.2, 0.3):
        assert run(session, f"U = ETUDE MO MA (COTE 1 BAS) MC {mu} F ;") == 1
    assert run(session, "RC JC = RIGI MC (MATE MC 'MU' 0.3) ; V = RESO (K ET CL ET RC) (F ET JC) ;") == 1
    assert run(session, "MESS ((MAXI (U ENLE 'LX' - (V ENLE 'LX')) 'ABS') < 1.E-12) ;") == 1


def test_another_matrix_condition_or_solver_is_not_taken_for_it(session):
    run(session, "RC JC = RIGI MC (MATE MC 'MU' 0.2) ; U = RESO (K ET CL ET RC) (F ET JC) ;")
    assert run(session, "K2 = RIGI MO (MATE MO 'YOUN' 1001. 'NU' 0.3) ; U = RESO (K2 ET CL ET RC) (F ET JC) ;") == 2
    assert run(session, "C2 = CL ET (BLOQ 'UX' (COTE 3 HAUT)) ; U = RESO (K2 ET C2 ET RC) (F ET JC) ;") == 3
    assert run(session, "OPTI 'RESO' 'DIRE' ; U = RESO (K2 ET C2 ET RC) (F ET JC) ;") == 4


def test_linear_and_contact_solutions_keep_theirs_side_by_side(session):
    both = "RC JC = RIGI MC (MATE MC 'MU' 0.2) ; U = RESO (K ET CL ET RC) (F ET JC) ; C3 = BLOQ 'DEPL' HAUT ;"
    assert run(session, both) == 1
    kinds = session.state["factors"]
    assert set(kinds) == {"contact"}
    assert run(session, "L = RESO (K ET CL ET C3) F ; U = RESO (K ET CL ET RC) (F ET JC) ;") == 1
    assert set(kinds) == {"contact", "factor"}
    run(session, "K2 = RIGI MO (MATE MO 'YOUN' 1001. 'NU' 0.3) ; L = RESO (K2 ET CL ET C3) F ;")
    assert set(kinds) == {"factor"}  # results of other matrices go
