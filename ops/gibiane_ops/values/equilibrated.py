"""Stresses in equilibrium with given loads, on the zones of a model: what RDC needs, with contact or without."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import NotEquilibrated
from gibiane_ops.kernels.estimate.admissible import SWEEPS, Admissible, admissible_stress, plane_compliance
from gibiane_ops.kernels.estimate.joints import Joint
from gibiane_ops.kernels.estimate.macro import STATIC
from gibiane_ops.kernels.estimate.pieces import Aim, aim_of, balanced_stress, uniform_aim
from gibiane_ops.kernels.estimate.simplices import Simplices, simplices
from gibiane_ops.kernels.estimate.tractions import Exterior
from gibiane_ops.kernels.estimate.zz import SolidError
from gibiane_ops.kernels.supports import moved
from gibiane_ops.kernels.topology import group_by_nodes
from gibiane_ops.values.balance import unbalanced
from gibiane_ops.values.champs import MChaml
from gibiane_ops.values.estimates import Guarantee, Parts
from gibiane_ops.values.exterior import Side, held_at, held_directions
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import Point
from gibiane_ops.values.material import elastic_law, on_zone
from gibiane_ops.values.modele import DISPLACEMENTS
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store
from gibiane_ops.values.pieces import ROUND_OFF, Pieces
from gibiane_ops.values.rigidite import Rigidite

GUARANTEED = Guarantee(True, "a stress in exact equilibrium with the loads: the error is not above this value")


def guarantee_of(ctx: Context, found: Admissible, doubt: str = "", coulomb: bool = False) -> Guarantee:
    """Say whether the equilibrium was found to hold to round-off, and nothing else is in `doubt`; if not, warn."""
    if doubt:
        reason = f"not guaranteed ({doubt})"
        if coulomb:
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
        return GUARANTEED
    ctx.warn(
        "G411",
        "the equilibrium of the stress is violated by {share} of its tractions: the estimate is not a bound",
        level=1,
        share=f"{found.residual:.1e}",
    )
    return Guarantee(False, f"the equilibrium is violated by {found.residual:.1e} of the tractions")


def parts_of(pieces: Pieces, found: Admissible) -> Parts:
    """Return the errors zone by zone, those of simplices summed over the element that they are pieces of."""
    cuts = np.cumsum([len(owner) for owner in pieces.owner])[:-1]
    columns = [np.split(each, cuts) for each in (found.error, found.energy, found.sum_energy)]
    errors = [
        SolidError(*(np.bincount(owner, part, len(zone.cells)).astype(np.float64) for part in each))
        for zone, owner, *each in zip(pieces.zones, pieces.owner, *columns, strict=True)
    ]
    return Parts(pieces.zones, errors)


def equilibrated(
    ctx: Context,
    pieces: Pieces,
    stress: MChaml,
    material: MChaml,
    side: Side,
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
    points = node_store(ctx).coords[pieces.nodes][:, :dim]
    laws, at_nodes, means = [], [], []
    for zone, owner, corners in zip(zones, pieces.owner, pieces.corners, strict=True):
        of = shape(zone.shape)
        values = on_zone(ctx, stress, zone, "sig").values
        law = elastic_law(ctx, material, zone, "mat")
        laws.append(np.broadcast_to(law, (len(zone.cells), *2 * values.shape[2:]))[owner])
        at_nodes.append(moved(of, values, stress.support, "NOEUD")[owner])
        means.append(np.take_along_axis(at_nodes[-1], corners[:, :, None], axis=1).mean(axis=1))
    cells = np.concatenate(
        [
            np.take_along_axis(c[owner], corners, axis=1)
            for c, owner, corners in zip(pieces.cells, pieces.owner, pieces.corners, strict=True)
        ]
    )
    law, sigma = np.concatenate(laws), np.concatenate(means)
    with worded(ctx, at="model"):
        mesh = simplices(points, cells)
        traction, free = _on_boundary(side, pieces.nodes, mesh.nodes[mesh.boundary])
        loads = Exterior(traction, free, np.tile(body, (len(cells), 1)))
        aim = None
        if not (pieces.whole and nodal):
            if pieces.whole:
                aim = uniform_aim(sigma[:, STATIC[dim]], dim)
            else:
                aim = _aim(pieces, mesh, cells, at_nodes, plane_compliance(law, dim))
            known, held = held_directions(node_store(ctx), supports, DISPLACEMENTS[zones[0].family], dim)
            with worded(ctx, at="sig"):
                sigma = balanced_stress(mesh, sigma, law, loads, held_at(known, held, pieces.nodes))
        try:
            return admissible_stress(points, cells, sigma, law, loads, sweeps=count, mesh=mesh, aim=aim, joint=joint)
        except NotEquilibrated as failure:
            _unbalanced(ctx, pieces.nodes[failure.nodes], failure.forces)


def energy_bounds(found: Admissible, contact: float = 0.0) -> dict[str, float]:
    """Return bounds of the energy of the exact solution, where prescribed displacements and gaps are zero.

    The solution of the mesh has less energy, any stress in equilibrium more: dual analysis.
    """
    energy = float(found.energy.sum())
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


def _aim(pieces: Pieces, mesh: Simplices, cells: IntArray, nodal: list[FloatArray], compliance: FloatArray) -> Aim:
    """Describe the stress of the elements on their pieces, the corners in the order of the mesh of simplices."""
    order, static = np.argsort(cells, axis=1), np.array(STATIC[mesh.dim])
    found, start = [], 0
    for zone, corners, values in zip(pieces.zones, pieces.corners, nodal, strict=True):
        some = slice(start, start + len(corners))
        turned = np.take_along_axis(corners, order[some], axis=1)
        found.append(aim_of(shape(zone.shape), mesh.map[some], values[:, :, static], turned, compliance[some]))
        start += len(corners)
    return Aim(*(np.concatenate(each) for each in zip(*[(a.mean, a.pull, a.constant) for a in found], strict=True)))


def _on_boundary(side: Side, nodes: IntArray, boundary: IntArray) -> tuple[FloatArray, FloatArray]:
    """Put what is imposed on the sides in the order of the boundary of a mesh of simplices."""
    given = np.searchsorted(nodes, side.facets.nodes)
    order = np.argsort(given, axis=1)
    group, _ = group_by_nodes(np.vstack([boundary, given]))
    place = np.empty(len(boundary), np.int64)
    place[group[: len(boundary)]] = np.arange(len(boundary))
    traction, free = np.empty_like(side.traction), np.empty_like(side.free)
    rows = place[group[len(boundary) :]]
    traction[rows] = np.take_along_axis(side.traction, order[:, :, None], axis=1)
    free[rows] = side.free
    return traction, free
