"""The prompt through a real terminal, and what it proposes."""

from __future__ import annotations

import contextlib
import os
import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from gibiane.completion import candidates, incomplete
from gibiane.session import Session

pexpect = pytest.importorskip("pexpect")
ROOT = Path(__file__).parents[3]
SECONDS = 20


def _environment(folder: Path, **more: str) -> dict[str, str]:
    kept = {k: v for k, v in os.environ.items() if k in ("PATH", "HOME", "LANG", "SYSTEMROOT")}
    paths = f"{ROOT / 'interpreter'}{os.pathsep}{ROOT / 'ops'}"
    return {
        **kept,
        "PYTHONPATH": paths,
        "TERM": "xterm",
        "PROMPT_TOOLKIT_NO_CPR": "1",
        "XDG_STATE_HOME": str(folder / "state"),
        **more,
    }


_HIDE = "import importlib.util as u; f = u.find_spec; u.find_spec = lambda n, *a: None if n == {!r} else f(n, *a); "
_MOVE = re.compile(r"\x1b\[(\d+)C")
_CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\x1b[=>]|\x08|\r")


class Terminal:
    """A gibiane in a pseudo-terminal; what it shows is read without colours and movements of the cursor."""

    def __init__(self, folder: Path, *arguments: str, hide: str = "") -> None:
        code = "import sys; from gibiane.cli import main; sys.exit(main())"
        self.raw = ""
        self.seen = 0
        self.child = pexpect.spawn(
            sys.executable,
            ["-c", (_HIDE.format(hide) if hide else "") + code, *arguments],
            env=_environment(folder),
            cwd=str(folder),
            encoding="utf-8",
            timeout=SECONDS,
            dimensions=(40, 120),
        )

    def enter(self, text: str) -> None:
        self.child.send(text + "\r")

    def expect(self, pattern: str) -> None:
        """Wait until what was shown since the last time matches."""
        end = time.monotonic() + SECONDS
        while True:
            shown = _CONTROL.sub("", _MOVE.sub(lambda m: " " * int(m.group(1)), self.raw))
            found = re.compile(pattern).search(shown, self.seen)
            if found:
                self.seen = found.end()
                return
            if time.monotonic() > end:
                raise AssertionError(f"{pattern!r} is not in {shown[self.seen :]!r}")
            with contextlib.suppress(pexpect.TIMEOUT):
                self.raw += self.child.read_nonblocking(4096, timeout=0.2)

    def prompt(self) -> None:
        """Wait for an empty prompt: what is typed before it may be lost."""
        self.expect(r"(?m)\$ +$")

    def end(self) -> int:
        self.child.expect(pexpect.EOF)
        self.child.close()
        return int(self.child.exitstatus)


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    started = Terminal(tmp_path)
    started.prompt()
    yield started
    started.child.close(force=True)


def test_a_value_is_kept_and_shown(terminal: Terminal) -> None:
    terminal.enter("X = 20 + 1 ;")
    terminal.prompt()
    terminal.enter("MESS 'x is ' (X * 2) ;")
    terminal.expect("x is 42")


def test_a_block_is_read_to_its_end(terminal: Terminal) -> None:
    terminal.enter("REPE B1 3 ;")
    terminal.expect("REPE B1> ")
    terminal.enter("MESS 'turn ' &B1 ;")
    terminal.enter("FIN B1 ;")
    terminal.expect("turn 1")
    terminal.expect("turn 3")


def test_an_error_keeps_the_session(terminal: Terminal) -> None:
    terminal.enter("X = 5 ;")
    terminal.prompt()
    terminal.enter("Y = X / 0 ;")
    terminal.expect("division by zero")
    terminal.prompt()
    terminal.enter("MESS 'still ' X ;")
    terminal.expect("still 5")


def test_interrupt_drops_what_is_pending(terminal: Terminal) -> None:
    terminal.enter("X = 7 ;")
    terminal.prompt()
    terminal.enter("REPE B1 3 ;")
    terminal.expect("REPE B1> ")
    terminal.child.sendintr()
    terminal.prompt()
    terminal.enter("MESS 'x ' X ;")
    terminal.expect("x 7")


def test_interrupt_stops_a_loop_and_keeps_every_object(terminal: Terminal) -> None:
    terminal.enter("N = 1 ; MESS 'sta' 'rted' ; REPE B ; N = N + 1 ; FIN B ;")
    terminal.expect("started")
    terminal.child.sendintr()
    terminal.expect("interrupted")
    terminal.prompt()
    terminal.enter("MESS (N > 0) ;")
    terminal.expect("VRAI")


def test_end_of_input_ends_the_session(terminal: Terminal) -> None:
    terminal.child.sendeof()
    assert terminal.end() == 0


def test_fin_ends_the_session(terminal: Terminal) -> None:
    terminal.enter("FIN ;")
    assert terminal.end() == 0


def test_keys_are_completed(terminal: Terminal) -> None:
    terminal.enter("T = TABL ; T.'LONGUEUR' = 12 ;")
    terminal.prompt()
    terminal.child.send("MESS 'got ' (T . LONG\t")
    terminal.enter(") ;")
    terminal.expect("got 12")


