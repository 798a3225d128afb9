"""DEFORME and VECTEUR: what TRAC draws besides meshes and fields."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from gibiane.values import DEFORME, VECTEUR, Value
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.maillage import Maillage


@dataclass(frozen=True, eq=False)
class Arrow:
    """A nodal field drawn as arrows: components by axis, amplification (None: automatic), colour ("" by default)."""

    field: ChPoint
    names: tuple[str, ...]
    factor: float | None = None
    colour: str = ""


class Vecteur(Value):
    """One or several fields of arrows."""

    type_name = VECTEUR

    def __init__(self, arrows: Sequence[Arrow]) -> None:
        self.arrows = tuple(arrows)

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the lines that LIST prints."""
        yield f" VECTEUR de pointeur {session.ordinal(self)} contenant {len(self.arrows)} champ(s)"
        for arrow in self.arrows:
            yield f" composantes {' '.join(arrow.names)} couleur {arrow.colour or 'DEFA'}"


@dataclass(frozen=True, eq=False)
class Shape:
    """A displaced mesh: amplification (None: automatic), colour, a field shown on it, arrows."""

    mesh: Maillage
    displacement: ChPoint
    factor: float | None = None
    colour: str = ""
    field: ChPoint | MChaml | None = None
    arrows: Vecteur | None = None


class Deforme(Value):
    """One or several displaced meshes."""

    type_name = DEFORME

    def __init__(self, shapes: Sequence[Shape]) -> None:
        self.shapes = tuple(shapes)

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the lines that LIST prints."""
        yield f" DEFORME de pointeur {session.ordinal(self)} contenant {len(self.shapes)} deformee(s)"
        for shape in self.shapes:
            shown = "automatique" if shape.factor is None else f"{shape.factor:g}"
            yield f" {shape.mesh.n_cells} element(s), amplification {shown}, couleur {shape.colour or 'DEFA'}"
