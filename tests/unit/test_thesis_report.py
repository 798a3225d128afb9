"""The report of examples/these, made by its script and read in a real browser."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from browser import Browser, find_browser

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
@pytest.mark.skipif(find_browser() is None, reason="SKIPPED LOUDLY: no Chromium, the report is not looked at")
def test_the_short_report_of_the_thesis(tmp_path: Path) -> None:
    shutil.copy(ROOT / "examples" / "these" / "rapport.dgibi", tmp_path)
    paths = os.pathsep.join(str(ROOT / folder) for folder in ("interpreter", "ops"))
    run = subprocess.run(
        [sys.executable, "-m", "gibiane", "--workers", "2", "rapport.dgibi"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=1200,
    )
    assert "the report: results/rapport.html" in run.stdout, run.stderr
    file = tmp_path / "results" / "rapport.html"
    assert not re.search(r"https?://(?!www\.w3\.org)", file.read_text(encoding="utf-8"))
    browser = Browser(tmp_path / "profile")
    try:
        browser.open(file, "location.pathname.endsWith('rapport.html') && gibiane.data !== null")
        pages = browser.value("gibiane.data.pages.length")
        assert pages == 18
        for page in range(pages):
            browser.value(f"gibiane.open({page})")
        browser.wait("Object.keys(gibiane.views).length >= 6")
        titles = browser.value("gibiane.data.pages.map((p) => p.title)")
        assert {"Cost, footing", "Cost, wall", "Published", "Wall, loads"} <= set(titles)
        # every axis can be read, and every published number that is not found again says why
        axes = "Object.values(gibiane.charts).flatMap((c) => [c.x.ticks(46), c.y.ticks(26)])"
        assert browser.value(f"Math.min(...{axes}.map((a) => a.filter((t) => t[1]).length))") >= 3
        rows = browser.value("gibiane.data.pages.find((p) => p.title === 'Published').blocks[1].rows")
        assert len(rows) > 90
        assert [row[0] for row in rows if row[4] and not row[5]] == []
        # cost charts hold measured errors, hp too; what was estimated stands in a table, with the share that it finds
        costs = browser.value(
            "gibiane.data.pages.filter((p) => p.title.startsWith('Cost')).map((p) => "
            "[p.blocks.find((b) => b.kind === 'chart').curves.map((c) => c.name), p.blocks.at(-1).rows])"
        )
        assert len(costs) == 5
        for names, estimates in costs:
            assert any(name.endswith("adapted hp") for name in names)
            assert {row[1] for row in estimates} == {"MOYE", "SPR"}
            assert all(0 < row[4] < 100 and row[5] == pytest.approx(row[3] / row[4]) for row in estimates)
        assert browser.value("gibiane.errors.length") == 0
        assert browser.complaints == []
    finally:
        browser.close()
