"""Match SI/SINON/FINSI, REPE/FIN and DEBP/FINP: jump targets for the evaluator, errors for procedures."""

from __future__ import annotations

from typing import Any

from gibiane.diagnostics import Diagnostic, make
from gibiane.nodes import Instr, Literal, Name


def block_name(instr: Instr) -> str | None:
    """Return the name after a block word (FIN B, DEBP NAME), or None."""
    return next(iter(block_names(instr)), None)


def block_names(instr: Instr) -> list[str]:
    """Return every word of a block instruction that could be its name (`REPE N B1`: N or B1)."""
    seen_head = False
    found = []
    for item in instr.items:
        word = item.word if isinstance(item, Name) else item.value if isinstance(item, Literal) else None
        if not isinstance(word, str):
            continue
        if not seen_head and word[:4] == instr.head:
            seen_head = True
            continue
        found.append(word.upper()[:24])
    return found


def annotate(program: list[Instr]) -> None:
    """Set `jump` and `other` of the control instructions of a program.

    SI: `jump` its SINON or FINSI, `other` its FINSI. SINON: `jump` its FINSI. REPE: `jump` its FIN;
    FIN: `jump` its REPE. DEBP: `jump` its FINP. What has no partner keeps None.
    """
    _Matcher(program).run()


class _Matcher:
    def __init__(self, program: list[Instr]) -> None:
        self.program = program
        self.procedures: list[int] = []
        self.ifs: list[list[int]] = [[]]
        self.loops: list[list[tuple[list[str], int]]] = [[]]

    def run(self) -> None:
        for index, instr in enumerate(self.program):
            match instr.head:
                case "SI":
                    self.ifs[-1].append(index)
                case "SINO":
                    self._else(index)
                case "FINS":
                    self._end_if(index)
                case "REPE":
                    self.loops[-1].append((block_names(instr), index))
                case "FIN":
                    self._end_loop(index)
                case "DEBP" | "DEBM":
                    self.procedures.append(index)
                    self.ifs.append([])
                    self.loops.append([])
                case "FINP" | "FINM" if self.procedures:
                    start = self.procedures.pop()
                    self.program[start].jump = index
                    instr.jump = start
                    self.ifs.pop()
                    self.loops.pop()

    def _else(self, index: int) -> None:
        if self.ifs[-1]:
            opening = self.program[self.ifs[-1][-1]]
            if opening.jump is None:
                opening.jump = index

    def _end_if(self, index: int) -> None:
        if not self.ifs[-1]:
            return
        opening = self.program[self.ifs[-1].pop()]
        opening.other = index
        if opening.jump is None:
            opening.jump = index
        else:
            self.program[opening.jump].jump = index

    def _end_loop(self, index: int) -> None:
        name = block_name(self.program[index])
        if name is None:
            return
        loops = self.loops[-1]
        for depth in range(len(loops) - 1, -1, -1):
            if name in loops[depth][0]:
                start = loops[depth][1]
                self.program[start].jump = index
                self.program[index].jump = start
                del loops[depth:]
                return


def never_closed(instr: Instr) -> Diagnostic:
    """Word the error of a DEBP without its FINP."""
    return make(
        1134,
        "this procedure is never closed",
        operator="DEBPROC",
        span=instr.span(),
        hint="write FINP and its results after the last instruction",
    )


def check_structure(program: list[Instr], start: int, end: int) -> list[Diagnostic]:
    """Report the wrong block structure of instructions [start, end): errors 1020 to 1024, 154."""
    found: list[Diagnostic] = []
    open_blocks: list[tuple[str, int, bool]] = []  # word, index, SINON seen
    names: dict[int, list[str]] = {}

    def report(code: int, text: str, at: int, hint: str, **fields: Any) -> None:
        found.append(make(code, text, span=program[at].span(), hint=hint, **fields))

    for index in range(start, end):
        head = program[index].head
        if head == "SI":
            open_blocks.append(("SI", index, False))
        elif head == "REPE":
            names[index] = block_names(program[index])
            open_blocks.append(("REPE", index, False))
        elif head == "SINO":
            if not open_blocks or open_blocks[-1][0] != "SI":
                report(1020, "SINON without an open SI", index, "write the SI of this block before it")
            elif open_blocks[-1][2]:
                report(1024, "a second SINON in one SI block", index, "nest another SI in the first SINON")
            else:
                open_blocks[-1] = ("SI", open_blocks[-1][1], True)
        elif head == "FINS":
            if not open_blocks or open_blocks[-1][0] != "SI":
                report(1021, "FINSI without an open SI", index, "write the SI of this block before it")
            else:
                open_blocks.pop()
        elif head == "FIN" and (name := block_name(program[index])):
            if open_blocks and open_blocks[-1][0] == "SI" and any(b[0] == "REPE" for b in open_blocks):
                line = program[open_blocks[-1][1]].span().line
                report(
                    1022,
                    "the SI of line {line} is still open at the end of this loop",
                    index,
                    "write its FINSI before this FIN",
                    line=line,
                )
                while open_blocks and open_blocks[-1][0] == "SI":
                    open_blocks.pop()
            if open_blocks and open_blocks[-1][0] == "REPE" and name in names[open_blocks[-1][1]]:
                open_blocks.pop()
            else:
                report(
                    154,
                    "{name} is not the innermost open loop",
                    index,
                    "close the loops from the inside out",
                    name=name,
                )
    for word, index, _ in open_blocks:
        closing = "FINSI" if word == "SI" else "FIN"
        report(1023, "this {word} is never closed", index, "write its {closing}", word=word, closing=closing)
    return found
