"""Operands and results that the estimates of a contact solution share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gibiane.registry import Context
from gibiane.values import MCHAML
from gibiane_ops.kernels.estimate.combine import combine, facets_to_cells
from gibiane_ops.values.algebra import SCAL, SCALAIRE
from gibiane_ops.values.champs import ChamZone, ChPoint, MChaml
from gibiane_ops.values.contact import SolvedContact
from gibiane_ops.values.estimates import Guarantee, Parts, add_quality, table_of, without_table
from gibiane_ops.values.maillage import Block, Maillage
from gibiane_ops.values.modele import Modele, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store


class ContactOperands(NamedTuple):
    """What the user gave, each in its place.

    Attributes
    ----------
    model, contact : Modele
        Solids, contact zones (the same object when one model holds both).
    u, reaction : ChPoint
        Displacement and contact forces.
    law : MChaml
        Material of the contact.
    solid : tuple of MChaml or None
        The two or three other element fields: stress, material, smoothed stress, in the order given.
    """

    model: Modele
    contact: Modele
    u: ChPoint
    reaction: ChPoint
    law: MChaml
    solid: tuple[MChaml, MChaml, MChaml | None]


def contact_operands(
    ctx: Context,
    model: Modele,
    mc: Modele | None,
    u: ChPoint,
    rea: ChPoint,
    fields: Sequence[tuple[str, MChaml | None]],
) -> ContactOperands:
    """Tell the operands of a contact estimate apart, in whatever order they came."""
    if mc is None:
        mc = model
    elif model.contacts and not model.zones:
        model, mc = mc, model
    if not any(n in u.names for n in ("UX", "UY", "UZ")) and any(n in rea.names for n in ("UX", "UY", "UZ")):
        u, rea = rea, u
    given = [(name, field) for name, field in fields if field is not None]
    zones = mc.contacts
    of_contact = next((pair for pair in given if zones and pair[1].zone_of(zones[0]) is not None), None)
    if of_contact is None:
        ctx.fail(
            565,
            "no material of the contact model among the operands",
            at="matc",
            hint="MATE MC 'MU' 0.2 makes it, with the same contact model",
        )
    rest = [field for name, field in given if name != of_contact[0]]
    if len(rest) < 2:
        raise ctx.operands.missing(MCHAML, "the stress and the material of the solids")
    return ContactOperands(model, mc, u, rea, of_contact[1], (rest[0], rest[1], rest[2] if len(rest) > 2 else None))


def facet_zones(ctx: Context, state: SolvedContact, squares: Sequence[FloatArray], mode: str) -> list[ChamZone]:
    """Return the contact errors of the slave facets of a zone as zones of a field."""
    zones = []
    for block, values in zip(state.zone.slave.blocks, squares, strict=True):
        surface = Maillage(node_store(ctx), [Block(block.shape, block.cells, block.colours)])
        zone = ModelZone(surface, "CONTACT", (state.zone.law,), mode)
        zones.append(ChamZone(zone, [SCAL], np.sqrt(values)[:, None, None]))
    return zones


def partners(ctx: Context, state: SolvedContact) -> IntArray:
    """Return the master node facing each slave node, by node of the session; -1 elsewhere and on obstacles."""
    partner = np.full(node_store(ctx).count, -1, np.int64)
    partner[state.pairs.pairs[:, 0]] = state.pairs.pairs[:, 1]
    return partner


def shared_out(
    ctx: Context,
    state: SolvedContact,
    blocks: Sequence[tuple[str, IntArray]],
    squares: Sequence[FloatArray],
    totals: Sequence[FloatArray],
) -> list[FloatArray]:
    """Add the squared errors of the facets of a zone to those of the elements, half to each side."""
    shared = facets_to_cells(blocks, state.zone.slave.kernel_blocks, squares, partners(ctx, state))
    return [a + b for a, b in zip(totals, shared, strict=True)]


def contact_results(
    ctx: Context,
    parts: Parts,
    contact: Sequence[FloatArray],
    norm: str | None,
    tabl: bool,
    guarantee: Guarantee,
    facets: Sequence[ChamZone],
    reference: float | MChaml | None,
    more: Mapping[str, Any] | None = None,
) -> Any:
    """Return the solid, contact and total relative errors and their map, or the TABLE of everything."""
    found = combine(parts.errors, contact, "THES" if norm == "THESE" else "USUE")
    columns = zip(found.solid_map, found.contact_map, found.total_map, strict=True)
    zones = [
        ChamZone(zone, ("SOLI", "CONT", "TOTA"), np.stack(column, axis=1)[:, None, :])
        for zone, column in zip(parts.zones, columns, strict=True)
    ]
    field = MChaml(zones, SCALAIRE, "GRAVITE", "error")
    if not tabl:
        without_table(ctx, reference)
        return found.solid, found.contact, found.total, field
    table = table_of(ctx, found, parts, field, norm, guarantee)
    table.set("FACETTE", MChaml(facets, SCALAIRE, "GRAVITE", "error"))
    for index, value in (more or {}).items():
        table.set(index, value)
    squares = [e.error + c for e, c in zip(parts.errors, contact, strict=True)]
    add_quality(ctx, table, parts, found, squares, reference)
    return table


def check_energy(ctx: Context, states: Sequence[SolvedContact], reference: float | MChaml | None) -> None:
    """Refuse the energy of an exact solution with friction: its difference is no measure of the error."""
    if isinstance(reference, float) and any(s.zone.law == "TRESCA" or (s.mu > 0).any() for s in states):
        ctx.fail(
            21,
            "with friction the energy of the exact solution does not tell the error",
            at="refe",
            hint="give the map of the error to a solution on a much finer mesh ('ABSO')",
        )
