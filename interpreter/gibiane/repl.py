"""The prompt: read a complete block, run it, keep the session whatever happens."""

from __future__ import annotations

import sys
from typing import Any

from gibiane.blocks import annotate
from gibiane.source import SourceText
from gibiane.syntax import parse

PROMPT, CONTINUATION = "$ ", ". "


def incomplete(text: str) -> str | None:
    """Say what is still open in a text: a block or loop name, an instruction (""), or None when it is complete."""
    if not text.strip():
        return None
    program = parse(SourceText("<prompt>", text))
    annotate(program)
    if program and program[-1].bad is not None and program[-1].bad.code == "G102":
        return ""
    for instr in program:
        if instr.head in ("SI", "REPE", "DEBP") and instr.jump is None:
            words = [getattr(item, "word", "") for item in instr.items]
            return " ".join(w for w in words if w)[:16] or str(instr.head)
    return None


def run(session: Any) -> int:
    """Read and run instructions until FIN or the end of the input; return the exit code."""
    sys.stdout.write("Gibiane. INFO name ; describes an operator, FIN ; ends.\n")
    count = 0
    while True:
        try:
            text = _read_block()
        except EOFError:
            sys.stdout.write("\n")
            return 0
        except KeyboardInterrupt:
            sys.stdout.write("\n")
            continue
        if not text.strip():
            continue
        count += 1
        session.worst = 0
        session.run_text(text, f"<{count}>")
        if session.finished:
            return 0


def _read_block() -> str:
    text = input(PROMPT)
    while (still := incomplete(text)) is not None:
        text += "\n" + input(f"{still}> " if still else CONTINUATION)
    return text
