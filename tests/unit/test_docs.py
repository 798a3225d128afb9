"""The scripts that documents show run as they stand."""

import io
import re
from pathlib import Path

import pytest

from gibiane.session import Session

DOCS = Path(__file__).parents[2] / "docs"


def test_the_tutorial_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    script = "".join(re.findall(r"^```\n(.*?)^```$", (DOCS / "tutorial.md").read_text(encoding="utf-8"), re.M | re.S))
    out, err = io.StringIO(), io.StringIO()
    assert Session(out=out, err=err).run_text(script, "tutorial") == 0, err.getvalue()
    assert "iterations" in out.getvalue()
    assert len(list(tmp_path.glob("blocs_*.png"))) == 2
