"""What operators ask of element fields: which is the stress, which the material, and the elastic laws of a zone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels import materials
from gibiane_ops.values.algebra import Incompatible, restricted
from gibiane_ops.values.champs import ChamZone, MChaml
from gibiane_ops.values.modele import Modele, ModelZone
from gibiane_ops.values.nodes import FloatArray

STRESS, STRAIN, MATERIAL = "CONTRAINTES", "DEFORMATIONS", "CARACTERISTIQUES"
_MAKERS = {STRESS: "SIGM or LISSER makes stresses", STRAIN: "EPSI makes strains", MATERIAL: "MATE makes a material"}


def refused(ctx: Context, failure: Incompatible, at: str | None = None) -> NoReturn:
    """Raise the error of two fields that do not go together."""
    ctx.fail(failure.code, failure.template, at=at, **failure.fields)


def told_apart(ctx: Context, fields: Sequence[tuple[str, MChaml | None]], *subtypes: str) -> list[MChaml]:
    """Return the element fields in the order of `subtypes`, whatever order they were given in (error 565)."""
    left = [(name, field) for name, field in fields if field is not None]
    found = []
    for subtype in subtypes:
        match = next((pair for pair in left if pair[1].subtype == subtype), None)
        if match is None:
            wrong = next((pair for pair in left if pair[1].subtype not in subtypes), left[0] if left else None)
            ctx.fail(
                565,
                "no element field of sub-type {subtype} among the operands",
                at=wrong[0] if wrong else None,
                subtype=subtype,
                given=wrong[1].subtype if wrong else "",
                label="this one has the sub-type {given}" if wrong else None,
                hint=_MAKERS.get(subtype),
            )
        left.remove(match)
        found.append(match[1])
    return found


def solid_zones(ctx: Context, model: Modele, at: str = "model") -> list[ModelZone]:
    """Return the solid zones of a model, or fail when it has none."""
    if not model.zones:
        ctx.fail(21, "the model has no solid, only contact", at=at)
    return model.zones


def on_zone(ctx: Context, field: MChaml, zone: ModelZone, at: str | None = None) -> ChamZone:
    """Return the values of a field on a zone of a model, or fail with error 565."""
    found = restricted(field, zone)
    if found is None:
        ctx.fail(
            565,
            "the field of sub-type {subtype} is not defined on every zone of the model",
            at=at,
            subtype=field.subtype,
            hint="make it with the same model",
        )
    return found


def elastic_constants(
    ctx: Context, field: MChaml, zone: ModelZone, at: str | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return Young's modulus and Poisson's ratio of a zone: one value if uniform, else one per element."""
    values = on_zone(ctx, field, zone, at)
    missing = [n for n in ("YOUN", "NU") if n not in values.names]
    if missing:
        ctx.fail(
            46, "the property {name} is missing", at=at, name=missing[0], hint="an elastic solid needs YOUN and NU"
        )
    young, nu = values.component("YOUN")[:, 0], values.component("NU")[:, 0]
    if np.ptp(young) == 0 and np.ptp(nu) == 0:
        return young[0], nu[0]
    return young, nu


def elastic_law(ctx: Context, field: MChaml, zone: ModelZone, at: str | None = None) -> FloatArray:
    """Return the matrix that gives stresses from strains: (c, c) if uniform, else (m, c, c)."""
    young, nu = elastic_constants(ctx, field, zone, at)
    return materials.isotropic(young, nu, zone.mode.split()[-1])


def elastic_compliance(ctx: Context, field: MChaml, zone: ModelZone, at: str | None = None) -> FloatArray:
    """Return the matrix that gives strains from stresses: (c, c) if uniform, else (m, c, c)."""
    young, nu = elastic_constants(ctx, field, zone, at)
    return materials.compliance(young, nu, zone.mode.split()[-1])
