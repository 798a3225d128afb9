"""Texts that are too deep, too long or no texts: a diagnostic in good time, never a traceback."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from gibiane.check import problems
from gibiane.cli import main
from gibiane.session import Session
from gibiane.source import SourceText

DEEP = 100_000


def _run(text: str, **options: bool) -> tuple[int, str]:
    shown = io.StringIO()
    session = Session(out=shown, err=shown)
    session.options.update(options)
    code = session.run_text(text, "x")
    assert not session.internal, shown.getvalue()[:500]
    return code, shown.getvalue()


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("X = " + "(" * 20_000 + "1" + ")" * 20_000 + " ;", "G103"),
        ("X = " + "(" * DEEP + " ;", "error[1]"),
        ("X = " + "(" * 5_000 + "1" + " + 1)" * 5_000 + " ;", "G103"),
        ("X = T" + " . A" * 3_000 + " ;", "error[11]"),
        ("=" * DEEP + ";", "error[1014]"),
        ("'" * (DEEP + 1), "G102"),
        ("X = " + "9" * DEEP + " ;", "a number of 100000 characters"),
        ("DEBP F n*ENTIER ; X = F (n + 1) ; FINP X ; Y = F 1 ;", "deeper than 500"),
        ("DEBP F ; G ; FINP ; DEBP G ; F ; FINP ; F ;", "deeper than 500"),
        ("T = TEXTE 'T' ; T ; T ;", "a TEXTE contains itself"),
        ("T = 'a' ; REPE B 40 ; T = ET T T ; FIN B ;", "error[1114]"),
        ("X = 9 ** 999999999 ;", "error[26]"),
        ("\x01\x02\x7f ;", "G101"),
        ("A " * 20_000 + "= 1 ;", "error[37]"),
    ],
)
def test_too_much_is_refused(text: str, error: str) -> None:
    code, shown = _run(text)
    assert code == 8
    assert error in shown
    assert len(shown) < 4000
    problems(SourceText("x", text))


@pytest.mark.parametrize(
    "text",
    ["A" * DEEP + " = 3 ;", " " * 10 * DEEP, "\n" * 10 * DEEP, "X = '" + "a" * DEEP + "' ;", "L = PROG 1000000*1. ;"],
)
def test_what_is_only_long_is_read(text: str) -> None:
    assert _run(text) == (0, "")


def test_an_integer_of_many_digits_is_printed() -> None:
    _, shown = _run("X = 9 ** 9000 ; MESS X ;")
    assert shown.strip() == str(9**9000)


def test_a_long_line_is_shown_in_part() -> None:
    _, shown = _run("X = 3 ; " * 100 + "Y = (4 ; " + "X = 3 ; " * 100)
    assert max(len(line) for line in shown.splitlines()) < 190
    place, carets = shown.splitlines()[3:5]
    assert place[carets.index("^")] == "("


@pytest.mark.parametrize("data", [b"\x00\x01\x02", bytes(range(256)) * 10, b"\xff\xfe\x00a"])
def test_a_binary_file_is_refused(data: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = tmp_path / "x.dgibi"
    script.write_bytes(data)
    for arguments in ([str(script)], ["check", str(script)]):
        assert main(arguments) == 8
        assert "not a text file" in capsys.readouterr().err


def test_commands_are_run_only_where_it_is_allowed() -> None:
    code, shown = _run("EXTE 'echo hello' ;")
    assert code == 8
    assert "--allow-exec" in shown
    assert _run("EXTE 'echo' 'hello' 3 ;", EXEC=True) == (0, "hello 3\n")
    code, shown = _run("EXTE 'exit 3' ;", EXEC=True)
    assert "ended with code 3" in shown


def test_thousands_of_lines_are_checked() -> None:
    text = "X = PROG 1. 2. 3. ;\nSI (X EGA 3) ; MESS 'a' ; FINSI ;\n" * 2_500
    assert problems(SourceText("x", text)) == []
