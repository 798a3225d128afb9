"""PRES on a model of surfaces under pressure: MODE 'CHARGEMENT' 'PRESSION'."""

from __future__ import annotations

import numpy as np

from gibiane.forms import Arg
from gibiane.registry import Context, extend
from gibiane.values import FLOTTANT, MAILLAGE, MCHAML, MMODEL, MOT
from gibiane_ops.kernels import topology
from gibiane_ops.values.champs import ChamZone, MChaml
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.material import on_zone
from gibiane_ops.values.modele import Modele
from gibiane_ops.values.pressure import COMPONENT, SUBTYPE, pressed

PRES = extend("PRESSION")


@PRES.form(
    Arg("model", MMODEL, "model of pressure"),
    Arg("name", MOT, "component"),
    Arg("p", FLOTTANT, "pressure"),
    Arg("g", MAILLAGE, "facets", optional=True),
    gives=[MCHAML],
    last=True,
)
def _uniform(ctx: Context, model: Modele, name: str, p: float, g: Maillage | None) -> MChaml:
    if name.strip()[:4] != COMPONENT:
        ctx.fail(197, "{name} is no pressure: its component is PRES", at="name", name=name.strip())
    zones, found = [], 0
    for zone in pressed(ctx, model):
        value = np.full((len(zone.cells), 1, 1), p)
        if g is not None:
            cells = g.cells(zone.shape)
            if not len(cells):
                continue
            group, _ = topology.group_by_nodes(np.vstack([zone.cells, cells]))
            value[~np.isin(group[: len(zone.cells)], group[len(zone.cells) :])] = 0.0
            found += int(np.isin(group[len(zone.cells) :], group[: len(zone.cells)]).sum())
        zones.append(ChamZone(zone, [COMPONENT], value))
    if g is not None and found < g.n_cells:
        ctx.fail(21, "{count} facets of the mesh are not in the model", at="g", count=g.n_cells - found)
    return MChaml(zones, SUBTYPE, "GRAVITE")


@PRES.form(Arg("model", MMODEL, "model of pressure"), Arg("field", MCHAML, "pressures"), gives=[MCHAML], last=True)
def _field(ctx: Context, model: Modele, field: MChaml) -> MChaml:
    if len(field.names) != 1:
        ctx.fail(26, "the pressure has several components", at="field")
    zones = [ChamZone(z, [COMPONENT], on_zone(ctx, field, z, "field").values) for z in pressed(ctx, model)]
    return MChaml(zones, SUBTYPE, field.support)
