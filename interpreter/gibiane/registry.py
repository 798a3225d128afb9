"""One declaration per operator: dispatch, usage lines, INFO, completion and the registry test read it.

    RESO = operator("RESO", topic="resolution", summary="...", notice=\"\"\"...\"\"\", example="U1 = RESO K1 F1 ;")

    @RESO.form(Arg("k", RIGIDITE, "matrix"), Key("NOID", "skip the check"), gives=[CHPOINT])
    def _reso(ctx, k, noid): ...

The function's parameters are `ctx` and the names declared, in the same order (a keyword's parameter is its word in
lower case unless `name` says otherwise); a difference is refused at import.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from gibiane.binding import Mismatch, Operands, bind, explain
from gibiane.diagnostics import Diagnostic, GibianeError, Label, Text, make
from gibiane.forms import Arg, Form, Function, Key
from gibiane.nodes import Node
from gibiane.values import ANY

BEYOND = 1 << 63
"""First ENTIER that has no place in 64 bits."""


class Operator:
    """An operator: its description and its forms, some of them loaded when first needed."""

    def __init__(
        self,
        name: str,
        *,
        topic: str,
        summary: str,
        notice: str,
        example: str,
        see: Sequence[str],
        source: str,
        whole: bool,
        terminal: bool,
        symbolic: bool,
    ) -> None:
        self.name = name
        self.topic = topic
        self.summary = summary
        self.notice = inspect.cleandoc(notice)
        self.example = inspect.cleandoc(example)
        self.see = list(see)
        self.source = source
        self.whole = whole
        self.terminal = terminal
        self.symbolic = symbolic
        self.forms: list[Form] = []
        self.pending: list[str] = []
        self.modules: Sequence[str] = ()
        self.fast: Callable[[Any, Any], Any] | None = None

    def form(self, *parts: Arg | Key, gives: Sequence[str] = (), last: bool = False) -> Callable[[Function], Function]:
        """Declare a form; the decorated function gets the context and the named operands."""

        def declare(function: Function) -> Function:
            code = function.__code__  # inspect.signature takes ten times as long, at every start
            names = list(code.co_varnames[: code.co_argcount])
            expected = ["ctx", *(p.name for p in parts)]
            if names != expected:
                raise TypeError(f"{self.name}: parameters {names} differ from the declaration {expected}")
            self._add(Form(parts, gives, function, stream=False, syntax=None, last=last))
            return function

        return declare

    def stream(
        self, *parts: Arg | Key, syntax: str, gives: Sequence[str] = (), last: bool = False
    ) -> Callable[[Function], Function]:
        """Declare a form that reads the queue itself: the function gets the context and the operands.

        `parts` still lists every keyword, for INFO and completion.
        """

        def declare(function: Function) -> Function:
            self._add(Form(parts, gives, function, stream=True, syntax=syntax, last=last))
            return function

        return declare

    def _add(self, form: Form) -> None:
        if not form.stream and any(_same_operands(form, other) for other in self.forms if not other.stream):
            raise TypeError(f"{self.name}: a form with these operands exists already")
        self.forms.append(form)
        # the order of the modules decides, whichever of them another operator has made import first
        self.forms.sort(key=lambda f: (f.last, self._rank(f)))

    def _rank(self, form: Form) -> int:
        module = form.function.__module__
        return list(self.modules).index(module) if module in self.modules else -1

    def load_more(self) -> bool:
        """Import the next module that adds forms; say whether there was one."""
        if not self.pending:
            return False
        import_module(self.pending.pop(0))
        return True

    def all_forms(self) -> list[Form]:
        """Return every form, loading what is not loaded yet."""
        while self.load_more():
            pass
        return self.forms

    def run(self, session: Any, q: Operands, node: Node) -> None:
        """Read operands from the queue by the first form that fits, run it, push its results in front."""
        if session.interactive and "?" in q.values:
            self.answer(session, q)
            return
        given = q.values[:]
        try:
            self._apply(session, q, node)
        except OverflowError:
            # Only an ENTIER beyond 64 bits has no place among FLOTTANTs and arrays; anything else is a fault of ours.
            if not any(type(v) is int and not -BEYOND <= v < BEYOND for v in given):
                raise
            diagnostic = make(26, "an ENTIER is too large for this operator", operator=self.name, span=q.span(node))
            raise GibianeError(diagnostic) from None

    def _apply(self, session: Any, q: Operands, node: Node) -> None:
        """Run the first form that fits."""
        misses: list[Mismatch] = []
        tried: tuple[Form, ...] = ()
        i = 0
        while True:
            if i < len(self.forms) and not (self.forms[i].last and self.pending):
                form = self.forms[i]
                i += 1
                if form in tried:
                    continue
                if form.stream:
                    ctx = Context(session, self, q, node, {})
                    result = form.function(ctx, q)
                else:
                    bound = bind(form, q)
                    if isinstance(bound, Mismatch):
                        misses.append(bound)
                        continue
                    ctx = Context(session, self, q, node, bound[1])
                    result = form.function(ctx, **bound[0])
                if result is Refused:
                    continue
                q.push_front(_results(result), node)
                return
            tried = (*tried, *self.forms[:i])
            i = 0
            if not self.load_more():
                raise explain(self.name, misses, q, symbolic=self.symbolic)

    def answer(self, session: Any, q: Operands) -> None:
        """Write the forms and keywords, asked for by `?` among the operands at the prompt; nothing is run."""
        for form in self.all_forms():
            session.write("   " + form.usage(self.name))
        keys = {word: key.doc for form in self.forms for key in form.keys for word in key.words}
        for word, doc in sorted(keys.items()):
            session.write(f"   '{word}' {doc}".rstrip())
        q.values.clear()
        q.nodes.clear()


class _Refusal:
    """What a stream form returns, the queue untouched, when the operands are for another form."""


Refused = _Refusal()


def _results(result: Any) -> Sequence[Any]:
    if result is None:
        return ()
    return result if isinstance(result, tuple) else (result,)


def _same_operands(a: Form, b: Form) -> bool:
    def shape(form: Form) -> tuple[Any, ...]:
        required = tuple(k.words for k in form.keys if k.required)
        return tuple((x.types, x.subtype, x.many) for x in form.args if not x.optional), required

    return shape(a) == shape(b)


class Context:
    """What an operator may ask: options, output, warnings, errors about its operands, calls of procedures."""

    __slots__ = ("node", "operands", "operator", "places", "session")

    def __init__(
        self, session: Any, operator: Operator, operands: Operands, node: Node, places: dict[str, Node]
    ) -> None:
        self.session = session
        self.operator = operator
        self.operands = operands
        self.node = node
        self.places = places

    @property
    def state(self) -> dict[str, Any]:
        """The place where operator packages keep what belongs to the session."""
        state: dict[str, Any] = self.session.state
        return state

    def option(self, name: str) -> Any:
        """Return the value of an option (OPTI)."""
        return self.session.options[name]

    def write(self, line: str) -> None:
        """Write a line of output."""
        self.session.write(line)

    def diagnostic(
        self,
        code: int | str,
        template: str,
        *,
        at: str | None = None,
        label: str | None = None,
        hint: str | None = None,
        level: int | None = None,
        **fields: Any,
    ) -> Diagnostic:
        """Build a diagnostic about operand `at` (a declared name), or about the operator's word."""
        node = self.places.get(at, self.node) if at else self.node
        span = self.operands.span(node)
        labels = [Label(span, Text(label, fields))] if label else []
        return make(
            code, template, operator=self.operator.name, span=span, labels=labels, hint=hint, level=level, **fields
        )

    def fail(self, code: int | str, template: str, **options: Any) -> NoReturn:
        """Raise an error; options as for :meth:`diagnostic`."""
        raise GibianeError(self.diagnostic(code, template, **options))

    def cannot_write(self, path: Path, failure: OSError) -> NoReturn:
        """Refuse a file that the system does not let be written (error 1130)."""
        reason = (failure.strerror or "unknown reason").lower()
        self.fail(1130, "the file {path} cannot be written ({reason})", path=path.as_posix(), reason=reason)

    def warn(self, code: int | str, template: str, *, level: int = 1, **options: Any) -> None:
        """Emit a warning (level 1) or a note (level 0)."""
        self.session.emit(self.diagnostic(code, template, level=level, **options))

    def call(self, procedure: Any, *arguments: Any) -> list[Any]:
        """Call a procedure (an object or its name) with arguments; return its results."""
        results: list[Any] = self.session.call(procedure, list(arguments), self.operands.span(self.node))
        return results