def test_history_holds_a_block_as_one_entry(tmp_path: Path) -> None:
    first = Terminal(tmp_path)
    first.prompt()
    first.enter("REPE B1 2 ;")
    first.expect("REPE B1> ")
    first.enter("MESS 'again ' &B1 ; FIN B1 ;")
    first.expect("again 2")
    first.prompt()
    first.child.sendeof()
    assert first.end() == 0
    second = Terminal(tmp_path)
    second.prompt()
    second.child.send("\x1b[A")
    second.expect("MESS")
    second.child.send("\r")
    second.expect("again 2")
    second.child.close(force=True)


def test_a_script_may_be_followed_by_work_at_the_prompt(tmp_path: Path) -> None:
    (tmp_path / "a.dgibi").write_text("X = 30 ;\nFIN ;\n")
    started = Terminal(tmp_path, "-i", "a.dgibi")
    started.prompt()
    started.enter("MESS 'x ' (X + 3) ;")
    started.expect("x 33")
    started.child.close(force=True)


def test_info_stops_at_the_end_of_the_screen(tmp_path: Path) -> None:
    started = Terminal(tmp_path)
    started.child.setwinsize(10, 120)
    started.prompt()
    started.enter("INFO MESS ;")
    started.expect("write a line")
    started.expect("q to leave")
    started.child.send("q\r")
    started.prompt()
    started.child.close(force=True)


def test_a_question_mark_lists_the_keywords(terminal: Terminal) -> None:
    terminal.enter("ENTI ? ;")
    terminal.expect("'PROC' rounding")


def test_warnings_are_shown_at_the_prompt(terminal: Terminal) -> None:
    terminal.enter("MESS = 3 ;")
    terminal.expect("now hides the operator MESSAGE")


def test_without_prompt_toolkit_a_plain_prompt_says_what_to_install(tmp_path: Path) -> None:
    started = Terminal(tmp_path, hide="prompt_toolkit")
    started.expect(r"pip install 'gibiane\[repl\]'")
    started.prompt()
    started.enter("REPE B1 2 ;")
    started.expect("REPE B1> ")
    started.enter("FIN B1 ; MESS 'do' 'ne' ;")
    started.expect("done")
    started.prompt()
    started.child.sendeof()
    assert started.end() == 0


@pytest.mark.parametrize(
    ("text", "still"),
    [
        ("", None),
        ("X = 3 ;", None),
        ("X = 3", ""),
        ("X = (3 +", ""),
        ("MESS 'abc", ""),
        ("SI VRAI ;", "SI"),
        ("SI VRAI ; MESS 1 ; FINSI ;", None),
        ("REPE B1 3 ; SI VRAI ;", "SI"),
        ("REPE B1 3 ; SI VRAI ; FINSI ;", "REPE B1"),
        ("REPE B1 3 ; FIN B1 ;", None),
        ("DEBP F x*ENTIER ;", "DEBP F"),
        ("DEBP F x*ENTIER ; REPE B ; FIN B ; FINP x ;", None),
        ("FINSI ;", None),
    ],
)
def test_what_is_still_open(text: str, still: str | None) -> None:
    assert incomplete(text) == still


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    made = Session(interactive=True)
    made.run_text(
        "T = TABL ; T.'ALPHA' = 1 ; T.'beta' = 2 ; T.'SUB' = TABL ; T.'SUB'.'DEEP' = 3 ; LONGUEUR = 2. ;", "x"
    )
    return made


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("MES", "MESS"),
        ("mes", "mess"),
        ("MESSA", "MESSAGE"),
        ("X = LONG", "LONGUEUR"),
        ("X = long", "longueur"),
        ("X = T . '", "ALPHA"),
        ("X = T.'be", "beta"),
        ("X = T . AL", "ALPHA"),
        ("X = T.'SUB'.'", "DEEP"),
        ("X = ENTI 'PR", "PROC"),
        ("X = ENTI 2.5 PR", "PROC"),
        ("OPTI DI", "DIME"),
        ("SI VRAI ; MES", "MESS"),
    ],
)
def test_what_is_proposed(session: Session, text: str, wanted: str) -> None:
    assert wanted in [word for word, _ in candidates(session, text)[1]]


def test_files_are_proposed(session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results.txt").write_text("")
    (tmp_path / "runs").mkdir()
    assert [word for word, _ in candidates(session, "OPTI 'SORT' 'r")[1]] == ["results.txt", "runs/"]
    (tmp_path / "runs" / "a.dgibi").write_text("")
    assert [word for word, _ in candidates(session, "OPTI DONN 'runs/")[1]] == ["runs/a.dgibi"]


def test_a_script_is_coloured() -> None:
    pytest.importorskip("pygments")
    from pygments.token import Comment, Keyword, Name, Number, Operator, String

    from gibiane.highlight import GibianeLexer

    text = "* note\nSI (X EGA 3.5) ;\n mess 'it''s' &B1 @AUX 12 ;\n'FINSI' ;\nx1 = a**-1.0 ;\n"
    kinds = {(kind, value) for kind, value in GibianeLexer().get_tokens(text)}
    assert (Comment.Single, "* note") in kinds
    assert (Keyword, "SI") in kinds
    assert (Keyword, "'FINSI'") in kinds
    assert (Name.Builtin, "mess") in kinds
    assert (Name.Builtin, "EGA") in kinds
    assert (String.Single, "'it''s'") in kinds
    assert (Number.Float, "3.5") in kinds
    assert (Number.Integer, "12") in kinds
    assert (Name.Function, "@AUX") in kinds
    assert (Name, "x1") in kinds
    assert (Operator, "**") in kinds
