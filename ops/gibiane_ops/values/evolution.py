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
        yield f" EVOLUTIO de pointeur {session.ordinal(self)} contenant {len(self.curves)} courbe(s)"
        for number, curve in enumerate(self.curves, 1):
            yield f" Courbe {number} : {curve.title}  type {curve.kind}  couleur {curve.colour}".rstrip()
            for role, name, values in (("Abscisse", curve.x_name, curve.x), ("Ordonnee", curve.y_name, curve.y)):
                yield f" {role} : {name}".rstrip(" ")
                yield from values.listing(session, brief, width)
