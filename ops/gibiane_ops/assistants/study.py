"""A study: cases of one instruction as bytes that another process can run, and their results as bytes.

A study holds the queue of each case, the procedures that they may call and the objects that those name; a case is run
in a session of its own, which begins with the options of the session that asks. A file names its objects as SAUV does.
"""

from __future__ import annotations

import gc
import hashlib
import io
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from gibiane import __version__
from gibiane.binding import Operands
from gibiane.diagnostics import Diagnostic, GibianeError
from gibiane.nodes import Literal, Name, Node
from gibiane.source import SourceText
from gibiane.values import Procedure, Value, type_of
from gibiane_ops.assistants.needs import words
from gibiane_ops.values.archive import Archive, NotSaveable, write_archive
from gibiane_ops.values.nodes import node_store
from gibiane_ops.values.texts import rebuilt

# What a case does not take from the session that asks: how that one talks, and that it has workers.
OWN_OPTIONS = frozenset({"ASSI", "DASK", "ECHO", "WARN", "DONN"})


class Case(NamedTuple):
    """One elementary instruction: its values in order, each with the text it was written as and whether quoted."""

    index: Any
    values: list[Any]
    words: list[tuple[str, bool]]


class Answer(NamedTuple):
    """What a case gave.

    Attributes
    ----------
    results : bytes or None
        An archive of the results, None when the case failed.
    text : str
        What it has printed, and its diagnostics.
    level : int
        Highest error level.
    code : int or str
    sentence : str
        Of the failure, empty when there is none.
    seconds : float
        On the clock of who ran it.
    """

    results: bytes | None
    text: str
    level: int
    code: int | str
    sentence: str
    seconds: float


def case_of(q: Operands, index: Any, values: list[Any]) -> Case:
    """Return the case of a queue in which `values` stand for its own."""
    words = []
    for value, node in zip(values, q.nodes, strict=True):
        quoted = isinstance(node, Literal) and node.quoted
        shown = value if isinstance(value, str) else value.name if isinstance(value, Procedure) else None
        if shown is None:
            shown = str(value) if isinstance(value, bool | int | float) else type_of(value)
        words.append((shown, quoted))
    return Case(index, values, words)


def pack(session: Any, cases: list[Case], found: dict[str, Any]) -> bytes:
    """Return a study as bytes.

    Raises
    ------
    NotSaveable
        When a value is of a type that an archive cannot hold.
    """
    options = {
        name: value
        for name, value in session.options.items()
        if name not in OWN_OPTIONS and isinstance(value, bool | int | float | str)
    }
    names: dict[str, Any] = {f"object {name}": value for name, value in found.items()}
    for number, case in enumerate(cases):
        names[f"case {number}"] = [case.values, [text for text, _ in case.words], [quoted for _, quoted in case.words]]
    names["directory"] = session.library.directory
    file = io.BytesIO()
    write_archive(file, names, node_store(session), options, "study")
    return file.getvalue()


def fingerprint(session: Any, case: Case, found: dict[str, Any]) -> str:
    """Return a text that changes when the case, its procedures (shipped ones by version) or its objects change."""
    digest = hashlib.sha256(__version__.encode())
    digest.update(_content(session, {"case": [case.values, [list(word) for word in case.words]], **found}))
    for name in sorted({word for word, _ in words(case.values)}):
        source = session.library.find(name) if session.operator(name) is None and name not in found else None
        if source is not None:
            digest.update(source.text.encode())
    return digest.hexdigest()[:24]


def _content(session: Any, names: dict[str, Any]) -> bytes:
    """Return the bytes of an archive without the dates of its members."""
    file = io.BytesIO()
    options = {name: session.options.get(name) for name in ("DIME", "MODE", "ELEM", "DENS")}
    write_archive(file, names, node_store(session), options, "")
    archive = Archive(file)
    return archive.digest()


def run_case(study: bytes, number: int, make_session: Callable[..., Any]) -> Answer:
    """Run one case of a study in a session of its own.

    Parameters
    ----------
    study : bytes
        Of :func:`pack`.
    number : int
        From 0.
    make_session : callable
        The class of sessions: it is named by who asks, since operators do not know it.
    """
    start = time.perf_counter()
    gc.collect()  # a session holds itself in circles, and with it the factors of an earlier case: gigabytes
    out = io.StringIO()
    session = make_session(out=out, err=out)
    archive = Archive(io.BytesIO(study))
    session.options.update(archive.options)
    found = archive.restore(session, node_store(session), rebuilt)
    session.library.directory = found["directory"]
    for name, value in found.items():
        if name.startswith("object "):
            session.assign(name.removeprefix("object "), value)
    values, texts, quoted = found[f"case {number}"]
    q = _queue(session, values, list(zip(texts, quoted, strict=True)), number)
    try:
        session.evaluator.evaluate(q, 1)
        results = io.BytesIO()
        write_archive(results, {"results": q.values}, node_store(session), {}, "results")
    except GibianeError as failure:
        diagnostic: Diagnostic = failure.diagnostic
        session.emit(diagnostic)
        return Answer(None, out.getvalue(), session.worst, diagnostic.code, str(failure), time.perf_counter() - start)
    except NotSaveable as failure:
        sentence = f"a {failure.type_name} cannot come back from a worker"
        return Answer(None, out.getvalue(), 2, 39, sentence, time.perf_counter() - start)
    return Answer(results.getvalue(), out.getvalue(), session.worst, 0, "", time.perf_counter() - start)


def results_of(session: Any, answer: bytes) -> list[Value | int | float | str | bool]:
    """Put the results of a case into a session; nodes come in addition to its own."""
    archive = Archive(io.BytesIO(answer))
    found: list[Any] = archive.restore(session, node_store(session), rebuilt)["results"]
    return found


def _queue(session: Any, values: list[Any], words: list[tuple[str, bool]], number: int) -> Operands:
    """Make the queue of a case, with a text in which diagnostics can point."""
    text, nodes = "", list[Node]()
    for (shown, quoted), value in zip(words, values, strict=True):
        piece = f"'{shown}'" if quoted else shown
        start, end = len(text), len(text) + len(piece)
        if isinstance(value, str) and not quoted:
            nodes.append(Name(value, start, end))
        elif isinstance(value, str | int | float):
            nodes.append(Literal(value, start, end, quoted))
        else:
            nodes.append(Node(start, end))
        text += piece + " "
    return Operands(session, SourceText(f"<case {number + 1}>", text + ";"), values, nodes)
