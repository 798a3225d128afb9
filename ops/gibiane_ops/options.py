"""What the geometry asks of a session: points from bare numbers, and checks of the options that meshes depend on."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from gibiane_ops.makers import MAKERS

if TYPE_CHECKING:
    from gibiane.registry import Context

ELEMENTS = (
    "POI1",
    "SEG2",
    "SEG3",
    "TRI3",
    "TRI6",
    "QUA4",
    "QUA8",
    "TET4",
    "TE10",
    "PYR5",
    "PY13",
    "PRI6",
    "PR15",
    "CUB8",
    "CU20",
)
MODES = {1: ("UNID",), 2: ("PLAN", "AXIS", "FOUR"), 3: ("TRID",)}
DEFAULT_MODE = {1: "UNID PLAN", 2: "PLAN DEFO", 3: "TRID"}


def prepare(session: Any) -> None:
    """Give a session its maker of points, its hints, and its checks of OPTI DIME, ELEM, MODE and COUL."""
    session.point_maker = _point_maker(session)
    session.state["makers"] = MAKERS
    for name, check in (("DIME", _dimension), ("ELEM", _element), ("MODE", _mode), ("COUL", _colour)):
        session.listeners.setdefault(name, []).append(check)


def _point_maker(session: Any) -> Callable[[list[float]], Any]:
    def make(coordinates: list[float]) -> Any:
        from gibiane_ops.values.maillage import Point
        from gibiane_ops.values.nodes import node_store

        store = node_store(session)
        return Point(store, store.add([coordinates], session.options["DENS"])[0])

    return make


def _dimension(ctx: Context, dim: int) -> int:
    old = ctx.option("DIME")
    if dim == old:
        return dim
    store = ctx.state.get("nodes")
    if store is not None and store.count and dim < old:
        beyond = store.coords[:, dim:]
        if beyond.any():
            ctx.fail(
                12,
                "the dimension of space cannot go from {old} to {new}: points have a coordinate beyond",
                at="value",
                level=3,
                old=old,
                new=dim,
                label="points exist outside the smaller space",
                hint="set OPTI DIME once, before the first point",
            )
    mode = ctx.option("MODE")
    if mode is None or not mode.startswith(MODES[dim]):
        ctx.session.options["MODE"] = DEFAULT_MODE[dim]
    return dim


def _element(ctx: Context, word: str) -> str:
    from gibiane.diagnostics import nearest

    name = word[:4].upper()
    if name not in ELEMENTS:
        close = nearest(name, list(ELEMENTS))
        ctx.fail(
            16,
            "there is no element type '{word}'",
            at="value",
            word=word,
            close=close,
            known=" ".join(ELEMENTS),
            hint="did you mean {close}?" if close else "known types: {known}",
        )
    return name


def _mode(ctx: Context, mode: str) -> str:
    dim = ctx.option("DIME")
    if dim and not mode.startswith(MODES[dim]):
        ctx.fail(
            970,
            "the mode {mode} does not go with DIME {dim}",
            at="value",
            mode=mode,
            dim=dim,
            known=" ".join(MODES[dim]),
            hint="in this dimension: {known}; OPTI DIME comes before MODE",
        )
    return mode


def _colour(ctx: Context, word: Any) -> str:
    from gibiane_ops.values.maillage import COLOURS

    name = str(word)[:4]
    if name not in COLOURS:
        ctx.fail(
            1055,
            "there is no colour '{word}'",
            at="value",
            word=word,
            known=" ".join(COLOURS),
            hint="known colours: {known}",
        )
    return name
