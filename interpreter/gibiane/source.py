"""Source text, positions in it, and decoding of files: nothing else touches raw text."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

TAB_WIDTH = 4


class NotText(Exception):
    """Bytes that are no script text (a NUL byte was met at `offset`)."""

    def __init__(self, offset: int) -> None:
        super().__init__(offset)
        self.offset = offset


def decode(data: bytes) -> str:
    """Decode a script: UTF-8 first, Latin-1 when that fails; drop a byte-order mark; normalise line ends.

    Raises
    ------
    NotText
        If the bytes hold a NUL, which no script text does.
    """
    nul = data.find(b"\0")
    if nul >= 0:
        raise NotText(nul)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


@dataclass(frozen=True, eq=False)
class SourceText:
    """A named text that knows where its lines start."""

    name: str
    text: str
    directory: str | None = field(default=None)

    @cached_property
    def _starts(self) -> list[int]:
        starts = [0]
        find = self.text.find
        at = find("\n")
        while at >= 0:
            starts.append(at + 1)
            at = find("\n", at + 1)
        return starts

    def locate(self, offset: int) -> tuple[int, int]:
        """Return the 1-based line and column of a character offset."""
        line = bisect_right(self._starts, offset)
        return line, offset - self._starts[line - 1] + 1

    def line(self, number: int) -> str:
        """Return the text of the 1-based line `number`, without its end."""
        start = self._starts[number - 1]
        end = self._starts[number] - 1 if number < len(self._starts) else len(self.text)
        return self.text[start:end]


class Span(NamedTuple):
    """A stretch of a source text, by character offsets (end excluded)."""

    source: SourceText
    start: int
    end: int

    @property
    def line(self) -> int:
        """Line number of the start, from 1."""
        return self.source.locate(self.start)[0]

    @property
    def column(self) -> int:
        """Column of the start, from 1."""
        return self.source.locate(self.start)[1]

    @property
    def text(self) -> str:
        """The characters covered."""
        return self.source.text[self.start : self.end]

    def to(self, other: Span) -> Span:
        """Return the stretch from the start of this one to the end of `other`."""
        return Span(self.source, self.start, max(self.end, other.end))


def expand_tabs(line: str, column: int) -> tuple[str, int]:
    """Replace tabs by blanks for display; return the line and the display column of 1-based `column`."""
    before = line[: column - 1].replace("\t", " " * TAB_WIDTH)
    return line.replace("\t", " " * TAB_WIDTH), len(before) + 1
