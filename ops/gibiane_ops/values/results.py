"""How many results the user asks for, for operators whose last results are optional."""

from __future__ import annotations

from typing import Any

from gibiane.registry import Context


def wanted_results(ctx: Context) -> int:
    """Return the number of names on the left of `=` when the operator stands alone on the right, else 1."""
    instruction: Any = ctx.session.evaluator.current
    if instruction is None or not any(item is ctx.node for item in instruction.items):
        return 1
    return max(len(instruction.targets), 1)
