"""ERREUR 'CONTACT' 'RDC': constitutive relation error with contact, guaranteed without friction or with Tresca's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gibiane.diagnostics import Text
from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend
from gibiane.values import CHPOINT, ENTIER, FLOTTANT, MCHAML, MMODEL
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.contact_bound import VIOLATION, ContactTractions, contact_tractions
from gibiane_ops.kernels.estimate.cutting import CORNERS
from gibiane_ops.kernels.estimate.joints import Joint
from gibiane_ops.values.champs import ChamZone, ChPoint, MChaml
from gibiane_ops.values.contact import SolvedContact, nodal_property, solved_contacts
from gibiane_ops.values.contact_estimates import (
    check_energy,
    contact_operands,
    contact_results,
    facet_zones,
    shared_out,
)
from gibiane_ops.values.contact_surface import CLOSED, Surface, lost, surface_of
from gibiane_ops.values.equilibrated import COULOMB, check_balance, energy_bounds, equilibrated, guarantee_of, parts_of
from gibiane_ops.values.estimates import NORM, REFE, TABL, stresses_of
from gibiane_ops.values.exterior import LOADS, Side, add_tractions, exterior
from gibiane_ops.values.failures import worded
from gibiane_ops.values.listes import ListReel
from gibiane_ops.values.maillage import Point
from gibiane_ops.values.material import solid_zones
from gibiane_ops.values.modele import Modele
from gibiane_ops.values.nodes import FloatArray, IntArray
from gibiane_ops.values.pieces import ROUND_OFF, Pieces, cut_sides, doubts_of, fields_of, pieces_of
from gibiane_ops.values.rigidite import Rigidite

ERRE = extend("ERREUR")
WORKING = 1e-5
"""Part of the largest work of friction that it may lack: solutions obey the law that well."""

FLAT = 1e-6
"""Largest angle between the normals of facets and nodes of a contact surface that counts as plane."""


@ERRE.form(
    Key("CONTACT", "with the contact part", required=True),
    Key("RDC", "constitutive relation error", required=True),
    Arg("model", MMODEL, "solids; other elements than linear simplices are cut"),
    Arg("sig", MCHAML, "stress"),
    Arg("mat", MCHAML, "material"),
    Arg("mc", MMODEL, "contact model", optional=True),
    Arg("matc", MCHAML, "contact material"),
    Arg("u", CHPOINT, "displacement"),
    Arg("rea", CHPOINT, "contact forces (REAC)"),
    *LOADS,
    Key(
        "BALAYAGES",
        "improvements (2): from the second on with smaller cells where much is left",
        Arg("n", ENTIER),
        name="sweeps",
    ),
    NORM,
    TABL,
    REFE,
    gives=[FLOTTANT, FLOTTANT, FLOTTANT, MCHAML],
)
def _bound_with_contact(
    ctx: Context,
    contact: bool,
    rdc: bool,
    model: Modele,
    sig: MChaml,
    mat: MChaml,
    mc: Modele | None,
    matc: MChaml,
    u: ChPoint,
    rea: ChPoint,
    cl: Rigidite | None,
    pres: list[Any],
    fsur: list[Any],
    volu: Point | None,
    sweeps: int | None,
    norm: str | None,
    tabl: bool,
    refe: Any,
) -> Any:
    given = contact_operands(ctx, model, mc, u, rea, [("sig", sig), ("mat", mat), ("matc", matc)])
    stress, material, _ = stresses_of(ctx, *given.solid)
    zones = solid_zones(ctx, given.model)
    outside = exterior(ctx, zones, cl, pres, fsur)
    states = list(solved_contacts(ctx, given.contact, given.law, given.u, given.reaction))
    check_energy(ctx, states, refe)
    if not all(state.pairs.coincident for state in states):
        ctx.fail(
            251,
            "contact tractions in balance need surfaces whose nodes coincide; these have different meshes",
            at="mc",
            hint="mesh the contact surface once and copy it for the other solid; ERREUR 'CONTACT' without 'RDC' "
            "estimates the error on any meshes",
        )
    pairs = np.concatenate([np.zeros((0, 2), np.int64), *(s.pairs.pairs for s in states)])
    _check_friction(ctx, states)
    pieces = pieces_of(ctx, zones, pairs, None if any(shape(z.shape).degree > 1 for z in zones) else CORNERS)
    check_balance(ctx, pieces, stress, outside, volu, cl, [each for s in states for each in _forces(s)])
    fields = fields_of(ctx, pieces, stress, material)
    boundary = cut_sides(ctx, pieces, outside, fields)
    sides = [boundary.side]
    blocks = [(z.shape, z.cells) for z in zones]
    totals = [np.zeros(len(cells)) for _, cells in blocks]
    facets: list[ChamZone] = []
    doubts: list[Text] = []
    squares: list[list[FloatArray]] = []
    nodal = True
    surfaces = [surface_of(ctx, state, given.law, pieces, cl) for state in states]
    for state, surface in zip(states, surfaces, strict=True):
        found, each = _tractions(ctx, surface, pieces, sides)
        nodal = nodal and found.nodal
        squares.append(each)
        doubts += _doubts(ctx, state, given.law, found)
        if surface.quadratic and surface.opens_in_part(found.traction):
            doubts.append(Text("quadratic contact facets are open in part, and may overlap between their nodes"))
    joint, parts = _joint(states, surfaces, pieces, sides[0], squares)
    solid = equilibrated(ctx, pieces, stress, material, fields, boundary, volu, sweeps, cl, joint, nodal)
    for (square, owner), change in zip(parts, np.split(solid.contact, _ends(parts)), strict=bool(len(solid.contact))):
        np.add.at(square, owner, change)
    for state, each in zip(states, squares, strict=True):
        # The identity of Prager and Synge holds with twice the contact part.
        each = [np.maximum(square, 0.0) for square in each]
        totals = shared_out(ctx, state, blocks, each, totals)
        facets += facet_zones(ctx, state, each, zones[0].mode)
    if solid.excess > VIOLATION:
        doubts.append(_unlawful(solid.excess))
    guarantee = guarantee_of(ctx, solid, doubts + doubts_of(ctx, pieces, boundary.same, fields))
    more: dict[str, Any] = {"EQUILIBRE": solid.residual, "HISTOIRE": ListReel(solid.history)}
    if all(state.zone.law == "UNILATERAL" and _without_gap(state) for state in states):
        more |= energy_bounds(solid, float(sum(each.sum() for each in totals)))
    return contact_results(ctx, parts_of(pieces, solid), totals, norm, tabl, guarantee, facets, refe, more)


def _check_friction(ctx: Context, states: Sequence[SolvedContact]) -> None:
    """Refuse friction on quadratic facets: the length of their slips is no polynomial."""
    for state in states:
        wrong = next((b.shape for b in state.zone.slave.blocks if shape(b.shape).degree > 1), None)
        if wrong is not None and state.zone.law != "UNILATERAL":
            ctx.fail(
                251,
                "with friction contact tractions in balance stand on facets of linear elements only, not on {shape}",
                at="mc",
                shape=wrong,
                hint="without friction ('UNILATERAL') on any; ERREUR 'CONTACT' without 'RDC' gives no bound",
            )


def _forces(state: SolvedContact) -> list[tuple[IntArray, FloatArray]]:
    """Return the contact forces at the nodes of both surfaces, in global axes."""
    slave, master = state.pairs.pairs.T
    force = np.einsum("nij,ni->nj", state.frames, state.force)
    both = master >= 0
    return [(slave, force), (master[both], -force[both])]


def _tractions(
    ctx: Context, surface: Surface, pieces: Pieces, sides: list[Side]
) -> tuple[ContactTractions, list[FloatArray]]:
    """Find the contact tractions of a zone and put them on both of its surfaces; twice the errors of its facets."""
    name = "TRI3" if pieces.zones[0].dim == 3 else "SEG2"
    with worded(ctx, at="mc"):
        found = contact_tractions(
            pieces.cutting.points,
            surface.cells,
            surface.points,
            surface.frames,
            surface.force,
            surface.relative,
            surface.gap,
            surface.mu,
            surface.threshold,
            surface.sure,
            surface.motions,
        )
    count = len(surface.cells) - add_tractions(sides, name, surface.cells, found.traction)
    both = (surface.facing >= 0).all(axis=1)
    there = surface.facing[both]
    count += len(there) - add_tractions(sides, name, there, -found.traction[both])
    if count:
        lost(ctx, count)
    parts = np.split(2 * found.facet, np.cumsum([len(owner) for owner in surface.owner])[:-1])
    return found, [np.bincount(o, p).astype(np.float64) for o, p in zip(surface.owner, parts, strict=True)]


Parts = list[tuple[FloatArray, IntArray]]


def _ends(parts: Parts) -> IntArray:
    """Return where each part but the last ends, laid end to end."""
    return np.cumsum([len(owner) for _, owner in parts])[:-1]


def _joint(
    states: Sequence[SolvedContact],
    surfaces: Sequence[Surface],
    pieces: Pieces,
    side: Side,
    squares: list[list[FloatArray]],
) -> tuple[Joint | None, Parts]:
    """Find the facets that are closed at all their nodes, without a gap in the mesh: their tractions may be improved.

    Pressures, and with Tresca's law friction too; nothing where friction ties the bounds of the tractions to the
    pressures, nor where supports hold a facet: its reactions are no contact, and not opposite on the two bodies. Also
    tells which contact error of `squares`, and which of its facets, each facet of the joint is part of.
    """
    dim = pieces.zones[0].dim
    fixed = side.facets.nodes[np.abs(side.free).max(axis=(1, 2)) > ROUND_OFF]
    points = pieces.cutting.points
    name, parts = np.arange(len(points)), Parts()
    facets, bounds, slips = [np.zeros((0, dim), np.int64)], [np.zeros((0, dim))], [np.zeros((0, dim, dim))]
    for state, surface, own in zip(states, surfaces, squares, strict=True):
        if state.zone.law not in ("UNILATERAL", "TRESCA"):
            continue
        one, two = surface.points, np.where(surface.partner < 0, surface.points, surface.partner)
        held, touching = np.zeros((2, len(points)), bool)
        touching[one], touching[two] = True, True
        held[fixed[touching[fixed].all(axis=1)]] = True
        size = float(np.ptp(points, axis=0).max())
        shut = surface.closed & (np.abs(points[one] - points[two]).max(axis=1) <= CLOSED * size)
        shut &= ~(held[one] | held[two])
        name[one[shut]] = two[shut]
        closed, bound = np.zeros(len(points), bool), np.full(len(points), np.inf)
        slip = np.zeros((len(points), dim))
        closed[one[shut]] = True
        if state.zone.law == "TRESCA":
            bound[one] = surface.threshold
            slip[one] = np.einsum("nij,ni->nj", surface.frames[:, 1:], surface.relative[:, 1:])
        cuts = np.cumsum([len(owner) for owner in surface.owner])[:-1]
        for cells, owner, square in zip(np.split(surface.cells, cuts), surface.owner, own, strict=True):
            kept = closed[cells].all(axis=1)
            cells = cells[kept]
            facets.append(name[cells])
            bounds.append(bound[cells])
            slips.append(slip[cells])
            parts.append((square, owner[kept]))
    error = float(sum(square.sum() for own in squares for square in own))
    joint = Joint(name, np.concatenate(facets), np.concatenate(bounds), np.concatenate(slips), error)
    return (joint if len(joint.closed) or error else None), parts


def _without_gap(state: SolvedContact) -> bool:
    """Say whether the bodies touch everywhere at first: forces across a gap do work."""
    return bool(np.abs(state.gap).max(initial=0.0) <= CLOSED * np.abs(state.relative).max(initial=0.0))


def _unlawful(violation: float) -> Text:
    return Text("no contact tractions in balance obey the law: it is left by {size}", {"size": f"{violation:.2g}"})


def _doubts(ctx: Context, state: SolvedContact, law: MChaml, found: ContactTractions) -> list[Text]:
    """Say what keeps the contact of a zone from being part of a bound."""
    doubts: list[Text] = []
    slave, values = state.pairs.pairs[:, 0], law.zone_of(state.zone)
    size = float(np.abs(state.force).max(initial=0.0))
    convex = state.zone.law in ("UNILATERAL", "TRESCA")
    if not convex and ((state.mu > 0).any() or np.abs(state.force[:, 1:]).max(initial=0.0) > CLOSED * size):
        law_name = state.zone.law
        doubts.append(COULOMB if law_name == "COULOMB" else Text("friction law {law}", {"law": law_name}))
    adhesion = nodal_property(ctx, values, "ADHE", slave)
    if adhesion is not None and (adhesion > 0).any():
        doubts.append(Text("adhesion"))
    open_by = state.gap - state.relative[:, 0]
    far = CLOSED * float(np.abs(state.relative).max(initial=0.0))
    if (-open_by).max(initial=0.0) > max(far, CLOSED * float(np.abs(state.gap).max(initial=0.0))):
        doubts.append(Text("the bodies overlap by {depth}", {"depth": f"{-open_by.min():.2g}"}))
    threshold = nodal_property(ctx, values, "SEUI", slave) if state.zone.law == "TRESCA" else None
    if threshold is not None and ((open_by > far) & (threshold > 0)).any():
        doubts.append(Text("Tresca's bound on pairs that are open, where it jumps to zero"))
    elif threshold is not None:
        bound = threshold * state.pairs.area
        most = float(bound @ np.linalg.norm(state.relative[:, 1:], axis=1))
        lacking = most + float((state.force[:, 1:] * state.relative[:, 1:]).sum())
        if lacking > WORKING * most + CLOSED * state.motion * float(bound.sum()):
            doubts.append(Text("friction does not oppose the slip: does it count from another state, as with 'HIST'?"))
    if not found.admissible:
        doubts.append(_unlawful(found.violation))
    if found.flatness > FLAT:
        doubts.append(Text("the contact surface is not plane"))
    if len(state.pairs.unpaired_slave):
        doubts.append(Text("nodes of the contact surface have no partner"))
    return doubts
