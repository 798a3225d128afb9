"""LISTCHPO and LISTOBJE: lists of objects of one type. A list is changed by REMPLACER only."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from gibiane.values import CHPOINT, LISTCHPO, LISTOBJE, Value, type_of

OBJECTS_A_LINE = 10


class ObjectList(Value):
    """What LISTCHPO and LISTOBJE share: objects in order, by reference."""

    heading = ""

    def __init__(self, objects: Sequence[Any]) -> None:
        self.objects = tuple(objects)

    def __len__(self) -> int:
        return len(self.objects)

    @property
    def kind(self) -> str | None:
        """The type of the objects, None in an empty list."""
        return type_of(self.objects[0]) if self.objects else None

    def replace(self, objects: Sequence[Any]) -> None:
        """Give the list its content."""
        self.objects = tuple(objects)

    def same(self, other: Any) -> bool:
        """Say whether another list of this type holds the same objects."""
        return (
            isinstance(other, type(self))
            and len(other) == len(self)
            and all(a is b or a == b for a, b in zip(self.objects, other.objects, strict=True))
        )

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the heading and the numbers that stand for the objects, ten a line unless told otherwise."""
        yield session.listed(self.heading, p=session.ordinal(self), n=len(self), type=self.kind or "")
        if brief:
            return
        step = width or OBJECTS_A_LINE
        for start in range(0, len(self), step):
            yield "".join(f"{session.brief(each):>8}" for each in self.objects[start : start + step])


class ListChpo(ObjectList):
    """A LISTCHPO: nodal fields."""

    type_name = LISTCHPO
    heading = " LISTCHPO de pointeur {p} contenant {n} champ(s) par points"

    @property
    def kind(self) -> str:
        """The type of the objects."""
        return CHPOINT


class ListObje(ObjectList):
    """A LISTOBJE: objects of one type."""

    type_name = LISTOBJE
    heading = " LISTOBJE de pointeur {p} contenant {n} objet(s) {type}"
