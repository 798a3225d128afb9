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
    "Triangles look to the side of higher values. The nodes are new; an empty result is a warning. `G2 = ISOV G CHPO "
    "'EGSUPE' x` and `ISOV CHAM 'EGSUPE' x` give the part where the field is x or more, 'EGINFE' x or less: elements "
    "that are cut, and all others than simplices, become TRI3 or TET4; the nodes inside are those of the mesh.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROIT 4 (0. 0.) (1. 0.)) TRAN 4 (0. 1.) ; "
    "L = ISOV S (COOR 1 S) 0.3 ; MESS (MESU L) ;",
    see=["TRACER", "POINT"],
)
SIDE = Key(("EGAL", "EGINFE", "EGSUPE"), "equal (the usual), at most, at least", name="side")


@ISOV.form(
    Arg("g", MAILLAGE, "mesh"),
    Arg("field", CHPOINT, "field"),
    SIDE,
    Arg("x", (FLOTTANT, LISTREEL), "values"),
    gives=[MAILLAGE],
)
def _nodal(ctx: Context, g: Maillage, field: ChPoint, side: str | None, x: float | ListReel) -> Maillage:
    if len(field.names) != 1:
        ctx.fail(21, "the field has {count} components: name one", at="field", count=len(field.names))
    name = field.names[0]
    missing = np.setdiff1d(linear_mesh(ctx, g).nodes, field.parts[name][0])
    if len(missing):
        ctx.fail(181, "the field has no value at {count} nodes of the mesh", at="field", count=len(missing))
    values = np.zeros(nodes_of(ctx).count)
    values[field.parts[name][0]] = field.parts[name][1]
    return _part(ctx, g, values, side, x)


@ISOV.form(
    Arg("field", MCHAML, "element field at nodes"),
    SIDE,
    Arg("x", (FLOTTANT, LISTREEL), "values"),
    gives=[MAILLAGE],
)
def _elements(ctx: Context, field: MChaml, side: str | None, x: float | ListReel) -> Maillage:
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
    return _part(ctx, join(meshes), total / np.maximum(count, 1.0), side, x)


def _part(ctx: Context, g: Maillage, values: FloatArray, side: str | None, x: float | ListReel) -> Maillage:
    if side in (None, "EGAL"):
        return _levels(ctx, g, values, x)
    if isinstance(x, ListReel):
        ctx.fail(21, "'{side}' wants one value, not a LISTREEL", at="x", side=side)
    dimension(ctx)
    store, sign = nodes_of(ctx), 1.0 if side == "EGSUPE" else -1.0
    blocks = [_simplices(block.shape, block.cells) for block in linear_mesh(ctx, g).blocks]
    parts: list[tuple[str, IntArray]] = []
    for d in sorted({cells.shape[1] for cells in blocks}):
        cells = np.concatenate([each for each in blocks if each.shape[1] == d])
        places, kept = levels.clip(store.coords, cells, sign * values, sign * float(x))
        ids = np.concatenate([np.arange(store.count), store.add(places, float(ctx.option("DENS")))])
        if len(kept):
            parts.append((("POI1", "SEG2", "TRI3", "TET4")[d - 1], ids[kept]))
        values = np.concatenate([values, np.full(len(places), float(x))])
    if not parts:
        ctx.warn(26, "the field has such values nowhere: the mesh is empty")
    return new_mesh(ctx, parts)


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
