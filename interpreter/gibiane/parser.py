"""The LALR parser of one instruction: built by lark from grammar.lark, or read from the table made beforehand.

Building takes as long as all the rest of the start; `grammar.json` holds what lark would build. It is used when it
was made from this grammar by this version of lark, else the parser is built from the grammar.
`python -m gibiane.parser` writes it anew; a test says when it is stale.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import lark
from lark import Lark, Transformer
from lark.lexer import Lexer

from gibiane.lexer import Token
from gibiane.nodes import Access, Group, Literal, Name, Node

GRAMMAR = Path(__file__).with_name("grammar.lark")
TABLE = Path(__file__).with_name("grammar.json")


class _Ready(Lexer):
    """A lexer for tokens that are already made."""

    def __init__(self, _conf: Any) -> None:
        pass

    def lex(self, data: Iterable[Token]) -> Iterator[Token]:  # type: ignore[override]
        return iter(data)


def leaf(token: Token) -> Node:
    """Return the node of a word, literal, symbol or separator."""
    if token.type == "NAME":
        return Name(str(token.value), token.start_pos, token.end_pos)
    if token.type == "ACCESS":
        return Access(str(token.value), token.start_pos, token.end_pos)
    return Literal(token.value, token.start_pos, token.end_pos, quoted=token.type == "STRING")


class _Build(Transformer[Token, Any]):
    """Grammar rules to nodes, applied while parsing."""

    def sequence(self, items: list[Any]) -> list[Node]:
        return [leaf(item) if type(item) is Token else item for item in items]

    def group(self, parts: list[Any]) -> Node:
        return Group(parts[1], parts[0].start_pos, parts[2].end_pos)

    def directive(self, parts: list[Any]) -> tuple[list[Node] | None, list[Node]]:
        return None, parts[0]

    def assignment(self, parts: list[Any]) -> tuple[list[Node] | None, list[Node]]:
        return parts[0], parts[2]


@cache
def parser() -> Lark:
    """Return the parser of instructions; it takes a list of tokens and gives (left side or None, items)."""
    table = json.loads(TABLE.read_text(encoding="utf-8")) if TABLE.is_file() else {}
    if table.get("lark") == lark.__version__ and table.get("grammar") == GRAMMAR.read_text(encoding="utf-8"):
        data = _with_numbers(table["data"])
        data["options"]["lexer"] = data["parser"]["lexer_conf"]["lexer_type"] = _Ready
        loaded: Lark = Lark._load_from_dict(  # type: ignore[no-untyped-call]
            data, _with_numbers(table["memo"]), transformer=_Build()
        )
        return loaded
    return built()


def built() -> Lark:
    """Build the parser from the grammar."""
    return Lark(GRAMMAR.read_text(encoding="utf-8"), parser="lalr", lexer=_Ready, transformer=_Build())


def table() -> dict[str, Any]:
    """Return what `grammar.json` has to hold."""
    from lark.grammar import Rule
    from lark.lexer import TerminalDef

    data, memo = built().memo_serialize([TerminalDef, Rule])
    kept = {k: v for k, v in data["options"].items() if k not in ("lexer", "transformer")}
    data = {**data, "options": kept}
    data["parser"]["lexer_conf"]["lexer_type"] = None
    return {"lark": lark.__version__, "grammar": GRAMMAR.read_text(encoding="utf-8"), "data": data, "memo": memo}


def _with_numbers(value: Any) -> Any:
    """Turn the keys that JSON made strings back into the numbers they were."""
    if isinstance(value, dict):
        return {int(k) if k.isdigit() else k: _with_numbers(v) for k, v in value.items()}
    return [_with_numbers(v) for v in value] if isinstance(value, list) else value


if __name__ == "__main__":
    TABLE.write_text(json.dumps(table(), indent=None, separators=(",", ":"), sort_keys=True) + "\n", encoding="utf-8")
