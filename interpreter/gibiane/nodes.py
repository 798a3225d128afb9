"""The syntax tree: instructions, words, literals and groups, each with its place in the source."""

from __future__ import annotations

from typing import Any

from gibiane.diagnostics import Diagnostic
from gibiane.source import SourceText, Span

NAME_LENGTH = 24


class Node:
    """One item of an instruction; `start` and `end` are character offsets in its source."""

    __slots__ = ("end", "start")

    def __init__(self, start: int, end: int) -> None:
        self.start = start
        self.end = end


class Name(Node):
    """An unquoted word: `word` is it in upper case, `name` its first 24 characters."""

    __slots__ = ("name", "word")

    def __init__(self, text: str, start: int, end: int) -> None:
        super().__init__(start, end)
        self.word = text.upper()
        self.name = self.word[:NAME_LENGTH]


class Literal(Node):
    """A quoted string, an integer, a real, or an operator symbol (`value` is str, int or float)."""

    __slots__ = ("quoted", "value")

    def __init__(self, value: Any, start: int, end: int, quoted: bool = False) -> None:
        super().__init__(start, end)
        self.value = value
        self.quoted = quoted


class Access(Node):
    """The separators `.` (table element) and `%` (object member)."""

    __slots__ = ("symbol",)

    def __init__(self, symbol: str, start: int, end: int) -> None:
        super().__init__(start, end)
        self.symbol = symbol


class Group(Node):
    """A parenthesis: an elementary instruction evaluated before what surrounds it."""

    __slots__ = ("code", "items")

    def __init__(self, items: list[Node], start: int, end: int) -> None:
        super().__init__(start, end)
        self.items = items
        self.code: Any = None


class Target(Node):
    """A name or table element to assign; `path` holds the indices, `type_name` the wanted type if given."""

    __slots__ = ("member", "name", "path", "type_name")

    def __init__(self, name: str, start: int, end: int) -> None:
        super().__init__(start, end)
        self.name = name
        self.path: list[tuple[str, Node]] = []
        self.type_name: str | None = None
        self.member = False


class Instr:
    """One instruction up to its `;`.

    `head` is its control word (SI, REPE, ...) or None; `jump` and `other` are indices of the matching
    instructions in its program, set by :mod:`gibiane.blocks`; `bad` is its syntax error, if it has one.
    """

    __slots__ = ("bad", "code", "end", "head", "items", "jump", "other", "source", "start", "targets")

    def __init__(self, source: SourceText, start: int, end: int, targets: list[Target], items: list[Node]) -> None:
        self.source = source
        self.start = start
        self.end = end
        self.targets = targets
        self.items = items
        self.head: str | None = None
        self.jump: int | None = None
        self.other: int | None = None
        self.bad: Diagnostic | None = None
        self.code: Any = None

    def span(self) -> Span:
        """Return the place of the whole instruction."""
        return Span(self.source, self.start, self.end)

    def at(self, node: Node) -> Span:
        """Return the place of one of its nodes."""
        return Span(self.source, node.start, node.end)
