"""Objects: `O % M args` calls a method of an object, `%X` inside a method is an attribute of the object."""

from __future__ import annotations

from typing import Any

from gibiane.binding import ABSENT, Operands
from gibiane.diagnostics import GibianeError, make, nearest
from gibiane.nodes import Name, Node, Target
from gibiane.runner import Runner
from gibiane.source import Span
from gibiane.values import Objet, Procedure, Table

BIND, INHERIT = "METHODE", "HERITE"


def resolve(ev: Runner, q: Operands, i: int) -> int:
    """Resolve the `%` at position `i` of a queue; return the position from where to go on.

    After an object: its method, ready to be called. Otherwise: the attribute of the object whose method runs, or
    for `EXIS % X` whether it exists.
    """
    if i + 1 == len(q.values):
        raise GibianeError(make(1043, "a name is missing after %", span=q.span(q.nodes[i])))
    before = q.values[i - 1] if i else None
    if isinstance(before, Objet):
        return _method(ev, q, i, before)
    this = _this(ev, q.span(q.nodes[i]))
    if isinstance(before, str) and before[:4] == "EXIS":
        q.values[i - 1 : i + 2] = [this.attributes.has(_index(q, i + 1))]
        del q.nodes[i : i + 2]
        return i
    span = q.span(q.nodes[i + 1])
    try:
        value = this.attributes.get(_index(q, i + 1))
    except GibianeError:
        known = [k for k, _ in this.attributes.entries.values() if isinstance(k, str)]
        name = _index(q, i + 1)
        close = nearest(name, known, 3) if isinstance(name, str) else None
        raise GibianeError(
            make(
                535,
                "this object has no attribute {name}",
                name=name,
                span=span,
                close=close,
                hint="did you mean {close}?" if close else "%{name} = ... gives it one",
            )
        ) from None
    q.values[i : i + 2] = [value]
    del q.nodes[i]
    return i + 1 if not isinstance(value, Table) else i


def assign(ev: Runner, target: Target, value: Any, span: Span) -> None:
    """Give an attribute of the current object a value."""
    _this(ev, span).attributes.set(target.name, value)


def attribute(ev: Runner, name: str, span: Span) -> Any:
    """Return an attribute of the current object, or ABSENT."""
    attributes = _this(ev, span).attributes
    return attributes.get(name) if attributes.has(name) else ABSENT


def _this(ev: Runner, span: Span) -> Objet:
    this = ev.frame.this
    if not isinstance(this, Objet):
        raise GibianeError(
            make(
                153,
                "attributes are seen inside a method only",
                span=span,
                hint="write a method that gives its value: DEBM ... FINM %X ;",
            )
        )
    return this


def _index(q: Operands, i: int) -> Any:
    """Return the name of an attribute as it is written, or the value of a number, string or parenthesis."""
    node = q.nodes[i]
    return node.name if isinstance(node, Name) else q.values[i]


def _method(ev: Runner, q: Operands, i: int, this: Objet) -> int:
    node = q.nodes[i + 1]
    name = node.name if isinstance(node, Name) else str(q.values[i + 1]).upper()
    if name[:4] == BIND[:4]:
        _bind(q, i, this)
        return i - 1
    if name[:4] == INHERIT[:4]:
        _inherit(q, i, this)
        return i - 1
    found = this.methods.get(name, q.values[i + 1])
    if not (isinstance(found, Procedure) and found.is_method):
        close = nearest(name, list(this.methods))
        raise GibianeError(
            make(
                9,
                "this object of class {kind} has no method {name}",
                kind=this.class_name,
                name=name,
                span=q.span(node),
                close=close,
                hint="did you mean {close}?" if close else ("O%METHODE {name} M gives it one: M is defined with DEBM"),
            )
        )
    q.values[i - 1 : i + 2] = [found.of(this)]
    del q.nodes[i - 1 : i + 1]
    return i


def _bind(q: Operands, i: int, this: Objet) -> None:
    """Do `O % METHODE NAME M`: the object gets the method M under a name."""
    node: Node | None = q.nodes[i + 2] if i + 2 < len(q.nodes) else None
    method = q.values[i + 3] if i + 3 < len(q.values) else None
    if not isinstance(node, Name) or not (isinstance(method, Procedure) and method.is_method):
        raise GibianeError(
            make(
                37,
                "METHODE wants a name and a method",
                span=q.span(q.nodes[i + 1]),
                hint="O%METHODE NAME M ; where M is defined with DEBM",
            )
        )
    this.methods[node.name] = method
    del q.values[i - 1 : i + 4], q.nodes[i - 1 : i + 4]


def _inherit(q: Operands, i: int, this: Objet) -> None:
    """Do `O % HERITE OTHER`: the object gets the methods of another."""
    other = q.values[i + 2] if i + 2 < len(q.values) else None
    if not isinstance(other, Objet):
        raise GibianeError(
            make(
                37,
                "HERITE wants the object whose methods are taken over",
                span=q.span(q.nodes[i + 1]),
                hint="O%HERITE OTHER ;",
            )
        )
    for name, method in other.methods.items():
        this.methods.setdefault(name, method)
    del q.values[i - 1 : i + 3], q.nodes[i - 1 : i + 3]
