"""PROI: a field of one mesh on another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, FLOTTANT, MAILLAGE, MCHAML, MMODEL, POINT
from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.mesh.hosts import find_hosts, interpolated
from gibiane_ops.kernels.supports import SUPPORTS, support_points
from gibiane_ops.kernels.transfer import fitted
from gibiane_ops.values.champs import DIFFUS, ChamZone, ChPoint, MChaml
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.material import solid_zones
from gibiane_ops.values.modele import Modele, ModelZone
from gibiane_ops.values.nodes import node_store

PROI = operator(
    "PROI",
    topic="fields",
    summary="a field of one mesh brought onto another",
    notice="`CHP = PROI G CH (tol)`: the values of an element field at the nodes of another mesh, a DIFFUS CHPOINT. "
    "`CH2 = PROI MODL CH ('GRAVITE'|'RIGIDITE'|'MASSE'|'STRESSES') (tol)`: an element field on the elements of a "
    "model, at their nodes or at the points named. `PROI MODL CH 'MINI' (n)`: the element field at nodes that differs "
    "least from CH in the mean of the square over each element, with n integration points along each axis (3). CH "
    "must stand at nodes (CHAN 'NOEUD'). A point belongs to the element that holds it, up to tol times the size of "
    "the element (1.E-5); beyond, the value of the nearest element is taken and a warning counts such points. A "
    "characteristics field of shells may precede CH. A field of the degree of the elements is found again exactly.",
    example="""
    OPTI DIME 2 ELEM QUA4 ; S = (DROI 2 (0. 0.) (2. 0.)) TRAN 2 (0. 1.) ; X = COOR 1 S ;
    MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; CH = CHAN 'CHAM' (NOMC 'T' X) MO ;
    OPTI ELEM TRI3 ; S2 = (DROI 3 (0. 0.) (2. 0.)) TRAN 5 (0. 1.) ; T2 = PROI S2 CH ;
    MESS (MAXI (ABS ((COOR 1 S2) - (EXCO 'T' T2)))) ;
    """,
    see=["CHANGER", "REDUIRE", "REMAILLER"],
)
TOLERANCE = Arg("tolerance", FLOTTANT, "distance caught around elements, by parts of their size", optional=True)


class Source:
    """An element field at nodes that can be asked for values anywhere.

    Points that no element holds are counted, with the distance to the farthest.
    """

    def __init__(self, ctx: Context, field: MChaml, tolerance: float | None, at: str) -> None:
        if field.support != "NOEUD" and not all(z.values.shape[1] == 1 for z in field.zones):
            ctx.fail(
                21,
                "the values of this field stand at {support}, those at nodes are wanted",
                at=at,
                support=field.support,
                label="not at nodes",
                hint="CHAN 'NOEUD' MODL CH moves them there",
            )
        zones = [z for z in field.zones if isinstance(z.zone, ModelZone)]
        if not zones:
            ctx.fail(21, "this field has no value on a solid", at=at)
        if tolerance is not None and not tolerance >= 0:
            ctx.fail(41, "a distance is positive: {value} cannot be one", at="tolerance", value=tolerance)
        self.ctx = ctx
        self.names = field.names
        self.tolerance = 1e-5 if tolerance is None else float(tolerance)
        self.dim = max(int(ctx.option("DIME")), 1)
        self.coords = node_store(ctx).coords[:, : self.dim]
        self.blocks = [(z.zone.shape, z.zone.cells) for z in zones if isinstance(z.zone, ModelZone)]
        self.values, self.has = [], []
        for zone, (_, cells) in zip(zones, self.blocks, strict=True):
            table = np.zeros((*cells.shape, len(self.names)))
            column = [self.names.index(name) for name in zone.names]
            table[:, :, column] = zone.values
            self.values.append(table)
            self.has.append(np.isin(np.arange(len(self.names)), column))
        self.starts = np.cumsum([0] + [len(cells) for _, cells in self.blocks])
        self.total = self.lost = 0
        self.farthest = 0.0

    def ask(self, points: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return values (k, n_names) at points, and which components exist there."""
        hosts = find_hosts(points, self.coords, self.blocks, self.tolerance, nearest=True)
        lost = np.flatnonzero(~np.isfinite(hosts.out))
        self.total += len(points)
        self.lost += len(lost)
        if len(lost):
            corners = [self.coords[cells] for _, cells in self.blocks]
            gap = np.linalg.norm(interpolated(hosts, self.blocks, corners)[lost] - points[lost], axis=1)
            self.farthest = max(self.farthest, float(gap.max()))
        zone = np.searchsorted(self.starts, hosts.cell, side="right") - 1
        return interpolated(hosts, self.blocks, self.values), np.array(self.has)[zone]

    def report(self) -> None:
        """Warn of the points that no element holds."""
        if self.lost:
            self.ctx.warn(
                18,
                "no element of the field holds {count} of the {total} points, the farthest at {distance}: they get the "
                "value of the nearest element",
                count=self.lost,
                total=self.total,
                distance=f"{self.farthest:.3g}",
                at="fields",
                hint="a number after the field is the distance accepted, by parts of an element (1.E-5)",
            )