CATALOGUE: dict[str, Operator] = {}
LONG: dict[str, Operator] = {}
_MODULES: dict[str, list[str]] = {}
# names that a four-letter key would let clash with words of scripts (MAIL is a variable in hundreds of them)
WHOLE_NAMES = frozenset({"MAILLER", "LISSER"})


def _register(op: Operator) -> Operator:
    table, key = (LONG, op.name) if op.whole else (CATALOGUE, op.name[:4])
    if key in table:
        raise TypeError(f"operator {op.name} is declared twice")
    table[key] = op
    # its module may be imported for another of its operators, before anyone asks for this one
    op.modules = _MODULES.pop(op.name, [])
    op.pending.extend(m for m in op.modules[1:] if m not in sys.modules)
    return op


def operator(
    name: str,
    *,
    topic: str,
    summary: str,
    notice: str = "",
    example: str = "",
    see: Sequence[str] = (),
    source: str = "",
    whole: bool = False,
    terminal: bool = False,
) -> Operator:
    """Declare an operator by its name; the first four letters are its key, or the whole name with `whole`."""
    return _register(
        Operator(
            name,
            topic=topic,
            summary=summary,
            notice=notice,
            example=example,
            see=see,
            source=source,
            whole=whole,
            terminal=terminal,
            symbolic=False,
        )
    )


