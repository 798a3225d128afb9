"""Control instructions: SI, REPE, QUIT, ITER, FIN, and the procedure words. Each handler returns the next index."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gibiane import compiled, faults, procedures
from gibiane.blocks import block_name, block_names
from gibiane.diagnostics import GibianeError, Label, Text, make
from gibiane.frames import Frame, Loop, Stop
from gibiane.nodes import Instr, Literal, Name, Node
from gibiane.runner import Runner
from gibiane.values import LOGIQUE


def _without_head(instr: Instr) -> list[Node]:
    """Return the items of a control instruction without its control word."""
    items = list(instr.items)
    for i, item in enumerate(items):
        word = item.word if isinstance(item, Name) else item.value if isinstance(item, Literal) else ""
        if isinstance(word, str) and word[:4] == instr.head:
            del items[i]
            break
    return items


def _if(ev: Runner, program: list[Instr], pc: int) -> int:
    instr = program[pc]
    code = instr.code
    if not code:
        code = instr.code = _condition(instr, ev.closures)
    holds = code(ev.frame)
    if holds is None:
        holds = _condition_by_queue(ev, instr)
    if holds:
        return pc + 1
    if instr.jump is not None:
        return instr.jump + 1
    raise GibianeError(make(1023, "this SI is never closed", operator="SI", span=instr.span(), hint="write its FINSI"))


def _condition(instr: Instr, closures: bool) -> Callable[[Frame], bool | None]:
    """Return a closure for the condition of an SI; it gives None when the queue must do the work."""
    fetch = compiled.condition(_without_head(instr)) if closures else None

    def holds(frame: Frame) -> bool | None:
        if fetch is None:
            return None
        try:
            return bool(fetch(frame))
        except (compiled.Fallback, ArithmeticError):
            return None

    return holds


def _condition_by_queue(ev: Runner, instr: Instr) -> bool:
    q = ev.operands(instr.source, _without_head(instr))
    ev.resolve_accesses(q)
    condition = q.read(LOGIQUE)
    if condition is None:
        failure = q.missing(LOGIQUE)
        failure.diagnostic.operator = "SI"
        failure.diagnostic.forms = ["SI LOGIQUE ;"]
        if len(q.values) > 1:
            failure.diagnostic.hint = Text("put the whole condition between parentheses")
        raise failure
    if q.values:
        failure = faults.leftover(ev, q, 0)
        failure.diagnostic.operator = "SI"
        failure.diagnostic.hint = Text("put the whole condition between parentheses")
        raise failure
    return bool(condition)


def _else(ev: Runner, program: list[Instr], pc: int) -> int:
    """Skip to the FINSI: its own, or for a stray SINON the next one."""
    instr = program[pc]
    if instr.jump is not None:
        return instr.jump + 1
    for index in range(pc + 1, len(program)):
        if program[index].head == "FINS":
            return index + 1
    raise GibianeError(make(1021, "this SINON has no FINSI", operator="SINON", span=instr.span()))


def _end_if(_ev: Runner, _program: list[Instr], pc: int) -> int:
    return pc + 1


def _repeat(ev: Runner, program: list[Instr], pc: int) -> int:
    instr = program[pc]
    names = block_names(instr)
    if not names:
        raise GibianeError(
            make(533, "a loop needs a name", operator="REPETER", span=instr.span(), hint="REPE B1 10 ; ... FIN B1 ;")
        )
    if instr.jump is None:
        _refuse_crossed_loop(program, pc, names)
        raise GibianeError(
            make(
                1023,
                "this REPETER is never closed",
                operator="REPETER",
                span=instr.span(),
                hint="write FIN {name} ;",
                name=names[0],
            )
        )
    name = block_name(program[instr.jump]) or names[0]
    frame = ev.frame
    if any(loop.name == name for loop in frame.loops):
        raise GibianeError(
            make(
                21,
                "a loop named {name} is already active",
                operator="REPETER",
                name=name,
                span=instr.span(),
                hint="nested loops need different names",
            )
        )
    rest = _without_head(instr)
    for i, item in enumerate(rest):
        word = item.word if isinstance(item, Name) else item.value if isinstance(item, Literal) else None
        if isinstance(word, str) and word.upper()[:24] == name:
            del rest[i]
            break
    q = ev.operands(instr.source, rest)
    ev.resolve_accesses(q)
    count = q.read("ENTIER")
    if q.values:
        label = q.describe(0, "ENTIER")
        raise GibianeError(
            make(37, "the number of turns is an ENTIER", operator="REPETER", labels=[label], span=label.span)
        )
    if count == 0:
        return instr.jump + 1
    frame.loops.append(Loop(name, program, pc, instr.jump, -1 if count is None else count))
    frame.names["&" + name[:23]] = 1
    return pc + 1


def _refuse_crossed_loop(program: list[Instr], pc: int, names: list[str]) -> None:
    """Tell of a FIN that closes this loop outside the loop that contains it."""
    for instr in program[pc + 1 :]:
        if instr.head == "FIN" and block_name(instr) in names:
            span, end = program[pc].span(), instr.span()
            labels = [Label(span, Text("opened inside another loop")), Label(end, Text("closed outside it"))]
            raise GibianeError(
                make(
                    154,
                    "loops are closed in the wrong order",
                    operator="FIN",
                    span=end,
                    labels=labels,
                    hint="close the loops from the inside out",
                )
            )


def _end(ev: Runner, program: list[Instr], pc: int) -> int:
    instr = program[pc]
    name = block_name(instr)
    if name is None:
        raise Stop
    loops = ev.frame.loops
    if not loops or loops[-1].name != name:
        inside = loops[-1].name if loops else None
        raise GibianeError(
            make(
                154,
                "{name} is not the innermost active loop",
                operator="FIN",
                name=name,
                span=instr.span(),
                inside=inside,
                hint="the innermost is {inside}" if inside else "no loop is active here",
            )
        )
    return loops[-1].turn(ev.frame)


def _leave(ev: Runner, program: list[Instr], pc: int, word: str) -> tuple[int, Loop | None]:
    """Find the loop that QUIT or ITER names; (position, loop) or, for the procedure's own name, (-1, None)."""
    instr = program[pc]
    name = block_name(instr)
    if name is None:
        raise GibianeError(
            make(
                533,
                "the name of a loop is missing",
                operator=word,
                span=instr.span(),
                hint="{word} B1 ; names the loop to leave",
                word=word,
            )
        )
    loops = ev.frame.loops
    for i in range(len(loops) - 1, -1, -1):
        if loops[i].name == name:
            return i, loops[i]
    procedure = ev.frame.procedure
    if word == "QUITTER" and procedure is not None and procedure.name == name:
        return -1, None
    active = ", ".join(loop.name for loop in loops)
    raise GibianeError(
        make(
            154,
            "{name} is not an active loop",
            operator=word,
            name=name,
            span=instr.span(),
            active=active,
            hint="active here: {active}" if active else "no loop is active here",
        )
    )


