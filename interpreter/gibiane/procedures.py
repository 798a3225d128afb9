"""Procedures: definition, finding by name, call, arguments and results."""

from __future__ import annotations

from typing import Any

from gibiane import compiled, slips
from gibiane.binding import ABSENT, Operands
from gibiane.blocks import annotate, check_structure, never_closed
from gibiane.diagnostics import GibianeError, make
from gibiane.frames import Frame
from gibiane.nodes import Instr, Literal, Name, Node
from gibiane.runner import Runner
from gibiane.source import SourceText, Span
from gibiane.syntax import parse, refuse_long
from gibiane.values import ANY, ENTIER, FLOTTANT, NOTHING, Parameter, Procedure, Table

MAX_DEPTH = 500
ECHO_PROCEDURES = 2  # the level of OPTI ECHO that shows the lines of procedure files


def _word(node: Node) -> str | None:
    if isinstance(node, Name):
        return node.word
    if isinstance(node, Literal) and isinstance(node.value, str):
        return str(node.value)
    return None


def parameters(instr: Instr, items: list[Node]) -> list[Parameter]:
    """Read the declarations `name*'TYPE'` (mandatory) and `name/'TYPE'` (optional) of DEBP and ARGU."""
    found: list[Parameter] = []
    i = 0
    while i < len(items):
        name = items[i].name if isinstance(items[i], Name) else _word(items[i])  # type: ignore[attr-defined]
        if name is None or name in ("*", "/"):
            raise GibianeError(
                make(
                    37,
                    "the name of an argument is wanted here",
                    span=instr.at(items[i]),
                    hint="arguments are declared as NAME*TYPE, or NAME/TYPE when optional",
                )
            )
        i += 1
        mark = _word(items[i]) if i < len(items) else None
        if mark not in ("*", "/"):
            found.append(Parameter(name.upper(), None, False, None))
            continue
        wanted = _word(items[i + 1]) if i + 1 < len(items) else None
        if wanted is None:
            raise GibianeError(make(6, "a type is wanted after {mark}", mark=mark, span=instr.at(items[i])))
        i += 2
        subtype = None
        if i + 1 < len(items) and _word(items[i]) == mark and isinstance(items[i], Literal):
            subtype = _word(items[i + 1])
            i += 2
        found.append(Parameter(name.upper(), wanted[:8].rstrip(), mark == "/", subtype))
    return found


def define(ev: Runner, program: list[Instr], pc: int) -> int:
    """Store the procedure that starts at `pc` under its name; return the index after its FINP."""
    instr = program[pc]
    end = instr.jump
    if end is None:
        raise GibianeError(never_closed(instr))
    problems = check_structure(program, pc + 1, end)
    if problems:
        raise GibianeError(problems[0])
    items = [item for item in instr.items if _word(item) is not None]
    if len(items) < 2:
        raise GibianeError(make(533, "a procedure needs a name", operator="DEBPROC", span=instr.span()))
    at = instr.items.index(items[1])
    name = (_word(items[1]) or "").upper()[:24]
    procedure = Procedure(name, parameters(instr, instr.items[at + 1 :]), program, pc + 1, end, instr.head == "DEBM")
    ev.assign_name(name, procedure, instr)
    return end + 1


def load(ev: Runner, word: str) -> Procedure | None:
    """Find the procedure `word` in a file, define everything the file holds in the session, and return it."""
    if not word[0].isalpha() and word[0] not in "@_":
        return None
    source = ev.session.library.find(word)
    if source is None:
        return None
    program = define_all(ev, source)
    found = ev.session.globals.names.get(word[:24])
    if not isinstance(found, Procedure):
        raise GibianeError(
            make(
                1031,
                "{file} does not define the procedure {name}",
                file=source.name,
                name=word,
                span=program[0].span() if program else None,
                hint="the name after DEBP must be the name of the file",
            )
        )
    return found


