"""EVOLUTIO: curves, each two lists of the same length with their names, a title and a colour."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from gibiane.values import EVOLUTIO, Value
from gibiane_ops.values.listes import AnyList, ListReel

NAME_LENGTH = 12


@dataclass(frozen=True, eq=False)
class Curve:
    """One curve: abscissae, ordinates and how it is shown."""

    x: AnyList
    y: AnyList
    x_name: str = ""
    y_name: str = ""
    title: str = ""
    colour: str = "DEFA"
    kind: str = "REEL"

    def numbers(self) -> tuple[Any, Any] | None:
        """Return abscissae and ordinates as arrays of float64, or None when one is a list of words."""
        if isinstance(self.x, ListReel) and isinstance(self.y, ListReel):
            return self.x.values, self.y.values
        return None


class Evolution(Value):
    """One or several curves."""

    type_name = EVOLUTIO

    def __init__(self, curves: Sequence[Curve]) -> None:
        self.curves = tuple(curves)

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the heading, then each curve with its two lists."""
        heading = " EVOLUTIO de pointeur {p} contenant {n} courbe(s)"
        yield session.listed(heading, p=session.ordinal(self), n=len(self.curves))
        for number, curve in enumerate(self.curves, 1):
            heading = " Courbe {n} : {title}  type {kind}  couleur {colour}"
            yield session.listed(heading, n=number, title=curve.title, kind=curve.kind, colour=curve.colour)
            yield session.listed(" Abscisse : {name}", name=curve.x_name).rstrip()
            yield from curve.x.listing(session, brief, width)
            yield session.listed(" Ordonnee : {name}", name=curve.y_name).rstrip()
            yield from curve.y.listing(session, brief, width)
