"""RESO by the corrected small model, from a script: same results as by the exact stiffness, told, and interruptible."""

import io

import numpy as np
import pytest

from gibiane.session import Session
from gibiane_ops.kernels.contact import strategy
from gibiane_ops.values import contact_run

SCENE = """OPTI DIME 3 ELEM CUB8 ;
B = (DROI 6 (0. 0. -6.) (6. 0. -6.)) TRAN 6 (0. 6. 0.) ; V1 = B VOLU 6 'TRAN' (0. 0. 6.) ;
T = (DROI 3 (2. 2. 0.) (5. 2. 0.)) TRAN 3 (0. 3. 0.) ; V2 = T VOLU 3 'TRAN' (0. 0. 3.) ;
MO = MODE (V1 ET V2) 'MECANIQUE' 'ELASTIQUE' ; K = RIGI MO (MATE MO 'YOUN' 1000. 'NU' 0.3) ; CL = BLOQ 'DEPL' B ;
F = (PRES 'MASS' MO 3. (FACE 2 V2)) ET (FORC 'FX' 2. (FACE 2 V2)) ;
MC = MODE (FACE 2 V1) (FACE 1 V2) 'CONTACT' 'FROTTANT' 'COULOMB' ; RC JC = RIGI MC (MATE MC 'MU' 0.2) ;
"""
SOLVE = "T = TABL ; U = RESO (K ET CL ET RC) (F ET JC) 'RAPP' T {} ;"


@pytest.fixture
def session():
    found = Session(out=io.StringIO(), err=io.StringIO())
    assert found.run_text(SCENE) == 0, found.err.getvalue()
    return found


@pytest.fixture
def corrected(monkeypatch):
    """Take the small model whatever the size, with one ring of nodes."""
    monkeypatch.setattr(strategy, "SMALL", 0)
    monkeypatch.setattr(strategy, "FEW", 0)
    monkeypatch.setattr("gibiane_ops.kernels.contact.small_model.RINGS", 1)


def solve(session, options="", words=""):
    session.state.get("factors", {}).clear()
    assert session.run_text(options + SOLVE.format(words)) == 0, session.err.getvalue()
    names = session.names()
    return {name: values for name, (_, values) in names["U"].parts.items()}, names["T"]


@pytest.mark.parametrize("solver", ["DIRE", "ITER"])
@pytest.mark.parametrize("words", ["", "'TRES'", "'PROJ'"])
def test_same_solution_and_report(session, request, solver, words):
    exact, table = solve(session, "", words)
    request.getfixturevalue("corrected")
    found, other = solve(session, f"OPTI 'RESO' '{solver}' ;", words)
    assert contact_of(session).learned is not None
    for name, values in exact.items():
        np.testing.assert_allclose(found[name], values, atol=3e-8 * np.abs(values).max())
    assert list(other.get("STATUTS").values) == list(table.get("STATUTS").values)
    assert other.get("CONVERGE") is True


def contact_of(session):
    return session.state["factors"]["contact"][3].bodies


def test_echo_tells_the_way_and_the_corrections(session, corrected):
    solve(session, "OPTI ECHO 1 'RESO' 'ITER' ;")
    told = [line for line in session.out.getvalue().splitlines() if line.startswith(" RESO :")]
    assert "multigrid, contact corrected on a small model of 16 pairs, about" in told[0]
    assert told[-1].endswith("corrections")


def test_methods_with_laws_of_their_own_take_the_exact_stiffness(session, corrected):
    solve(session, "", "'PENA' 1.E4")
    assert contact_of(session).is_exact


