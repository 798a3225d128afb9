"""OPTI DEBU 1: after an error at the prompt, the procedure that failed stays open to inspection."""

import io

from gibiane.session import Session

PROCEDURES = "DEBP INNER n ; L = PROG 1. 2. ; K = n + 'word' ; FINP K ;\nDEBP OUTER n ; R = INNER (2 * n) ; FINP R ;\n"


def prompt() -> tuple[Session, io.StringIO]:
    out = io.StringIO()
    session = Session(out=out, err=out, interactive=True)
    session.run_text(PROCEDURES, "<1>")
    return session, out


def test_the_scope_of_the_procedure_that_failed_can_be_inspected() -> None:
    session, out = prompt()
    session.run_text("OPTI DEBU 1 ; X = OUTER 4 ;", "<2>")
    assert "objects of INNER: " in out.getvalue()
    session.run_text("MESS 'n is' N ;", "<3>")
    session.run_text("MESS (DIME L) ;", "<4>")
    assert out.getvalue().endswith("n is8\n2\n")


def test_debu_0_goes_back_to_the_session() -> None:
    session, out = prompt()
    session.run_text("OPTI DEBU 1 ; X = OUTER 4 ;", "<2>")
    session.run_text("OPTI DEBU 0 ;", "<3>")
    session.run_text("MESS N ;", "<4>")
    assert out.getvalue().endswith("N\n")


def test_without_debu_the_session_is_where_it_was() -> None:
    session, out = prompt()
    session.run_text("X = OUTER 4 ;", "<2>")
    session.run_text("MESS N ;", "<3>")
    assert out.getvalue().endswith("N\n")
