"""Every sentence that a message can hold is known in French, with the same fields."""

from __future__ import annotations

import ast
import string
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from gibiane.messages_fr import FRENCH

ROOT = Path(__file__).parents[3]
SOURCES = [ROOT / "interpreter" / "gibiane", ROOT / "ops" / "gibiane_ops"]

# functions that take a sentence, and which of their arguments it is
SENTENCE_AT = {
    "make": 1,
    "error": 1,
    "fail": 1,
    "warn": 1,
    "diagnostic": 1,
    "report": 1,
    "Incompatible": 1,
    "Text": 0,
    "BadFormat": 0,
    "Guarantee": 1,
}
SENTENCE_KEYWORDS = ("hint", "label", "template")
PLAIN_CALLS = {
    "Incompatible",
    "make",
    "error",
    "fail",
    "warn",
    "diagnostic",
    "report",
    "Text",
    "Label",
    "BadFormat",
    "Guarantee",
}


@cache
def trees() -> dict[str, ast.Module]:
    """Return the sources that can hold sentences, by their paths."""
    paths = [path for folder in SOURCES for path in sorted(folder.rglob("*.py")) if "kernels" not in path.parts]
    return {str(path.relative_to(ROOT)): ast.parse(path.read_text(encoding="utf-8")) for path in paths}


@cache
def sentences() -> dict[str, str]:
    """Return every template of the sources with the place where it stands."""
    found: dict[str, str] = {}
    for path, tree in trees().items():
        for template, line in _templates(tree):
            found.setdefault(template, f"{path}:{line}")
    return found


def _templates(tree: ast.Module) -> Iterator[tuple[str, int]]:
    scopes = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)]
    everywhere = _assigned(tree)
    for scope in [*scopes, tree]:
        assigned = {**everywhere, **_assigned(scope)}
        for node in _own_nodes(scope):
            if isinstance(node, ast.Call):
                for argument in _sentence_arguments(node):
                    for text in _constants(argument, assigned):
                        yield text, node.lineno


def _own_nodes(scope: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a function or module without those of the functions inside it."""
    waiting = list(ast.iter_child_nodes(scope))
    while waiting:
        node = waiting.pop()
        yield node
        if not isinstance(node, ast.FunctionDef):
            waiting.extend(ast.iter_child_nodes(node))


def _sentence_arguments(call: ast.Call) -> Iterator[ast.expr]:
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name not in PLAIN_CALLS:
        return
    at = SENTENCE_AT.get(name)
    if at is not None and len(call.args) > at:
        yield call.args[at]
    if name == "report" and len(call.args) > 3:
        yield call.args[3]
    yield from (k.value for k in call.keywords if k.arg in SENTENCE_KEYWORDS)


def _assigned(scope: ast.AST) -> dict[str, list[ast.expr]]:
    """Return what each name of a function may hold."""
    values: dict[str, list[ast.expr]] = {}
    for node in _own_nodes(scope):
        if isinstance(node, ast.Assign):
            for target in node.targets:
                pairs = (
                    zip(target.elts, node.value.elts, strict=False)
                    if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
                    else [(target, node.value)]
                )
                for one, value in pairs:
                    if isinstance(one, ast.Name):
                        values.setdefault(one.id, []).append(value)
        elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            values.setdefault(node.target.id, []).append(node.value)
    return values


def _constants(node: ast.expr, assigned: dict[str, list[ast.expr]]) -> Iterator[str]:
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value:
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from _constants(node.body, assigned)
        yield from _constants(node.orelse, assigned)
    elif isinstance(node, ast.BoolOp):
        for value in node.values:
            yield from _constants(value, assigned)
    elif isinstance(node, ast.Name):
        for value in assigned.get(node.id, []):
            if not (isinstance(value, ast.Name) and value.id == node.id):
                yield from _constants(value, assigned)


def fields(template: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(template) if name}


def test_the_scan_finds_sentences() -> None:
    found = sentences()
    assert len(found) > 150
    assert "division by zero" in found
    assert "no result is left for {name}" in found


def test_reasons_of_estimates_and_lines_of_studies_are_sentences() -> None:
    assert "adhesion" in sentences()
    assert "not guaranteed ({doubt})" in sentences()
    assert "explicit residuals follow the error up to a factor that depends on the mesh" in sentences()
    assert "{old} of {total} cases were done before" in sentences()


def test_no_sentence_is_filled_before_it_is_translated() -> None:
    calls = ((path, n) for path, tree in trees().items() for n in ast.walk(tree) if isinstance(n, ast.Call))
    filled = [
        f"{path}:{n.lineno}" for path, n in calls if any(isinstance(a, ast.JoinedStr) for a in _sentence_arguments(n))
    ]
    assert filled == []


def test_every_sentence_has_a_french_one() -> None:
    missing = [f"{place}: {text!r}" for text, place in sentences().items() if text not in FRENCH]
    assert missing == []


def test_no_french_sentence_without_use() -> None:
    unused = [text for text in FRENCH if text not in sentences()]
    assert unused == []


def test_the_fields_are_those_of_the_sentence() -> None:
    # the description of an operand is written in English only: French sentences may leave it out
    wrong = [
        english
        for english, french in FRENCH.items()
        if not fields(french) <= fields(english) or not fields(english) - fields(french) <= {"what"}
    ]
    assert wrong == []