def define_all(ev: Runner, source: SourceText, only: str | None = None) -> list[Instr]:
    """Define every procedure of a file in the session, or that of one name; return the instructions of the file."""
    program = parse(source)
    if ev.session.options["STRICT"]:
        refuse_long(program)
    slips.mark(source, program)
    annotate(program)
    if ev.session.options["ECHO"] >= ECHO_PROCEDURES:
        ev.echo(source, 1, source.locate(len(source.text.rstrip()))[0])
    outer, ev.frame = ev.frame, ev.session.globals
    try:
        pc = 0
        while pc < len(program):
            instr = program[pc]
            if instr.bad is not None:
                raise GibianeError(instr.bad)
            if instr.head not in ("DEBP", "DEBM"):
                raise GibianeError(make(1031, "a procedure file holds procedures only", span=instr.span()))
            named = [_word(item) for item in instr.items if _word(item) is not None][1:2]
            wanted = only is None or instr.jump is None or [only] == [str(word).upper() for word in named]
            pc = define(ev, program, pc) if wanted else instr.jump + 1  # type: ignore[operator]
    finally:
        ev.frame = outer
    return program


def import_file(ev: Runner, source: SourceText, name: str | None) -> None:
    """Define the procedures of a file (LIRE 'PROC'), or make one, `name`, of a file that holds no DEBP."""
    program = parse(source)
    if any(instr.head in ("DEBP", "DEBM") for instr in program):
        define_all(ev, source, name)
        if name is not None and not isinstance(ev.session.globals.names.get(name), Procedure):
            raise GibianeError(make(9, "{file} defines no procedure {name}", file=source.name, name=name))
        return
    if name is None:
        raise GibianeError(
            make(
                37,
                "{file} defines no procedure: the name of the one it becomes is wanted",
                file=source.name,
                hint="LIRE 'PROC' 'file' 'NAME' ;",
            )
        )
    slips.mark(source, program)
    whole = [*parse(SourceText(source.name, f"DEBP {name} ;")), *program, *parse(SourceText(source.name, "FINP ;"))]
    annotate(whole)
    for instr in program:
        if instr.bad is not None:
            raise GibianeError(instr.bad)
    outer, ev.frame = ev.frame, ev.session.globals
    try:
        define(ev, whole, 0)
    finally:
        ev.frame = outer


def call(ev: Runner, procedure: Procedure, q: Operands, node: Node) -> None:
    """Call a procedure with operands read from the caller's queue; push its results in front."""
    q.push_front(results(ev, procedure, q, node), node)


def results(ev: Runner, procedure: Procedure, q: Operands, node: Node) -> list[Any]:
    """Call a procedure with operands read from the caller's queue; return its results."""
    span = q.span(node)
    frame = _enter(ev, procedure, q.source, node)
    frame.arguments = q
    for parameter in procedure.parameters:
        _read_parameter(frame.names, parameter, q, procedure, span)
    return _run(ev, frame, procedure, q.source, node)


def _enter(ev: Runner, procedure: Procedure, source: SourceText, node: Node) -> Frame:
    """Return the frame of a new call, on top of the current one."""
    if ev.frame.depth >= MAX_DEPTH:
        raise GibianeError(
            make(
                "G103",
                "calls are nested deeper than {limit}: does {name} call itself without end?",
                limit=MAX_DEPTH,
                name=procedure.name,
                span=Span(source, node.start, node.end),
            )
        )
    frame = Frame(ev, ev.frame, procedure)
    frame.called = (source, node)
    if procedure.is_method:
        if procedure.this is None:
            raise GibianeError(
                make(
                    153,
                    "the method {name} is called on an object",
                    name=procedure.name,
                    span=Span(source, node.start, node.end),
                    hint="O % {name} where O is an OBJET",
                )
            )
        frame.this = procedure.this
    return frame


def _run(ev: Runner, frame: Frame, procedure: Procedure, source: SourceText, node: Node) -> list[Any]:
    """Run the body of the procedure of a frame whose arguments are set; return its results."""
    caller, instr = ev.frame, ev.current
    ev.frame = frame
    try:
        if procedure.start < procedure.end:
            ev.execute(procedure.program, procedure.start, procedure.end)
        final = procedure.program[procedure.end]
        ev.current = final
        code = final.code
        if code is None:
            code = final.code = (ev.closures and compiled.result(final)) or False
        value = code(frame) if code and not frame.quitting else None
        if value is not None:
            frame.results.append(value)
        else:
            if final.bad is not None:
                raise GibianeError(final.bad)
            frame.results.extend(results_of(ev, final, final.items, skip_undefined=frame.quitting))
    except GibianeError as failure:
        failure.diagnostic.trace.append((procedure.name, Span(source, node.start, node.end)))
        raise
    finally:
        ev.frame = caller
        ev.current = instr
    if ev.session.options["LOCA"]:
        _keep_locals(ev, frame, procedure)
    return frame.results


