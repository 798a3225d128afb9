"""The files that pictures go to: their names, their numbers, and what happens without matplotlib."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gibiane.registry import Context
from gibiane_ops.kernels.errors import MissingPackage
from gibiane_ops.values.failures import worded

EXTENSIONS = (".png", ".svg", ".pdf")
COLOURS = {
    "DEFA": "",
    "BLEU": "#2f6fb3",
    "ROUG": "#c0392b",
    "ROSE": "#d96a9b",
    "VERT": "#2e8b57",
    "TURQ": "#2aa7a0",
    "JAUN": "#e0b400",
    "BLAN": "#f2f2f2",
    "NOIR": "#1b1f24",
    "VIOL": "#7d4fa8",
    "ORAN": "#d97a26",
    "AZUR": "#6fb1e0",
    "OCEA": "#1c4e80",
    "CYAN": "#22b8cf",
    "OLIV": "#7a8a2a",
    "GRIS": "#9aa0a6",
    "LIME": "#8bc34a",
}
"""Colours of the language on paper."""


def colour(word: str) -> str:
    """Return the colour of a word of the language for the kernel, "" for the default one."""
    return COLOURS.get(word[:4].upper(), "")


def ink(word: str) -> str:
    """Return the colour of lines, points and arrows: white ones would not be seen on paper and take the default."""
    return "" if word[:4].upper() == "BLAN" else colour(word)


def next_path(ctx: Context) -> Path:
    """Return the file of the next picture: name of OPTI 'FTRA' (or traces/trace), number from 001, extension."""
    wanted = ctx.session.options.get("FTRA")
    base = Path(wanted) if isinstance(wanted, str) and wanted.strip() else Path("traces/trace")
    extension = base.suffix.lower() if base.suffix.lower() in EXTENSIONS else ""
    if not extension:
        device = ctx.session.options.get("TRAC")
        extension = f".{device[:3].lower()}" if isinstance(device, str) and device[:3] in ("SVG", "PDF") else ".png"
    stem = base.with_suffix("") if base.suffix.lower() in (*EXTENSIONS, ".ps") else base
    counts: dict[str, int] = ctx.state.setdefault("pictures", {})
    number = counts[stem.as_posix()] = counts.get(stem.as_posix(), 0) + 1
    return stem.with_name(f"{stem.name}_{number:03d}{extension}")


def vtk_draws(ctx: Context) -> bool:
    """Tell whether VTK draws the pictures in space; say once what it lacks when it is installed and cannot start."""
    from gibiane_ops.kernels.plot.vtk_image import DEBIAN_PACKAGES, obstacle

    library = obstacle()
    if library not in (None, "pyvista") and not ctx.state.get("no vtk"):
        ctx.state["no vtk"] = True
        ctx.warn(
            "G202",
            "VTK cannot draw here (no {library}): pictures in space are drawn without it",
            level=0,
            library=library,
            packages=" ".join(DEBIAN_PACKAGES),
            hint="on Debian: apt install {packages}",
        )
    return library is None


def in_window(ctx: Context) -> bool:
    """Tell whether pictures go to a window: at the prompt, on a screen, when OPTI 'FTRA' names no file."""
    if not ctx.session.interactive or ctx.session.options.get("FTRA"):
        return False
    from gibiane_ops.kernels.plot.window import screen_exists

    return screen_exists()


def draw(
    ctx: Context,
    picture: Callable[[Path], None],
    at: str | None = None,
    *,
    window: Callable[[], None] | None = None,
    wait: bool = True,
) -> None:
    """Write the next picture; without matplotlib say so once and go on: pictures never change results.

    At the prompt, on a screen, the picture is shown in a window instead, unless there is nobody to close it (`wait`).
    """
    if wait and in_window(ctx):
        with worded(ctx, at=at):
            _show(picture, window)
        return
    path = next_path(ctx)
    try:
        with worded(ctx, at=at):
            _attempt(ctx, picture, path)
    except OSError as failure:
        ctx.cannot_write(path, failure)


def _show(picture: Callable[[Path], None], window: Callable[[], None] | None) -> None:
    """Open a window: of its own kind, or with the picture in it."""
    if window is not None:
        window()
        return
    from tempfile import TemporaryDirectory

    from gibiane_ops.kernels.plot.window import show_picture

    with TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        picture(path)
        show_picture(path)


def _attempt(ctx: Context, picture: Callable[[Path], None], path: Path) -> None:
    try:
        picture(path)
    except MissingPackage as failure:
        if not ctx.state.get("no pictures"):
            ctx.state["no pictures"] = True
            ctx.warn(
                "G201",
                "no picture is drawn: the package {package} is not installed",
                package=failure.package,
                install=failure.install,
                hint="{install}",
            )
        return
    if ctx.option("ECHO") >= 1:
        ctx.write(f" {ctx.operator.name} : {path.as_posix()}")


def title(ctx: Context, given: str | None) -> str:
    """Return the title of a picture: the one given, else that of OPTI TITR or TITRE."""
    text = given if given is not None else ctx.session.options.get("TITR")
    return text.strip() if isinstance(text, str) else ""
