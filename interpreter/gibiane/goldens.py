"""Golden scripts: run `x.dgibi`, compare all that it shows with `x.out`, accept a new output (bless).

A comment line `* golden: rtol=1e-6 atol=1e-12 exit=8 args=N=2` at the top of a script sets how it is compared: numbers
with the two tolerances (default: exactly), the exit code that it must give (default 0), objects defined before it
starts (`args=N=2,M=3`). `slow` marks one that takes minutes, `helper` a script that is no golden itself;
`needs=package` skips it where an optional Python package is not installed.
"""

from __future__ import annotations

import difflib
import io
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from gibiane.session import Session
from gibiane.source import decode

_HEADER = re.compile(r"^\*\s*golden:(.*)$", re.MULTILINE | re.IGNORECASE)
_FIRST_COMMENTS = re.compile(r"(?:\*[^\n]*\n|\s*\n)*")
_NUMBER = re.compile(r"(?<![A-Za-z0-9_.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][+-]?\d+|[+-]\d{3})?(?![A-Za-z0-9_])")
_BLANKS = re.compile(r"\s+")

# What no two runs share: numbers that stand for objects, dates, times of day, durations.
_MASKS = (
    (re.compile(r"\b(pointeur|pointer) \d+"), r"\1 P"),
    (re.compile(r"MAILLAGE +\d+ :"), "MAILLAGE P :"),
    (re.compile(r"\b(?:\d{4}-\d\d-\d\d|\d\d/\d\d/\d{2,4})\b"), "DATE"),
    (re.compile(r"\b\d\d:\d\d:\d\d\b"), "TIME"),
    (re.compile(r"(?<![\w.])\d+(?:\.\d+)? m?s\b"), "T s"),
)


class BadHeader(Exception):
    """A `* golden:` line that cannot be understood."""


@dataclass(frozen=True)
class Golden:
    """One script with the settings of its header."""

    script: Path
    rtol: float = 0.0
    atol: float = 0.0
    exit: int = 0
    args: tuple[str, ...] = ()
    slow: bool = False
    helper: bool = False
    needs: str = ""

    @property
    def expected(self) -> Path:
        """The file that holds the expected output."""
        return self.script.with_suffix(".out")


@dataclass(frozen=True)
class Outcome:
    """What one run showed, normalised, and its exit code."""

    text: str
    code: int


def read(script: Path) -> Golden:
    """Read the header of a script.

    Raises
    ------
    BadHeader
        For a setting that is unknown or has no number where one is wanted.
    """
    text = decode(script.read_bytes())
    top = _FIRST_COMMENTS.match(text)
    settings: dict[str, object] = {}
    for line in _HEADER.findall(top.group() if top else ""):
        for word in line.split():
            name, _, value = word.partition("=")
            try:
                if name in ("rtol", "atol"):
                    settings[name] = float(value)
                elif name == "exit":
                    settings[name] = int(value)
                elif name == "args" and value:
                    settings[name] = tuple(value.split(","))
                elif name == "needs" and value:
                    settings[name] = value
                elif word in ("slow", "helper"):
                    settings[word] = True
                else:
                    raise ValueError
            except ValueError:
                known = "rtol=x atol=x exit=n args=NAME=VALUE needs=package slow helper"
                raise BadHeader(f"{script.name}: '{word}' is no setting of a golden script ({known})") from None
    return Golden(script, **settings)  # type: ignore[arg-type]


def discover(folder: Path, *, all_scripts: bool = False) -> list[Path]:
    """Return the scripts under a folder that have an expected output beside them, or all, in order of name."""
    scripts = sorted(p for p in folder.resolve().rglob("*.dgibi") if p.is_file())
    return [p for p in scripts if all_scripts or p.with_suffix(".out").is_file()]


def run(golden: Golden) -> Outcome:
    """Run a script in a fresh session, inside a temporary copy of its folder's files.

    Output and messages go to one stream, in the order of emission. The script and the files of its folder are
    copied, so that nothing that it writes stays and nothing that it shows depends on where it stands.
    """
    shown = io.StringIO()
    with _workplace(golden.script):
        session = Session(out=shown, err=shown)
        for text in golden.args:
            if not session.define(text):
                raise BadHeader(f"{golden.script.name}: '{text}' is not NAME=VALUE")
        text = decode(golden.script.read_bytes())
        code = session.run_text(text, golden.script.name, directory="")
    return Outcome(normalise(shown.getvalue()), code)


