"""A Pygments lexer of the language, for the prompt and for anything else that uses Pygments."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any, ClassVar

from pygments.lexer import RegexLexer, bygroups
from pygments.token import Comment, Keyword, Name, Number, Operator, Punctuation, String, Text, Whitespace, _TokenType

_BLOCKS = "SI|SINO|SINON|FINS|FINSI|REPE|REPETER|FIN|QUIT|QUITTER|ITER|ITERER"
_PROCEDURES = "DEBP|DEBPROC|FINP|FINPROC|DEBM|DEBMETH|FINM|FINMETH|ARGU|ARGUMENT|RESP|RESPRO|RESPROC"
_LETTER = r"[A-Za-z0-9_@&!#?$]"


@cache
def _operators() -> frozenset[str]:
    from gibiane import cast3m, registry

    words = {*cast3m.names(), *registry.names()}
    return frozenset({word[:4] for word in words if word[:1] != "@"})


class GibianeLexer(RegexLexer):  # type: ignore[misc]  # Pygments ships no types
    """Colours Gibiane scripts: block words, operators, strings, numbers, comments in column 1."""

    name = "Gibiane"
    aliases: ClassVar[list[str]] = ["gibiane", "dgibi"]
    filenames: ClassVar[list[str]] = ["*.dgibi", "*.procedur"]
    mimetypes: ClassVar[list[str]] = ["text/x-gibiane"]
    url = "https://en.wikipedia.org/wiki/Cast3M"
    version_added = ""
    tokens: ClassVar[dict[str, Any]] = {
        "root": [
            (r"^\$\$\$\$.*$", Comment.Special),
            (r"^\*.*$", Comment.Single),
            (r"\s+|,", Whitespace),
            (rf"'(?:{_BLOCKS}|{_PROCEDURES})'", Keyword),
            (r"'(?:''|[^'])*'?", String.Single),
            (rf"\b(?i:{_BLOCKS}|{_PROCEDURES})(?!{_LETTER})(?!\s*=)", Keyword),
            (r"\b(?i:VRAI|FAUX)\b", Keyword.Constant),
            (rf"(?<!{_LETTER})(?:\d+(?:\.\d*)?|\.\d+)[EeDd][+-]?\d+", Number.Float),
            (r"\d+\.\d*|(?<![\w')])\.\d+", Number.Float),
            (rf"\d+(?!{_LETTER})", Number.Integer),
            (rf"(&)({_LETTER}+)", bygroups(Operator, Name.Variable.Magic)),
            (rf"[A-Za-z_@!#?$]{_LETTER}*", Name),
            (r"\*\*|[<>](?:EG(?!\w))?|[-+*/=]", Operator),
            (r"[();.%]", Punctuation),
            (r".", Text),
        ]
    }

    def get_tokens_unprocessed(self, text: str, stack: Any = ("root",)) -> Iterator[tuple[int, _TokenType, str]]:
        """Yield the tokens; a word whose first four letters are those of an operator is a built-in name."""
        known = _operators()
        for index, kind, value in super().get_tokens_unprocessed(text, stack):
            if kind is Name and value[:4].upper() in known and value[0] not in "@!":
                yield index, Name.Builtin, value
            elif kind is Name and value[0] == "@":
                yield index, Name.Function, value
            else:
                yield index, kind, value
