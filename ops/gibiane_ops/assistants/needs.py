"""What the cases of a study need of the session that asks: the procedures and objects that they name."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

from gibiane.blocks import block_names
from gibiane.nodes import Access, Group, Instr, Literal, Name, Node
from gibiane.values import Procedure, Table, Texte

WORD = re.compile(r"[A-Za-z_@!][A-Za-z0-9_@]*")


def called(session: Any, values: Iterable[Any]) -> dict[str, Any]:
    """Return the objects of the session that values may name: procedures, and what those name in turn.

    A procedure needs the names that it reads before it has given them a value itself; a word alone between quotes
    (the index of a table, the name of a procedure to call) needs a procedure only.
    """
    visible = session.names()
    found: dict[str, Any] = {}
    seen: set[str] = set()
    waiting = list(words(values))
    while waiting:
        word, only_procedures = waiting.pop()
        if word in found or word not in visible or (only_procedures and word in seen):
            continue
        seen.add(word)
        value = visible[word]
        if session.operator(word) is not None or (only_procedures and not isinstance(value, Procedure)):
            continue
        if isinstance(value, Procedure) and _shipped(session, word, value):
            continue  # a worker finds it by its name, whether this session has read it already or not
        found[word] = value
        waiting.extend(words([value]))
    return found


def _shipped(session: Any, name: str, procedure: Procedure) -> bool:
    """Say whether a procedure was read from a file of its own name."""
    source = session.library.find(name)
    return source is not None and source.text == procedure.program[procedure.start - 1].source.text


def words(values: Iterable[Any], depth: int = 0) -> Iterator[tuple[str, bool]]:
    """Yield the words of values, each with whether only a procedure may be meant."""
    for value in values:
        if isinstance(value, str):
            yield from _text_words(value)
        elif isinstance(value, Texte):
            yield from ((match.upper()[:24], False) for match in WORD.findall(value.text))
        elif isinstance(value, Procedure):
            yield from free_words(value)
        elif isinstance(value, Table) and depth < 8:
            yield from words((item for _, item in value.entries.values()), depth + 1)


def _text_words(text: str) -> Iterator[tuple[str, bool]]:
    """Yield the words of a MOT: alone it can name a procedure, in a sentence (of a TEXTE to come) anything."""
    words = [match.upper()[:24] for match in WORD.findall(text)]
    alone = len(words) == 1 and WORD.fullmatch(text.strip()) is not None
    yield from ((word, alone) for word in words)


def free_words(procedure: Procedure) -> list[tuple[str, bool]]:
    """Return the words of a procedure that the caller may have to give, each with whether only a procedure is meant.

    Parameters and names that got a value above, in the same block or one around it, are its own.
    """
    scopes: list[set[str]] = [{parameter.name for parameter in procedure.parameters}]
    found: dict[tuple[str, bool], None] = {}
    branches: list[set[str]] = []
    for instr in procedure.program[procedure.start : procedure.end]:
        if instr.head in ("FINS", "FIN", "SINO") and len(scopes) > 1:
            ended = scopes.pop()
            if instr.head == "SINO":
                branches[-1] = ended
            elif instr.head == "FINS" and branches:
                scopes[-1].update(ended & branches.pop())  # given in both branches
        if instr.head == "SI":
            branches.append(set())
        if instr.head in ("SI", "SINO", "REPE"):
            scopes.append(set())
        if instr.head == "ARGU":
            scopes[-1].update(node.name for node in instr.items if isinstance(node, Name))
            continue
        skipped = set(block_names(instr)[-1:]) if instr.head in ("REPE", "FIN", "QUIT", "ITER") else set()
        for key in _instruction_words(instr):
            if key[0] not in skipped and not any(key[0] in scope for scope in scopes):
                found[key] = None
        scopes[-1].update(target.name for target in instr.targets if not target.path and not target.member)
    return list(found)


def _instruction_words(instr: Instr) -> Iterator[tuple[str, bool]]:
    yield from _node_words(instr.items)
    for target in instr.targets:
        if target.path or target.member:
            yield target.name, False
            yield from _node_words([node for symbol, node in target.path])


def _node_words(nodes: list[Node]) -> Iterator[tuple[str, bool]]:
    after_access = False
    for node in nodes:
        if isinstance(node, Group):
            yield from _node_words(node.items)
        elif isinstance(node, Name):
            yield node.name, False
        elif isinstance(node, Literal) and isinstance(node.value, str) and not after_access:
            yield from _text_words(node.value)
        after_access = isinstance(node, Access)