@PROI.form(
    Arg("where", (MAILLAGE, POINT), "new mesh"),
    Arg("fields", MCHAML, "element field at nodes", many=True),
    TOLERANCE,
    gives=["CHPOINT"],
)
def _on_nodes(ctx: Context, where: Maillage | Point, fields: Sequence[MChaml], tolerance: float | None) -> ChPoint:
    source = Source(ctx, fields[-1], tolerance, "fields")
    nodes: IntArray = where.nodes if isinstance(where, Maillage) else np.array([where.node])
    values, has = source.ask(source.coords[nodes])
    source.report()
    parts = {name: (nodes[has[:, i]], values[has[:, i], i]) for i, name in enumerate(source.names)}
    return ChPoint(node_store(ctx), parts, DIFFUS, fields[-1].title)


@PROI.form(
    Arg("model", MMODEL, "model of the new mesh"),
    Arg("fields", MCHAML, "element field at nodes", many=True),
    Key("MINI", "least squares over each element", Arg("n", ENTIER, optional=True), required=True),
    gives=[MCHAML],
)
def _least_squares(ctx: Context, model: Modele, fields: Sequence[MChaml], mini: int | None) -> MChaml:
    source = Source(ctx, fields[-1], None, "fields")
    zones = []
    for zone in solid_zones(ctx, model):
        X = source.coords[zone.cells]
        with worded(ctx, at="mini"):
            values = fitted(shape(zone.shape), X, lambda points: source.ask(points)[0], 3 if mini is None else mini)
        zones.append(ChamZone(zone, source.names, values))
    source.report()
    return MChaml(zones, fields[-1].subtype, "NOEUD", fields[-1].title)


@PROI.form(
    Arg("model", MMODEL, "model of the new mesh"),
    Arg("fields", MCHAML, "element field at nodes", many=True),
    Key(SUPPORTS, "where the values shall stand (nodes)", name="support"),
    TOLERANCE,
    gives=[MCHAML],
)
def _on_elements(
    ctx: Context, model: Modele, fields: Sequence[MChaml], support: str | None, tolerance: float | None
) -> MChaml:
    source = Source(ctx, fields[-1], tolerance, "fields")
    place = support or "NOEUD"
    zones = []
    for zone in solid_zones(ctx, model):
        kind = shape(zone.shape)
        at = geometry.positions(kind, source.coords[zone.cells], support_points(kind, place))
        values, _ = source.ask(at.reshape(-1, source.dim))
        zones.append(ChamZone(zone, source.names, values.reshape(*at.shape[:2], -1)))
    source.report()
    return MChaml(zones, fields[-1].subtype, place, fields[-1].title)
