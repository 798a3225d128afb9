"""`gibiane check`: every syntax error of a file, without running it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from gibiane import cast3m, slips
from gibiane.blocks import annotate, block_name, check_structure, never_closed
from gibiane.diagnostics import Diagnostic
from gibiane.nodes import Access, Group, Instr, Literal, Name, Node
from gibiane.source import SourceText
from gibiane.syntax import parse, refuse_long


def problems(source: SourceText, *, strict: bool = False) -> list[Diagnostic]:
    """Return the syntax errors and wrong block structures of a source text, in order of place.

    What follows the `FIN ;` of a script is not read. Block structure is judged only when every instruction is
    sound, for a lost `;` takes block words with it. `strict` refuses instructions that Cast3M finds too long.
    """
    program = parse(source)
    if strict:
        refuse_long(program)
    lost = slips.apostrophe(source)[0] if slips.ends_in_string(program) else None
    read = _until_end(program)
    if lost is None or read[-1].end <= lost:
        program = read
    slips.mark(source, program, thorough=True)
    annotate(program)
    found = [instr.bad for instr in program if instr.bad is not None]
    if not found:
        found = _structure(program)
    return sorted(found, key=lambda d: d.span.start if d.span else 0)


def _until_end(program: list[Instr]) -> list[Instr]:
    """Return the instructions up to the FIN that ends the run: without a name, outside every block."""
    depth = 0
    for index, instr in enumerate(program):
        match instr.head:
            case "SI" | "REPE" | "DEBP" | "DEBM":
                depth += 1
            case "FINS" | "FINP" | "FINM":
                depth = max(depth - 1, 0)
            case "FIN" if block_name(instr) is not None:
                depth = max(depth - 1, 0)
            case "FIN" if depth == 0 and instr.bad is None:
                return program[: index + 1]
    return program


def _structure(program: list[Instr]) -> list[Diagnostic]:
    found: list[Diagnostic] = []
    index = outer = 0
    while index < len(program):
        instr = program[index]
        if instr.head in ("DEBP", "DEBM"):
            if instr.jump is None:
                return [*found, never_closed(instr)]
            found.extend(_loose(check_structure(program, outer, index)))
            found.extend(check_structure(program, index + 1, instr.jump))
            index = instr.jump
            outer = index + 1
        index += 1
    found.extend(_loose(check_structure(program, outer, len(program))))
    return found


def _loose(found: list[Diagnostic]) -> list[Diagnostic]:
    """Keep what is an error outside procedures too: there a SINON or FINSI without SI is passed over."""
    return [d for d in found if d.code not in ("1020", "1021", "1024")]


# ------------------------------------------------------------------------------------------- what a script misses


@dataclass
class Missing:
    """A name of Cast3M that a text uses and that is not here: where first, how often, what is nearest."""

    name: str
    near: str
    line: int
    count: int = 1


def missing_names(source: SourceText, has: Callable[[str], bool]) -> list[Missing]:
    """Return the operators and procedures of Cast3M that a text calls and that `has` denies, in order of place.

    A word is taken for a call where it is the first word of an instruction or of a parenthesis and the text gives it
    no value; the name of a procedure wherever it stands.
    """
    program = _until_end(parse(source))
    habits = slips.Habits(program)
    found: dict[str, Missing] = {}
    for instr in program:
        for word, start in _calls(instr.items):
            meaning = cast3m.meant(word) if not has(word) and not habits.assigns(word) else None
            if meaning is None:
                continue
            name, near = meaning
            if name in found:
                found[name].count += 1
            else:
                found[name] = Missing(name, near, source.locate(start)[0])
    return list(found.values())


def _calls(items: list[Node]) -> Iterator[tuple[str, int]]:
    """Yield the words of a sequence that may be calls, with their places."""
    first = True
    after_dot = False
    for item in items:
        if isinstance(item, Group):
            yield from _calls(item.items)
        word = item.word if isinstance(item, Name) else item.value if isinstance(item, Literal) else None
        if isinstance(word, str) and not after_dot and (word[:1].isalpha() or word[:1] == "@"):
            if first or (isinstance(item, Name) and len(word) > 4):
                yield word, item.start
            first = False
        after_dot = isinstance(item, Access)
