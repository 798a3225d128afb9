"""Tokens to instructions: one instruction at a time, each with its own syntax error if it has one."""

from __future__ import annotations

from typing import Any

from lark import UnexpectedToken

from gibiane.diagnostics import Diagnostic, Label, Text, make
from gibiane.lexer import Token, tokens
from gibiane.nodes import NAME_LENGTH, Access, Group, Instr, Literal, Name, Node, Target
from gibiane.parser import leaf, parser
from gibiane.source import SourceText, Span

LONGEST_INSTRUCTION = 500


class SyntaxFailure(Exception):
    """A syntax error inside one instruction."""

    def __init__(self, diagnostic: Diagnostic) -> None:
        super().__init__(diagnostic.sentence.render())
        self.diagnostic = diagnostic


def parse(source: SourceText, start: int = 0) -> list[Instr]:
    """Parse a source text into instructions; a wrong one carries its diagnostic in `bad`.

    Control words are recognised (`head`); matching them into blocks is the work of :mod:`gibiane.blocks`.
    """
    errors: dict[int, Diagnostic] = {}
    program: list[Instr] = []
    held: list[Token] = []
    for token in tokens(source, errors, start):
        if token.type == "SEMI":
            program.append(_instruction(source, held, token.end_pos, errors))
            held = []
        else:
            held.append(token)
    if held:
        instr = _instruction(source, held, held[-1].end_pos, errors)
        if instr.bad is None or instr.bad.code == "1":
            last = Span(source, held[-1].start_pos, held[-1].end_pos)
            instr.bad = make(
                "G102",
                "the text ends before the `;` of this instruction",
                span=last,
                hint="close the instruction with ;",
            )
        program.append(instr)
    elif errors:
        program.append(_instruction(source, [], len(source.text), errors))
    return program


def refuse_long(program: list[Instr]) -> None:
    """Mark the instructions that Cast3M finds too long, comments not counted (--strict)."""
    for instr in program:
        if instr.bad is None and instr.end - instr.start > LONGEST_INSTRUCTION:
            text = instr.source.text[instr.start : instr.end]
            length = sum(len(line) for line in text.split("\n") if not line.startswith("*"))
            if length > LONGEST_INSTRUCTION:
                last = Span(instr.source, max(instr.end - 1, instr.start), instr.end)
                instr.bad = make(
                    3,
                    "an instruction of {length} characters: Cast3M reads {most}",
                    length=length,
                    most=LONGEST_INSTRUCTION,
                    span=last,
                    labels=[Label(last, Text("it ends here"))],
                    hint="split it; without --strict any length is accepted",
                )


def _instruction(source: SourceText, held: list[Token], end: int, errors: dict[int, Diagnostic]) -> Instr:
    start = held[0].start_pos if held else min(errors, default=end - 1)
    instr = Instr(source, start, end, [], [])
    lexical = [at for at in errors if at < end]
    try:
        left, items = _grouped(source, held)
        instr.items = items
        if left is not None:
            instr.targets = _targets(source, left, held)
    except SyntaxFailure as failure:
        instr.bad = failure.diagnostic
        instr.items = [leaf(t) for t in held if t.type in ("NAME", "STRING", "NUMBER")]
    if lexical:
        unclosed = [at for at in lexical if errors[at].code == "G102"]  # it explains the others
        instr.bad = errors[min(unclosed or lexical)]
        for at in lexical:
            del errors[at]
    if not instr.targets:
        instr.head = _head(instr.items)
    return instr


def _grouped(source: SourceText, held: list[Token]) -> tuple[list[Node] | None, list[Node]]:
    try:
        result: tuple[list[Node] | None, list[Node]] = parser().parse(held)  # type: ignore[assignment]
    except UnexpectedToken as failure:
        raise SyntaxFailure(_explain(source, held, failure.token)) from None
    return result


