"""Names of Cast3M 2024, so that a script is told what it misses by the name it uses.

Callers ask only about words that nothing here has: the list holds every name, those that exist here included.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path


@cache
def names() -> dict[str, str]:
    """Return the names of operators (four letters) and procedures, each with what is nearest here, or ""."""
    text = Path(__file__).with_name("cast3m_names.txt").read_text(encoding="utf-8")
    found = {}
    for line in text.splitlines():
        if line and not line.startswith("#"):
            name, _, near = line.partition(":")
            found[name.strip()] = near.strip()
    return found


def meant(word: str) -> tuple[str, str] | None:
    """Return the Cast3M name that `word` stands for there and what is nearest to it here, or None.

    A procedure is meant by its whole name, an operator by its four letters, or by a longer spelling without digits.
    """
    known = names()
    if word in known:
        return word, known[word]
    key = word[:4]
    return (key, known[key]) if len(word) > 4 and key in known and word.isalpha() else None
