"""`gibiane check`: every syntax error of a file, without running it."""

from __future__ import annotations

from gibiane.blocks import annotate, check_structure
from gibiane.diagnostics import Diagnostic, make
from gibiane.source import SourceText
from gibiane.syntax import parse


def problems(source: SourceText) -> list[Diagnostic]:
    """Return the syntax errors and wrong block structures of a source text, in order of place."""
    program = parse(source)
    annotate(program)
    found = [instr.bad for instr in program if instr.bad is not None]
    index = 0
    while index < len(program):
        instr = program[index]
        if instr.head in ("DEBP", "DEBM"):
            if instr.jump is None:
                found.append(make(1134, "this procedure is never closed", operator="DEBPROC", span=instr.span(),
                                  hint="write FINP and its results after the last instruction"))
            else:
                found.extend(check_structure(program, index + 1, instr.jump))
                index = instr.jump
        index += 1
    return sorted(found, key=lambda d: d.span.start if d.span else 0)
