"""The operators: which family declares or extends each name, imported when one is first used."""

from __future__ import annotations

from typing import Any

OPERATORS: dict[str, tuple[str, ...]] = {
    # lists
    "PROGRESSION": ("gibiane_ops.lists.building",),
    "LECTURE": ("gibiane_ops.lists.building",),
    "MOTS": ("gibiane_ops.lists.building",),
    "EXTRAIRE": ("gibiane_ops.lists.access", "gibiane_ops.fields.components"),
    "VIDE": ("gibiane_ops.lists.building",),
    "INSERER": ("gibiane_ops.lists.editing",),
    "ENLEVER": ("gibiane_ops.lists.editing",),
    "REMPLACER": ("gibiane_ops.lists.editing",),
    "POSITION": ("gibiane_ops.lists.sorting",),
    "ORDONNER": ("gibiane_ops.lists.sorting",),
    "UNIQUE": ("gibiane_ops.lists.sorting",),
    "SOMME": ("gibiane_ops.lists.mathematics",),
    "MASQUER": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.sums"),
    "BORNER": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.sums"),
    "DIMENSION": ("gibiane_ops.lists.access",),
    "COPIER": ("gibiane_ops.lists.access",),
    "+": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "-": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "*": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "/": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "**": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "MAXIMUM": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.sums"),
    "MINIMUM": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.sums"),
    "SIN": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "COS": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "TAN": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "ASIN": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "ACOS": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "ATG": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "EXP": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "LOG": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "SINH": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "COSH": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "TANH": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "ERF": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "ABS": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "SIGNE": ("gibiane_ops.lists.mathematics", "gibiane_ops.fields.arithmetic"),
    "ENTIER": ("gibiane_ops.lists.mathematics",),
    "FLOTTANT": ("gibiane_ops.lists.mathematics",),
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
    # fields and stresses
    "EXCO": ("gibiane_ops.fields.components",),
    "NOMC": ("gibiane_ops.fields.components",),
    "SOMT": ("gibiane_ops.fields.sums",),
    "RESULT": ("gibiane_ops.fields.sums",),
    "XTX": ("gibiane_ops.fields.sums",),
    "XTY": ("gibiane_ops.fields.sums",),
    "PSCAL": ("gibiane_ops.fields.sums",),
    "EPSI": ("gibiane_ops.stress",),
    "SIGMA": ("gibiane_ops.stress",),
    "ELAS": ("gibiane_ops.stress",),
    "BSIGMA": ("gibiane_ops.stress",),
    "ENERGIE": ("gibiane_ops.stress",),
    "VMISES": ("gibiane_ops.stress",),
    "TRESCA": ("gibiane_ops.stress",),
    "PRINCIPAL": ("gibiane_ops.stress",),
    "INVARIANTS": ("gibiane_ops.stress",),
    # operators of the language with further forms
    "ET": ("gibiane_ops.lists.access", "gibiane_ops.stiffness", "gibiane_ops.fields.arithmetic"),
    "EXISTE": ("gibiane_ops.fields.components",),
}


def setup(session: Any) -> None:
    """Announce the operators to the registry and prepare a session for them."""
    from gibiane.registry import announce

    announce(OPERATORS)
