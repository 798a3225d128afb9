"""Gibiane: an interpreter of the Gibiane language. Public surface: Session, run_text, run_file, GibianeError."""

from __future__ import annotations

from pathlib import Path

from gibiane.diagnostics import GibianeError
from gibiane.session import Session

__version__ = "0.1.0"


def run_text(text: str, name: str = "<text>") -> int:
    """Run a script given as text in a new session; return its exit code."""
    return Session().run_text(text, name)


def run_file(path: str | Path) -> int:
    """Run a script file in a new session; return its exit code."""
    return Session().run_file(path)


__all__ = ["GibianeError", "Session", "__version__", "run_file", "run_text"]
