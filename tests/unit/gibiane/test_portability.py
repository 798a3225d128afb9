"""What a script of Cast3M misses here."""

from __future__ import annotations

from pathlib import Path

import pytest

from gibiane import cast3m, registry
from gibiane.check import missing_names
from gibiane.cli import main
from gibiane.session import Session
from gibiane.source import SourceText

SCRIPT = """\
OPTI DIME 2 ELEM QUA4 ;
L = DROI 2 (0. 0.) (1. 0.) ;
TAB1 = TABLE ;
TAB1.'VIBR' = 3 ;
PASAPAS TAB1 ;
SI FAUX ;
  X = 'KTAN' TAB1 ;
  PASAPAS TAB1 ;
FINSI ;
RAFF = 3 ;
Y = RAFF + 1 ;
MESS (DYNE TAB1) ;
FIN ;
SEIS 3 ;
"""


def test_the_list_knows_the_operators_of_the_language() -> None:
    Session()
    known = cast3m.names()
    assert len(known) > 900
    assert {"RESO", "PASAPAS", "KTAN", "@EXCEL1"} <= set(known)


def test_what_is_nearest_exists_here() -> None:
    Session()
    for name, near in cast3m.names().items():
        for word in near.replace(",", " ").replace(";", " ").split():
            if word.isupper() and word.isalpha() and len(word) == 4 and name != word:
                assert registry.find(word) is not None, (name, word)


def test_calls_of_what_is_missing_are_listed_once_each() -> None:
    session = Session()
    found = missing_names(SourceText("x", SCRIPT), lambda word: session.operator(word) is not None)
    assert [(item.name, item.line, item.count) for item in found] == [
        ("PASAPAS", 5, 2),
        ("KTAN", 7, 1),
        ("DYNE", 12, 1),
    ]


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = tmp_path / "a.dgibi"
    script.write_text(SCRIPT)
    assert main(["check", "--portability", str(script)]) == 8
    shown = capsys.readouterr().out
    assert "3 names of Cast3M are missing here" in shown
    assert "nearest here: RESO, once per load in a REPE loop" in shown
    script.write_text("X = 3 ;\n")
    assert main(["check", "--portability", str(script)]) == 0
    assert "no names of Cast3M are missing here" in capsys.readouterr().out
    script.write_text("X = (3 ;\n")
    assert main(["check", str(script)]) == 8