def _keep_locals(ev: Runner, frame: Frame, procedure: Procedure) -> None:
    """Keep the names of a finished call in the table `&NAME` (OPTI LOCA)."""
    kept = Table()
    for name, value in frame.names.items():
        if name[0] != "&":
            kept.set(name, value)
    ev.frame.names["&" + procedure.name[:23]] = kept


def call_with_numbers(
    ev: Runner, procedure: Procedure, values: list[Any], instr: Instr, node: Node
) -> list[Any] | None:
    """Call a procedure with numbers that are its parameters one by one; None when they are not (nothing has run)."""
    parameters = procedure.parameters
    if len(parameters) != len(values):
        return None
    names: dict[str, Any] = {}
    for parameter, value in zip(parameters, values, strict=True):
        wanted = parameter.type_name
        if wanted == FLOTTANT:
            value = float(value)
        elif wanted is not None and (wanted != ENTIER or type(value) is not int):
            return None
        names[parameter.name] = value
    frame = _enter(ev, procedure, instr.source, node)
    frame.names = names
    return _run(ev, frame, procedure, instr.source, node)


def _read_parameter(names: dict[str, Any], parameter: Parameter, q: Operands, procedure: Procedure, span: Span) -> None:
    wanted = (parameter.type_name,) if parameter.type_name else (ANY,)
    value, _ = q.take(wanted, parameter.subtype)
    if value is ABSENT:
        if not parameter.optional:
            what = parameter.type_name or "value"
            if parameter.subtype:
                what = f"{what} {parameter.subtype}"
            labels = [q.describe(0, what)] if q.values else []
            diag = make(
                1121,
                "argument {argument} is missing: a {what} is wanted",
                argument=parameter.name,
                what=what,
                operator=procedure.name,
                span=labels[0].span if labels else span,
                labels=labels,
            )
            diag.forms = [usage(procedure)]
            raise GibianeError(diag)
        value = NOTHING
    elif parameter.type_name == FLOTTANT:
        value = float(value)
    names[parameter.name] = value


def usage(procedure: Procedure) -> str:
    """Return the header of a procedure as a usage line."""
    parts = []
    for p in procedure.parameters:
        text = f"{p.name.lower()}:{p.type_name}" if p.type_name else p.name.lower()
        text += f" '{p.subtype}'" if p.subtype else ""
        parts.append(f"({text})" if p.optional else text)
    return " ".join([procedure.name, *parts, ";"])


def results_of(ev: Runner, instr: Instr, items: list[Node], *, skip_undefined: bool = False) -> list[Any]:
    """Evaluate the operands of FINP or RESP: everything they leave is a result."""
    if items and items is instr.items:
        items = [i for n, i in enumerate(items) if n != _head_position(instr)]
    q = ev.operands(instr.source, items)
    if skip_undefined:
        kept = [
            i
            for i, (v, n) in enumerate(zip(q.values, q.nodes, strict=True))
            if not (isinstance(n, Name) and v == n.word)
        ]
        q.values, q.nodes = [q.values[i] for i in kept], [q.nodes[i] for i in kept]
    ev.evaluate(q, 2)  # two targets or more: bare numbers are results, not a point
    return q.values


def _head_position(instr: Instr) -> int:
    return next(n for n, i in enumerate(instr.items) if (_word(i) or "")[:4] == instr.head)


def read_arguments(ev: Runner, instr: Instr, items: list[Node]) -> None:
    """Run ARGU: read more arguments from what is still unread in the caller's queue."""
    frame = ev.frame
    if frame.procedure is None:
        raise GibianeError(make(153, "it stands inside a procedure only", operator="ARGUMENT", span=instr.span()))
    unread = frame.arguments or Operands(ev.session, instr.source, [], [])
    for parameter in parameters(instr, items):
        _read_parameter(frame.names, parameter, unread, frame.procedure, instr.span())
