"""What may come next at the prompt: operators, names, keywords, table keys, files; and what is still open."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from gibiane import registry
from gibiane.blocks import block_name, block_names
from gibiane.lexer import Token, tokens
from gibiane.nodes import Instr
from gibiane.source import SourceText
from gibiane.syntax import parse
from gibiane.values import Table, type_of

FILE_OPTIONS = frozenset({"ACQU", "SORT", "DONN", "SAUV", "REST", "FTRA", "LECT"})
_WORD = re.compile(r"[A-Za-z0-9_@&!#?$]*\Z")
_CLOSING = {"FINS": "SI", "FINP": "DEBP", "FINM": "DEBM"}


def incomplete(text: str) -> str | None:
    """Say what is still open in a text: a block (`REPE B1`), an instruction (""), or None when it is complete."""
    if not text.strip():
        return None
    program = parse(SourceText("<prompt>", text))
    opened: list[tuple[str, list[str]]] = []
    for instr in program:
        _follow(instr, opened)
    if opened:
        word, names = opened[-1]
        return f"{word} {names[0]}"[:24] if names else word
    bad = program[-1].bad if program else None
    return "" if bad is not None and bad.code == "G102" else None


def _follow(instr: Instr, opened: list[tuple[str, list[str]]]) -> None:
    """Follow the blocks that an instruction opens and closes."""
    head = instr.head
    if head in ("SI", "REPE", "DEBP", "DEBM"):
        opened.append((head, block_names(instr) if head != "SI" else []))
    elif head in _CLOSING and any(word == _CLOSING[head] for word, _ in opened):
        while opened.pop()[0] != _CLOSING[head]:
            pass
    elif head == "FIN" and (name := block_name(instr)) is not None:
        for depth in range(len(opened) - 1, -1, -1):
            if name in opened[depth][1]:
                del opened[depth:]
                return


def candidates(session: Any, text: str) -> tuple[str, list[tuple[str, str]]]:
    """Return the part of a text that would be replaced and what may replace it, each with a word of explanation."""
    held, quoted = _unfinished(text)
    partial = quoted if quoted is not None else _WORD.search(text).group()  # type: ignore[union-attr]
    if quoted is None and partial and held:
        held = held[:-1]
    found = dict(_possible(session, held, partial, quoted is not None))
    return partial, sorted(found.items())


def _unfinished(text: str) -> tuple[list[Token], str | None]:
    """Return the tokens of the instruction at the end of a text, and the text of a string that is still open."""
    source = SourceText("<prompt>", text)
    errors: dict[int, Any] = {}
    held: list[Token] = []
    for token in tokens(source, errors):
        if token.type == "SEMI":
            held = []
        else:
            held.append(token)
    if held and held[-1].type == "STRING" and held[-1].start_pos in errors:
        return held[:-1], str(held[-1].value)
    return held, None


def _possible(session: Any, held: list[Token], partial: str, quoted: bool) -> Iterator[tuple[str, str]]:
    if held and held[-1].type == "ACCESS":
        yield from _table_keys(session, held, partial, quoted)
        return
    before = str(held[-1].value).upper()[:4] if held else ""
    if quoted and before in FILE_OPTIONS and str(held[0].value).upper()[:4] in ("OPTI", "LIRE"):
        yield from _files(partial)
        return
    op = _operator(held)
    keywords = [(w, f"keyword of {op.name}") for f in op.all_forms() for k in f.keys for w in k.words] if op else []
    yield from _matching(keywords, partial, quoted)
    if quoted:
        yield from _matching([(name, "operator") for name in registry.names()], partial, quoted)
        return
    names = [(name, type_of(value)) for name, value in session.names().items() if not name.startswith("#")]
    yield from _matching(names, partial, quoted)
    if partial:
        words = [(name, _summary(name)) for name in registry.spellings() if not name.startswith(("+", "-", "*"))]
        yield from _matching(words, partial, quoted)
        yield from _matching([(name, "procedure") for name in session.library.names()], partial, quoted)


def _matching(words: Iterable[tuple[str, str]], partial: str, quoted: bool) -> Iterator[tuple[str, str]]:
    """Yield the words that begin with what is typed, in its case (capitals between apostrophes)."""
    small = not quoted and partial.islower()
    for word, meta in words:
        if word.upper().startswith(partial.upper()) and (not quoted or word.startswith(partial)):
            yield (word.lower() if small else word), meta


def _summary(name: str) -> str:
    op = registry.CATALOGUE.get(name[:4])
    return op.summary if op is not None else "operator"


def _operator(held: list[Token]) -> registry.Operator | None:
    """Return the last operator of the innermost open parenthesis."""
    groups: list[registry.Operator | None] = [None]
    joined = False
    for token in held:
        if token.type == "LPAR":
            groups.append(None)
        elif token.type == "RPAR" and len(groups) > 1:
            groups.pop()
        elif token.type == "EQUAL":
            groups[-1] = None
        elif token.type in ("NAME", "STRING") and not joined:
            word = str(token.value) if token.type == "STRING" else str(token.value).upper()
            found = registry.find(word)
            known = groups[-1]
            if found is not None and (known is None or not _is_keyword(known, word)):
                groups[-1] = found
        joined = token.type == "ACCESS"
    return groups[-1]


def _is_keyword(op: registry.Operator, word: str) -> bool:
    return any(key.match(word) for form in op.all_forms() for key in form.keys)


def _table_keys(session: Any, held: list[Token], partial: str, quoted: bool) -> Iterator[tuple[str, str]]:
    """Yield the words that are indices of the table named before the last separator (`T . 'A' . `)."""
    path: list[Any] = []
    at = len(held) - 2
    while at >= 0 and held[at].type in ("NAME", "STRING", "NUMBER"):
        path.append(held[at])
        if at == 0 or held[at - 1].type != "ACCESS":
            break
        at -= 2
    table = session.names().get(str(path[-1].value).upper()) if path else None
    for token in reversed(path[:-1]):
        index = str(token.value).upper() if token.type == "NAME" else token.value
        table = table.get(index) if isinstance(table, Table) and table.has(index) else None
    if not isinstance(table, Table):
        return
    for index, value in table.entries.values():
        if isinstance(index, str):
            plain = index.isidentifier() and index == index.upper()
            if quoted and index.startswith(partial):
                yield index, type_of(value)
            elif not quoted and index.upper().startswith(partial.upper()):
                yield (index if plain else f"'{index}'"), type_of(value)


def _files(partial: str) -> Iterator[tuple[str, str]]:
    folder, _, start = partial.rpartition("/")
    where = Path(folder or ("/" if partial.startswith("/") else "."))
    if not where.is_dir():
        return
    for path in sorted(where.iterdir()):
        if path.name.startswith(start) and (start.startswith(".") or not path.name.startswith(".")):
            name = f"{folder}/{path.name}" if "/" in partial else path.name
            yield (name + "/" if path.is_dir() else name), "folder" if path.is_dir() else "file"
