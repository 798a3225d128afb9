"""The scripts that documents show run as they stand."""

import io
import re
from pathlib import Path

import pytest

from gibiane.session import Session

DOCS = Path(__file__).parents[2] / "docs"


def fences(name: str) -> list[tuple[str, str]]:
    """Return the fenced parts of a document: the word behind the fence and the text."""
    text = (DOCS / name).read_text(encoding="utf-8")
    return re.findall(r"^```(\w*)\n(.*?)^```$", text, re.M | re.S)


def test_the_tutorial_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    script = "".join(body for kind, body in fences("tutorial.md") if not kind)
    out, err = io.StringIO(), io.StringIO()
    assert Session(out=out, err=err).run_text(script, "tutorial") == 0, err.getvalue()
    assert "iterations" in out.getvalue()
    assert len(list(tmp_path.glob("blocs_*.png"))) == 2


@pytest.mark.slow
def test_the_adaptation_of_the_tutorial_prints_what_it_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    parts = fences("tutorial.md")
    number = [kind for kind, _ in parts].index("gibiane")
    out, err = io.StringIO(), io.StringIO()
    assert Session(out=out, err=err).run_text(parts[number][1], "tutorial") == 0, err.getvalue()
    assert out.getvalue().splitlines()[-1] == parts[number + 1][1].splitlines()[-1]


def test_what_the_tutorial_shows_is_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first step, whose output no other machine changes."""
    monkeypatch.chdir(tmp_path)
    (_, script), (kind, shown) = fences("tutorial.md")[:2]
    out = io.StringIO()
    assert Session(out=out, err=out).run_text(script, "tutorial") == 0
    assert (kind, out.getvalue()) == ("text", shown)


def test_the_gallery_shows_pictures_and_scripts_that_exist() -> None:
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    links = re.findall(r"\]\((\.\./[^)#]+)\)", text)
    assert len(links) > 25
    assert [link for link in links if not (DOCS / link).exists()] == []
    for place in re.findall(r"`cd (\S+) && gibiane scene\.dgibi", text):
        assert (DOCS.parent / place / "scene.dgibi").is_file(), place
