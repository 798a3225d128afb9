"""Where procedures are found by name: beside the script, here, in ./procedur, and in the shipped library."""

from __future__ import annotations

import os
from pathlib import Path

from gibiane.source import SourceText, decode


def shipped() -> Path | None:
    """Return the folder of the shipped procedures: inside the package, or `scripts/` of a checkout."""
    here = Path(__file__).resolve().parent
    for folder in (here / "scripts", here.parent.parent / "scripts"):
        if folder.is_dir():
            return folder
    return None


class Library:
    """Finds `name.procedur` on the search path; remembers what it has read, by name."""

    def __init__(self) -> None:
        self.directory: str | None = None
        self._shipped: dict[str, Path] | None = None
        self._absent: set[tuple[str, str]] = set()

    def folders(self) -> list[Path]:
        """Return the user's folders, in order of search."""
        first = [Path(self.directory)] if self.directory else []
        return [*first, Path(), Path("procedur")]

    def find(self, word: str) -> SourceText | None:
        """Return the source of the procedure file for `word`, or None."""
        key = (self.directory or "", word)
        if key in self._absent:
            return None
        for folder in self.folders():
            for name in (word.lower(), word):
                path = folder / f"{name}.procedur"
                if path.is_file():
                    return _read(path)
        if self._shipped is None:
            root = shipped()
            found = sorted(root.rglob("*.procedur")) if root else []
            self._shipped = {p.stem.upper(): p for p in found}
        if word in self._shipped:
            path = self._shipped[word]
            return SourceText(f"scripts/{path.name}", decode(path.read_bytes()), str(path.parent))
        self._absent.add(key)
        return None

    def forget_absent(self) -> None:
        """Look again for files that were not there (a new instruction of a REPL may find new ones)."""
        self._absent.clear()

    def names(self) -> list[str]:
        """Return the names of all procedures that can be found, for completion and hints."""
        found = set()
        for folder in {os.path.realpath(f) for f in self.folders()}:
            if Path(folder).is_dir():
                found.update(p.stem.upper() for p in Path(folder).glob("*.procedur"))
        root = shipped()
        if root:
            found.update(p.stem.upper() for p in root.rglob("*.procedur"))
        return sorted(found)


def _read(path: Path) -> SourceText:
    try:
        shown = path.relative_to(Path.cwd())
    except ValueError:
        shown = path
    return SourceText(shown.as_posix(), decode(path.read_bytes()), str(path.parent))
