"""The table of G codes and the sources name the same codes."""

import re
from pathlib import Path

from gibiane.diagnostics import G_CODES, LEVELS

ROOT = Path(__file__).parents[3]


def raised() -> set[str]:
    sources = [*ROOT.glob("interpreter/**/*.py"), *ROOT.glob("ops/**/*.py")]
    texts = [path.read_text(encoding="utf-8") for path in sources if path.name != "diagnostics.py"]
    return {code for text in texts for code in re.findall(r'"(G[0-9]{3})"', text)}


def test_every_code_that_is_raised_is_in_the_table_and_the_other_way_round():
    assert raised() == set(G_CODES)


def test_levels_are_those_of_known_codes():
    assert {code for code in LEVELS if code.startswith("G")} <= set(G_CODES)
