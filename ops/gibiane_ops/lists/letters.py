"""CHANGER of words: capitals and small letters."""

from __future__ import annotations

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend
from gibiane.values import MOT


@extend("CHANGER").form(
    Key(("MAJUSCULE", "MINUSCULE"), "capitals, or small letters", name="how", required=True),
    Arg("word", MOT, "word"),
    gives=[MOT],
)
def _letters(ctx: Context, how: str, word: str) -> str:
    return word.upper() if how == "MAJUSCULE" else word.lower()
