"""The evaluator: instructions, elementary groups, assignment, and the queue of typed values.

A group is evaluated by one rule: its first word, if it is an operator, reads operands from the queue and puts its
results in front; this repeats until the first word is no operator or none is left. There is no precedence.
"""

from __future__ import annotations

from typing import Any

from gibiane import compiled, control, faults, objects, procedures, slips
from gibiane.binding import ABSENT, DOT, PERCENT, Mark, Operands
from gibiane.diagnostics import FATAL, GibianeError, Text, make
from gibiane.frames import Frame
from gibiane.nodes import Access, Group, Instr, Literal, Name, Node, Target
from gibiane.registry import Operator, find
from gibiane.source import SourceText, Span
from gibiane.values import ANY, ENTIER, FLOTTANT, NOTHING, Procedure, Table, Texte

KEEPS_TEXT = frozenset({"TYPE", "TEXTE", "LISTER", "EXISTE", "EGA", "NEG"})

# Operators that end a group when their result is a MOT, which must not be taken for an operator.
WORD_ENDS = ("CHANGER",)


class Evaluator:
    """Runs programs in the frames of one session."""

    def __init__(self, session: Any) -> None:
        self.session = session
        self.frame: Frame = Frame(self, None, None)
        self.current: Instr | None = None
        self.failed: Frame | None = None  # the innermost frame of the error that stopped the run
        self.closures = True  # False: the queue machine alone, which defines the language (tests compare both)
        self._echoed: tuple[SourceText | None, int] = (None, 0)

    # -- programs -----------------------------------------------------------------------------------------

    def run(self, program: list[Instr]) -> None:
        """Run a program in the current frame, echoing its lines when OPTI ECHO asks for it."""
        self.session.library.forget_absent()
        self.execute(program, 0, len(program), echo=True)

    def execute(self, program: list[Instr], pc: int, end: int, *, echo: bool = False) -> None:
        """Run instructions [pc, end) of a program; control instructions move `pc`."""
        frame = self.frame
        loops = frame.loops
        handlers = control.HANDLERS
        reached = pc - 1 if echo else end  # the last instruction whose lines are read
        while pc < end:
            instr = program[pc]
            if pc > reached:
                reached = pc
                self._read_lines(instr)
            code = instr.code
            if code is None:
                code = instr.code = (self.closures and compiled.instruction(instr)) or False
            head = instr.head
            if head is None:
                if code and code(frame):
                    pc += 1
                    continue
            elif head == "FIN" and loops and loops[-1].end == pc and loops[-1].program is program:
                pc = loops[-1].turn(frame)
                continue
            self.current = instr
            try:
                if instr.bad is not None:
                    raise GibianeError(instr.bad)
                if instr.head is None:
                    self.instruction(instr)
                    pc += 1
                else:
                    pc = handlers[instr.head](self, program, pc)
            except GibianeError as failure:
                self.frame = frame
                self._failed(instr, failure)
                pc += 1

    def _failed(self, instr: Instr, failure: GibianeError) -> None:
        """Give the targets no value; stop, or go on when OPTI ERRE says so."""
        diag = failure.diagnostic
        if diag.span is None:
            diag.span = instr.span()
        if instr.bad is None and (lost := slips.slip(instr, slips.Habits())) is not None and lost.span is not None:
            diag.notes.append(Text("is a ; missing at the end of line {line}?", {"line": lost.span.line}))
        for target in instr.targets:
            if not target.path:
                self.assign_name(target.name, NOTHING, instr)
        mode = self.session.options["ERRE"]
        if mode in ("IGNO", "CONT") and diag.level < FATAL and not self.session.interactive:
            self.session.worst = max(self.session.worst, diag.level)
            if mode == "IGNO":
                diag.trace.extend(self.frame.calls())
                self.session.emit(diag)
            return
        if self.failed is None:
            self.failed = self.frame
            if self.session.options["DEBU"] and self.frame.procedure is not None:
                diag.notes.append(faults.local_objects(self))
        raise failure

    def unwind(self, *, stay: bool = False) -> None:
        """Return to the session's own frame after a stop, closing what was open; `stay` in the one that failed."""
        self.frame = (self.failed or self.frame) if stay else self.session.globals
        self.failed = None
        self.frame.loops.clear()

    def _read_lines(self, instr: Instr) -> None:
        """Pass the lines up to the end of an instruction that is reached for the first time, with their echo."""
        source, shown = self._echoed
        if source is not instr.source:
            source, shown = instr.source, 0
        last = instr.source.locate(max(instr.end - 1, instr.start))[0]
        if last > shown and self.session.options["ECHO"] >= 1:
            self.echo(source, shown + 1, last)
        self._echoed = source, max(shown, last)

    def echo(self, source: SourceText, first: int, last: int) -> None:
        """Write lines of a source text as they are read."""
        for number in range(first, last + 1):
            line = source.line(number)
            self.session.write(f" $  * {line} " if line else " $  *   ")

    # -- instructions -------------------------------------------------------------------------------------

    def instruction(self, instr: Instr) -> None:
        """Run a directive or an assignment."""
        q = self.operands(instr.source, instr.items)
        self.evaluate(q, len(instr.targets))
        self.finish(instr, q)

    def finish(self, instr: Instr, q: Operands) -> None:
        """Bind what an evaluated queue holds to the targets; fail when too much or too little is left."""
        targets = instr.targets
        if not targets:
            if len(q.values) > 1:
                raise faults.leftover(self, q, 1)
            if len(q.values) == 1 and isinstance(q.values[0], str):
                faults.lonely_word(self, q)
            return
        full = Operands(self.session, q.source, q.values[:], q.nodes[:]) if len(q.values) > len(targets) else None
        results = [self._result_for(target, q, instr) for target in targets]
        if q.values:
            raise faults.leftover(self, q, 0, full)
        for target, value in zip(targets, results, strict=True):
            self.assign(target, value, instr)

    def _result_for(self, target: Target, q: Operands, instr: Instr) -> Any:
        wanted: tuple[str, ...] = (ANY,) if target.type_name is None else (target.type_name,)
        value, _ = q.take(wanted)
        if value is not ABSENT:
            return value
        if target.type_name is not None:
            label = [q.describe(0, target.type_name)] if q.values else []
            raise GibianeError(
                make(
                    37,
                    "no {type} among the results for {name}",
                    type=target.type_name,
                    name=target.name,
                    span=instr.at(target),
                    labels=label,
                )
            )
        if q.values and isinstance(q.values[0], Mark):
            raise faults.stray_access(self, q, 0)
        raise faults.no_result(self, target, instr)

    def assign(self, target: Target, value: Any, instr: Instr) -> None:
        """Bind a value to a target: a name, a table element, or an attribute of an object."""
        if target.member and not target.path:
            objects.assign(self, target, value, instr.at(target))
            return
        if not target.path:
            self.assign_name(target.name, value, instr)
            return
        container = (
            objects.attribute(self, target.name, instr.at(target)) if target.member else self.frame.lookup(target.name)
        )
        for step, (_, index) in enumerate(target.path):
            if not isinstance(container, Table):
                raise faults.no_table(self, target, step, container, instr)
            key = self.index_value(instr.source, index)
            if step == len(target.path) - 1:
                container.set(key, value)
            else:
                container = self._element(container, key, instr.at(index))

    def assign_name(self, name: str, value: Any, instr: Instr | None) -> None:
        """Bind a name in the current frame."""
        frame = self.frame
        frame.names[name] = value
        if instr is not None:
            frame.origins[name] = instr

    def index_value(self, source: SourceText, node: Node) -> Any:
        """Return the value of a table index on the left of `=`."""
        if isinstance(node, Group):
            value = self.group(source, node)
            if value is ABSENT:
                raise GibianeError(make(1043, "this index gives no value", span=Span(source, node.start, node.end)))
            return value
        return self.word(node) if isinstance(node, Name) else node.value  # type: ignore[attr-defined]

    # -- values -------------------------------------------------------------------------------------------

    def word(self, node: Name) -> Any:
        """Resolve a word: a visible object, else a procedure in a file, else the word itself."""
        value = self.frame.lookup(node.name)
        if value is not ABSENT:
            return value
        word = node.word
        op = find(word)
        if op is not None and word in (op.name, op.name[:4]):
            return word
        found = procedures.load(self, word)
        return word if found is None else found

    def operands(self, source: SourceText, items: list[Node]) -> Operands:
        """Resolve the items of a group, evaluating inner groups first, into a queue."""
        values: list[Any] = []
        nodes: list[Node] = []
        for item in items:
            kind = type(item)
            if kind is Name:
                value = self.word(item)  # type: ignore[arg-type]
            elif kind is Literal:
                value = item.value  # type: ignore[attr-defined]
            elif kind is Group:
                value = self.group(source, item)  # type: ignore[arg-type]
                if value is ABSENT:
                    continue
            else:
                value = DOT if isinstance(item, Access) and item.symbol == "." else PERCENT
            values.append(value)
            nodes.append(item)
        return Operands(self.session, source, values, nodes)

    def group(self, source: SourceText, node: Group) -> Any:
        """Evaluate a parenthesis; return its one result, or ABSENT when it gives none."""
        q = self.operands(source, node.items)
        self.evaluate(q, 1)
        if not q.values:
            return ABSENT
        if len(q.values) > 1:
            raise faults.leftover(self, q, 1)
        return q.values[0]

    def evaluate(self, q: Operands, n_targets: int) -> None:
        """Apply the evaluation rule to a queue until no operator is left to run."""
        expanded = 0
        while True:
            kinds = {type(value) for value in q.values}
            if Mark in kinds:
                self.resolve_accesses(q)
            i = q.first_word() if str in kinds or Procedure in kinds else -1
            op: Operator | None = None
            if i >= 0 and type(q.values[i]) is str:
                op = find(q.values[i])
            if Texte in kinds and (op is None or op.name not in KEEPS_TEXT) and self._expand_texts(q):
                expanded += 1
                if expanded > procedures.MAX_DEPTH:
                    raise GibianeError(make("G103", "a TEXTE contains itself", span=q.span(q.nodes[0])))
                continue
            if i < 0:
                break
            node = q.nodes[i]
            if op is None:
                if isinstance(q.values[i], Procedure):
                    procedure = q.values.pop(i)
                    del q.nodes[i]
                    procedures.call(self, procedure, q, node)
                    continue
                break
            if self.session.options["WARN"]:
                faults.warn_traps(self, op, q, i)
            del q.values[i], q.nodes[i]
            if op.symbolic and self.closures and compiled.reduce_front(op.name, q.values, q.nodes, node):
                continue
            try:
                op.run(self.session, q, node)
            except GibianeError as failure:
                diag = failure.diagnostic
                if diag.operator is None and not diag.trace:
                    diag.operator = op.name
                if diag.span is None:
                    diag.span = q.span(node)
                if diag.hint is None and diag.code in ("7", "37", "533") and not diag.trace:
                    diag.hint = _read_otherwise(node, op)
                raise
            if op.terminal or (op.name in WORD_ENDS and q.values and type(q.values[0]) is str and q.nodes[0] is node):
                break
        if n_targets <= 1 and self.session.point_maker is not None:
            self.make_point(q, self.session.options["DIME"])

    def make_point(self, q: Operands, dim: int) -> None:
        """Make a point of two or three bare numbers left in a queue (OPTI DIME 2 or 3)."""
        if dim < 2:
            return
        first, node = q.take((ENTIER, FLOTTANT))
        if first is ABSENT:
            return
        second, other = q.take((ENTIER, FLOTTANT))
        if second is ABSENT:
            q.push_front([first], node)
            return
        if self.session.options["WARN"] and node is not None and other is not None:
            faults.warn_comma(self, q.span(node), q.span(other))
        coordinates = [first, second]
        if dim == 3:
            third, _ = q.take((ENTIER, FLOTTANT))
            if third is ABSENT:
                raise GibianeError(
                    make(
                        37,
                        "a point in space has three coordinates; only two numbers are here",
                        span=q.span(node),
                        hint="write the third, or OPTI DIME 2",
                    )
                )
            coordinates.append(third)
        q.push_front([self.session.point_maker(coordinates)], node)

    def resolve_accesses(self, q: Operands) -> None:
        """Replace `TABLE . index` by the element, from left to right, and call methods for `OBJET % name`."""
        i = 0
        while i < len(q.values):
            mark = q.values[i]
            if mark is PERCENT:
                i = objects.resolve(self, q, i)
                continue
            if mark is DOT and i and isinstance(q.values[i - 1], Table):
                if i + 1 == len(q.values):
                    raise GibianeError(make(1043, "an index is missing after .", span=q.span(q.nodes[i])))
                value = self._element(q.values[i - 1], q.values[i + 1], q.span(q.nodes[i + 1]))
                q.values[i - 1 : i + 2] = [value]
                del q.nodes[i : i + 2]
                continue
            i += 1

    def _element(self, table: Table, index: Any, span: Span) -> Any:
        try:
            return table.get(index)
        except GibianeError as failure:
            failure.diagnostic.span = span
            raise

    def _expand_texts(self, q: Operands) -> bool:
        for i, value in enumerate(q.values):
            if isinstance(value, Texte):
                inner = self.operands(value.source, value.items)
                node = q.nodes[i]
                q.values[i : i + 1] = inner.values
                q.nodes[i : i + 1] = [node] * len(inner.values)
                return True
        return False

    # -- procedures ------------------------------------------------------------------------------------------

    def call_with_numbers(self, procedure: Procedure, values: list[Any], instr: Instr, node: Node) -> list[Any] | None:
        """Call a procedure for the closures (see :mod:`gibiane.compiled`)."""
        return procedures.call_with_numbers(self, procedure, values, instr, node)

    def call_values(self, procedure: Any, arguments: list[Any], span: Span) -> list[Any]:
        """Call a procedure (object or name) with given values, for an operator."""
        if isinstance(procedure, str):
            found = self.frame.lookup(procedure.upper())
            if not isinstance(found, Procedure):
                found = procedures.load(self, procedure.upper())
            if found is None:
                raise GibianeError(make(9, "there is no procedure {name}", name=procedure, span=span))
            procedure = found
        node = Node(span.start, span.end)
        q = Operands(self.session, span.source, arguments, [node] * len(arguments))
        procedures.call(self, procedure, q, node)
        return q.values


def _read_otherwise(node: Node, op: Operator) -> Text | None:
    """Say that a word was read as the operator that shares its first four letters, when it is no short form of it."""
    if not isinstance(node, Name) or len(node.word) <= 4 or op.whole or op.name.startswith(node.word.upper()):
        return None
    fields = {"word": node.word.upper(), "name": op.name}
    if fields["word"] == "PRINT":
        return Text("{word} is read as {name}, by its first four letters; MESS writes on the screen", fields)
    return Text("{word} is read as {name}, by its first four letters", fields)