def _explain(source: SourceText, held: list[Token], bad: Any) -> Diagnostic:
    """Name the mistake from the token the parser stopped at."""
    depth: list[Token] = []
    equals = 0
    for token in held:
        if token is bad:
            break
        if token.type == "LPAR":
            depth.append(token)
        elif token.type == "RPAR":
            depth.pop()
        elif token.type == "EQUAL":
            equals += 1
    if bad.type == "RPAR":
        return make(
            2,
            "this closing parenthesis has no opening one",
            span=Span(source, bad.start_pos, bad.end_pos),
            hint="remove it, or write the missing ( before it",
        )
    if bad.type == "EQUAL" and equals:
        return make(
            1014,
            "a second = in one instruction",
            span=Span(source, bad.start_pos, bad.end_pos),
            hint="is the ; of the instruction before it missing? To compare two values: A EGA B",
        )
    if bad.type == "EQUAL":
        return make(
            1014,
            "an = inside a parenthesis",
            span=Span(source, bad.start_pos, bad.end_pos),
            hint="assign in an instruction of its own; to compare two values: A EGA B",
        )
    opening, last = (Span(source, token.start_pos, token.end_pos) for token in (depth[-1], held[-1]))
    labels = [Label(opening, Text("opened here"))]
    if last.line != opening.line:
        labels.append(Label(last, Text("the instruction ends here")))
    return make(
        1,
        "this parenthesis is not closed before the end of the instruction",
        span=opening,
        labels=labels,
        hint="write the missing ) before the ;",
    )


def _targets(source: SourceText, left: list[Node], held: list[Token]) -> list[Target]:
    """Read the left side of `=`: names, each with an optional type mark or a path of indices."""
    targets: list[Target] = []
    items = list(left)
    i = 0
    while i < len(items):
        item = items[i]
        following = items[i + 1] if i + 1 < len(items) else None
        if isinstance(item, Access) and item.symbol == "%" and (attribute := _written_name(following)):
            target = Target(attribute, item.start, items[i + 1].end)
            target.member = True
            i += 2
        elif name := _written_name(item):
            target = Target(name, item.start, item.end)
            i += 1
        else:
            raise SyntaxFailure(
                make(
                    315,
                    "this cannot be given a value",
                    span=Span(source, item.start, item.end),
                    hint="on the left of = stand names and table elements: A T.'X' = ...",
                )
            )
        while i < len(items) and isinstance(access := items[i], Access):
            if i + 1 == len(items) or isinstance(items[i + 1], Access):
                raise SyntaxFailure(
                    make(
                        1043,
                        "an index is missing after {symbol}",
                        symbol=access.symbol,
                        span=Span(source, access.start, access.end),
                    )
                )
            target.path.append((access.symbol, items[i + 1]))
            target.end = items[i + 1].end
            i += 2
        if i + 1 < len(items) and isinstance(mark := items[i], Literal) and mark.value == "*" and not mark.quoted:
            wanted = items[i + 1]
            if isinstance(wanted, Name):
                target.type_name = wanted.word[:8]
            elif isinstance(wanted, Literal) and wanted.quoted:
                target.type_name = str(wanted.value)[:8]
            else:
                raise SyntaxFailure(make(6, "a type is wanted after *", span=Span(source, mark.start, wanted.end)))
            target.end = wanted.end
            i += 2
        if target.name.startswith("#") and not target.path:
            raise SyntaxFailure(
                make(315, "names that begin with # are reserved", span=Span(source, target.start, target.end))
            )
        targets.append(target)
    if not targets:
        equal = next(t for t in held if t.type == "EQUAL")
        raise SyntaxFailure(
            make(
                315,
                "nothing stands before the =",
                span=Span(source, equal.start_pos, equal.end_pos),
                hint="write the name of the result before it",
            )
        )
    return targets


def _written_name(node: Node | None) -> str | None:
    """Return the name that a word or a string stands for on the left of `=`."""
    if isinstance(node, Name):
        return node.name
    return str(node.value).upper()[:NAME_LENGTH] if isinstance(node, Literal) and node.quoted else None


CONTROL_HEADS = frozenset(
    {"SI", "SINO", "FINS", "REPE", "FIN", "QUIT", "ITER", "DEBP", "FINP", "ARGU", "RESP", "DEBM", "FINM"}
)


def _head(items: list[Node]) -> str | None:
    """Return the control word of a directive: its first word, numbers and groups before it skipped."""
    for item in items:
        if isinstance(item, Group) or (isinstance(item, Literal) and not isinstance(item.value, str)):
            continue
        word = item.word if isinstance(item, Name) else item.value if isinstance(item, Literal) else ""
        key = word[:4]
        if key in CONTROL_HEADS:
            return str(key)
        last = items[-1]
        if isinstance(item, Name) and isinstance(last, Name) and last.word == "SI" and key not in ("COMM", "MESS"):
            return "SI"  # `ok SI ;`
        return None
    return None
