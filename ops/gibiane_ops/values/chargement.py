"""CHARGEME: fields that vary with time, each under a name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gibiane.values import CHARGEME, Value
from gibiane_ops.values.algebra import Field, added, mapped
from gibiane_ops.values.nodes import FloatArray


@dataclass(frozen=True, eq=False)
class Load:
    """A load: `fields[i]` at `times[i]`, or one field times `factors[i]` at `times[i]`; linear in between.

    Attributes
    ----------
    name : str
    times : (n,) float64, increasing
    fields : sequence of Field
        One, or one per time.
    factors : (n,) float64 or None
    """

    name: str
    times: FloatArray
    fields: Sequence[Field]
    factors: FloatArray | None = None

    def at(self, t: float) -> Field:
        """Return the field at a time between the first and the last."""
        if self.factors is not None:
            factor = float(np.interp(t, self.times, self.factors))
            return mapped(self.fields[0], lambda v: factor * v)
        after = min(max(int(np.searchsorted(self.times, t)), 1), len(self.times) - 1)
        first, last = self.times[after - 1], self.times[after]
        share = float((t - first) / (last - first))
        before, behind = self.fields[after - 1], self.fields[after]
        if share in (0.0, 1.0):
            return behind if share else before
        return added(mapped(before, lambda v: (1 - share) * v), mapped(behind, lambda v: share * v))


class Chargement(Value):
    """One or several loads."""

    type_name = CHARGEME

    def __init__(self, loads: Sequence[Load]) -> None:
        self.loads = list(loads)

    @property
    def names(self) -> list[str]:
        """Names of the loads, each once."""
        return list(dict.fromkeys(load.name for load in self.loads))

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the lines that LIST prints."""
        yield f" CHARGEME de pointeur {session.ordinal(self)} contenant {len(self.loads)} chargement(s)"
        for load in self.loads:
            kind = load.fields[0].type_name
            yield f" {load.name:<4} : {kind} de {load.times[0]:g} a {load.times[-1]:g}, {len(load.times)} instant(s)"
