"""COOR of element fields and of models: the places where their values stand."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg
from gibiane.registry import Context, extend
from gibiane.values import ENTIER, MCHAML, MMODEL
from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.supports import support_points
from gibiane_ops.values.algebra import SCAL, SCALAIRE
from gibiane_ops.values.champs import ChamZone, MChaml
from gibiane_ops.values.material import field_zones
from gibiane_ops.values.modele import Modele, ModelZone
from gibiane_ops.values.nodes import node_store

COOR = extend("COORDONNEE")
WHICH = Arg("n", ENTIER, "which one", optional=True)


@COOR.form(Arg("model", MMODEL, "model: at the nodes of its elements"), WHICH, gives=["MCHAML..."])
def _of_model(ctx: Context, model: Modele, n: int | None) -> Any:
    return _places(ctx, field_zones(ctx, model), "NOEUD", n)


@COOR.form(Arg("field", MCHAML, "element field: at its points"), WHICH, gives=["MCHAML..."])
def _of_field(ctx: Context, field: MChaml, n: int | None) -> Any:
    zones = [z.zone for z in field.zones if isinstance(z.zone, ModelZone)]
    if not zones:
        ctx.fail(21, "there is no solid zone", at="field")
    return _places(ctx, zones, field.support, n)


def _places(ctx: Context, zones: list[ModelZone], support: str, n: int | None) -> Any:
    store, dim = node_store(ctx), int(ctx.option("DIME"))
    if n is not None and not 1 <= n <= dim + 1:
        ctx.fail(1068, "coordinates are 1 to {dim}, and {after} is the density", at="n", dim=dim, after=dim + 1)
    found = []
    for zone in zones:
        of = shape(zone.shape)
        points = support_points(of, support)
        places = geometry.positions(of, store.coords[zone.cells], points)[..., :dim]
        density = np.matmul(store.density[zone.cells], of.N(points).T)[..., None]
        found.append(np.concatenate([places, density], axis=-1))
    made = [
        MChaml([ChamZone(z, [SCAL], v[..., i : i + 1]) for z, v in zip(zones, found, strict=True)], SCALAIRE, support)
        for i in (range(dim) if n is None else [n - 1])
    ]
    return tuple(made)
