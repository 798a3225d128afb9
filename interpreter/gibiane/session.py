"""A session: names, options, loaded operators, output. All state of a run lives here, none in modules."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TextIO

from gibiane import faults, registry, slips
from gibiane.blocks import annotate
from gibiane.diagnostics import ERROR, WARNING, Diagnostic, GibianeError, error, make, render
from gibiane.evaluator import Evaluator
from gibiane.frames import Frame, Resume, Stop
from gibiane.library import Library, read_script
from gibiane.nodes import Instr
from gibiane.source import SourceText, Span
from gibiane.syntax import parse, refuse_long
from gibiane.values import PREDEFINED, Value, type_of

EXIT_CODES = {0: 0, 1: 4, 2: 8, 3: 12}
INTERNAL_FAILURE = 70
KEYBOARD = 5  # the unit that OPTI DONN 5 reads
MAX_INCLUDED = 50
# 500 nested calls of procedures take a dozen Python calls each
RECURSION_LIMIT = 12_000


def default_options() -> dict[str, Any]:
    """Return the options of a new session (OPTI)."""
    return {
        "DIME": 0,
        "MODE": None,
        "ELEM": None,
        "DENS": 0.0,
        "ECHO": 0,
        "ERRE": "NORM",
        "LANG": None,
        "LOCA": False,
        "DEBU": 0,
        "WARN": False,
        "EXEC": False,
        "STRICT": False,
        "PREC": sys.float_info.epsilon,
        "PETI": sys.float_info.min,
        "GRAN": sys.float_info.max,
        "TRAC": "PNG",
        "COUL": "DEFA",
    }


class Session:
    """Everything a run of scripts shares; `run_text` and `run_file` add to it.

    Parameters
    ----------
    out, err : text streams
        Where output and messages go (standard streams by default). A message flushes `out` first.
    interactive : bool
        True in a REPL: errors keep the session, warnings about likely mistakes are on.
    colour : bool
        Colour in messages.
    """

    def __init__(
        self, *, out: TextIO | None = None, err: TextIO | None = None, interactive: bool = False, colour: bool = False
    ) -> None:
        sys.set_int_max_str_digits(0)  # an ENTIER has no largest value
        self.out = out if out is not None else sys.stdout
        self.err = err if err is not None else sys.stderr
        self.interactive = interactive
        self.colour = colour
        self.debug = False
        self.options = default_options()
        self.options["WARN"] = interactive
        self.state: dict[str, Any] = {}
        self.listeners: dict[str, list[Any]] = {}
        self.point_maker: Any = None
        self.pager: Callable[[str], None] | None = None
        self.library = Library()
        self.worst = 0
        self.concern = 0
        self.internal = False
        self.finished = False
        self.handed_over = False
        self.pending: list[str | int] = []
        self._included = 0
        self.started = time.perf_counter()
        self._ordinals: dict[int, tuple[int, Any]] = {}
        self.evaluator = Evaluator(self)
        self.globals = Frame(self.evaluator, None, None)
        self.globals.names.update(PREDEFINED)
        self.evaluator.frame = self.globals
        load_operators(self)

    # -- output ---------------------------------------------------------------------------------------------

    @property
    def lang(self) -> str:
        """Language of diagnostics: English unless OPTI LANG says otherwise."""
        return "fr" if self.options["LANG"] == "FRAN" else "en"

    def listed(self, template: str, **fields: Any) -> str:
        """Return a line of a listing: in French as stored outputs are, in English after OPTI LANG ANGL."""
        if self.options["LANG"] == "ANGL":
            from gibiane.listings_en import ENGLISH

            template = ENGLISH.get(template, template)
        return template.format(**fields)

    def write(self, line: str) -> None:
        """Write one line of output."""
        self.out.write(line + "\n")

    def page(self, text: str) -> None:
        """Write a long text, a screen at a time where somebody reads it."""
        if self.pager is None:
            self.write(text)
        else:
            self.out.flush()
            self.pager(text)

    def emit(self, diagnostic: Diagnostic) -> None:
        """Show a message of any level and remember the highest."""
        self.worst = max(self.worst, diagnostic.level)
        if diagnostic.level == WARNING:
            self.concern = int(diagnostic.code) if diagnostic.code.isdigit() else 1
        if diagnostic.level < ERROR and self.options["ECHO"] < 0:
            return
        self.out.flush()
        self.err.write(render(diagnostic, colour=self.colour, lang=self.lang) + "\n")
        self.err.flush()

    # -- what operators and the evaluator ask ------------------------------------------------------------------

    def operator(self, word: str) -> registry.Operator | None:
        """Return the operator that `word` calls, or None."""
        return registry.find(word)

    def origin(self, name: str) -> int | None:
        """Return the line where a visible name was last given its value, or None."""
        return self.evaluator.frame.origin(name)

    def ordinal(self, value: Value) -> int:
        """Return a small number that stands for an object in listings (Cast3M prints a pointer)."""
        found = self._ordinals.get(id(value))
        if found is None:
            found = len(self._ordinals) + 1, value
            self._ordinals[id(value)] = found
        return found[0]

    def brief(self, value: Any) -> str:
        """Return a value in a few characters, for listings."""
        if isinstance(value, bool):
            return "VRAI" if value else "FAUX"
        if isinstance(value, float):
            from gibiane.fortran import general

            return general(value).strip()
        if isinstance(value, int | str):
            return str(value)
        return str(self.ordinal(value))

    def assign(self, name: str, value: Any) -> None:
        """Give a name a value in the current frame, for an operator that names its results itself (ACQU)."""
        self.evaluator.assign_name(name, value, self.evaluator.current)

    def ask(self, prompt: str) -> str:
        """Ask for a line at the keyboard; return "" when none can be had."""
        self.out.write(prompt)
        self.out.flush()
        line = sys.stdin.readline()
        if not line.endswith("\n"):
            self.out.write("\n")
        return line.rstrip("\n")

    def call(self, procedure: Any, arguments: list[Any], span: Span) -> list[Any]:
        """Call a procedure (an object or its name) from an operator; return its results."""
        return self.evaluator.call_values(procedure, arguments, span)

    def define(self, assignment: str) -> bool:
        """Define an object from `NAME=VALUE` (command line, golden header); False when the text is not that."""
        name, equal, value = assignment.partition("=")
        if not equal or not name.isidentifier():
            return False
        self.globals.names[name.upper()[:24]] = _value(value)
        return True

    # -- running --------------------------------------------------------------------------------------------

    def run_text(self, text: str, name: str = "<text>", directory: str | None = None) -> int:
        """Run a script given as text; return the exit code of the session so far."""
        return self._run(SourceText(name, text, directory))

    def run_file(self, path: str | Path) -> int:
        """Run a script file; return the exit code of the session so far."""
        source = self.open(path)
        return EXIT_CODES[self.worst] if source is None else self._run(source)

    def open(self, path: str | Path) -> SourceText | None:
        """Read a script file; a missing or unreadable one is a diagnostic and None."""
        try:
            return read_script(Path(path))
        except GibianeError as failure:
            self.emit(failure.diagnostic)
            return None

    def _run(self, source: SourceText) -> int:
        program = self._program(source)
        previous = self.library.directory
        if source.directory is not None:
            self.library.directory = source.directory
        limit = sys.getrecursionlimit()
        sys.setrecursionlimit(max(limit, RECURSION_LIMIT))
        if self.options["WARN"]:
            faults.warn_hidden_operators(self.evaluator, program)
        try:
            self.evaluator.run(program)
        except Stop:
            self.finished = True
        except Resume:
            pass
        except GibianeError as failure:
            self.emit(failure.diagnostic)
            self.finished = self.options["ERRE"] == "FATA"
        except RecursionError:
            self.emit(make("G103", "calls or parentheses are nested too deeply"))
        except KeyboardInterrupt:
            if not self.interactive:
                raise
            self.out.flush()
            self.err.write("interrupted; every object is kept\n")
        except BrokenPipeError:
            raise  # who read the output has closed it: no fault of the program
        except Exception as failure:
            self._internal(failure)
        finally:
            sys.setrecursionlimit(limit)
            self.library.directory = previous
            self.evaluator.unwind(stay=self.interactive and bool(self.options["DEBU"]))
            self.out.flush()
        return INTERNAL_FAILURE if self.internal else EXIT_CODES[self.worst]

    def _program(self, source: SourceText) -> list[Instr]:
        """Parse a text, look for slips in it, match its blocks."""
        program = parse(source)
        if self.options["STRICT"]:
            refuse_long(program)
        slips.mark(source, program)
        annotate(program)
        return program

    def switch_input(self, source: str | int, span: Span) -> None:
        """Do what OPTI DONN asks: read the instructions of a file now, or leave what is being read.

        A file's end, or `OPTI DONN 3` in it, goes back to the instruction after the one that named it.
        `OPTI DONN 5` hands over to the keyboard: a script that is not read at a prompt ends there.
        """
        if isinstance(source, int):
            self.handed_over = source == KEYBOARD
            if self._included or (self.handed_over and not self.interactive):
                raise Resume
            return
        path = Path(source)
        beside = Path(self.library.directory or "") / source
        text = read_script(beside if not path.is_file() and beside.is_file() else path)
        if self._included >= MAX_INCLUDED:
            raise error("G103", "files are read one inside another more than {limit} deep", limit=MAX_INCLUDED)
        self._included += 1
        try:
            self.evaluator.run(self._program(text))
        except Resume:
            if self.handed_over:
                raise
        except GibianeError as failure:
            failure.diagnostic.trace.append(("OPTI DONN", span))
            raise
        finally:
            self._included -= 1

    def _internal(self, failure: Exception) -> None:
        """Turn an unforeseen Python error into G900: the user gets a sentence, --debug the traceback."""
        self.internal = True
        instr = self.evaluator.current
        self.emit(
            make(
                "G900",
                "internal failure: {kind}: {text}",
                kind=type(failure).__name__,
                text=str(failure),
                span=instr.span() if instr is not None else None,
                hint="this is a fault of the program: please report it with this script (--debug shows more)",
            )
        )
        if self.debug:
            raise failure

    def names(self) -> dict[str, Any]:
        """Return every visible name with its value."""
        return self.evaluator.frame.visible()

    def listing(self, value: Any, *, brief: bool = False, width: int | None = None) -> Sequence[str]:
        """Return the lines that LIST prints for a value that is not a scalar."""
        if not isinstance(value, Value):
            raise TypeError(type_of(value))
        return list(value.listing(self, brief, width))


def _value(text: str) -> Any:
    """Return the object that NAME=VALUE defines: a number if the text is one, VRAI/FAUX, else a word."""
    if text.upper() in ("VRAI", "FAUX"):
        return text.upper() == "VRAI"
    for kind in (int, float):
        try:
            return kind(text.upper().replace("D", "E") if kind is float else text)
        except ValueError:
            continue
    return text


def load_operators(session: Session) -> None:
    """Announce the operators of every installed package, without importing what they need."""
    import gibiane.builtins  # noqa: F401  (declares the operators of the language itself)

    for package in _packages():
        package.setup(session)


def _packages() -> list[Any]:
    from importlib.util import find_spec

    found: dict[str, Any] = {}
    if find_spec("gibiane_ops") is not None:
        from importlib import import_module

        found["gibiane_ops"] = import_module("gibiane_ops")
    return list(found.values())
