"""Numbers from 1, as scripts count, to indices from 0, or error 1068."""

from __future__ import annotations

from gibiane.registry import Context
from gibiane_ops.values.listes import ListEnti


def position(ctx: Context, number: int, size: int, at: str = "i") -> int:
    """Return the index from 0 of a number from 1, or fail with 1068."""
    if not 1 <= number <= size:
        ctx.fail(1068, "there is no number {number}: this object has {size}", at=at, number=number, size=size)
    return number - 1


def positions(ctx: Context, numbers: ListEnti, size: int, at: str = "i") -> list[int]:
    """Return the indices from 0 of a list of numbers from 1."""
    return [position(ctx, number, size, at) for number in numbers.values.tolist()]
