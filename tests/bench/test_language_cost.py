"""The language: parsing, a loop, a procedure call and the start, against CPython in the same run."""

import io
import os
import subprocess
import sys

import pytest

from gibiane.session import Session
from gibiane.source import SourceText
from gibiane.syntax import parse

LINE = "A{i} = (B * 2.5) + (COOR 1 P) - 'WORD' ; SI (A EGA 3) ; MESS 'text' A ; FINSI ; * note\n"
STATEMENTS = 200_000


def python_loop(count):
    total, i = 0.0, 0
    for i in range(1, count + 1):
        total = total + (i * 2.0)
    return total


def python_calls(count):
    def double(x):
        return x * 2.0

    y = 0.0
    for i in range(count):
        y = double(i)
    return y


def run(text):
    session = Session(out=io.StringIO(), err=io.StringIO())
    assert session.run_text(text) == 0, session.err.getvalue()


@pytest.mark.bench
def test_parsing(bench):
    text = "".join(LINE.format(i=i) for i in range(10_000))
    bench.compare("parse", "10 000 lines", lambda: parse(SourceText("lines", text)), {}, rounds=2)
    seconds = bench.rows[-1]["ours"]
    bench.notes.append(f"parse: {10_000 / seconds * 60:.0f} lines a minute (aim: at least 100 000)")


@pytest.mark.bench
def test_loop(bench):
    text = "S = 0. ; REPE B 1000000 ; S = S + (&B * 2.) ; FIN B ;"
    bench.compare(
        "S = S + (&B * 2.)", "1 000 000 turns", lambda: run(text), {"CPython": lambda: python_loop(10**6)}, aim=20
    )


@pytest.mark.bench
def test_procedure_call(bench):
    text = f"DEBP TWICE X*FLOTTANT ; Y = X * 2. ; FINP Y ; REPE B {STATEMENTS} ; Y = TWICE &B ; FIN B ;"
    bench.compare("procedure call", f"{STATEMENTS} calls", lambda: run(text),
                  {"CPython": lambda: python_calls(STATEMENTS)}, aim=60)  # fmt: skip


@pytest.mark.bench
def test_start(bench):
    # as installed: modules compiled once and kept, whatever the environment of the bench says
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}

    def start(*arguments):
        return lambda: subprocess.run([sys.executable, *arguments], check=True, capture_output=True, env=environment)

    peers = {"python -c 'import lark'": start("-c", "import lark")}
    bench.compare("start: MESS 1", "a process", start("-m", "gibiane", "-c", "MESS 1 ;"), peers, aim=1.5, rounds=7)