def _quit(ev: Runner, program: list[Instr], pc: int) -> int:
    i, loop = _leave(ev, program, pc, "QUITTER")
    if loop is None:
        procedure = ev.frame.procedure
        ev.frame.quitting = True
        ev.frame.loops.clear()
        return procedure.end if procedure is not None else pc + 1
    del ev.frame.loops[i:]
    return loop.end + 1


def _iterate(ev: Runner, program: list[Instr], pc: int) -> int:
    i, loop = _leave(ev, program, pc, "ITERER")
    del ev.frame.loops[i + 1 :]
    return loop.end if loop is not None else pc + 1


def _define(ev: Runner, program: list[Instr], pc: int) -> int:
    return procedures.define(ev, program, pc)


def _end_procedure(_ev: Runner, program: list[Instr], pc: int) -> int:
    raise GibianeError(make(153, "no DEBPROC stands before it", operator="FINPROC", span=program[pc].span()))


def _arguments(ev: Runner, program: list[Instr], pc: int) -> int:
    procedures.read_arguments(ev, program[pc], _without_head(program[pc]))
    return pc + 1


def _respond(ev: Runner, program: list[Instr], pc: int) -> int:
    instr = program[pc]
    if ev.frame.procedure is None:
        raise GibianeError(make(153, "it stands inside a procedure only", operator="RESPRO", span=instr.span()))
    ev.frame.results.extend(procedures.results_of(ev, instr, _without_head(instr)))
    return pc + 1


HANDLERS: dict[str, Any] = {
    "SI": _if,
    "SINO": _else,
    "FINS": _end_if,
    "REPE": _repeat,
    "FIN": _end,
    "QUIT": _quit,
    "ITER": _iterate,
    "DEBP": _define,
    "FINP": _end_procedure,
    "ARGU": _arguments,
    "RESP": _respond,
    "DEBM": _define,
    "FINM": _end_procedure,
}