@contextmanager
def _workplace(script: Path) -> Iterator[None]:
    """Stand in a temporary folder that holds copies of the files the script may read; nobody is at the keyboard."""
    before = Path.cwd()
    text = decode(script.read_bytes())
    with tempfile.TemporaryDirectory(prefix="gibiane-") as name:
        for path in script.resolve().parent.iterdir():
            if path.is_file() and (path.suffix not in (".dgibi", ".out") or path.name in text):
                shutil.copy(path, name)
            elif path.is_dir() and (path.name == "procedur" or f"{path.name}/" in text):
                shutil.copytree(path, Path(name, path.name))
        keyboard, sys.stdin = sys.stdin, io.StringIO()
        os.chdir(name)
        try:
            yield
        finally:
            os.chdir(before)
            sys.stdin = keyboard


def normalise(text: str) -> str:
    """Mask what changes from run to run and strip trailing blanks; end with one line end, or be empty."""
    for pattern, mask in _MASKS:
        text = pattern.sub(mask, text)
    lines = [line.rstrip() for line in text.split("\n")]
    while lines and not lines[-1]:
        lines.pop()
    return "".join(line + "\n" for line in lines)


def difference(golden: Golden, outcome: Outcome) -> str | None:
    """Compare an outcome with what is expected; return what to tell, or None when all agrees."""
    problems: list[str] = []
    if golden.expected.is_file():
        expected = normalise(decode(golden.expected.read_bytes())).splitlines()
        found = _settle(expected, outcome.text.splitlines(), golden)
        name = golden.script.stem
        diff = difflib.unified_diff(expected, found, f"{name}.out (expected)", f"{name} (this run)", lineterm="")
        problems.extend(diff)
    else:
        problems.append(f"{golden.expected.name} is missing (--bless writes it)")
    if outcome.code != golden.exit:
        problems.append(f"exit code {outcome.code}; the header of the script says {golden.exit}")
    return "\n".join(problems) or None


def bless(golden: Golden, outcome: Outcome) -> bool:
    """Write the outcome as the expected output when they differ; say whether the file changed."""
    if golden.expected.is_file() and difference(golden, Outcome(outcome.text, golden.exit)) is None:
        return False
    golden.expected.write_text(outcome.text, encoding="utf-8")
    return True


def _settle(expected: list[str], found: list[str], golden: Golden) -> list[str]:
    """Return the found lines, those that agree within the tolerances replaced by the expected ones."""
    if not (golden.rtol or golden.atol):
        return found
    settled = list(found)
    matcher = difflib.SequenceMatcher(None, [_skeleton(e) for e in expected], [_skeleton(f) for f in found], False)
    for first, second, size in matcher.get_matching_blocks():
        for i in range(size):
            if _close(expected[first + i], found[second + i], golden):
                settled[second + i] = expected[first + i]
    return settled


def _skeleton(line: str) -> str:
    """Return a line with its numbers and the widths of its blanks taken out."""
    return _BLANKS.sub(" ", _NUMBER.sub(" # ", line)).strip()


def _close(expected: str, found: str, golden: Golden) -> bool:
    pairs = zip(_NUMBER.findall(expected), _NUMBER.findall(found), strict=True)
    return all(a == b or _near(_value(a), _value(b), golden) for a, b in pairs)


def _near(expected: float, found: float, golden: Golden) -> bool:
    return abs(found - expected) <= golden.atol + golden.rtol * abs(expected)


def _value(text: str) -> float:
    plain = text.replace("D", "E").replace("d", "e")
    if "E" not in plain.upper() and (sign := max(plain.rfind("+"), plain.rfind("-"))) > 0:
        plain = f"{plain[:sign]}E{plain[sign:]}"  # a three-digit exponent drops its letter: 1.00000+101
    return float(plain)


def main(folder: Path, *, accept: bool, write: Callable[[str], object]) -> int:
    """Run every golden script under a folder, tell what differs, end with a summary; return 0 or 1."""
    folder = folder.resolve()
    failed = blessed = count = 0
    for script in discover(folder, all_scripts=accept):
        name = script.relative_to(folder).as_posix()
        try:
            golden = read(script)
            if golden.helper:
                continue
            if golden.needs and find_spec(golden.needs) is None:
                write(f"SKIPPED {name}: the package {golden.needs} is not installed\n")
                continue
            count += 1
            outcome = run(golden)
        except BadHeader as failure:
            failed += 1
            write(f"FAILED {name}\n{failure}\n")
            continue
        problem = difference(golden, outcome)
        if accept and problem is not None and bless(golden, outcome):
            blessed += 1
            write(f"blessed {name}\n{problem}\n")
            problem = difference(golden, outcome)
        if problem is not None:
            failed += 1
            write(f"FAILED {name}\n{problem}\n")
    if not count:
        write(f"no golden scripts (x.dgibi beside x.out) under {folder.as_posix()}\n")
        return 1
    tail = f", {blessed} blessed" if accept else ""
    write(f"{count} golden scripts: {count - failed} passed, {failed} failed{tail}\n")
    return 1 if failed else 0
