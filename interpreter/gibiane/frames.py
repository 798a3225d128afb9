"""Frames: the names, loops and pending results of one procedure call."""

from __future__ import annotations

from typing import Any

from gibiane.binding import ABSENT, Operands
from gibiane.nodes import Instr, Node
from gibiane.source import SourceText, Span
from gibiane.values import Procedure


class Stop(Exception):
    """The run ends here: FIN."""


class Resume(Exception):
    """Reading goes on elsewhere: OPTI DONN 3 in a file that another one reads, OPTI DONN 5 in a script."""


class Loop:
    """An active REPE block."""

    __slots__ = ("count", "counter", "end", "limit", "name", "program", "start")

    def __init__(self, name: str, program: list[Instr], start: int, end: int, limit: int) -> None:
        self.name = name
        self.counter = "&" + name[:23]
        self.program = program
        self.start = start
        self.end = end
        self.limit = limit
        self.count = 1

    def turn(self, frame: Frame) -> int:
        """Do what FIN does: count a turn, and return the index of the next instruction (the loop may be over)."""
        self.count = count = self.count + 1
        frame.names[self.counter] = count
        if 0 <= self.limit < count:
            frame.loops.pop()
            return self.end + 1
        return self.start + 1


class Frame:
    """The names of one call (or of the session), on top of the caller's."""

    __slots__ = (
        "arguments",
        "called",
        "depth",
        "evaluator",
        "loops",
        "names",
        "origins",
        "parent",
        "procedure",
        "quitting",
        "results",
        "this",
    )

    def __init__(self, evaluator: Any, parent: Frame | None, procedure: Procedure | None) -> None:
        self.evaluator = evaluator
        self.parent = parent
        self.procedure = procedure
        self.names: dict[str, Any] = {}
        self.origins: dict[str, Instr] = {}
        self.loops: list[Loop] = []
        self.results: list[Any] = []
        self.arguments: Operands | None = None
        self.called: tuple[SourceText, Node] | None = None
        self.this: Any = None
        self.quitting = False
        self.depth: int = 0 if parent is None else parent.depth + 1

    def lookup(self, name: str) -> Any:
        """Return the value of a name seen from here, or ABSENT; names with `!` are seen in their own call only."""
        frame: Frame | None = self
        while frame is not None:
            value = frame.names.get(name, ABSENT)
            if value is not ABSENT or name[0] == "!":
                return value
            frame = frame.parent
        return ABSENT

    def origin(self, name: str) -> int | None:
        """Return the line that gave a visible name its value."""
        frame: Frame | None = self
        while frame is not None:
            if name in frame.names:
                instr = frame.origins.get(name)
                return instr.span().line if instr is not None else None
            frame = frame.parent
        return None

    def calls(self) -> list[tuple[str, Span]]:
        """Return the procedures that are running, the innermost first, each with the place of its call."""
        found = []
        frame: Frame | None = self
        while frame is not None:
            if frame.procedure is not None and frame.called is not None:
                source, node = frame.called
                found.append((frame.procedure.name, Span(source, node.start, node.end)))
            frame = frame.parent
        return found

    def visible(self) -> dict[str, Any]:
        """Return every visible name with its value."""
        found = {} if self.parent is None else self.parent.visible()
        found.update(self.names)
        return found
