"""TEXTE and procedures made again of their text: parsed, not run."""

from __future__ import annotations

from typing import Any

from gibiane.blocks import annotate
from gibiane.nodes import Literal, Name
from gibiane.procedures import parameters
from gibiane.source import SourceText
from gibiane.syntax import parse
from gibiane.values import Procedure, Texte, Value
from gibiane_ops.values.archive import BadArchive


def rebuilt(kind: str, text: str) -> Value:
    """Make a TEXTE or a procedure (`kind` is the name of the class) of its text.

    Raises
    ------
    BadArchive
        When the text is not one of these.
    """
    if kind == "Texte":
        program = parse(SourceText("<TEXTE>", text.rstrip().rstrip(";") + " ;"))
        if len(program) != 1 or program[0].bad is not None:
            raise BadArchive("a TEXTE in it is not one instruction")
        return Texte(text, program[0].items, program[0].source)
    program = parse(SourceText("<REST>", text))
    annotate(program)
    first = program[0] if program else None
    if first is None or first.head not in ("DEBP", "DEBM") or first.jump != len(program) - 1:
        raise BadArchive("a procedure in it is not whole")
    words: list[Any] = [item for item in first.items if isinstance(item, Name | Literal)]
    name = words[1].name if isinstance(words[1], Name) else str(words[1].value)
    at = first.items.index(words[1])
    declared = parameters(first, first.items[at + 1 :])
    return Procedure(name.upper()[:24], declared, program, 1, first.jump, first.head == "DEBM")