def infix(
    name: str, *, topic: str, summary: str, notice: str = "", example: str = "", see: Sequence[str] = ()
) -> Operator:
    """Declare an operator written as a symbol (`+`, `<EG`), or one that errors treat like it (EGA)."""
    return _register(
        Operator(
            name,
            topic=topic,
            summary=summary,
            notice=notice,
            example=example,
            see=see,
            source="",
            whole=False,
            terminal=False,
            symbolic=True,
        )
    )


def extend(name: str) -> Operator:
    """Return an operator declared elsewhere, to give it further forms."""
    found = LONG.get(name) or find(name)
    if found is None:
        raise TypeError(f"extend({name!r}): no such operator is declared")
    return found


def announce(table: Mapping[str, Sequence[str]]) -> None:
    """Tell which modules declare (first) and extend (others) operators, without importing them."""
    for name, modules in table.items():
        declared = LONG.get(name) or CATALOGUE.get(name[:4])
        if declared is not None:
            declared.modules = list(modules)
            declared.pending.extend(m for m in modules if m not in declared.pending and m not in sys.modules)
        else:
            _MODULES[name] = list(modules)
    _find_cached.cache_clear()


def find(word: str) -> Operator | None:
    """Return the operator that a word calls: by its first four letters, else by its name; a sentence calls none."""
    return _find_cached(word)


def names() -> list[str]:
    """Return the names of all operators, declared or announced."""
    return sorted({op.name for op in CATALOGUE.values()} | set(LONG) | set(_MODULES))


def spellings() -> list[str]:
    """Return every way of writing an operator that hints may propose: full names and their four letters."""
    full = [name for name in names() if len(name) > 2]
    return [*full, *(name[:4] for name in full if name not in WHOLE_NAMES and len(name) > 4)]


@lru_cache(maxsize=4096)
def _find_cached(word: str) -> Operator | None:
    key = word[:4].rstrip()
    if not key or " " in word.rstrip():
        return None
    found = CATALOGUE.get(key)
    if found is not None:
        return found
    for name, modules in _MODULES.items():
        if (name[:4] == key and (name not in WHOLE_NAMES)) or (name in WHOLE_NAMES and word.startswith(name)):
            import_module(modules[0])
            declared = CATALOGUE.get(key) or LONG.get(name)
            if declared is None:
                raise TypeError(f"{modules[0]} does not declare {name}")
            return declared
    return next((op for name, op in LONG.items() if word.startswith(name)), None)


__all__ = ["ANY", "Arg", "Context", "Form", "Key", "Operator", "Refused", "extend", "infix", "operator"]
