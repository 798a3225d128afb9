"""What operators ask of element fields: which is the stress, which the material, and the elastic laws of a zone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels import materials
from gibiane_ops.values.algebra import Incompatible, restricted
from gibiane_ops.values.champs import ChamZone, MChaml
from gibiane_ops.values.failures import worded
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
        ctx.fail(21, "the model has no solid", at=at, hint="contact, pressure and heat are no elastic solids")
    return model.zones


def field_zones(ctx: Context, model: Modele) -> list[ModelZone]:
    """Return the zones of a model that carry element fields: solids, zones of heat, surfaces under pressure."""
    return [*model.zones, *model.heated, *model.loads] or solid_zones(ctx, model)


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


def properties(
    ctx: Context, field: MChaml, zone: ModelZone, names: Sequence[str], at: str | None = None, hint: str | None = None
) -> FloatArray:
    """Return properties of a zone: (k,) if uniform, else one row per element, (m, k); error 46 when one is missing."""
    values = on_zone(ctx, field, zone, at)
    missing = [n for n in names if n not in values.names]
    if missing:
        ctx.fail(46, "the property {name} is missing", at=at, name=missing[0], hint=hint)
    table = np.stack([values.component(n)[:, 0] for n in names], axis=1)
    return table[0] if len(table) and not np.ptp(table, axis=0).any() else table


# Of an orthotropic material: moduli that each mode needs, and what the absent ones count for.
MODULI = ("YG1", "YG2", "YG3", "NU12", "NU13", "NU23", "G12", "G13", "G23")
NEEDED = {
    "CONT": ("YG1", "YG2", "NU12", "G12"),
    "DEFO": ("YG1", "YG2", "YG3", "NU12", "NU23", "NU13", "G12"),
    "AXIS": ("YG1", "YG2", "YG3", "NU12", "NU23", "NU13", "G12"),
    "TRID": ("YG1", "YG2", "YG3", "NU12", "NU23", "NU13", "G12", "G23", "G13"),
}
AXES = {2: ("V1X", "V1Y"), 3: ("V1X", "V1Y", "V1Z", "V2X", "V2Y", "V2Z")}


def material_axes(ctx: Context, field: MChaml, zone: ModelZone, at: str | None = None) -> FloatArray | None:
    """Return the axes of orthotropy by rows, (3, 3) or (m, 3, 3); None when they are those of space."""
    if AXES[zone.dim][0] not in on_zone(ctx, field, zone, at).names:
        return None
    given = properties(ctx, field, zone, AXES[zone.dim], at)
    first, second = np.zeros((2, *given.shape[:-1], 3))
    first[..., : zone.dim] = given[..., : zone.dim]
    if zone.dim == 3:
        second[...] = given[..., 3:]
    else:
        second[..., 0], second[..., 1] = -first[..., 1], first[..., 0]
    return np.stack([first, second, np.cross(first, second)], axis=-2)


def _orthotropic(
    ctx: Context, field: MChaml, zone: ModelZone, at: str | None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray | None, str]:
    """Return E, nu, G (k, 3), axes and mode; moduli that a plane mode does not feel are set to harmless values."""
    mode = zone.mode.split()[-1]
    needed = NEEDED[mode]
    given = properties(ctx, field, zone, needed, at, "an orthotropic solid needs here " + " ".join(needed))
    columns = {name: given[..., i] for i, name in enumerate(needed)}
    one, zero = np.ones_like(given[..., 0]), np.zeros_like(given[..., 0])
    neutral = {"YG": columns["YG1"], "NU": zero, "G1": one, "G2": one}
    table = np.stack([columns.get(name, neutral[name[:2]]) for name in MODULI], axis=-1)
    return table[..., :3], table[..., 3:6], table[..., 6:], material_axes(ctx, field, zone, at), mode


def _bar(ctx: Context, field: MChaml, zone: ModelZone, at: str | None) -> FloatArray:
    """Return Young's modulus times section, (1, 1) or (m, 1, 1)."""
    given = properties(ctx, field, zone, ("YOUN", "SECT"), at, "a bar needs YOUN and SECT (its section)")
    return np.asarray((given[..., 0] * given[..., 1])[..., None, None], np.float64)


def elastic_law(ctx: Context, field: MChaml, zone: ModelZone, at: str | None = None) -> FloatArray:
    """Return the matrix that gives stresses from strains: (c, c) if uniform, else (m, c, c)."""
    if zone.bars:
        return _bar(ctx, field, zone, at)
    if zone.orthotropic:
        with worded(ctx, at=at):
            return materials.orthotropic(*_orthotropic(ctx, field, zone, at))
    young, nu = elastic_constants(ctx, field, zone, at)
    return materials.isotropic(young, nu, zone.mode.split()[-1])


def elastic_compliance(ctx: Context, field: MChaml, zone: ModelZone, at: str | None = None) -> FloatArray:
    """Return the matrix that gives strains from stresses: (c, c) if uniform, else (m, c, c)."""
    if zone.bars:
        return 1.0 / _bar(ctx, field, zone, at)
    if zone.orthotropic:
        with worded(ctx, at=at):
            return materials.orthotropic_compliance(*_orthotropic(ctx, field, zone, at))
    young, nu = elastic_constants(ctx, field, zone, at)
    return materials.compliance(young, nu, zone.mode.split()[-1])


def expansion(ctx: Context, field: MChaml, zone: ModelZone, at: str | None = None) -> FloatArray:
    """Return the strain of a free body heated by one degree, (c,) if uniform, else (m, c)."""
    if zone.bars:
        return properties(ctx, field, zone, ("ALPH",), at, "the coefficient of thermal expansion")
    mode = zone.mode.split()[-1]
    if not zone.orthotropic:
        alpha = properties(ctx, field, zone, ("ALPH",), at, "the coefficient of thermal expansion")
        return materials.thermal_strain(np.repeat(alpha, 3, axis=-1), None, mode)
    wanted = ("ALP1", "ALP2") if mode == "CONT" else ("ALP1", "ALP2", "ALP3")
    alpha = properties(ctx, field, zone, wanted, at, "the coefficients of thermal expansion along the axes")
    if len(wanted) == 2:
        alpha = np.concatenate([alpha, np.zeros_like(alpha[..., :1])], axis=-1)
    return materials.thermal_strain(alpha, material_axes(ctx, field, zone, at), mode)
