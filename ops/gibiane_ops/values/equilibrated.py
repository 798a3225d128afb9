"""Stresses in equilibrium with given loads, on the zones of a model: what RDC needs, with contact or without."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from gibiane.diagnostics import Text, joined
from gibiane.registry import Context
from gibiane_ops.kernels.errors import NotConverged, NotEquilibrated
from gibiane_ops.kernels.estimate.admissible import SWEEPS, Admissible, admissible_stress, plane_compliance
from gibiane_ops.kernels.estimate.bodies import without_resultants
from gibiane_ops.kernels.estimate.fields import Field
from gibiane_ops.kernels.estimate.joints import Joint
from gibiane_ops.kernels.estimate.macro import STATIC
from gibiane_ops.kernels.estimate.pieces import Source, balanced_stress, uniform_aim
from gibiane_ops.kernels.estimate.simplices import Simplices, simplices
from gibiane_ops.kernels.estimate.tractions import Exterior
from gibiane_ops.kernels.estimate.zz import SolidError
from gibiane_ops.kernels.topology import group_by_nodes
from gibiane_ops.values.balance import unbalanced
from gibiane_ops.values.champs import MChaml
from gibiane_ops.values.estimates import Guarantee, Parts
from gibiane_ops.values.exterior import Side, held_at, held_directions, projectors
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import Point
from gibiane_ops.values.material import elastic_law, on_zone
from gibiane_ops.values.modele import DISPLACEMENTS
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store
from gibiane_ops.values.pieces import ROUND_OFF, Boundary, Pieces
from gibiane_ops.values.rigidite import Rigidite

WORKLESS = 1e-7
"""Work of prescribed displacements over the energy that is none: solutions are as exact as that."""

GUARANTEED = Guarantee(True, Text("a stress in exact equilibrium with the loads: the error is not above this value"))
COULOMB = Text("Coulomb")
"""Doubt that a problem near by has not."""


def guarantee_of(ctx: Context, found: Admissible, doubts: Sequence[Text]) -> Guarantee:
    """Say whether the equilibrium was found to hold to round-off, and there are no other `doubts`; if not, warn."""
    doubt = joined(doubts, "; ")
    if doubt is not None:
        reason = Text("not guaranteed ({doubt})", {"doubt": doubt})
        if COULOMB in doubts:
            ctx.warn(
                "G411",
                "the estimate is not a bound: {reason}",
                level=0,
                reason=reason,
                hint="the bound holds for the same problem with Tresca's friction: MATE 'SEUI' of MU times PN (COFR)",
            )
        else:
            ctx.warn("G411", "the estimate is not a bound: {reason}", level=0, reason=reason)
        return Guarantee(False, reason)
    if found.residual <= ROUND_OFF:
        if not found.remainder:
            return GUARANTEED
        share = 1.0 - np.sqrt(1.0 - found.remainder / found.total**2)
        return Guarantee(
            True,
            Text(
                "a stress in exact equilibrium with the loads: the error is not above this value, of which {share} "
                "stands for the integration of rational stresses (the difference of two rules)",
                {"share": f"{share:.1e}"},
            ),
        )
    left = f"{found.residual:.1e}"
    ctx.warn(
        "G411",
        "the equilibrium of the stress is violated by {share} of its tractions: the estimate is not a bound",
        level=1,
        share=left,
    )
    return Guarantee(False, Text("the equilibrium is violated by {share} of the tractions", {"share": left}))


def parts_of(pieces: Pieces, found: Admissible) -> Parts:
    """Return the errors zone by zone, those of simplices summed over the element that they are pieces of."""
    cuts = np.cumsum([len(owner) for owner in pieces.cutting.owner])[:-1]
    columns = [np.split(each, cuts) for each in (found.error, found.energy, found.sum_energy)]
    errors = [
        SolidError(*(np.bincount(owner, part, len(zone.cells)).astype(np.float64) for part in each))
        for zone, owner, *each in zip(pieces.zones, pieces.cutting.owner, *columns, strict=True)
    ]
    return Parts(pieces.zones, errors)


def equilibrated(
    ctx: Context,
    pieces: Pieces,
    stress: MChaml,
    material: MChaml,
    fields: list[Field],
    boundary: Boundary,
    volu: Point | None,
    sweeps: int | None,
    supports: Rigidite | None,
    joint: Joint | None = None,
    nodal: bool = True,
) -> Admissible:
    """Build the stress in equilibrium over all the zones together: they exchange tractions where they share nodes.

    Not `nodal`: the tractions of contact do not balance each node, and the stress to start from is corrected to do so.
    """
    zones = pieces.zones
    dim = zones[0].dim
    if sweeps is not None and sweeps < 0:
        ctx.fail(41, "the number of sweeps {count} is negative", at="sweeps", count=sweeps)
    body = np.zeros(dim) if volu is None else volu.coords[:dim]
    count = SWEEPS if sweeps is None else sweeps
    points, cells = pieces.cutting.points, pieces.cutting.cells
    values = [on_zone(ctx, stress, z, "sig").values for z in zones]
    laws = [
        np.broadcast_to(elastic_law(ctx, material, z, "mat"), (len(v), *2 * v.shape[2:]))
        for z, v in zip(zones, values, strict=True)
    ]
    law = np.concatenate([each[owner] for each, owner in zip(laws, pieces.cutting.owner, strict=True)])
    aim, source = None, None
    with worded(ctx, at="model"):
        mesh = simplices(points, cells)
        traction, free, bent = _on_boundary(boundary, mesh.nodes[mesh.boundary])
        loads = Exterior(traction, free, np.tile(body, (len(cells), 1)))
        if bent.any():
            loads = without_resultants(mesh, loads, bent)
        if pieces.whole:
            sigma = np.concatenate([v.mean(axis=1) for v in values])
            aim = None if nodal else uniform_aim(sigma[:, STATIC[dim]], dim)
        else:
            source = _source(pieces, fields)
            aim = source.aim(mesh.points[mesh.cells], plane_compliance(law, dim))
            sigma = np.zeros((len(cells), law.shape[1]))
            sigma[:, STATIC[dim]] = aim.mean
        if aim is not None:
            known, there = held_directions(node_store(ctx), supports, DISPLACEMENTS[zones[0].family], dim)
            held = _held(pieces, mesh, free, held_at(known, there, pieces.nodes))
            try:
                with worded(ctx, at="sig"):
                    sigma = balanced_stress(mesh, sigma, law, loads, held)
            except NotConverged as failure:
                ctx.fail(
                    21,
                    "the loads and contact forces given do not balance a body: {share} of the largest force is left",
                    at="sig",
                    share=f"{100 * failure.history[-1]:.2g} %",
                    hint="give every load by 'PRES', 'FSUR' or 'VOLU' and the supports, and the contact forces (REAC) "
                    "of this very solution",
                )
        try:
            return admissible_stress(
                points, cells, sigma, law, loads, sweeps=count, mesh=mesh, aim=aim, source=source, joint=joint
            )
        except NotEquilibrated as failure:
            _unbalanced(ctx, pieces.nodes[pieces.cutting.near[failure.nodes]], failure.forces)


def energy_bounds(found: Admissible, contact: float = 0.0) -> dict[str, float]:
    """Return bounds of the energy of the exact solution where nothing but loads does work: dual analysis.

    The solution of the mesh has less energy, any stress in equilibrium more. That needs the work
    ``int (s_hat - s_h) : eps(u_h)`` to be zero (half of the squared contact error, with contact): prescribed
    displacements, other than as a rigid motion, and thermal strains make it something else, and there is no such
    bound; nor without a sweep, which makes the reactions others than those of the mesh, and their work seen. Distorted
    elements, whose stiffness is integrated by points, are none of Galerkin's either.
    """
    energy = float(found.energy.sum())
    work = float(found.sum_energy.sum() - found.error.sum()) / 4 - energy
    if len(found.history) < 2 or abs(work - contact / 2) > WORKLESS * energy:
        return {}
    return {"INFERIEURE": energy, "SUPERIEURE": energy + found.total**2 + contact}


def _unbalanced(ctx: Context, nodes: IntArray, forces: FloatArray) -> NoReturn:
    """Fail because forces are left at nodes."""
    # the two sides of a contact keep opposite forces: of equal ones the first node is named, whatever round-off says
    size = np.linalg.norm(forces, axis=1)
    worst = min(np.flatnonzero(size > (1 - 1e-6) * size.max()), key=lambda i: nodes[i])
    where = " ".join(f"{x:g}" for x in node_store(ctx).coords[nodes[worst]][: forces.shape[1]])
    left = forces[worst]
    force = " ".join(f"{x:.4g}" for x in np.where(np.abs(left) > 1e-9 * np.abs(left).max(), left, 0.0))
    ctx.fail(
        21,
        "the stress does not balance the loads given: {count} nodes keep a force, first node {node} at "
        "({where}), force ({force})",
        at="sig",
        count=len(nodes),
        node=int(nodes[worst]) + 1,
        where=where,
        force=force,
        hint="give every load by 'PRES', 'FSUR' or 'VOLU' and the supports; forces and supports at single "
        "points or lines, and contact, are not balanced by tractions",
    )


def check_balance(
    ctx: Context,
    pieces: Pieces,
    stress: MChaml,
    sides: list[Side],
    volu: Point | None,
    supports: Rigidite | None,
    contact: Sequence[tuple[IntArray, FloatArray]] = (),
) -> None:
    """Fail unless the stress of elements that are cut balances loads and contact forces at the nodes not held.

    Pieces of elements would balance whatever they are given: a load forgotten must be seen before.
    """
    if pieces.whole:
        return
    nodes, forces = unbalanced(ctx, pieces.zones, stress, sides, volu, supports, contact)
    if len(nodes):
        _unbalanced(ctx, nodes, forces)


def _source(pieces: Pieces, fields: list[Field]) -> Source:
    """Return where the stress on the pieces comes from, their corners in the order of the mesh of simplices."""
    owner = pieces.cutting.owner
    block = np.repeat(np.arange(len(owner)), [len(each) for each in owner])
    found = Source(fields, block, np.concatenate(owner), pieces.cutting.at)
    return found.turned(np.argsort(pieces.cutting.cells, axis=1))


def _held(pieces: Pieces, mesh: Simplices, free: FloatArray, at_nodes: FloatArray) -> FloatArray:
    """Return the projectors on the directions in which points are held, (n, d, d): new ones by the sides around."""
    cutting, dim = pieces.cutting, mesh.dim
    around = np.zeros((len(mesh.points), dim, dim))
    np.add.at(around, mesh.nodes[mesh.boundary], np.repeat(free[:, None], dim, axis=1))
    fresh = cutting.node < 0
    around[~fresh] = at_nodes[cutting.node[~fresh]]
    if fresh.any():
        around[fresh] = projectors(around[fresh])
    return around


def _on_boundary(boundary: Boundary, edge: IntArray) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Put what is known of the sides in the order of the boundary of a mesh of simplices."""
    side = boundary.side
    given = side.facets.nodes
    order = np.argsort(given, axis=1)
    group, _ = group_by_nodes(np.vstack([edge, given]))
    place = np.empty(len(edge), np.int64)
    place[group[: len(edge)]] = np.arange(len(edge))
    traction, free, bent = np.empty_like(side.traction), np.empty_like(side.free), np.zeros(len(edge), bool)
    rows = place[group[len(edge) :]]
    traction[rows] = np.take_along_axis(side.traction, order[:, :, None], axis=1)
    free[rows], bent[rows] = side.free, boundary.bent
    return traction, free, bent
