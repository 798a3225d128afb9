"""What is wrong with an instruction that leaves values unread: the word that stopped it, and what it may have meant."""

from __future__ import annotations

from typing import Any

from gibiane import cast3m, procedures
from gibiane.binding import ABSENT, DOT, Mark, Operands
from gibiane.diagnostics import GibianeError, Label, Text, make, nearest
from gibiane.nodes import Instr, Literal, Name, Node, Target
from gibiane.registry import Operator, find, spellings
from gibiane.runner import Runner
from gibiane.source import Span
from gibiane.values import ENTIER, FLOTTANT, POINT, Procedure, type_of


def leftover(ev: Runner, q: Operands, at: int, full: Operands | None = None) -> GibianeError:
    """Return the error for value `at` of a queue, which nothing has read; `full` is the queue before assignment."""
    whole = full or q
    for i, value in enumerate(whole.values):
        if isinstance(value, Mark):
            return stray_access(ev, whole, i)
    at = min(at, len(q.values) - 1)
    word = whole.first_word()
    if word >= 0 and isinstance(whole.values[word], str):
        found = _stopped_by(ev, whole, word, q.nodes[at])
        if found is not None:
            return found
    label = q.describe(at)
    failure = make(
        11, "a result of type {type} is left over", type=type_of(q.values[at]), labels=[label], span=label.span
    )
    procedure = _called(ev)
    if procedure is not None:
        failure.hint = Text("does {name} take so many arguments?", {"name": procedure.name})
        failure.forms = [procedures.usage(procedure)]
    elif len(whole.values) > 1 and all(node is whole.nodes[0] for node in whole.nodes):
        failure.hint = Text("it gives several results: A B = ... gives each a name")
    elif len(whole.values) > 1 and all(type_of(v) in (ENTIER, FLOTTANT) for v in whole.values):
        failure.hint = _numbers_hint(ev, whole)
    elif type_of(whole.values[0]) == POINT and all(type_of(v) in (ENTIER, FLOTTANT) for v in whole.values[1:]):
        failure.hint = Text("a point has two coordinates after OPTI DIME 2, three after OPTI DIME 3")
    elif type_of(whole.values[0]).startswith("LIST") and len(whole.values) == 2 and type_of(whole.values[1]) == ENTIER:
        fields = {"list": whole.nodes[0].name if isinstance(whole.nodes[0], Name) else "L", "number": whole.values[1]}
        failure.hint = Text("EXTR {list} {number} gives the value of that number in a list", fields)
    elif (op := _first_operator(ev)) is not None and isinstance(q.values[at], str):
        failure.hint = Text(
            "{directive} does not read it: INFO {directive} ; tells what it reads", {"directive": op.name}
        )
    else:
        failure.hint = Text("an operator is missing, or a ; between two instructions")
    return GibianeError(failure)


def _numbers_hint(ev: Runner, whole: Operands) -> Text:
    """Say what numbers side by side may have been meant for: a point, a decimal comma, an operation."""
    dim, count = ev.session.options["DIME"], len(whole.values)
    first, last = (whole.span(whole.nodes[i]) for i in (0, -1))
    between = whole.source.text[first.end : last.start]
    if count == 2 and between == ",":
        return Text("the decimal point is a point: 3.5")
    if dim < 2 and count in (2, 3):
        missing = "an operator is missing between them; for a point, OPTI DIME {count} ; comes first"
        return Text(missing, {"count": count})
    return Text("an operator is missing between the values, or a ; between two instructions")


