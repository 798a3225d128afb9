"""Warnings of a session at the prompt: on there, off in a script."""

from __future__ import annotations

import pytest

from gibiane.session import Session


def _shown(text: str, capsys: pytest.CaptureFixture[str], *, interactive: bool) -> str:
    Session(interactive=interactive).run_text(text, "x")
    return capsys.readouterr().err


CASES = [
    ("MESS = 3 ;", "the name MESS now hides the operator MESSAGE"),
    ("WHATEVER ;", "WHATEVER does nothing"),
    ("X = PROG1 2. ;", "the word PROG1 runs the operator PROGRESSION"),
    ("OPTI DIME 2 ; X = 3,5 ;", "3,5 is the point of coordinates 3 and 5: a comma is a blank"),
    ("OPTI DIME 2 ; Q = 0. 6./2. ;", "/ reads the two leftmost numbers, not those beside it"),
]


@pytest.mark.parametrize(("text", "warning"), CASES)
def test_a_likely_mistake_is_told_at_the_prompt(text: str, warning: str, capsys: pytest.CaptureFixture[str]) -> None:
    shown = _shown(text, capsys, interactive=True)
    assert shown.startswith("note[G301]")
    assert warning in shown


@pytest.mark.parametrize("text", [text for text, _ in CASES])
def test_a_script_is_not_disturbed(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert _shown(text, capsys, interactive=False) == ""


@pytest.mark.parametrize(
    "text",
    [
        "X = 3 ; Y = X ;",
        "OPTI DIME 2 ; Q = 6./2. 0. ;",
        "A = 1 + 2 * 3 ;",
        "L = PROGRESS 1. ;",
        "MESSAGE 'a' ;",
        "X*ENTIER = 2 ;",
        "OPTI DIME 2 ; P = 3, 5 ; Q = 0.,5. ;",
    ],
)
def test_what_is_usual_gives_no_warning(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert _shown(text, capsys, interactive=True) == ""


def test_a_missing_name_of_cast3m_alone_in_an_instruction_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    for interactive in (True, False):
        shown = _shown("OSCI ;", capsys, interactive=interactive)
        assert "error[251]: OSCI of Cast3M is not available yet" in shown


def test_messages_are_coloured_on_a_terminal_only() -> None:
    import io

    for colour in (True, False):
        shown = io.StringIO()
        Session(out=shown, err=shown, colour=colour).run_text("X = 1 / 0 ;", "x")
        assert ("\x1b[" in shown.getvalue()) is colour
