"""The stored parser table is what lark builds from the grammar."""

import json

import lark

from gibiane import parser


def test_table_is_fresh() -> None:
    stored = json.loads(parser.TABLE.read_text(encoding="utf-8"))
    assert stored["grammar"] == parser.GRAMMAR.read_text(encoding="utf-8"), "run python -m gibiane.parser"
    assert set(stored) == {"lark", "grammar", "data", "memo"}


def test_table_and_grammar_parse_alike() -> None:
    if json.loads(parser.TABLE.read_text(encoding="utf-8"))["lark"] != lark.__version__:
        assert parser.parser().source_path != "<deserialized>"  # another lark: built from the grammar
        return
    assert parser.parser().source_path == "<deserialized>"
    kinds = ["NAME", "EQUAL", "LPAR", "NUMBER", "SYMBOL", "STRING", "RPAR", "ACCESS", "NAME"]
    tokens = [parser.Token(kind, "X" if kind == "NAME" else 1, i, i + 1) for i, kind in enumerate(kinds)]

    def shown(value: object) -> object:
        if isinstance(value, list | tuple):
            return [shown(v) for v in value]
        return [
            type(value).__name__,
            *(shown(getattr(value, s)) for s in getattr(value, "__slots__", ()) if s != "code"),
        ]

    assert shown(parser.parser().parse(tokens)) == shown(parser.built().parse(tokens))