def _stopped_by(ev: Runner, q: Operands, at: int, unread: Node) -> GibianeError | None:
    """Explain the first word of a queue that stopped its evaluation: misspelt, not available, or in a wrong place."""
    word, node = q.values[at], q.nodes[at]
    span = q.span(node)
    plain = isinstance(node, Name) and word == node.word
    runs = find(word) is not None
    if plain and not runs:
        return unknown(ev, q, at, unread)
    if runs and (plain or isinstance(node, Literal)):
        hint = "an operator that follows EXTR, TYPE, CHAI, MOT, LIST or VALE needs parentheses around these"
        return GibianeError(
            make(
                11,
                "the operator {word} is not run",
                word=word,
                span=span,
                labels=[Label(span, Text("the operator before it ends the instruction"))],
                hint=hint,
            )
        )
    if isinstance(node, Literal) and node.quoted and (missing := cast3m.meant(word)) is not None:
        return GibianeError(q.not_available(at, *missing))
    if isinstance(node, Literal) and word.upper() != word and find(word.upper()) is not None:
        return GibianeError(
            make(
                11,
                "the word '{word}' is no operator",
                word=word,
                span=span,
                capitals=word.upper(),
                labels=[Label(span, Text("only a word"))],
                hint="a quoted operator is written in capitals: '{capitals}'",
            )
        )
    after = next((i for i in range(at + 1, len(q.values)) if q.is_operator_word(i) or _is_symbol(q, i)), None)
    if after is not None:
        labels = [Label(span, Text("this word stands before it")), Label(q.span(q.nodes[after]), Text("not run"))]
        return GibianeError(
            make(
                11,
                "the operator {word} is not run: a word stands before it",
                word=q.values[after],
                labels=labels,
                span=labels[1].span,
                hint="words follow their operator: ET 'abc' 'def', EGA X 'WORD'",
            )
        )
    return None


def _is_symbol(q: Operands, i: int) -> bool:
    node = q.nodes[i]
    return isinstance(node, Literal) and not node.quoted and isinstance(node.value, str)


def unknown(ev: Runner, q: Operands, at: int, unread: Node | None = None) -> GibianeError:
    """Return the error for a word that is no operator, procedure or object, where one was meant."""
    word, node = q.values[at], q.nodes[at]
    span = q.span(node)
    labels = [Label(span, Text("nothing has this name"))]
    missing = cast3m.meant(word)
    if missing is not None and (missing[0] == word or nearest(word, list(ev.session.names())) is None):
        return GibianeError(q.not_available(at, *missing))
    if unread is not None and unread is not node:
        labels.append(Label(q.span(unread), Text("not read by anything")))
    close = nearest(word, [*spellings(), *ev.session.names(), *ev.session.library.names()])
    hint = "did you mean {close}?" if close else "is it misspelt, or defined later?"
    return GibianeError(
        make(
            11,
            "{word} is not the name of an operator, a procedure or an object",
            word=word,
            span=span,
            labels=labels,
            hint=hint,
            close=close,
        )
    )


def stray_access(ev: Runner, q: Operands, i: int) -> GibianeError:
    """Return the error for a separator whose left side has no elements."""
    if not i:
        return GibianeError(make(11, "nothing stands before this separator", span=q.span(q.nodes[i])))
    label = q.describe(i - 1)
    value, node = q.values[i - 1], q.nodes[i - 1]
    close = None
    if isinstance(node, Name) and value == node.word:
        close = nearest(node.word, list(ev.session.names()))
    what = "only a TABLE has elements" if q.values[i] is DOT else "only an OBJET has methods"
    return GibianeError(
        make(11, what, labels=[label], span=label.span, close=close, hint="did you mean {close}?" if close else None)
    )


def _called(ev: Runner) -> Procedure | None:
    """Return the procedure that the current instruction names."""
    for item in ev.current.items if ev.current is not None else []:
        if isinstance(item, Name) and isinstance(value := ev.frame.lookup(item.name), Procedure):
            return value
    return None


def _first_operator(ev: Runner) -> Operator | None:
    """Return the operator that the current instruction begins with."""
    items = ev.current.items if ev.current is not None else []
    first = items[0] if items else None
    word = first.word if isinstance(first, Name) else first.value if isinstance(first, Literal) else None
    return find(word) if isinstance(word, str) else None


def no_result(ev: Runner, target: Target, instr: Instr) -> GibianeError:
    """Return the error for a name for which no result is left."""
    hint = "the right side gives fewer results than there are names"
    fields: dict[str, Any] = {"name": target.name}
    op = _first_operator(ev)
    if op is not None and not any(form.gives for form in op.all_forms()):
        hint = "{directive} gives no result: write it without {name} ="
        fields["directive"] = op.name
    return GibianeError(make(37, "no result is left for {name}", span=instr.at(target), hint=hint, **fields))


def no_table(ev: Runner, target: Target, step: int, container: object, instr: Instr) -> GibianeError:
    """Return the error for an element of something that is no table, on the left of `=`."""
    end = target.path[step - 1][1].end if step else target.start + len(target.name)
    span = Span(instr.source, target.start, min(end, target.end))
    if container is ABSENT:
        close = nearest(target.name, list(ev.session.names()))
        hint = "did you mean {close}?" if close else "make the table first: {name} = TABL ;"
        return GibianeError(
            make(
                315,
                "{name} is not defined: it has no elements to assign",
                name=target.name,
                span=span,
                close=close,
                hint=hint,
            )
        )
    return GibianeError(
        make(
            315,
            "{name} is a {type}, not a TABLE: it has no elements to assign",
            name=span.text,
            type=type_of(container),
            span=span,
            hint="make the table first: {name} = TABL ;",
        )
    )


