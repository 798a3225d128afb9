"""What a form of an operator declares: positional operands, keywords, results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

Function = Callable[..., Any]


class Arg:
    """A positional operand: read by type, wherever words let it be seen.

    `types` is one type name or several alternatives; `many` collects all there are into a list (at least one
    unless `optional`); an absent optional operand is None.
    """

    def __init__(
        self,
        name: str,
        types: str | Sequence[str],
        doc: str = "",
        *,
        optional: bool = False,
        many: bool = False,
        subtype: str | None = None,
    ) -> None:
        self.name = name
        self.types = (types,) if isinstance(types, str) else tuple(types)
        self.doc = doc
        self.optional = optional
        self.many = many
        self.subtype = subtype

    def usage(self) -> str:
        """Return its part of the usage line."""
        text = f"{self.name}:{'|'.join(self.types)}" + ("..." if self.many else "")
        return f"({text})" if self.optional else text


class Key:
    """A keyword, or several alternatives (`words`), with operands of its own.

    The parameter is True/False for a bare keyword, the operand (a tuple for several) for one with operands, the
    word read for alternatives (with its operands: a tuple, word first); None (False when bare) if absent, a list of
    these with `repeat`.
    """

    def __init__(
        self,
        words: str | Sequence[str],
        doc: str = "",
        *args: Arg,
        name: str | None = None,
        required: bool = False,
        repeat: bool = False,
        width: int = 4,
    ) -> None:
        self.words = (words,) if isinstance(words, str) else tuple(words)
        self.doc = doc
        self.args = args
        self.name = name or self.words[0].lower()
        self.required = required
        self.repeat = repeat
        self.width = width

    def match(self, word: str) -> str | None:
        """Return the keyword that `word` abbreviates or extends (first letters compared), or None."""
        short = word[: self.width].rstrip()
        return next((w for w in self.words if w[: self.width] == short), None)

    @property
    def default(self) -> Any:
        """What the parameter is when the keyword is absent."""
        return [] if self.repeat else False if not self.args and len(self.words) == 1 else None

    def usage(self) -> str:
        """Return its part of the usage line."""
        words = "|".join(f"'{w}'" for w in self.words)
        text = " ".join([words, *(arg.usage() for arg in self.args)]) + ("..." if self.repeat else "")
        return text if self.required else f"({text})"


class Form:
    """One way of calling an operator: what it reads, what it gives, and the function that does it."""

    def __init__(
        self,
        parts: Sequence[Arg | Key],
        gives: Sequence[str],
        function: Function,
        *,
        stream: bool,
        syntax: str | None,
        last: bool,
    ) -> None:
        self.args = [p for p in parts if isinstance(p, Arg)]
        self.keys = [p for p in parts if isinstance(p, Key)]
        self.gives = list(gives)
        self.function = function
        self.stream = stream
        self.syntax = syntax
        self.last = last
        self.defaults: dict[str, Any] = {a.name: [] if a.many else None for a in self.args}
        self.defaults.update((k.name, k.default) for k in self.keys)
        self.order = [p.name for p in parts]

    def usage(self, name: str) -> str:
        """Return the usage line of this form."""
        left = " ".join(self.gives)
        body = (
            self.syntax
            if self.syntax is not None
            else " ".join([*(a.usage() for a in self.args), *(k.usage() for k in self.keys)])
        )
        text = f"{name} {body}".rstrip()
        return f"{left} = {text} ;" if left else f"{text} ;"
