"""The command line: run, repl, check, info, test, docs.

Exit codes: 0 4 8 12 by the highest error level; 2 wrong usage, 70 internal failure, 130 interrupted.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

USAGE = """\
usage: gibiane FILE [NAME=VALUE ...]    run a script (- reads it from standard input)
       gibiane                          work at the prompt
       gibiane -c TEXT                  run a text
       gibiane -i FILE [NAME=VALUE ...] run a script and stay at the prompt
       gibiane check FILE...            parse only: report syntax errors
       gibiane info NAME                describe an operator, a procedure or a code (G405)
       gibiane test DIR [--bless]       run golden scripts: x.dgibi against x.out
       gibiane docs [--check] [FILE]    write OPERATORS.md, or say whether it is stale
options: --echo N  --lang fr|en  --workers N  --dask tcp://HOST:PORT (who runs ASSI 'TOUS')
          --allow-exec  --debug  --version  --help
         --strict  refuse what Cast3M refuses for its length: instructions of more than 500 characters
"""


class _Usage(Exception):
    """A wrong command line."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(encoding="utf-8", errors="replace")
    try:
        return _dispatch(arguments)
    except _Usage as failure:
        sys.stderr.write(f"gibiane: {failure}\n{USAGE}")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        return 130
    except BrokenPipeError:
        sys.stderr.close()
        return 0


def _dispatch(arguments: list[str]) -> int:
    options, rest = _options(arguments)
    if options.get("help"):
        sys.stdout.write(USAGE)
        return 0
    if options.get("version"):
        from gibiane import __version__

        sys.stdout.write(f"gibiane {__version__}\n")
        return 0
    if not rest:
        return _interactive(options, None, [])
    command, operands = rest[0], rest[1:]
    if command == "-c":
        if len(operands) < 1:
            raise _Usage("-c needs a text")
        session = _session(options, operands[1:])
        return _finish(session, session.run_text(operands[0], "<command>"))
    if command == "-i":
        if not operands:
            raise _Usage("-i needs a script")
        return _interactive(options, operands[0], operands[1:])
    if command in _COMMANDS and not Path(command).is_file():
        return int(_COMMANDS[command](options, operands))
    if command == "-":
        session = _session(options, operands)
        return _finish(session, session.run_text(_stdin(), "<stdin>"))
    if command.startswith("-"):
        raise _Usage(f"unknown option {command}")
    session = _session(options, operands)
    code = session.run_file(command)
    if session.handed_over and sys.stdin.isatty():  # OPTI DONN 5 ;
        from gibiane.repl import run

        session.interactive = True
        return run(session)
    return _finish(session, code)


def _stdin() -> str:
    from gibiane.source import decode

    return decode(sys.stdin.buffer.read())


def _options(arguments: list[str]) -> tuple[dict[str, Any], list[str]]:
    """Split the options that start with -- from the rest (they may stand anywhere)."""
    options: dict[str, Any] = {}
    rest: list[str] = []
    i = 0
    while i < len(arguments):
        word = arguments[i]
        if word in ("--echo", "--lang", "--workers", "--dask"):
            if i + 1 == len(arguments):
                raise _Usage(f"{word} needs a value")
            value = arguments[i + 1]
            if word == "--echo" and value not in ("-1", "0", "1", "2"):
                raise _Usage("--echo needs -1, 0, 1 or 2")
            if word == "--lang" and value not in ("fr", "en"):
                raise _Usage("--lang needs fr or en")
            if word == "--workers" and not (value.isdigit() and int(value) <= 1024):
                raise _Usage("--workers needs a number of processes, 0 to 1024")
            options[word[2:]] = value
            i += 2
            continue
        if word in (
            "--strict",
            "--allow-exec",
            "--debug",
            "--version",
            "--help",
            "--check",
            "--bless",
            "--portability",
        ):
            options[word[2:]] = True
        elif word == "-h":
            options["help"] = True
        elif word == "-c":
            rest.extend(arguments[i:])
            break
        elif word.startswith("--"):
            raise _Usage(f"unknown option {word}")
        else:
            rest.append(word)
        i += 1
    return options, rest


