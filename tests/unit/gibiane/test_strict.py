"""--strict: error 3 for what Cast3M finds too long."""

import io

import pytest

from gibiane.check import problems
from gibiane.session import Session
from gibiane.source import SourceText

COMMENT = "\n* " + "a comment inside the instruction " * 3 + "\n"


def text(length: int) -> str:
    """Return an instruction of so many characters."""
    start = "MESS '"
    return start + "x" * (length - len(start) - 2) + "';"


def run(script: str, strict: bool) -> tuple[int, str]:
    out = io.StringIO()
    session = Session(out=out, err=out)
    session.options["STRICT"] = strict
    return session.run_text(script, "s.dgibi"), out.getvalue()


@pytest.mark.parametrize(("length", "strict", "code"), [(500, True, 0), (501, True, 8), (501, False, 0)])
def test_long_instructions(length: int, strict: bool, code: int) -> None:
    found, shown = run(text(length), strict)
    assert found == code
    assert ("error[3]" in shown) == (code == 8)


def test_comments_do_not_count() -> None:
    script = "X = PROG 1. " + COMMENT * 10 + " 2. ; MESS (DIME X) ;"
    assert run(script, True) == (0, "2\n")


def test_check_says_the_same() -> None:
    source = SourceText("s.dgibi", text(600))
    assert problems(source) == []
    assert [d.code for d in problems(source, strict=True)] == ["3"]
