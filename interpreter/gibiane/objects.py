"""Objects and methods: `O % M args` calls, `%X` reads an attribute inside a method."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gibiane.binding import Operands
from gibiane.diagnostics import GibianeError, make

if TYPE_CHECKING:
    from gibiane.evaluator import Evaluator


def resolve(ev: Evaluator, q: Operands, i: int) -> int:
    """Resolve the `%` at position `i` of a queue; return where to go on."""
    raise GibianeError(make(251, "objects and their methods are not available yet", span=q.span(q.nodes[i]),
                            hint="use a TABLE and procedures"))
