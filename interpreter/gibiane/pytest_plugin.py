"""Pytest collects every `x.dgibi` that has an `x.out` beside it; `pytest --bless` accepts new outputs."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from gibiane import goldens


class _Mismatch(Exception):
    """What differs, told without a traceback."""


class GoldenItem(pytest.Item):
    """One golden script as a test."""

    golden: goldens.Golden

    def runtest(self) -> None:
        """Run the script and compare; with `--bless` write what differs and show it."""
        needs = self.golden.needs
        if needs and find_spec(needs) is None:
            pytest.skip(f"SKIPPED: the package {needs} is not installed")
        outcome = goldens.run(self.golden)
        problem = goldens.difference(self.golden, outcome)
        if problem is not None and self.config.getoption("--bless") and goldens.bless(self.golden, outcome):
            reporter = self.config.pluginmanager.get_plugin("terminalreporter")
            if reporter is not None:
                reporter.write_line(f"\nblessed {self.golden.expected.name}\n{problem}")
            problem = goldens.difference(self.golden, outcome)
        if problem is not None:
            raise _Mismatch(problem)

    def repr_failure(self, excinfo: Any, style: Any = None) -> Any:
        """Show the difference only, when it is one."""
        if isinstance(excinfo.value, _Mismatch):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Name the test by its script."""
        return self.path, 0, f"golden: {self.name}"


class GoldenFile(pytest.File):
    """A script that is collected as one test."""

    def collect(self) -> Iterator[GoldenItem]:
        """Yield the test of this script."""
        try:
            golden = goldens.read(self.path)
        except goldens.BadHeader as failure:
            raise self.CollectError(str(failure)) from None
        if golden.helper:
            return
        item = GoldenItem.from_parent(self, name=self.path.stem)
        item.golden = golden
        if golden.slow:
            item.add_marker("slow")
        yield item


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--bless`."""
    group = parser.getgroup("gibiane")
    group.addoption("--bless", action="store_true", help="write the new output of golden scripts; shows each change")


def pytest_configure(config: pytest.Config) -> None:
    """Refuse `--bless` where nobody reads the change; make the mark of slow scripts known."""
    if config.getoption("--bless") and os.environ.get("CI"):
        raise pytest.UsageError("--bless is refused when CI is set: outputs are accepted by a person who reads them")
    config.addinivalue_line("markers", "slow: takes minutes rather than seconds")


def pytest_collect_file(parent: pytest.Collector, file_path: Path) -> GoldenFile | None:
    """Collect a script that has its expected output beside it (with `--bless`, any script)."""
    if file_path.suffix != ".dgibi":
        return None
    if not file_path.with_suffix(".out").is_file() and not parent.config.getoption("--bless"):
        return None
    return GoldenFile.from_parent(parent, path=file_path)