def test_an_interruption_keeps_the_session(session, corrected, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(contact_run, "solve_on_bodies", interrupted)
        session.interactive = True
        session.run_text(SOLVE.format(""))
        assert "interrupted" in session.err.getvalue()
    assert "U" not in session.names()
    first, _ = solve(session)
    again, _ = solve(session)
    np.testing.assert_array_equal(first["UX"], again["UX"])


def energy_of(difference, session):
    """Return the square root of ``du . K du`` of a difference of solutions named by an expression."""
    script = f"D = {difference} ; Q = K * (ENLE D 'LX') ;"
    assert session.run_text(script) == 0, session.err.getvalue()
    names = session.names()
    parts = names["D"].parts
    force = names["Q"].parts
    total = 0.0
    for axis in "XYZ":
        nodes, values = parts[f"U{axis}"]
        total += float(values @ names["Q"].at(f"F{axis}", nodes)) if f"F{axis}" in force else 0.0
    return np.sqrt(max(total, 0.0))


@pytest.mark.parametrize("solver", ["DIRE", "ITER"])
def test_corrections_stop_at_a_tenth_of_the_error_of_the_mesh(session, corrected, solver):
    option = f"OPTI 'RESO' '{solver}' ;"
    _, whole = solve(session, option)
    assert session.run_text("U0 = U ;") == 0
    assert whole.get("CONVERGE") is True
    size = energy_of("U0", session)
    assert whole.get("SOLVEUR") < 1e-7 * size
    stopped = 0
    for share in (3.0, 0.3, 0.03, 3e-3):
        aim = share * size
        _, table = solve(session, option, f"'ARRE' {aim:.15E}")
        true, estimate = energy_of("U - U0", session), table.get("SOLVEUR")
        assert estimate < 0.1 * aim
        assert true / 3 <= estimate <= 3 * true or true < 1e-8 * size
        if not table.get("CONVERGE"):
            stopped += 1
            assert "ARRE" in table.get("MESSAGE")
    assert stopped >= 2


def test_early_stop_without_report_is_noted(session, corrected):
    assert session.run_text("U = RESO (K ET CL ET RC) (F ET JC) 'ARRE' 1.E3 ;") == 0
    assert "G418" in session.err.getvalue() + session.out.getvalue()


def test_condensed_contact_does_not_stop_early(session):
    exact, table = solve(session)
    found, other = solve(session, words="'ARRE' 1.E3")
    assert other.get("CONVERGE") is True
    assert other.get("SOLVEUR") == table.get("SOLVEUR")
    for name, values in exact.items():
        np.testing.assert_array_equal(found[name], values)


def test_krylov_equals_newton(session):
    exact, table = solve(session)
    found, other = solve(session, words="'KRYL'")
    bodies = contact_of(session)
    assert bodies.factor.name == "amg"
    assert not bodies.is_exact
    assert bodies.learned is not None
    for name, values in exact.items():
        np.testing.assert_allclose(found[name], values, atol=1e-8 * np.abs(values).max())
    assert other.get("METHODE") == "KRYL"
    assert list(other.get("STATUTS").values) == list(table.get("STATUTS").values)


def test_a_method_that_needs_the_exact_stiffness_takes_a_factor_though_multigrid_was_kept(
    session, corrected, monkeypatch
):
    monkeypatch.setattr("gibiane_ops.kernels.choice.SMALL", 0)
    monkeypatch.setattr("gibiane_ops.kernels.choice.EACH", 100)
    solve(session)
    assert not contact_of(session).tied.direct
    assert session.run_text(SOLVE.format("'PENA' 1.E4")) == 0
    assert contact_of(session).tied.direct
    # and back: the exact stiffness that is there serves
    kept = contact_of(session)
    assert session.run_text(SOLVE.format("")) == 0
    assert contact_of(session) is kept


def test_graded_elements_take_a_factor_where_multigrid_iterates_long(session, corrected, monkeypatch):
    monkeypatch.setattr("gibiane_ops.kernels.contact.tied.SLOW", 1)
    monkeypatch.setattr("gibiane_ops.kernels.contact.tied.factor_is_faster", lambda *_: True)
    exact, _ = solve(session)
    found, _ = solve(session, "OPTI ECHO 1 'RESO' 'ITER' ;")
    assert contact_of(session).tied.direct
    assert " RESO : multigrid iterates long on these elements, a factor takes over" in session.out.getvalue()
    for name, values in exact.items():
        np.testing.assert_allclose(found[name], values, atol=3e-8 * np.abs(values).max())
