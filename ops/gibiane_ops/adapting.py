"""TAILLE 'DEGRE' and 'MOUVEMENT': what to do with elements and nodes other than choosing sizes."""

from __future__ import annotations

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend
from gibiane.values import CHPOINT, FLOTTANT, MCHAML, MMODEL, TABLE, Table
from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.adapt import degrees, moving, shares
from gibiane_ops.kernels.adapt.orders import singular_orders
from gibiane_ops.kernels.adapt.sizes import element_sizes, nodal_sizes
from gibiane_ops.kernels.arrays import FloatArray, IntArray, stress_tensor
from gibiane_ops.kernels.elasticity import internal_forces
from gibiane_ops.kernels.elements.quadratic import LINEAR, QUADRATIC
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.values.algebra import SCAL
from gibiane_ops.values.champs import DIFFUS, ChamZone, ChPoint, MChaml
from gibiane_ops.values.conditions import displacements
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.material import MATERIAL, on_zone, solid_zones
from gibiane_ops.values.modele import Modele, ModelZone
from gibiane_ops.values.nodes import node_store
from gibiane_ops.values.results import wanted_results
from gibiane_ops.values.sizing import coincident, error_map, prescribed, refuse_no_elements

TAIL = extend("TAILLE")

WORKING = 1e-8
"""Share of the largest work of a nodal force above which a node is loaded."""


@TAIL.form(
    Key("DEGRE", "which elements to divide, which to raise to the second degree", required=True),
    Arg("carte", MCHAML, "map of relative errors"),
    Arg("model", MMODEL, "model"),
    Arg("smooth", MCHAML, "smoothed stress at nodes (LISSER)"),
    Arg("sig", MCHAML, "stress at stress points", optional=True),
    Key("PREC", "prescribed relative error (needed)", Arg("e0", FLOTTANT)),
    Key("SEUL", "raise only, divide nothing"),
    Key("NBMA", "largest number of elements", Arg("n", FLOTTANT)),
    gives=[CHPOINT, MCHAML, FLOTTANT, "(FLOTTANT)"],
)
def _degrees(
    ctx: Context,
    degre: bool,
    carte: MChaml,
    model: Modele,
    smooth: MChaml,
    sig: MChaml | None,
    prec: float | None,
    seul: bool,
    nbma: float | None,
) -> tuple[ChPoint, MChaml, float] | tuple[ChPoint, MChaml, float, float]:
    target = prescribed(ctx, prec)
    refuse_no_elements(ctx, nbma)
    store = node_store(ctx)
    zones = solid_zones(ctx, model)
    error = error_map(ctx, carte, zones)
    nodes, blocks = _numbered(zones)
    dim = zones[0].dim
    points = store.coords[nodes][:, :dim]
    pairs = coincident(points)
    with worded(ctx, at="smooth"):
        stress = [_at_nodes(ctx, smooth, zone) for zone in zones]
        measures = [np.abs(geometry.measures(shape(n), points[c])) for n, c in blocks]
        degree = np.concatenate([np.full(len(c), shape(n).degree) for n, c in blocks])
        beta = 3.0 if dim == 3 and degree.max() == 1 else 2.0
        order = singular_orders(
            len(points), blocks, error**2, np.concatenate(measures), degree.astype(np.float64), beta=beta
        )
        size = np.concatenate([element_sizes(shape(n), m) for (n, _), m in zip(blocks, measures, strict=True)])
        peak = order < degree
        left = shares.left_by_degree(size, shares.smoothness(points, blocks, stress), peak)
        if sig is not None:
            start = 0
            for zone, (name, cells), values in zip(zones, blocks, stress, strict=True):
                if shape(name).degree == 2:
                    own = on_zone(ctx, sig, zone, "sig").values
                    left[start : start + len(cells)] = shares.left_measured(shape(name), points[cells], values, own)
                start += len(cells)
        may_rise = np.ones(len(degree), bool)
        low = [(LINEAR.get(n, n), c) for n, c in blocks]
        high = [(QUADRATIC.get(n, n), c) for n, c in low]
        may_rise &= np.concatenate([np.full(len(c), n in QUADRATIC) for n, c in low])
        cost = np.stack(
            [np.concatenate([np.full(len(c), degrees.NODES.get(n, 1.0)) for n, c in each]) for each in (low, high)]
        )
        now = degree == 2
        if seul:
            rows, predicted = degrees.raise_only(
                error**2, target, left=left, added=np.maximum(cost[1] - cost[0], 1.0), may_rise=may_rise & ~now
            )
            quadratic, nodal = now | rows, nodal_sizes(len(points), blocks, size, pairs=pairs)
            count = float(len(size))
        else:
            error2 = np.where(now, np.stack([error**2 / left, error**2]), np.stack([error**2, error**2 * left]))
            choices = degrees.Choices(
                error2,
                np.where(peak, order, np.array([[1.0], [2.0]])),
                cost,
                np.stack([np.ones(len(now), bool), may_rise]),
            )
            sizes, quadratic = degrees.degree_map(points, blocks, choices, target, pairs=pairs, max_count=nbma)
            nodal, predicted, count = sizes.nodal, sizes.reachable, float(sizes.count)
    marks = []
    start = 0
    for zone, (_, cells) in zip(zones, blocks, strict=True):
        rows = quadratic[start : start + len(cells)]
        start += len(cells)
        marks.append(ChamZone(zone, [SCAL], rows.astype(np.float64)[:, None, None]))
    found = ChPoint(store, {SCAL: (nodes, nodal)}, DIFFUS), MChaml(marks, MATERIAL, "GRAVITE"), predicted
    return (*found, count) if wanted_results(ctx) > 3 else found


