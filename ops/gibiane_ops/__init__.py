"""The operators: which family declares or extends each name, imported when one is first used."""

from __future__ import annotations

from typing import Any

OPERATORS: dict[str, tuple[str, ...]] = {
    # models, matrices, loads, solution
    "MODELISER": ("gibiane_ops.models",),
    "MATERIAU": ("gibiane_ops.models",),
    "RIGIDITE": ("gibiane_ops.stiffness",),
    "BLOQUER": ("gibiane_ops.loads",),
    "SYMT": ("gibiane_ops.loads",),
    "ANTI": ("gibiane_ops.loads",),
    "DEPIMPOSE": ("gibiane_ops.loads",),
    "FORCE": ("gibiane_ops.loads",),
    "PRESSION": ("gibiane_ops.loads",),
    "FSUR": ("gibiane_ops.loads",),
    "RESO": ("gibiane_ops.solve",),
    "REAC": ("gibiane_ops.solve",),
    "COFR": ("gibiane_ops.contact",),
    # operators of the language with further forms
    "ET": ("gibiane_ops.stiffness",),
}


def setup(session: Any) -> None:
    """Announce the operators to the registry and prepare a session for them."""
    from gibiane.registry import announce

    announce(OPERATORS)
