"""ASSI: an instruction done by an assistant, or the same one for many cases at once."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, LISTREEL, MOT, TABLE, Table
from gibiane_ops.assistants import study as studies
from gibiane_ops.assistants import workers
from gibiane_ops.assistants.needs import called
from gibiane_ops.assistants.progress import Progress
from gibiane_ops.assistants.study import Answer, Case
from gibiane_ops.values.archive import BadArchive, NotSaveable

SLAVE = "ESCLAVE"

NO_ROOM = "G414"
"""Code of what would take more memory than there is."""

ASSI = operator(
    "ASSISTANT",
    topic="procedures",
    summary="do an instruction for many cases at once, on several processes or machines",
    notice="ASSI 'TOUS' does one elementary instruction (operator or procedure, and operands) for every index of the "
    "tables of subtype ESCLAVE among its operands, which must have the same indices; each result is such a table. With "
    "OPTI ASSI n, or gibiane --workers n, the cases run on n processes of this machine; with gibiane --dask "
    "tcp://host:port on a Dask cluster (package distributed; gibiane must be installed there); otherwise one after the "
    "other here. The results are the same. A worker that dies loses nothing: its case is run again; one that finds too "
    "little memory beside the others of this machine is run again when they are done. A case that fails "
    "stops the others no more than itself; the error names it when all are done.\n"
    "A case sees the procedures that it calls and the objects that these name, and the options; what it assigns "
    "is gone, and tables that it changes are copies. Meshes that come back have nodes of their own. Pictures belong "
    "outside.\n"
    "'REPR' folder keeps each finished case there: a study that was interrupted, run again, only does what is missing. "
    "A case is done again when its operands, the procedures of the script or the objects that they name have changed; "
    "remove the folder to begin anew.\n"
    "Progress is shown on a terminal, or with ECHO >= 1. 'DURE' gives the seconds that each case is expected to take: "
    "the time ahead is said before the first case and corrected by what cases took, the longest cases begin, and "
    "progress is shown in a file too, every half minute.\n"
    "ASSI n does the instruction now, here: only 'TOUS' spreads work.",
    example="DEBP CARRE X*FLOTTANT ;\nY = X ** 2 ;\nFINP Y ;\nT = TABL ESCLAVE ;\n"
    "REPE B 3 ; T. &B = FLOT &B ; FIN B ;\nT2 = ASSI 'TOUS' CARRE T ;\nMESS (T2.1) (T2.2) (T2.3) ;",
    see=["OPTION", "TABLE"],
)


@ASSI.stream(
    Arg("n", ENTIER, "number of the assistant", optional=True),
    Key("TOUS", "every case of the tables ESCLAVE"),
    Key("REPR", "keep finished cases in a folder", Arg("folder", MOT)),
    Key("DURE", "expected seconds of each case", Arg("seconds", LISTREEL)),
    Arg("t", TABLE, "of subtype ESCLAVE", many=True, optional=True),
    syntax="n:ENTIER instruction... | 'TOUS' ('REPR' folder:MOT) ('DURE' seconds:LISTREEL) "
    "instruction with t:TABLE ESCLAVE...",
)
def _assi(ctx: Context, q: Operands) -> None:
    if q.read_keyword(["TOUS"]) is None:
        if q.read(ENTIER) is None:
            raise q.missing("ENTIER or 'TOUS'", "the number of an assistant")
        ctx.session.evaluator.evaluate(q, 1)
        return
    folder, expected = None, None
    while (word := q.read_keyword(["REPR", "DURE"])) is not None:
        if word == "REPR":
            folder = Path(str(q.need(MOT, "a folder")))
        else:
            expected = q.need(LISTREEL, "expected seconds").values.tolist()
    cases = _cases(ctx, q)
    if expected is not None and len(expected) != len(cases):
        ctx.fail(26, "'DURE' gives {n} lengths of time for {cases} cases", n=len(expected), cases=len(cases))
    if expected is not None and min(expected) <= 0.0:
        ctx.fail(26, "the lengths of time of 'DURE' must be positive, not {least}", least=min(expected))
    results = _Results(ctx, cases)
    if folder is None and expected is None and not ctx.session.options.get("DASK") and _workers(ctx) < 1:
        for number, case in enumerate(cases):
            inner = Operands(ctx.session, q.source, list(case.values), list(q.nodes))
            ctx.session.evaluator.evaluate(inner, 1)
            results.set(number, inner.values)
    else:
        _spread(ctx, cases, folder, expected, results)
    node = q.nodes[0] if q.nodes else ctx.node
    q.values.clear()
    q.nodes.clear()
    q.push_front(results.tables(), node)


def _workers(ctx: Context) -> int:
    return int(ctx.session.options.get("ASSI", 0))


def _cases(ctx: Context, q: Operands) -> list[Case]:
    """Return the cases of the queue: an operand ESCLAVE gives each its own."""
    tables = [value for value in q.values if isinstance(value, Table) and value.subtype == SLAVE]
    if not tables:
        ctx.fail(
            37,
            "no TABLE of subtype ESCLAVE among its operands",
            hint="T = TABL ESCLAVE ; T.1 = ... ; gives each case its value",
        )
    indices = _indices(tables[0])
    for number, table in enumerate(tables[1:]):
        if set(_indices(table)) != set(indices):
            ctx.fail(26, "table {n} of subtype ESCLAVE has other indices than the first", n=number + 2)
    return [
        studies.case_of(q, i, [v.get(i) if isinstance(v, Table) and v.subtype == SLAVE else v for v in q.values])
        for i in indices
    ]


def _indices(table: Table) -> list[Any]:
    return [index for index, _ in table.entries.values() if index != "SOUSTYPE"]


class _Results:
    """The results of the cases, as tables ESCLAVE."""

    def __init__(self, ctx: Context, cases: list[Case]) -> None:
        self.ctx = ctx
        self.cases = cases
        self.found: dict[int, list[Any]] = {}

    def set(self, number: int, values: list[Any]) -> None:
        self.found[number] = values

    def tables(self) -> list[Table]:
        counts = {len(values) for values in self.found.values()}
        if len(counts) > 1:
            low, high = min(counts), max(counts)
            self.ctx.fail(26, "some cases give {low} results, others {high}", low=low, high=high)
        made = [Table(SLAVE) for _ in range(counts.pop() if counts else 1)]
        for number, case in enumerate(self.cases):
            for table, value in zip(made, self.found.get(number, []), strict=False):
                table.set(case.index, value)
        return made


def _spread(
    ctx: Context, cases: list[Case], folder: Path | None, expected: list[float] | None, results: _Results
) -> None:
    """Run the cases that no file of `folder` holds, on whoever is there; set the results of all."""
    session = ctx.session
    found = called(session, [value for case in cases for value in case.values])
    try:
        package = studies.pack(session, cases, found)
    except NotSaveable as failure:
        ctx.fail(39, "a {type} cannot go to a worker", type=failure.type_name)
    progress = Progress(ctx, len(cases), expected, _workers(ctx))
    kept = (
        {
            n: folder / f"case_{studies.fingerprint(session, c, called(session, c.values))}.zip"
            for n, c in enumerate(cases)
        }
        if folder
        else {}
    )
    missing = []
    for number in range(len(cases)):
        values = _kept(session, kept.get(number))
        if values is None:
            missing.append(number)
        else:
            results.set(number, values)
    if expected is not None:
        missing.sort(key=lambda number: -expected[number])
    progress.begin(missing)
    failed: list[tuple[int, Answer]] = []
    texts: dict[int, str] = {}
    following = iter(sorted(missing))
    awaited = next(following, None)
    beside = _workers(ctx) > 0 and not session.options.get("DASK")
    postponed: list[int] = []

    def take(number: int, answer: Answer) -> None:
        nonlocal awaited
        texts[number] = answer.text
        if answer.results is None:
            failed.append((number, answer))
        else:
            if number in kept:
                _keep(kept[number], answer.results)
            results.set(number, studies.results_of(session, answer.results))
        while awaited in texts:  # what cases print stands in their order, whoever was first
            _print(ctx, texts[awaited])
            awaited = next(following, None)
        progress.done(number, answer.seconds)

    for number, answer in _answers(ctx, package, missing):
        if beside and answer.code == NO_ROOM:
            postponed.append(number)
        else:
            take(number, answer)
    for number in postponed:
        take(number, studies.run_case(package, number, type(session)))
    if failed:
        failed.sort()
        number, answer = failed[0]
        shown = ", ".join(str(cases[n].index) for n, _ in failed[:10])
        ctx.fail(
            answer.code,
            "case {index}: {sentence}",
            index=cases[number].index,
            sentence=answer.sentence,
            cases=shown,
            hint="cases that failed: {cases}; the others are done",
        )


def _answers(ctx: Context, package: bytes, missing: list[int]) -> Iterator[tuple[int, Answer]]:
    make_session = type(ctx.session)
    address = ctx.session.options.get("DASK")
    if not missing:
        return
    try:
        if address:
            yield from workers.dask(package, missing, str(address), make_session)
        elif _workers(ctx) < 1:
            yield from ((number, studies.run_case(package, number, make_session)) for number in missing)
        else:
            yield from workers.local(package, missing, _workers(ctx), make_session)
    except ImportError:
        ctx.fail("G201", "a cluster needs the package distributed", hint='pip install "gibiane[dask]"')
    except workers.WorkersLost as failure:
        ctx.fail(
            "G601",
            "workers die again and again, {n} cases are not done: {reason}",
            n=len(failure.cases),
            reason=failure.reason,
            hint="fewer workers need less memory at a time; with 'REPR' what is finished is kept",
        )
    except OSError as failure:
        ctx.fail("G602", "no cluster answers at {address}: {reason}", address=address, reason=str(failure)[:200])


def _kept(session: Any, path: Path | None) -> list[Any] | None:
    """Return the results in a file of an earlier run, None when there is none or it was cut."""
    if path is None or not path.is_file():
        return None
    try:
        return studies.results_of(session, path.read_bytes())
    except BadArchive:
        return None


def _keep(path: Path, results: bytes) -> None:
    """Write the results of a case, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(f".{os.getpid()}")
    part.write_bytes(results)
    part.replace(path)


def _print(ctx: Context, text: str) -> None:
    for line in text.splitlines():
        ctx.write(line)
