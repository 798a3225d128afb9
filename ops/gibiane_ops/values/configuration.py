"""CONFIGUR: the places of all nodes at one moment."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from gibiane.values import Value
from gibiane_ops.values.nodes import FloatArray, NodeStore

CONFIGUR = "CONFIGUR"


class Configuration(Value):
    """The coordinates of the nodes that existed when it was made.

    Attributes
    ----------
    coords : (n, 3) float64, length
    """

    type_name: ClassVar[str] = CONFIGUR

    def __init__(self, store: NodeStore) -> None:
        self.coords: FloatArray = np.array(store.coords)

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the lines that LIST prints."""
        yield f" CONFIGUR de pointeur {session.ordinal(self)} : {len(self.coords)} point(s)"
