"""Closures for the instructions that loops spend their time in: arithmetic and comparison of plain numbers.

An instruction or group whose items are numbers, names and symbols in infix order (`S = S + (&B * 2.)`, `(A < B)`) is
turned once into closures. They check every value they meet: if one is not a number, or anything unusual happens (a
division by zero, an overflow, an unknown name), :class:`Fallback` is raised before anything has changed, and the queue
machine, which defines the language, runs the instruction instead.
"""

from __future__ import annotations

import operator as py
from collections.abc import Callable, Sequence
from typing import Any

from gibiane.binding import ABSENT as _ABSENT
from gibiane.binding import Operands
from gibiane.frames import Frame
from gibiane.nodes import Access, Group, Instr, Literal, Name, Node
from gibiane.values import Procedure, Table

Fetch = Callable[[Frame], Any]
MAX_FALLBACKS = 8
_NUMBERS = (int, float)


class Fallback(Exception):
    """An evaluation that is not for the closures.

    Raised as a class: one instance raised again and again would gather the frames of all, and every session with them.
    """


def _beyond() -> Any:
    """Leave a result that is not finite to the queue machine, which refuses it or tells where it comes from."""
    raise Fallback


# A finite number less itself is 0; infinity less itself is no number.
def _sum(a: Any, b: Any) -> Any:
    return value if (value := a + b) - value == 0 else _beyond()


def _difference(a: Any, b: Any) -> Any:
    return value if (value := a - b) - value == 0 else _beyond()


def _product(a: Any, b: Any) -> Any:
    return value if (value := a * b) - value == 0 else _beyond()


def _quotient(a: Any, b: Any) -> Any:
    if b == 0:
        raise Fallback
    if type(a) is int and type(b) is int:
        q = abs(a) // abs(b)
        return q if (a >= 0) == (b >= 0) else -q
    return value if (value := a / b) - value == 0 else _beyond()


def _power(a: Any, b: Any) -> Any:
    if a <= 0 or (type(b) is int and type(a) is int):
        raise Fallback
    return a**b


NUMERIC: dict[str, Callable[[Any, Any], Any]] = {
    "+": _sum, "-": _difference, "*": _product, "/": _quotient, "**": _power,
}  # fmt: skip
COMPARE: dict[str, Callable[[Any, Any], bool]] = {"<": py.lt, ">": py.gt, "<EG": py.le, ">EG": py.ge}


def _equal(a: Any, b: Any) -> bool:
    return bool(a == int(b)) if type(a) is int else bool(a == b)


def instruction(instr: Instr) -> Callable[[Frame], bool] | None:
    """Return a closure for `NAME = expression`, or None; the closure returns False when the queue must do the work."""
    if len(instr.targets) != 1 or instr.bad is not None or instr.head is not None:
        return None
    target = instr.targets[0]
    if target.path or target.member or target.type_name is not None:
        return None
    fetch = expression(instr.items)
    name = target.name
    if fetch is None:
        return _call(instr, name)
    failures = 0

    def run(frame: Frame) -> bool:
        nonlocal failures
        try:
            value = fetch(frame)
        except (Fallback, ArithmeticError):
            failures += 1
            if failures > MAX_FALLBACKS:
                instr.code = False
            return False
        frame.names[name] = value
        frame.origins[name] = instr
        return True

    return run


def _call(instr: Instr, target: str) -> Callable[[Frame], bool] | None:
    """Return a closure for `NAME = PROCEDURE number number ...`, or None."""
    if not instr.items or not isinstance(first := instr.items[0], Name):
        return None
    rest = instr.items[1:]
    fetches = [_operand([item]) for item in rest]
    if any(f is None for f in fetches):
        return None
    name = first.name

    def run(frame: Frame) -> bool:
        procedure = frame.lookup(name)
        if type(procedure) is not Procedure:
            instr.code = False
            return False
        try:
            values = [fetch(frame) for fetch in fetches]  # type: ignore[misc]
        except (Fallback, ArithmeticError):
            return False
        ev = frame.evaluator
        ev.current = instr
        results = ev.call_with_numbers(procedure, values, instr, first)
        if results is None:
            return False
        if len(results) == 1:
            frame.names[target] = results[0]
            frame.origins[target] = instr
        else:
            ev.finish(instr, Operands(ev.session, instr.source, results, [first] * len(results)))
        return True

    return run


def result(instr: Instr) -> Fetch | None:
    """Return a closure for the operand of FINP when it is one number, or None; it gives None for anything else."""
    operands = instr.items[1:]
    if instr.bad is not None or len(operands) != 1 or not isinstance(instr.items[0], Name):
        return None
    fetch = _operand(operands)
    if fetch is None:
        return None

    def value(frame: Frame) -> Any:
        try:
            return fetch(frame)
        except (Fallback, ArithmeticError):
            return None

    return value


def reduce_front(symbol: str, values: list[Any], nodes: list[Node], node: Node) -> bool:
    """Apply a symbol to two numbers at the front of a queue; say whether it was done."""
    if len(values) < 2:
        return False
    a, b = values[0], values[1]
    if type(a) not in _NUMBERS or type(b) not in _NUMBERS:
        return False
    operate = NUMERIC.get(symbol) or COMPARE.get(symbol)
    if operate is None:
        return False
    try:
        value = operate(a, b)
    except (Fallback, ArithmeticError):
        return False
    values[0:2] = [value]
    nodes[0:2] = [node]
    return True


def condition(items: Sequence[Node]) -> Fetch | None:
    """Return a closure for the condition of SI, one parenthesis holding a comparison of numbers, or None."""
    if len(items) != 1 or not isinstance(items[0], Group):
        return None
    return _comparison(items[0].items)