def _session(options: dict[str, Any], assignments: Sequence[str], *, interactive: bool = False) -> Any:
    from gibiane.session import Session

    session = Session(interactive=interactive, colour=sys.stderr.isatty())
    session.debug = bool(options.get("debug"))
    if "echo" in options:
        session.options["ECHO"] = int(options["echo"])
    if "lang" in options:
        session.options["LANG"] = "FRAN" if options["lang"] == "fr" else "ANGL"
    if "workers" in options:
        session.options["ASSI"] = int(options["workers"])
    if "dask" in options:
        session.options["DASK"] = options["dask"]
    session.options["EXEC"] = bool(options.get("allow-exec"))
    session.options["STRICT"] = bool(options.get("strict"))
    for text in assignments:
        if not session.define(text):
            raise _Usage(f"'{text}' is not NAME=VALUE")
    return session


def _finish(session: Any, code: int) -> int:
    """Say the error level of the run, on stderr, when there is one (or ECHO asks for it)."""
    if session.worst >= 1 or session.options["ECHO"] >= 1:
        session.out.flush()
        session.err.write(
            f" **********     Arret du programme Gibiane. Niveau d'erreur: {session.worst}     **********\n"
        )
    return code


def _interactive(options: dict[str, Any], script: str | None, assignments: Sequence[str]) -> int:
    if script is None and not sys.stdin.isatty():
        session = _session(options, assignments)
        return _finish(session, session.run_text(_stdin(), "<stdin>"))
    session = _session(options, assignments, interactive=True)
    from gibiane.repl import run

    if script is not None:
        session.run_file(script)
        session.finished = False
    return run(session)


def _check(options: dict[str, Any], files: list[str]) -> int:
    if not files:
        raise _Usage("check needs at least one file")
    from gibiane.check import problems

    session = _session(options, [])
    missing = 0
    for name in files:
        source = session.open(name)
        if source is None:
            continue
        for diagnostic in problems(source, strict=bool(options.get("strict"))):
            session.emit(diagnostic)
        if options.get("portability"):
            missing += _portability(session, source)
    return 8 if session.worst >= 2 or missing else 0


def _portability(session: Any, source: Any) -> int:
    """List the operators and procedures of Cast3M that a script calls and that are not here; return their number."""
    from gibiane.check import missing_names

    def has(word: str) -> bool:
        return session.operator(word) is not None or session.library.find(word) is not None

    session.library.directory = source.directory
    found = missing_names(source, has)
    names = "name of Cast3M is" if len(found) == 1 else "names of Cast3M are"
    session.write(f"{source.name}: {len(found) or 'no'} {names} missing here")
    for item in found:
        times = "" if item.count == 1 else f", {item.count} times"
        near = f"  nearest here: {item.near}" if item.near else ""
        session.write(f"  {item.name:<10} line {item.line}{times}{near}")
    return len(found)


def _info(options: dict[str, Any], names: list[str]) -> int:
    if len(names) != 1:
        raise _Usage("info needs one name")
    session = _session(options, [])
    return int(session.run_text(f"INFO {names[0]} ;", "<command>"))


def _docs(options: dict[str, Any], files: list[str]) -> int:
    from gibiane import cast3m
    from gibiane.notice import markdown

    session = _session(options, [])
    missing = {
        name: near
        for name, near in cast3m.names().items()
        if session.operator(name) is None and session.library.find(name) is None
    }
    path = Path(files[0] if files else "OPERATORS.md")
    text = markdown(missing)
    if options.get("check"):
        fresh = path.is_file() and path.read_text(encoding="utf-8") == text
        sys.stdout.write(f"{path} is {'fresh' if fresh else 'stale: run `gibiane docs`'}\n")
        return 0 if fresh else 1
    path.write_text(text, encoding="utf-8")
    sys.stdout.write(f"{path} written\n")
    return 0


def _test(options: dict[str, Any], folders: list[str]) -> int:
    if len(folders) != 1 or not Path(folders[0]).is_dir():
        raise _Usage("test needs a folder of golden scripts")
    if options.get("bless") and os.environ.get("CI"):
        raise _Usage("--bless is refused when CI is set")
    from gibiane import goldens

    return goldens.main(Path(folders[0]), accept=bool(options.get("bless")), write=sys.stdout.write)


_COMMANDS = {"check": _check, "info": _info, "test": _test, "docs": _docs}
