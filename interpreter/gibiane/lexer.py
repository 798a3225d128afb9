"""The lexer: characters to tokens, by the rules that depend on what stands just before.

Separators are blanks, tabs, line ends and commas. A line with `*` in column 1 is a comment wherever it stands
between tokens (and inside a string over several lines); a line that starts with `$$$$` is a library header.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from gibiane.diagnostics import Diagnostic, make
from gibiane.source import SourceText, Span


class Token:
    """A token for lark: `type` is the grammar's terminal, `value` its content, with offsets."""

    __slots__ = ("end_pos", "start_pos", "type", "value")

    # lark borrows these for its end token; places are kept as offsets only
    line = column = end_line = end_column = None

    def __init__(self, kind: str, value: object, start: int, end: int) -> None:
        self.type = kind
        self.value = value
        self.start_pos = start
        self.end_pos = end


MOST_DIGITS = 4000  # of a number literal

_HEADER = r"(?:\*|\$\$\$\$)[^\n]*+"
_BLANK = re.compile(rf"(?:[ \t\f,]|\n(?:{_HEADER})?+)++")
_FIRST_LINE = re.compile(_HEADER)
_STRING = re.compile(r"'((?:[^'\n]|''|\n(?:\*[^\n]*+)?+)*+)'")
_NUMBER = re.compile(r"(?:\d++(\.\d*+)?|(\.\d++))([EeDd][+-]?\d++)?")
_WORD = re.compile(r"[A-Za-z_@&!#?$][A-Za-z0-9_@&!#?$]*+")
_DIGIT_WORD = re.compile(r"\d+[A-Za-z_@&!#?$][A-Za-z0-9_@&!#?$]*+")
_COMPARE = re.compile(r"[<>](?:EG(?![A-Za-z0-9_@&!#?$]))?", re.IGNORECASE)
# `T . 3. = x` has the index 3., for a separator needs something after it
_INDEX_REAL = re.compile(r"\d++(?:\.\d++(?:[EeDd][+-]?\d++)?|\.(?=\s*+[=;)]))?")
_INDEX_DIGITS = re.compile(r"\d++")
_LINE_BREAK = re.compile(r"\n(?:\*[^\n]*+)?+")

_WORD_START = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_@&!#?$")
_DIGITS = frozenset("0123456789")
_NO_SIGN_AFTER = _WORD_START | _DIGITS | frozenset("').")
_NO_DOT_NUMBER_AFTER = _WORD_START | _DIGITS | frozenset("')")
_SINGLE = {"(": "LPAR", ")": "RPAR", "=": "EQUAL", ";": "SEMI"}


def number_value(text: str) -> int | float:
    """Return the value of a number literal: ENTIER without point and exponent, else FLOTTANT."""
    if text.lstrip("+-").isdigit():
        return int(text)
    return float(text.replace("D", "E").replace("d", "e"))


def _string_value(raw: str) -> str:
    value = raw.replace("''", "'") if "''" in raw else raw
    if "\n" not in value:
        return value
    # a comment line inside a string vanishes with its line break; any other break becomes one blank
    return _LINE_BREAK.sub(lambda m: " " if len(m.group()) == 1 else "", value)


def tokens(source: SourceText, errors: dict[int, Diagnostic], start: int = 0) -> Iterator[Token]:
    """Yield the tokens of a source text; a character that starts none is reported in `errors` by its offset.

    The kinds are the terminals of the grammar and `SEMI`. Reading goes on after a bad character, so that
    one mistake does not hide the rest of the file.
    """
    text = source.text
    size = len(text)
    at = start
    if at == 0 and (first := _FIRST_LINE.match(text)):
        at = first.end()
    after_dot = False
    while at < size:
        char = text[at]
        before = text[at - 1] if at else "\n"
        if char in " \n,\t\f":
            at = _BLANK.match(text, at).end()  # type: ignore[union-attr]
            continue
        if char in _WORD_START:
            end = _WORD.match(text, at).end()  # type: ignore[union-attr]
            yield Token("NAME", text[at:end], at, end)
        elif after_dot and char in _DIGITS:
            pattern = _INDEX_DIGITS if before == "." else _INDEX_REAL
            end = pattern.match(text, at).end()  # type: ignore[union-attr]
            yield _number(source, errors, at, end)
        elif char in _DIGITS:
            found = _NUMBER.match(text, at)
            end = found.end()  # type: ignore[union-attr]
            if end < size and text[end] in _WORD_START and (word := _DIGIT_WORD.match(text, at)):
                end = word.end()
                yield Token("NAME", text[at:end], at, end)
            else:
                yield _number(source, errors, at, end)
        elif char == "'":
            found = _STRING.match(text, at)
            if found is None:
                end = size
                errors[at] = make(
                    "G102",
                    "the string that starts here is never closed",
                    span=Span(source, at, at + 1),
                    hint="close it with an apostrophe; inside a string an apostrophe is written twice",
                )
                yield Token("STRING", text[at + 1 :], at, end)
            else:
                end = found.end()
                yield Token("STRING", _string_value(found.group(1)), at, end)
        elif char in _SINGLE:
            end = at + 1
            yield Token(_SINGLE[char], char, at, end)
        elif char == "." and not (before not in _NO_DOT_NUMBER_AFTER and at + 1 < size and text[at + 1] in _DIGITS):
            yield Token("ACCESS", ".", at, at + 1)
            at += 1
            after_dot = True
            continue
        elif char in "+-." and before not in _NO_SIGN_AFTER and (found := _NUMBER.match(text, at + (char != "."))):
            end = found.end()
            yield _number(source, errors, at, end)
        elif char == ".":
            end = _NUMBER.match(text, at).end()  # type: ignore[union-attr]
            yield _number(source, errors, at, end)
        elif char == "*":
            end = at + (2 if text.startswith("**", at) else 1)
            yield Token("SYMBOL", text[at:end], at, end)
        elif char in "+-/":
            end = at + 1
            yield Token("SYMBOL", char, at, end)
        elif char in "<>":
            end = _COMPARE.match(text, at).end()  # type: ignore[union-attr]
            yield Token("SYMBOL", text[at:end].upper(), at, end)
        elif char == "%":
            end = at + 1
            yield Token("ACCESS", "%", at, end)
        else:
            end = at + 1
            errors[at] = make(
                "G101",
                "the character {char} cannot stand here",
                char=repr(char),
                span=Span(source, at, end),
                hint=_hint_for(char),
            )
        after_dot = False
        at = end


def _number(source: SourceText, errors: dict[int, Diagnostic], start: int, end: int) -> Token:
    if end - start > MOST_DIGITS:
        errors[start] = make(
            "G101",
            "a number of {length} characters",
            length=end - start,
            span=Span(source, start, start + 1),
            hint="at most {most} are read",
            most=MOST_DIGITS,
        )
        return Token("NUMBER", 0, start, end)
    text = source.text[start:end]
    value = number_value(text)
    if value in (math.inf, -math.inf):
        errors[start] = make(
            26, "the number {number} is too large for a FLOTTANT", number=text, span=Span(source, start, end)
        )
        value = 0.0
    return Token("NUMBER", value, start, end)


def _hint_for(char: str) -> str:
    if char == '"':
        return "strings are written between apostrophes: 'text'"
    if char in "[]{}":
        return "lists are made by an operator (PROG, LECT, MOTS), groups with parentheses"
    if char == ":":
        return "nothing in the language uses it outside a string"
    if char.isalpha():
        return "names are written without accents"
    return "put it inside a string between apostrophes, or remove it"