# -- warnings of a session at the prompt --------------------------------------------------------------------------


def lonely_word(ev: Runner, q: Operands) -> None:
    """Judge a directive whose only value is a word, which the language drops: refuse operators of Cast3M.

    At the prompt, warn of a word that nothing has.
    """
    node, word = q.nodes[0], q.values[0]
    if not isinstance(node, (Name, Literal)) or word != getattr(node, "word", word):
        return
    missing = cast3m.meant(word)
    if missing is not None and find(word) is None:
        raise GibianeError(q.not_available(0, *missing))
    if not ev.session.options["WARN"] or not isinstance(node, Name):
        return
    close = nearest(node.word, [*spellings(), *ev.session.names(), *ev.session.library.names()])
    ev.session.emit(
        make(
            "G301",
            "the word {word} does nothing: no object or operator has this name",
            word=node.word,
            span=q.span(node),
            close=close,
            hint="did you mean {close}?" if close else None,
        )
    )


def warn_hidden_operators(ev: Runner, program: list[Instr]) -> None:
    """Warn of names that a text gives a value and that hide an operator from then on."""
    known = set(ev.session.names())
    for instr in program:
        for target in instr.targets:
            op = find(target.name) if not target.path and not target.member and target.name not in known else None
            if op is not None and target.name in (op.name, op.name[:4]):
                known.add(target.name)
                ev.session.emit(
                    make(
                        "G301",
                        "the name {name} now hides the operator {hidden}",
                        name=target.name,
                        hidden=op.name,
                        span=instr.at(target),
                        short=op.name[:4],
                        hint="quote the operator to call it all the same: '{short}'",
                    )
                )


def warn_traps(ev: Runner, op: Operator, q: Operands, at: int) -> None:
    """Warn of two traps before an operator runs: a word taken for it by four letters, operands far from a symbol."""
    node = q.nodes[at]
    if op.symbolic:
        numbers = (int, float)
        if at >= 2 and at + 1 < len(q.values) and all(type(q.values[i]) in numbers for i in (0, 1, at - 1, at + 1)):
            used = [Label(q.span(q.nodes[i]), Text("read")) for i in (0, 1)]
            ev.session.emit(
                make(
                    "G301",
                    "{symbol} reads the two leftmost numbers, not those beside it",
                    symbol=op.name,
                    span=q.span(node),
                    labels=used,
                    hint="put the operation between parentheses",
                )
            )
    elif isinstance(node, Name) and q.values[at] == node.word:
        word = node.word
        if len(word) > 4 and not op.name.startswith(word) and not word[4:].isalpha():
            ev.session.emit(
                make(
                    "G301",
                    "the word {word} runs the operator {hidden}: four letters are enough",
                    word=word,
                    hidden=op.name,
                    span=q.span(node),
                    hint="an object of this name must be given a value first",
                )
            )


def warn_comma(ev: Runner, first: Span, second: Span) -> None:
    """Warn of two integers with nothing but a comma between them: a point, where a real may have been meant."""
    if first.end + 1 == second.start and first.text.lstrip("+-").isdigit() and second.text.isdigit():
        between = first.to(second)
        if between.text[first.end - first.start] == ",":
            ev.session.emit(
                make(
                    "G301",
                    "{text} is the point of coordinates {x} and {y}: a comma is a blank",
                    text=between.text,
                    x=first.text,
                    y=second.text,
                    span=between,
                    hint="a real is written with a dot: {x}.{y}",
                )
            )


def local_objects(ev: Runner) -> Text:
    """Return the note that shows what the procedure of the current frame holds (OPTI DEBU 1)."""
    frame = ev.frame
    shown = [
        f"{name} {type_of(value)}" + (f" {ev.session.brief(value)}" if isinstance(value, int | float | str) else "")
        for name, value in sorted(frame.names.items())
    ]
    name = frame.procedure.name if frame.procedure is not None else ""
    return Text("objects of {name}: {objects}", {"name": name, "objects": ", ".join(shown) or "-"})
