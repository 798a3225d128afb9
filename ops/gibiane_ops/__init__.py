"""The operators: which family declares or extends each name, imported when one is first used."""

from __future__ import annotations

from typing import Any

OPERATORS: dict[str, tuple[str, ...]] = {}


def setup(session: Any) -> None:
    """Announce the operators to the registry and prepare a session for them."""
    from gibiane.registry import announce

    announce(OPERATORS)
