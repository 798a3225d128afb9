"""Operands in a queue, read by type: the one rule by which every operator gets its arguments.

An operator has no left and no right: it takes the leftmost unread value of the type it wants, and a word (MOT or
PROCEDUR) hides everything behind it until it is read. :class:`Operands` is that queue; :func:`bind` fills one
declared form from it, or says how far it came.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gibiane import cast3m
from gibiane.diagnostics import Diagnostic, GibianeError, Label, Text, make, nearest
from gibiane.forms import Arg, Form, Key
from gibiane.nodes import Literal, Name, Node
from gibiane.source import SourceText, Span
from gibiane.values import ANNULE, ANY, ENTIER, FLOTTANT, LOGIQUE, MOT, PROCEDUR, Procedure, Table, type_of


class Mark:
    """An access separator waiting in a queue: `.` or `%`."""

    def __init__(self, symbol: str) -> None:
        self.symbol = symbol
        self.type_name = symbol


DOT, PERCENT = Mark("."), Mark("%")
ABSENT: Any = object()  # what `take` returns when nothing fits


class Operands:
    """The unread values of one group, in textual order, each with the node it came from."""

    __slots__ = ("nodes", "session", "source", "values")

    def __init__(self, session: Any, source: SourceText, values: list[Any], nodes: list[Node]) -> None:
        self.session = session
        self.source = source
        self.values = values
        self.nodes = nodes

    def __len__(self) -> int:
        return len(self.values)

    def span(self, node: Node) -> Span:
        """Return the place of a node of this queue."""
        return Span(self.source, node.start, node.end)

    def first_word(self) -> int:
        """Return the position of the first MOT or PROCEDUR, or -1."""
        for i, value in enumerate(self.values):
            kind = type(value)
            if kind is str or kind is Procedure:
                return i
        return -1

    def take(self, types: Sequence[str], subtype: str | None = None, *, choosy: bool = False) -> tuple[Any, Any]:
        """Take the leftmost readable value of one of `types`; return (value, node), or (ABSENT, None).

        `choosy` leaves unquoted operator words where they are (used for optional words, which would otherwise
        swallow the next operator of a chain).
        """
        for i, value in enumerate(self.values):
            kind = type_of(value)
            fits = kind in types or (kind == ENTIER and FLOTTANT in types) or (types[0] is ANY and kind not in ".%")
            if kind == PROCEDUR and not fits and MOT in types:
                fits, value = True, value.name
            if fits and subtype is not None and isinstance(value, Table):
                fits = value.subtype == subtype
            if fits and kind == MOT and choosy:
                fits = not self.is_operator_word(i)
            if fits:
                del self.values[i]
                node = self.nodes.pop(i)
                if kind == ENTIER and types[0] == FLOTTANT and len(types) == 1:
                    value = float(value)
                return value, node
            if kind in (MOT, PROCEDUR):
                break
        return ABSENT, None

    def is_operator_word(self, i: int) -> bool:
        """Say whether position `i` holds an unquoted word that is an operator."""
        node = self.nodes[i]
        if isinstance(node, Literal) and node.quoted:
            return False
        return isinstance(self.values[i], str) and self.session.operator(self.values[i]) is not None

    def read(self, types: str | Sequence[str], *, subtype: str | None = None) -> Any:
        """Read the leftmost value of `types`, or return None when there is none (see `need`)."""
        wanted = (types,) if isinstance(types, str) else types
        value, _ = self.take(wanted, subtype)
        return None if value is ABSENT else value

    def need(self, types: str | Sequence[str], what: str | None = None) -> Any:
        """Read the leftmost value of `types`.

        Raises
        ------
        GibianeError
            37 when there is none.
        """
        value = self.read(types)
        if value is None:
            wanted = types if isinstance(types, str) else " or ".join(types)
            raise self.missing(wanted, what)
        return value

    def missing(self, wanted: str, what: str | None = None, *, keyword: bool = False) -> GibianeError:
        """Return the error 37 for a type that is not there, with what stands in its place.

        With `keyword` the first unread word is a keyword of the operator, and not to blame.
        """
        labels, span = [], None
        # An object that a failed instruction left without value is the likely culprit, wherever it stands.
        lost = next((i for i, value in enumerate(self.values) if type_of(value) == ANNULE), None)
        at = lost if lost is not None else self.first_word() + 1 if keyword else 0
        if at < len(self.values):
            label = self.describe(at, None if lost is not None else wanted)
            labels, span = [label], label.span
        template = "no {type} among its operands" if not what else "no {type} ({what}) among its operands"
        failure = make(37, template, type=wanted, what=what, labels=labels, span=span)
        if lost is None:
            failure.hint = self.session.state.get("makers", {}).get(wanted.split(" ")[0])
        if not keyword:
            self.point_at_word(failure)
        return GibianeError(failure)

    def point_at_word(self, failure: Diagnostic) -> None:
        """Add to an error the unread word that nothing has and that hides what follows, with a likely correction."""
        i = self.first_word()
        node = self.nodes[i] if i >= 0 else None
        if i >= 0 and self.values[i] in cast3m.names() and self.session.operator(str(self.values[i])) is None:
            raise GibianeError(self.not_available(i, self.values[i], cast3m.names()[self.values[i]]))
        if not isinstance(node, Name) or self.values[i] != node.word or self.is_operator_word(i):
            return
        if i > 0:
            failure.labels.append(self.describe(i))
        close = nearest(node.word, [*self.session.names(), *self.session.library.names()])
        if close is not None:
            failure.hint = Text("did you mean {close}?", {"close": close})

    def not_available(self, i: int, name: str, near: str) -> Diagnostic:
        """Return the error 251 for an operator or procedure of Cast3M that is not here, called by word `i`."""
        hint = "the nearest thing here: {near}" if near else "gibiane check --portability lists what a script misses"
        failure = make(
            251, "{name} of Cast3M is not available yet", name=name, near=near, hint=hint, span=self.span(self.nodes[i])
        )
        failure.operator = ""  # nobody else speaks for it
        return failure

    def describe(self, i: int, wanted: str | None = None) -> Label:
        """Return a label that says what operand `i` is, and what was wanted instead."""
        value, node = self.values[i], self.nodes[i]
        kind = type_of(value)
        fields: dict[str, Any] = {"type": kind, "word": value if kind == MOT else ""}
        if kind == MOT and isinstance(node, Name) and value == node.word:
            text = "the word {word}: no object has this name"
        elif kind == MOT:
            text = "the word '{word}'"
        elif kind == PROCEDUR:
            text, fields["word"] = "the procedure {word}", value.name
        elif kind == ANNULE:
            text = "no value: the instruction that should have made it failed, or the argument was not given"
        elif isinstance(node, Name) and (line := self.session.origin(node.name)):
            text, fields["line"] = "a {type}, made at line {line}", line
        else:
            text = "a {type}"
        told = Text(text, fields)
        if wanted is not None:
            told = Text("{what}; a {wanted} is needed here", {"what": told, "wanted": wanted})
        return Label(self.span(node), told)

    def read_keyword(self, words: Sequence[str], width: int = 4) -> str | None:
        """Read one of `words` if it is the first unread word (compared on `width` letters), else return None."""
        i = self.first_word()
        if i < 0 or type(self.values[i]) is not str:
            return None
        word = self.values[i][:width]
        for candidate in words:
            if candidate[:width] == word:
                del self.values[i], self.nodes[i]
                return candidate
        return None

    def need_keyword(self, words: Sequence[str]) -> str:
        """Read one of `words`.

        Raises
        ------
        GibianeError
            7 with the accepted list, when the first word is another or there is none.
        """
        found = self.read_keyword(words)
        if found is None:
            raise self.unknown_keyword(words)
        return found

    def unknown_keyword(self, words: Sequence[str]) -> GibianeError:
        """Return the error 7 for the first unread word, with the accepted ones."""
        i = self.first_word()
        accepted = _listed(words, self.values[i] if i >= 0 and isinstance(self.values[i], str) else "")
        if i < 0:
            return GibianeError(make(7, "a keyword is missing; accepted: {accepted}", accepted=accepted))
        value = self.values[i]
        word = value if isinstance(value, str) else value.name
        close = nearest(word[:8], list(words))
        if close is None and (short := nearest(word[:4], [w[:4] for w in words])) is not None:
            close = next(w for w in words if w[:4] == short)
        return GibianeError(
            make(
                7,
                "unknown keyword '{word}'; accepted: {accepted}",
                word=word,
                accepted=accepted,
                span=self.span(self.nodes[i]),
                hint="did you mean '{close}'?" if close else None,
                close=close,
            )
        )

    def push_front(self, results: Sequence[Any], node: Node) -> None:
        """Put results at the front, in order, where the next operator finds them first."""
        self.values[:0] = results
        self.nodes[:0] = [node] * len(results)


# Accepted words that a message shows; of more only those that resemble what was written.
SHOWN = 12


def _listed(words: Sequence[str], written: str) -> str:
    """Return accepted words between quotes; of many the likeliest, and how many there are."""
    if len(words) <= SHOWN:
        return ", ".join(f"'{w}'" for w in words)
    from difflib import SequenceMatcher

    likely = sorted(words, key=lambda w: -SequenceMatcher(None, written[:4], w[:4]).ratio())[: SHOWN // 2]
    return ", ".join(f"'{w}'" for w in words if w in likely) + f" ... ({len(words)})"


class Mismatch:
    """How far one form came: values bound, and what it still wanted."""

    def __init__(self, form: Form, matched: int, wanted: Arg | Key | None, blocker: int, keys: Sequence[str]) -> None:
        self.form = form
        self.matched = matched
        self.wanted = wanted
        self.blocker = blocker
        self.keys = keys


def bind(form: Form, q: Operands) -> tuple[dict[str, Any], dict[str, Node]] | Mismatch:
    """Fill a form's parameters from the queue, or leave the queue as it was and say what was missing.

    Positional arguments are read in declared order as far as words allow; then the first word, if it is one of
    the form's keywords, is read with its own arguments; and so on until nothing more can be read.
    """
    values, nodes = q.values.copy(), q.nodes.copy()
    bound: dict[str, Any] = dict(form.defaults)
    places: dict[str, Node] = {}
    pending = list(form.args)
    matched = 0
    wanted: Arg | Key | None = None
    used: set[str] = set()
    while True:
        read = _read_args(pending, q, bound, places, form)
        matched += read
        key = _next_key(form, q, used)
        if key is None:
            if read:
                continue
            break
        i = q.first_word()
        places[key.name] = q.nodes[i]
        word = key.match(q.values[i]) or ""
        del q.values[i], q.nodes[i]
        if not key.repeat:
            used.add(key.name)
        matched += 1
        wanted = _read_key(key, word, q, bound)
        if wanted is not None:
            break
    if wanted is None:
        wanted = next((a for a in pending if not a.optional and not (a.many and bound[a.name])), None)
    if wanted is None:
        wanted = next((k for k in form.keys if k.required and k.name not in used), None)
    if wanted is None:
        return bound, places
    blocker = q.first_word()
    unread = [w for k in form.keys if k.name not in used for w in k.words]
    mismatch = Mismatch(form, matched, wanted, blocker, unread)
    q.values[:], q.nodes[:] = values, nodes
    return mismatch


def _read_args(pending: list[Arg], q: Operands, bound: dict[str, Any], places: dict[str, Node], form: Form) -> int:
    count = 0
    for arg in list(pending):
        while True:
            if MOT in arg.types and _key_ahead(form, q):
                break
            value, node = q.take(arg.types, arg.subtype, choosy=arg.optional or arg.many)
            if value is ABSENT:
                break
            count += 1
            places.setdefault(arg.name, node)
            if not arg.many:
                bound[arg.name] = value
                pending.remove(arg)
                break
            bound[arg.name] = [*bound[arg.name], value]
    return count


def _key_ahead(form: Form, q: Operands) -> bool:
    i = q.first_word()
    return i >= 0 and isinstance(q.values[i], str) and any(key.match(q.values[i]) for key in form.keys)


def _next_key(form: Form, q: Operands, used: set[str]) -> Key | None:
    i = q.first_word()
    if i < 0:
        return None
    word = q.values[i]
    if not isinstance(word, str):
        return None
    return next((key for key in form.keys if key.name not in used and key.match(word)), None)


def _read_key(key: Key, word: str, q: Operands, bound: dict[str, Any]) -> Arg | None:
    """Read the arguments of a keyword into `bound`; return the first missing mandatory one."""
    got: list[Any] = []
    for arg in key.args:
        if arg.many:
            several: list[Any] = []
            while (value := q.take(arg.types, arg.subtype, choosy=True)[0]) is not ABSENT:
                several.append(value)
            if not several and not arg.optional:
                return arg
            got.append(several)
            continue
        value, _ = q.take(arg.types, arg.subtype, choosy=arg.optional)
        if value is ABSENT:
            if not arg.optional:
                return arg
            value = None
        got.append(value)
    if len(key.words) > 1:
        result: Any = (word, *got) if got else word
    elif not key.args:
        result = True
    else:
        result = got[0] if len(got) == 1 else tuple(got)
    bound[key.name] = [*bound[key.name], result] if key.repeat else result
    return None


def explain(name: str, misses: list[Mismatch], q: Operands, *, symbolic: bool) -> GibianeError:
    """Word the failure of every form of the operator `name`: an unknown keyword, a missing operand, or wrong types."""
    i = q.first_word()
    first = q.values[i][:4] if i >= 0 and isinstance(q.values[i], str) else None
    # A form whose keyword stands first is the one that was meant.
    named = [m for m in misses if any(word[:4] == first for key in m.form.keys for word in key.words)]
    if not named:
        # Forms that cannot take an object that is there are not what was meant.
        objects = {type_of(v) for v in q.values} - {MOT, ENTIER, FLOTTANT, LOGIQUE, PROCEDUR}
        misses = [m for m in misses if _takes(m.form, objects)] or misses
    best = max(named or misses, key=lambda m: m.matched)
    said = {value[:4] for value in q.values if isinstance(value, str)}
    meant = [m for m in misses if any(word[:4] in said for key in m.form.keys for word in key.words)]
    forms = [m.form.usage(name) for m in named or meant or misses][:6]
    if symbolic:
        failure = _explain_infix(name, q)
        forms = []  # what every type of operands gives is of no help for two of them
    elif (
        not named
        and i >= 0
        and best.keys
        and isinstance(q.values[i], str)
        and not q.is_operator_word(i)
        and not _is_misspelt_name(q, i, best, keys := sorted({w for m in misses for w in m.keys}))
    ):
        failure = q.unknown_keyword(keys)
    elif isinstance(best.wanted, Key):
        words = " or ".join(f"'{w}'" for w in best.wanted.words)
        failure = GibianeError(make(7, "a keyword is missing: {words}", words=words))
    elif best.wanted is not None:
        what = best.wanted.doc if best.matched else None
        failure = q.missing(" or ".join(best.wanted.types), what, keyword=bool(named))
    else:
        failure = q.missing(ANY)
    failure.diagnostic.forms = forms
    failure.diagnostic.more = f"INFO {name} ;"
    return failure


def _takes(form: Form, types: set[str]) -> bool:
    """Say whether a form has operands of all these types."""
    wanted = {t for arg in (*form.args, *(a for key in form.keys for a in key.args)) for t in arg.types}
    return form.stream or ANY in wanted or types <= wanted


def _is_misspelt_name(q: Operands, i: int, best: Mismatch, keys: Sequence[str]) -> bool:
    """Say whether an unread word stands for a missing operand rather than for a keyword."""
    node = q.nodes[i]
    if not isinstance(best.wanted, Arg) or not isinstance(node, Name) or q.values[i] != node.word:
        return False
    return nearest(node.word[:8], keys) is None or nearest(node.word, list(q.session.names())) is not None


def _explain_infix(name: str, q: Operands) -> GibianeError:
    readable = []
    for i, value in enumerate(q.values):
        if type_of(value) in (MOT, PROCEDUR):
            break
        readable.append(i)
    if len(readable) >= 2:
        labels = [q.describe(i) for i in readable[:2]]
        types = [type_of(q.values[i]) for i in readable[:2]]
        return GibianeError(
            make(
                196,
                "cannot work on {left} and {right}",
                left=types[0],
                right=types[1],
                labels=labels,
                span=labels[0].span,
            )
        )
    if readable:
        labels = [q.describe(0)]
        hint = (
            "two operands are wanted"
            if name not in "+-"
            else ("two operands are wanted; a sign belongs to a number only: write -1 * X")
        )
        if len(q.values) > 1 and not isinstance(q.nodes[1], Name):
            labels.append(q.describe(1))
        failure = make(37, "its second operand is missing", labels=labels, span=labels[0].span, hint=hint)
        q.point_at_word(failure)
        return GibianeError(failure)
    labels = [q.describe(0)] if q.values else []
    failure = make(533, "its operands are missing", labels=labels, span=labels[0].span if labels else None)
    if name in "+-" and labels:
        failure.hint = Text("a sign belongs to a number only: write -1 * X")
    return GibianeError(failure)
