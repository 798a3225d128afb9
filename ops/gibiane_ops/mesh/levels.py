"""ISOVALEUR: where a field takes a value, as a mesh."""

from __future__ import annotations

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, LISTREEL, MAILLAGE, MCHAML
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.mesh import levels, simplices
from gibiane_ops.mesh.building import dimension, join, new_mesh, nodes_of
from gibiane_ops.mesh.degree import linear_mesh
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.listes import ListReel
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.modele import ModelZone

ISOV = operator(
    "ISOVALEUR",
    topic="mesh",
    summary="where a field takes a value, as a mesh",
    notice="`G2 = ISOV G CHPO x`, x a number or a LISTREEL: points on lines, SEG2 on surfaces, TRI3 in volumes, where "
    "the field of one component is x, linear between nodes (other elements than simplices are cut, mid-nodes do not "
    "count). `G2 = ISOV CHAM ('EGAL') x`: likewise for an element field at nodes, of which each node takes the mean. "
    "Triangles look to the side of higher values. The nodes are new; an empty result is a warning.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 4 (0. 0.) (1. 0.)) TRAN 4 (0. 1.) ; "
    "L = ISOV S (COOR 1 S) 0.3 ; MESS (MESU L) ;",
    see=["TRACER", "POINT"],
)


@ISOV.form(
    Arg("g", MAILLAGE, "mesh"),
    Arg("field", CHPOINT, "field"),
    Arg("x", (FLOTTANT, LISTREEL), "values"),
    gives=[MAILLAGE],
)
def _nodal(ctx: Context, g: Maillage, field: ChPoint, x: float | ListReel) -> Maillage:
    if len(field.names) != 1:
        ctx.fail(21, "the field has {count} components: name one", at="field", count=len(field.names))
    name = field.names[0]
    missing = np.setdiff1d(linear_mesh(ctx, g).nodes, field.parts[name][0])
    if len(missing):
        ctx.fail(181, "the field has no value at {count} nodes of the mesh", at="field", count=len(missing))
    values = np.zeros(nodes_of(ctx).count)
    values[field.parts[name][0]] = field.parts[name][1]
    return _levels(ctx, g, values, x)


@ISOV.form(
    Arg("field", MCHAML, "element field at nodes"),
    Key(("EGAL", "EGINFE", "EGSUPE"), "equal; the others are not available", name="how"),
    Arg("x", (FLOTTANT, LISTREEL), "values"),
    gives=[MAILLAGE],
)
def _elements(ctx: Context, field: MChaml, how: str | None, x: float | ListReel) -> Maillage:
    if how in ("EGINFE", "EGSUPE"):
        ctx.fail(251, "ISOV '{how}' is not available", at="how", how=how, hint="CH ELEM '{how}' x gives whole elements")
    if field.support != "NOEUD" or len(field.names) != 1:
        ctx.fail(
            21,
            "an element field of one component at nodes is wanted",
            at="field",
            hint="CHAN 'NOEUD' MODL FIELD brings it there, EXCO chooses a component",
        )
    total, count = np.zeros(nodes_of(ctx).count), np.zeros(nodes_of(ctx).count)
    meshes = []
    for zone in field.zones:
        if isinstance(zone.zone, ModelZone):
            np.add.at(total, zone.zone.cells, zone.values[..., 0])
            np.add.at(count, zone.zone.cells, 1.0)
            meshes.append(zone.zone.mesh)
    if not meshes:
        ctx.fail(21, "there is no solid zone", at="field")
    return _levels(ctx, join(meshes), total / np.maximum(count, 1.0), x)


def _levels(ctx: Context, g: Maillage, values: FloatArray, x: float | ListReel) -> Maillage:
    dimension(ctx)
    store = nodes_of(ctx)
    parts: list[tuple[str, IntArray]] = []
    for block in linear_mesh(ctx, g).blocks:
        cells = _simplices(block.shape, block.cells)
        if cells.shape[1] == 1:
            ctx.fail(16, "points have no inside: lines, surfaces or volumes are wanted", at="g")
        for at in x.values if isinstance(x, ListReel) else [x]:
            places, made = levels.level(store.coords, cells, values, float(at))
            if len(made):
                ids = store.add(places, float(ctx.option("DENS")))
                parts.append(({1: "POI1", 2: "SEG2", 3: "TRI3"}[made.shape[1]], ids[made]))
    if not parts:
        ctx.warn(26, "the field takes that value nowhere: the mesh is empty")
        return new_mesh(ctx, [])
    return join([new_mesh(ctx, [part]) for part in parts])


def _simplices(name: str, cells: IntArray) -> IntArray:
    if name == "QUA4":
        return simplices.triangles_of_quadrangles(cells)
    if name in ("PYR5", "PRI6", "CUB8"):
        return simplices.tetrahedra(name, cells)[0]
    return cells
