"""ERREUR as an operator: difference of fields, error of a stress, error of a contact solution."""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, Refused, extend
from gibiane.values import CHPOINT, ENTIER, FLOTTANT, MCHAML, MMODEL, type_of
from gibiane_ops.kernels.estimate.combine import combine
from gibiane_ops.kernels.estimate.contact import contact_error
from gibiane_ops.kernels.estimate.zz import solid_error
from gibiane_ops.values.algebra import added, values_of
from gibiane_ops.values.champs import ChamZone, ChPoint, MChaml
from gibiane_ops.values.contact import SolvedContact, solved_contacts
from gibiane_ops.values.contact_estimates import (
    check_energy,
    contact_operands,
    contact_results,
    facet_zones,
    shared_out,
)
from gibiane_ops.values.estimates import (
    KIND,
    NORM,
    REFE,
    SMOOTHED,
    TABL,
    Parts,
    field_of,
    results,
    stresses_of,
)
from gibiane_ops.values.failures import worded
from gibiane_ops.values.material import elastic_compliance
from gibiane_ops.values.modele import Modele
from gibiane_ops.values.nodes import FloatArray, node_store
from gibiane_ops.values.smoothed import METHODS, Solid, smoothed

ERRE = extend("ERREUR")

SMOOTHINGS = ("SPRE", "PLEI", "JOIN")
"""Smoothings of LISSER that are no keywords here, by their first letters."""
MIXTURE = 2.0
"""Ratio of stiffnesses in one solid above which a note tells that smoothing mixes them."""

HOW = Key(METHODS, "smoothing of the stresses (as LISSER)", name="method")


@ERRE.form(Arg("a", CHPOINT, "field"), Arg("b", CHPOINT, "field"), gives=[FLOTTANT])
def _difference(ctx: Context, a: ChPoint, b: ChPoint) -> float:
    values = values_of(added(a, b, -1.0))
    return float(np.abs(values).max(initial=0.0))


def _solid_part(
    ctx: Context, model: Modele, stress: MChaml, material: MChaml, method: str, smooth: MChaml | None
) -> Parts:
    solids: list[Solid] = smoothed(ctx, model, stress, method, smooth)
    zones, errors = [], []
    for solid in solids:
        for zone, block in zip(solid.zones, solid.blocks, strict=True):
            compliance = elastic_compliance(ctx, material, zone, "mat")
            _tell_mixture(ctx, compliance)
            with worded(ctx, at="model"):
                errors.append(solid_error(solid.points, block, solid.nodal, compliance, axisymmetric=zone.axisymmetric))
            zones.append(zone)
    return Parts(zones, errors)


def _tell_mixture(ctx: Context, compliance: FloatArray) -> None:
    """Say that the elements of one solid differ much: a smoothed stress runs across their jumps."""
    if compliance.ndim < 3:
        return
    size = np.trace(compliance, axis1=1, axis2=2)
    if size.max() > MIXTURE * size.min():
        ctx.warn(
            "G411",
            "one solid holds materials {ratio} times stiffer than others: its smoothed stress runs across their jumps",
            level=0,
            ratio=f"{size.max() / size.min():.3g}",
            hint="MODE for each material and their union by ET: solids are smoothed apart",
        )


@ERRE.form(
    Arg("model", MMODEL, "model"),
    Arg("sig", MCHAML, "stress"),
    Arg("mat", MCHAML, "material"),
    Arg("smooth", MCHAML, "smoothed stress (LISSER); made here if absent", optional=True),
    HOW,
    KIND,
    NORM,
    TABL,
    REFE,
    gives=[FLOTTANT, MCHAML, "(FLOTTANT)"],
)
def _indicator(
    ctx: Context,
    model: Modele,
    sig: MChaml,
    mat: MChaml,
    smooth: MChaml | None,
    method: str | None,
    kind: str | None,
    norm: str | None,
    tabl: bool,
    refe: Any,
) -> Any:
    stress, material, smooth = stresses_of(ctx, sig, mat, smooth)
    classical = method is None and smooth is None and kind is None and norm is None and not tabl and refe is None
    parts = _solid_part(ctx, model, stress, material, method or ("MOYE" if classical else "SPR"), smooth)
    if classical:
        found = combine(parts.errors)
        shares = [e.error / np.maximum(e.error + e.energy, np.finfo(float).tiny) for e in parts.errors]
        return found.total, field_of(parts.zones, shares)
    return results(ctx, parts, kind, norm, tabl, SMOOTHED, refe)


