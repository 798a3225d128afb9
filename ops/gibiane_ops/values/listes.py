"""Lists: LISTREEL, LISTENTI, LISTMOTS. The array of a list is never written into; REMPLACER gives it another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibiane.fortran import scientific
from gibiane.values import LISTENTI, LISTMOTS, LISTREEL, Value

WORD_LENGTH = 8
REALS_A_LINE, INTEGERS_A_LINE, WORDS_A_LINE = 10, 20, 10


class NumberList(Value):
    """What LISTREEL and LISTENTI share: a one-dimensional array that nobody writes into."""

    values: NDArray[Any]

    def __len__(self) -> int:
        return len(self.values)

    def same(self, other: Any) -> bool:
        """Say whether another list of this type has the same content."""
        return isinstance(other, type(self)) and bool(np.array_equal(self.values, other.values))

    def _rows(self, images: Sequence[str], width: int) -> Iterator[str]:
        for start in range(0, len(images), width):
            yield "".join(" " + image for image in images[start : start + width])


class ListReel(NumberList):
    """A LISTREEL: `values` is (n,) float64."""

    type_name = LISTREEL

    values: NDArray[np.float64]

    def __init__(self, values: Any) -> None:
        self.replace(values)

    def replace(self, values: Any) -> None:
        """Give the list its content."""
        self.values = np.array(values, dtype=np.float64).reshape(-1)
        self.values.flags.writeable = False

    def item(self, i: int) -> float:
        """Return value `i` (from 0) as a FLOTTANT."""
        return float(self.values[i])

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the heading and the values, ten a line unless told otherwise."""
        heading = " LISTREEL de pointeur {p} contenant {n} reel(s) que voici:"
        yield session.listed(heading, p=session.ordinal(self), n=len(self))
        if not brief:
            yield from self._rows([scientific(x) for x in self.values.tolist()], width or REALS_A_LINE)


class ListEnti(NumberList):
    """A LISTENTI: `values` is (n,) int64."""

    type_name = LISTENTI

    values: NDArray[np.int64]

    def __init__(self, values: Any) -> None:
        self.replace(values)

    def replace(self, values: Any) -> None:
        """Give the list its content."""
        self.values = np.array(values, dtype=np.int64).reshape(-1)
        self.values.flags.writeable = False

    def item(self, i: int) -> int:
        """Return value `i` (from 0) as an ENTIER."""
        return int(self.values[i])

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the heading and the values, twenty a line unless told otherwise."""
        heading = " LISTENTI de pointeur {p} contenant {n} entier(s) que voici:"
        yield session.listed(heading, p=session.ordinal(self), n=len(self))
        if not brief:
            texts = [str(n) for n in self.values.tolist()]
            room = max([5, *map(len, texts)])
            yield from self._rows([text.rjust(room) for text in texts], width or INTEGERS_A_LINE)


class ListMots(Value):
    """A LISTMOTS: words of at most eight characters, trailing blanks dropped."""

    type_name = LISTMOTS

    words: tuple[str, ...]

    def __init__(self, words: Sequence[str]) -> None:
        self.replace(words)

    def replace(self, words: Sequence[str]) -> None:
        """Give the list its content."""
        self.words = tuple(word[:WORD_LENGTH].rstrip() for word in words)

    def __len__(self) -> int:
        return len(self.words)

    def item(self, i: int) -> str:
        """Return word `i` (from 0)."""
        return self.words[i]

    def same(self, other: Any) -> bool:
        """Say whether another LISTMOTS has the same words."""
        return isinstance(other, ListMots) and self.words == other.words

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the heading and the words, ten a line unless told otherwise."""
        heading = " LISTMOTS de pointeur {p} qui contient {n} mot(s) de {k} caractere(s)"
        yield session.listed(heading, p=session.ordinal(self), n=len(self), k=WORD_LENGTH)
        if not brief:
            yield session.listed(" Liste des mots :")
            step = width or WORDS_A_LINE
            for start in range(0, len(self.words), step):
                line = "".join(f" {word:<{WORD_LENGTH}}" for word in self.words[start : start + step])
                yield line.rstrip()


AnyList = ListReel | ListEnti | ListMots


def like(model: AnyList, items: Any) -> AnyList:
    """Return a list of the type of `model` with other items."""
    return type(model)(items)


def items_of(values: AnyList) -> NDArray[Any] | tuple[str, ...]:
    """Return the items of a list: an array, or a tuple of words."""
    return values.words if isinstance(values, ListMots) else values.values