def expression(items: Sequence[Node]) -> Fetch | None:
    """Return a closure that gives the number of `a op b op c ...`, or None when the items are of another kind."""
    parts = _split(items)
    if parts is None:
        return None
    operands, symbols = parts
    if any(s not in NUMERIC for s in symbols):
        return None
    fetches = [_operand(each) for each in operands]
    if any(f is None for f in fetches):
        return None
    fetch = fetches[0]
    for symbol, right, nodes in zip(symbols, fetches[1:], operands[1:], strict=True):
        fetch = _binary(symbol, fetch, right, nodes)  # type: ignore[arg-type]
    return fetch


def _comparison(items: Sequence[Node]) -> Fetch | None:
    parts = _split(items)
    if parts is None or len(parts[1]) != 1:
        return None
    (left, right), (symbol,) = parts
    compare = COMPARE.get(symbol)
    a, b = _operand(left), _operand(right)
    if compare is None or a is None or b is None:
        return _equality(left, right, symbol, a, b)

    return lambda frame: compare(a(frame), b(frame))


def _equality(
    left: Sequence[Node], right: Sequence[Node], symbol: str, a: Fetch | None, b: Fetch | None
) -> Fetch | None:
    if symbol != "EGA" or a is None or b is None:
        return None

    def fetch(frame: Frame) -> bool:
        if frame.lookup("EGA") is not _ABSENT:
            raise Fallback
        return _equal(a(frame), b(frame))

    return fetch


def _split(items: Sequence[Node]) -> tuple[list[list[Node]], list[str]] | None:
    """Split items into operands (a value, with the accesses behind it) and the symbols between them."""
    operands: list[list[Node]] = []
    symbols: list[str] = []
    wants_operand = True
    for item in items:
        if isinstance(item, Access):
            if item.symbol != "." or wants_operand:
                return None
            operands[-1].append(item)
            wants_operand = True
            continue
        if wants_operand:
            if (
                isinstance(item, Literal)
                and isinstance(item.value, str)
                and not (operands and operands[-1] and isinstance(operands[-1][-1], Access))
            ):
                return None
            if operands and isinstance(operands[-1][-1], Access):
                operands[-1].append(item)
            else:
                operands.append([item])
            wants_operand = False
            continue
        word = (
            item.value if isinstance(item, Literal) and not item.quoted else item.word if isinstance(item, Name) else ""
        )
        if not isinstance(word, str) or (word not in NUMERIC and word not in COMPARE and word != "EGA"):
            return None
        symbols.append(word)
        wants_operand = True
    return None if wants_operand or len(operands) != len(symbols) + 1 else (operands, symbols)


def _operand(nodes: Sequence[Node]) -> Fetch | None:
    first = nodes[0]
    if len(nodes) > 1:
        return _element(nodes)
    if isinstance(first, Literal):
        value = first.value
        return None if isinstance(value, str) else lambda frame: value
    if isinstance(first, Group):
        return expression(first.items)
    return _variable(first.name) if isinstance(first, Name) else None


def _variable(name: str) -> Fetch:
    def fetch(frame: Frame) -> Any:
        value = frame.names.get(name)
        kind = type(value)
        if kind is float or kind is int:
            return value
        value = frame.lookup(name)
        kind = type(value)
        if kind is float or kind is int:
            return value
        raise Fallback

    return fetch


def _element(nodes: Sequence[Node]) -> Fetch | None:
    """Return a closure for `T . index . index` that gives a number."""
    base = nodes[0]
    if not isinstance(base, Name):
        return None
    indices = [_index(node) for node in nodes[2::2]]
    if any(i is None for i in indices):
        return None
    name = base.name

    def fetch(frame: Frame) -> Any:
        value = frame.lookup(name)
        for index in indices:
            if type(value) is not Table:
                raise Fallback
            key = index(frame)  # type: ignore[misc]
            kind = type(key)
            if kind is not int and kind is not str:
                raise Fallback
            found = value.entries.get(key if kind is int else key.rstrip())
            if found is None:
                raise Fallback
            value = found[1]
        kind = type(value)
        if kind is float or kind is int:
            return value
        raise Fallback

    return fetch


def _index(node: Node) -> Fetch | None:
    if isinstance(node, Literal):
        value = node.value
        return lambda frame: value
    if isinstance(node, Group):
        return expression(node.items)
    if not isinstance(node, Name):
        return None
    name, word = node.name, node.word

    def fetch(frame: Frame) -> Any:
        value = frame.lookup(name)
        return word if value is _ABSENT else value

    return fetch


def _binary(symbol: str, left: Fetch, right: Fetch, right_nodes: Sequence[Node]) -> Fetch:
    """Return the closure of one operation; the common ones are written out, which saves a call."""
    constant = right_nodes[0].value if len(right_nodes) == 1 and isinstance(right_nodes[0], Literal) else None
    if symbol == "+":
        if constant is None:
            return lambda frame: value if (value := left(frame) + right(frame)) - value == 0 else _beyond()
        return lambda frame: value if (value := left(frame) + constant) - value == 0 else _beyond()
    if symbol == "-":
        if constant is None:
            return lambda frame: value if (value := left(frame) - right(frame)) - value == 0 else _beyond()
        return lambda frame: value if (value := left(frame) - constant) - value == 0 else _beyond()
    if symbol == "*":
        if constant is None:
            return lambda frame: value if (value := left(frame) * right(frame)) - value == 0 else _beyond()
        return lambda frame: value if (value := left(frame) * constant) - value == 0 else _beyond()
    operate = NUMERIC[symbol]
    return lambda frame: operate(left(frame), right(frame))
