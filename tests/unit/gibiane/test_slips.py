"""Texts with one character lost: a sound text is left alone, a broken one is located."""

from __future__ import annotations

from pathlib import Path

import pytest

from gibiane.check import problems
from gibiane.lexer import tokens
from gibiane.session import Session
from gibiane.source import SourceText, decode

FRAGMENTS = sorted((Path(__file__).parents[2] / "data" / "fragments").glob("*.dgibi"))
NAMES = [path.stem for path in FRAGMENTS]
# Breaks that no reader could see: what remains is a correct text with another meaning.
INVISIBLE = 12


def _read(path: Path) -> str:
    return decode(path.read_bytes())


def _found(text: str) -> list[tuple[int, str]]:
    """Return the lines that a check points at, with codes: of the place itself and of its labels."""
    return [
        (label.line, d.code)
        for d in problems(SourceText("broken", text))
        for label in [d.span, *(label.span for label in d.labels)]
        if label is not None
    ]


def test_there_are_enough_fragments() -> None:
    assert len(FRAGMENTS) >= 60


@pytest.mark.parametrize("path", FRAGMENTS, ids=NAMES)
def test_a_sound_text_is_left_alone(path: Path) -> None:
    assert problems(SourceText(path.name, _read(path))) == []


def _places(text: str, kinds: str) -> list[int]:
    if "FIN ;\nwhat" in text:
        text = text[: text.index("what")]
    found = []
    for token in tokens(SourceText("x", text), {}):
        if token.type == "STRING" and "'" in kinds:
            found += [token.start_pos, token.end_pos - 1]
        elif token.type in ("SEMI", "LPAR", "RPAR") and token.value in kinds:
            found.append(token.start_pos)
    return found


@pytest.mark.parametrize("kind", ["'", "("])
@pytest.mark.parametrize("how", ["lost", "doubled"])
@pytest.mark.parametrize("path", FRAGMENTS, ids=NAMES)
def test_a_broken_apostrophe_or_parenthesis_is_located(path: Path, how: str, kind: str) -> None:
    text = _read(path)
    if path.stem == "after_the_end" and kind == "'":
        pytest.skip("the note after FIN holds an apostrophe of its own")
    for at in _places(text, kind):
        broken = text[:at] + (kind * 2 if how == "doubled" else "") + text[at + 1 :]
        line = text.count("\n", 0, at) + 1
        assert any(found in (line, line + 1) for found, _ in _found(broken)), broken


def test_a_lost_semicolon_is_located() -> None:
    missed = []
    for path in FRAGMENTS:
        text = _read(path)
        for at in _places(text, ";"):
            before, after = text[:at], text[at + 1 :]
            if before.rstrip(" \n")[-1:] in (";", "") or after.lstrip(" \n")[:1] == ";":
                continue  # one of two in a row
            line = text.count("\n", 0, at) + 1
            if not any(found in (line, line + 1) for found, _ in _found(before + after)):
                missed.append((path.stem, line))
    assert len(missed) <= INVISIBLE, missed


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("X = 3\nMESS X ;\n", 1),
        ("SI VRAI\n MESS 'a' ;\nFINSI ;\n", 1),
        ("SI VRAI ;\n MESS 'a'\nFINSI ;\n", 2),
        ("REPE B 2\n X = 1 ;\nFIN B ;\n", 1),
        ("T = TABL ;\nT.1 = 2\nT.2 = 3 ;\n", 2),
        ("MESS 'a' ;\nX = 'b ;\nMESS 'c' ;\n", 2),
        ("MESS 'a' ;\nX = b' ;\nMESS 'c' ;\nMESS 'd' ;\n", 2),
        ("MESS 'a'\nX = (3 + 4 ;\n", 1),
        ("X = (3 +\n 4 ;\n", 1),
        ("X = 1 ;\nY = 2 Z = 3 ;\n", 2),
        ("DEBP F x*ENTIER\n MESS x ;\nFINP ;\n", 1),
        ("MESS 1 ;\nX = 3 ", 2),
    ],
)
def test_places(text: str, line: int) -> None:
    assert {found for found, _ in _found(text)} & {line, line + 1}


def test_a_certain_slip_stops_before_the_instruction_runs(capsys: pytest.CaptureFixture[str]) -> None:
    session = Session()
    assert session.run_text("MESS 'before' ;\nX = 3\nMESS X ;\n", "x.dgibi") == 8
    shown = capsys.readouterr()
    assert shown.out == "before\n"
    assert "x.dgibi:2:5" in shown.err


def test_a_likely_slip_is_a_note_of_the_error_it_causes(capsys: pytest.CaptureFixture[str]) -> None:
    session = Session()
    session.run_text("L = PROG 1.\nTRAC L ;\n", "x.dgibi")
    assert "is a ; missing at the end of line 1?" in capsys.readouterr().err


def test_one_lost_character_gives_one_message() -> None:
    text = "SI (X EGA 1) ;\n  MESS 'a'\nFINSI ;\nREPE B 2 ;\nFIN B ;\n"
    assert len(problems(SourceText("x", text))) == 1
