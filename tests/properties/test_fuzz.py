"""Whatever is read as a script gives output or a diagnostic: never a traceback, never a hang.

The suite runs a few examples of each kind; GIBIANE_FUZZ=20000 runs so many (`make fuzz`).
"""

from __future__ import annotations

import io
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from gibiane.check import problems
from gibiane.completion import candidates, incomplete
from gibiane.lexer import tokens
from gibiane.session import Session
from gibiane.source import SourceText
from gibiane.syntax import parse

EXAMPLES = int(os.environ.get("GIBIANE_FUZZ", "60"))
LIMIT = 1.0  # seconds after which a script that goes on is interrupted, as Ctrl-C does
FRAGMENTS = [
    path.read_text(encoding="utf-8")
    for path in sorted((Path(__file__).parents[1] / "data" / "fragments").glob("*.dgibi"))
]
fuzz = settings(
    max_examples=EXAMPLES,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture, HealthCheck.data_too_large],
)

VOCABULARY = """
SI SINON FINSI REPE FIN QUIT ITER DEBP FINP ARGU RESP MESS CHAI LIST TYPE EXIS DIME INDE ENTI FLOT ABS SIGN SIN LOG EXP
TABL PROG LECT MOTS EXTR INSE ENLE REMP ORDO UNIQ SUIT POSI COPI OUBL ET OU NON EGA NEG VALE OPTI ERRE TEXTE MOT COMM
DEBM FINM OBJE VRAI FAUX A B B1 &B1 X T F 'A' 'B1' 'abc' '' 'PAS' PAS 'TABLE' 'ENTIER' 'X' ENTIER TABLE MOT FLOTTANT
DIME ECHO IGNO 0 1 2 3 -1 2.5 1.E3 -0.5 1.D-3 .5 = ; ; ; ; ( ) . % * / + - ** < > <EG >EG , @P !P #P $m
"""
WORDS = VOCABULARY.split()
tokens_soup = st.lists(st.sampled_from(WORDS), max_size=60).map(" ".join)
glued_soup = st.lists(st.sampled_from([*WORDS, "\n", " ", "\n*"]), max_size=60).map("".join)
any_text = st.text(max_size=200)


@st.composite
def broken_fragments(draw: Any) -> str:
    """Draw a sound text with a few characters lost, doubled or exchanged."""
    text = "\n".join(draw(st.lists(st.sampled_from(FRAGMENTS), min_size=1, max_size=3)))
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(text) - 1, 0)))
        put = draw(st.sampled_from(["", "'", ";", "(", ")", "=", ".", "%", "&", " ", "\n", "\n*", "É", "1"]))
        text = text[:at] + put + text[at + draw(st.integers(0, 2)) :]
    return text


@contextmanager
def _interrupted_after(seconds: float) -> Iterator[None]:
    def stop(_number: int, _frame: Any) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def _run(text: str, *, interactive: bool = False) -> None:
    shown = io.StringIO()
    session = Session(out=shown, err=shown, interactive=interactive)
    try:
        with _interrupted_after(LIMIT):
            code = session.run_text(text, "fuzz")
    except KeyboardInterrupt:
        return
    assert not session.internal, shown.getvalue()[-2000:]
    assert code in (0, 4, 8, 12)


@pytest.fixture(autouse=True)
def _alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.StringIO())


@fuzz
@given(st.one_of(any_text, glued_soup, broken_fragments()))
def test_any_text_is_read_and_checked(text: str) -> None:
    source = SourceText("fuzz", text)
    for token in tokens(source, {}):
        assert 0 <= token.start_pos <= token.end_pos <= len(text)
    for instr in parse(source):
        assert 0 <= instr.start <= instr.end <= len(text)
    for diagnostic in problems(source):
        assert diagnostic.span is not None
        assert 1 <= diagnostic.span.line <= text.count("\n") + 1


@fuzz
@given(st.one_of(tokens_soup, glued_soup))
@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timer on this system")
def test_words_in_any_order_are_run(text: str) -> None:
    _run(text)


@fuzz
@given(st.one_of(any_text, broken_fragments()))
@example(".TEXT;")
@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timer on this system")
def test_broken_texts_are_run(text: str) -> None:
    _run(text)


@fuzz
@given(tokens_soup)
@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timer on this system")
def test_words_at_the_prompt(text: str) -> None:
    _run(text, interactive=True)


SESSION = Session(out=io.StringIO(), err=io.StringIO(), interactive=True)
SESSION.run_text("T = TABL ; T.'A' = 1 ; T.'A b' = 2 ; A = 3 ;", "fuzz")


@fuzz
@given(st.one_of(tokens_soup, any_text))
@example("0\n")
def test_what_is_typed_can_be_completed(text: str) -> None:
    incomplete(text)
    partial, found = candidates(SESSION, text)
    assert text.endswith(partial)
    assert all(isinstance(word, str) for word, _ in found)