@ERRE.form(
    Key("CONTACT", "with the contact part", required=True),
    Arg("model", MMODEL, "solids"),
    Arg("sig", MCHAML, "stress"),
    Arg("mat", MCHAML, "material"),
    Arg("mc", MMODEL, "contact model", optional=True),
    Arg("matc", MCHAML, "contact material"),
    Arg("u", CHPOINT, "displacement"),
    Arg("rea", CHPOINT, "contact forces (REAC)"),
    Arg("smooth", MCHAML, "smoothed stress (LISSER); made here if absent", optional=True),
    HOW,
    NORM,
    Key(
        ("DENSITE", "NODE", "DLUM"), "contact part: densities (default), nodal forces, lumped densities", name="variant"
    ),
    TABL,
    REFE,
    gives=[FLOTTANT, FLOTTANT, FLOTTANT, MCHAML],
)
def _with_contact(
    ctx: Context,
    contact: bool,
    model: Modele,
    sig: MChaml,
    mat: MChaml,
    mc: Modele | None,
    matc: MChaml,
    u: ChPoint,
    rea: ChPoint,
    smooth: MChaml | None,
    method: str | None,
    norm: str | None,
    variant: str | None,
    tabl: bool,
    refe: Any,
) -> Any:
    given = contact_operands(ctx, model, mc, u, rea, [("sig", sig), ("mat", mat), ("matc", matc), ("smooth", smooth)])
    stress, material, smooth = stresses_of(ctx, *given.solid)
    parts = _solid_part(ctx, given.model, stress, material, method or "SPR", smooth)
    blocks = [(z.shape, z.cells) for z in parts.zones]
    totals = [np.zeros(len(cells)) for _, cells in blocks]
    facets: list[ChamZone] = []
    states = list(solved_contacts(ctx, given.contact, given.law, given.u, given.reaction))
    check_energy(ctx, states, refe)
    for state in states:
        found, on_facets = _contact_part(ctx, state, (variant or "DENSITE")[:4], parts.zones[0].mode)
        facets += on_facets
        totals = shared_out(ctx, state, blocks, found, totals)
    return contact_results(ctx, parts, totals, norm, tabl, SMOOTHED, facets, refe)


def _contact_part(
    ctx: Context, state: SolvedContact, variant: str, mode: str
) -> tuple[list[FloatArray], list[ChamZone]]:
    """Return the squared contact errors of the slave facets of a zone, and their roots as zones of a field."""
    store = node_store(ctx)
    points = store.coords[:, : state.frames.shape[1]]
    slave = state.zone.slave
    with worded(ctx, at="mc"):
        found = contact_error(
            points,
            slave.kernel_blocks,
            state.pairs.pairs[:, 0],
            state.frames,
            state.force,
            state.relative,
            state.gap,
            state.mu,
            variant,
            axisymmetric=mode == "AXIS",
        )
    return found.facet, facet_zones(ctx, state, found.facet, mode)


@ERRE.stream(syntax="'CONTACT'|... needs a model, a stress and a material")
def _incomplete(ctx: Context, q: Operands) -> Any:
    """Say what the indicator misses, rather than take its keyword for a text to show."""
    present = [type_of(v) for v in q.values]
    if not {MMODEL, MCHAML} & set(present):
        return Refused
    words = {v[:4] for v in q.values if isinstance(v, str)}
    contact, exact = "CONT" in words, "EXAC" in words and "PROC" not in words
    wanted = {MMODEL: 1, MCHAML: 3 if contact or exact else 2, CHPOINT: 2 if contact else 0}
    missing = next((kind for kind, n in wanted.items() if present.count(kind) < n), None)
    what = "stress SIG, material MAT"
    what += ", contact material MATC" if contact else ", exact stress SIGEX" if exact else ""
    names = {
        MMODEL: "the model MODL",
        MCHAML: f"one of its element fields ({what})",
        CHPOINT: "the displacement U or the contact forces REA",
    }
    if missing is None:
        _misread(ctx, q)
    ctx.fail(
        37,
        "the indicator lacks {what}",
        what=names[missing],
        hint="X CH = ERREUR MODL SIG MAT ; XS XC XG CARTE = ERREUR 'CONTACT' MODL SIG MAT MC MATC U REA",
    )


def _misread(ctx: Context, q: Operands) -> NoReturn:
    """Tell the first keyword that no form has, or that what it takes does not follow."""
    keys = [key for form in ctx.operator.forms for key in form.keys]
    for i, word in enumerate(q.values):
        if not isinstance(word, str):
            continue
        mine = [key for key in keys if key.match(word)]
        rest = Operands(q.session, q.source, q.values[i:], q.nodes[i:])
        if not mine and word[:4] in SMOOTHINGS:
            ctx.fail(
                7,
                "'{word}' is a smoothing of LISSER, whose result is given here",
                word=word,
                hint="X CH = ERREUR MODL SIG MAT (LISSER 'SPRE' MODL SIG ...)",
            )
        if not mine:
            raise rest.unknown_keyword(sorted({each for key in keys for each in key.words}))
        takes = [key.args[0] for key in mine if key.args]
        after = type_of(q.values[i + 1]) if i + 1 < len(q) else None
        kinds = {kind for arg in takes for kind in arg.types}
        if len(takes) == len(mine) and after not in kinds and not (after == ENTIER and FLOTTANT in kinds):
            ctx.fail(
                7,
                "after '{word}' comes {wanted}, not {found}"
                if after
                else "after '{word}' comes {wanted}: it is missing",
                word=word,
                wanted="|".join(sorted(kinds)),
                found=after,
                hint="INFO ERREUR tells what each keyword takes",
            )
    ctx.fail(7, "these keywords do not go together", hint="INFO ERREUR shows the forms")
