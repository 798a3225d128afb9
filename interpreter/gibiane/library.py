"""Where procedures are found by name: beside the script, here, in ./procedur, and in the shipped library."""

from __future__ import annotations

import os
from pathlib import Path

from gibiane.diagnostics import error, nearest
from gibiane.source import NotText, SourceText, decode


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
        found: set[str] = set()
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


def read_script(path: Path) -> SourceText:
    """Read a script file.

    Raises
    ------
    GibianeError
        1130 when it cannot be opened, G101 when it is no text.
    """
    try:
        data = path.read_bytes()
    except IsADirectoryError:
        raise error(1130, "{path} is a folder, not a script", path=path.as_posix()) from None
    except OSError as failure:
        close = _similar_file(path)
        raise error(
            1130,
            "the script {path} cannot be opened ({reason})",
            path=path.as_posix(),
            reason=(failure.strerror or "cannot be read").lower(),
            close=close,
            hint="did you mean {close}?" if close else None,
        ) from None
    try:
        return SourceText(path.as_posix(), decode(data), str(path.parent))
    except NotText as failure:
        raise error(
            "G101",
            "{path} is not a text file (a NUL byte at offset {offset})",
            path=path.as_posix(),
            offset=failure.offset,
        ) from None


def _similar_file(path: Path) -> str | None:
    if not path.parent.is_dir():
        return None
    names = [p.name for p in path.parent.iterdir() if p.is_file()]
    close = nearest(path.name, names, 3)
    if close is None and path.name + ".dgibi" in names:
        close = path.name + ".dgibi"
    return (path.parent / close).as_posix() if close else None