def _numbered(zones: list[ModelZone]) -> tuple[IntArray, list[tuple[str, IntArray]]]:
    """Return the nodes of zones and their elements by ranks among these."""
    nodes = np.unique(np.concatenate([z.cells.ravel() for z in zones]))
    return nodes, [(z.shape, np.searchsorted(nodes, z.cells)) for z in zones]


def _at_nodes(ctx: Context, field: MChaml, zone: ModelZone) -> FloatArray:
    """Return the smoothed stress of a zone at the nodes of its elements, (m, n_nodes, c)."""
    part = on_zone(ctx, field, zone, "smooth")
    if field.support != "NOEUD":
        ctx.fail(
            565,
            "the smoothed stress stands at {support}: it is wanted at the nodes",
            at="smooth",
            support=field.support,
            hint="LISSER without 'STRE' gives it",
        )
    return part.values


@TAIL.form(
    Key("MOUVEMENT", "moves of nodes that lower the potential energy", required=True),
    Arg("model", MMODEL, "model"),
    Arg("sig", MCHAML, "stress at stress points"),
    Arg("u", CHPOINT, "displacement"),
    Key("GROUPES", "parts that keep their place", Arg("t", TABLE), name="grou"),
    gives=[CHPOINT],
)
def _moves(ctx: Context, mouvement: bool, model: Modele, sig: MChaml, u: ChPoint, grou: Table | None) -> ChPoint:
    store = node_store(ctx)
    zones = solid_zones(ctx, model)
    nodes, blocks = _numbered(zones)
    dim = zones[0].dim
    names = displacements(ctx)[:dim]
    points = store.coords[nodes][:, :dim]
    pairs = coincident(points)
    merged = np.arange(len(nodes))
    if pairs is not None:
        merged[pairs.max(axis=1)] = pairs.min(axis=1)
    U = u.table(names, nodes)
    forces, load, energy = np.zeros_like(points), np.zeros_like(points), []
    for zone, (name, cells) in zip(zones, blocks, strict=True):
        of = shape(name)
        stress = on_zone(ctx, sig, zone, "sig").values
        tensor = stress_tensor(stress)[..., :dim, :dim]
        with worded(ctx, at="model"):
            each = moving.configurational_forces(of, points[cells], U[cells], tensor)
            inner = internal_forces(of, points[cells], stress)
        np.add.at(forces, merged[cells], each)
        np.add.at(load, merged[cells], inner.reshape(len(cells), of.n_nodes, dim))
        energy.append(0.5 * np.abs(np.einsum("mni,mni->m", inner.reshape(len(cells), -1, dim), U[cells])))
    work = np.abs(load * U).max(axis=1)
    loaded = np.flatnonzero(work > WORKING * np.abs(load).max() * np.abs(U).max())
    groups = [] if grou is None else _parts(grou, nodes)
    limits = [
        merged[each]
        for each in moving.limits_of([(z.shape, np.searchsorted(nodes, z.cells)) for z in zones], groups, dim)
    ]
    joined = [(name, merged[cells]) for name, cells in blocks]
    free = moving.freedoms(points, [*limits, merged[loaded][:, None]])
    move = moving.steps(points, joined, forces, energy, free)[merged]
    with worded(ctx, at="model"):
        share = moving.longest_step(points, blocks, move)
    return ChPoint.from_table(store, names, nodes, share * move, DIFFUS)


def _parts(table: Table, nodes: IntArray) -> list[IntArray]:
    """Return the corners of the elements of the groups of a table, by ranks among nodes."""
    found = []
    for index, value in table.entries.values():
        if index in ("PAIRES", "ARBRE", "SOUSTYPE") or not isinstance(value, Maillage):
            continue
        for block in value.blocks:
            corners = block.cells[:, : shape(block.shape).n_corners]
            if np.isin(corners, nodes).all():
                found.append(np.searchsorted(nodes, corners))
    return found
