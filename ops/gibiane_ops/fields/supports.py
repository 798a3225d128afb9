"""Fields from one support to another: CHAN on fields, REDU, INTG, POIN on fields."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend, operator
from gibiane.values import CHPOINT, LISTMOTS, MAILLAGE, MCHAML, MMODEL, MOT, POINT
from gibiane_ops.fields.components import rename, rename_only
from gibiane_ops.fields.making import mesh_zones
from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.recovery import nodal_mean
from gibiane_ops.kernels.supports import SUPPORTS, integrals, moved, support_points
from gibiane_ops.kernels.topology import places_in, used_nodes
from gibiane_ops.values.algebra import SCAL, SCALAIRE, Field
from gibiane_ops.values.champs import DIFFUS, ChamZone, ChPoint, MChaml, Part
from gibiane_ops.values.listes import ListMots
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.material import field_zones, on_zone
from gibiane_ops.values.mechanics import checked_corners
from gibiane_ops.values.modele import Modele, ModelZone
from gibiane_ops.values.nodes import FloatArray, NodeStore, node_store
from gibiane_ops.values.parts import model_part

CHAN = extend("CHANGER")
TYPE = Arg("subtype", MOT, "sub-type of the result", optional=True)


@CHAN.form(
    Key("CHPO", "a nodal field", required=True),
    Arg("model", MMODEL, "model"),
    Arg("field", MCHAML, "field"),
    Key(("MOYE", "SOMM", "SUPP"), "mean of the elements (default), their sum, or new points", name="how"),
    gives=[CHPOINT],
)
def _to_nodes(ctx: Context, chpo: bool, model: Modele, field: MChaml, how: str | None) -> ChPoint:
    store = node_store(ctx)
    zones = [(z, on_zone(ctx, field, z, "field")) for z in field_zones(ctx, model)]
    if how == "SUPP":
        return _at_points(field, zones, store)
    parts = {}
    for name in field.names:
        having = [(z, v) for z, v in zones if name in v.names]
        nodes = used_nodes([z.cells for z, _ in having])
        cells = [places_in(nodes, z.cells) for z, _ in having]
        values = [_at_nodes(z, v.component(name)[..., None], field) for z, v in having]
        mean = nodal_mean(len(nodes), cells, values)[:, 0]
        if how == "SOMM":
            mean = mean * np.bincount(np.concatenate([c.ravel() for c in cells]), minlength=len(nodes))
        parts[name] = (nodes, mean)
    return ChPoint(store, parts, DIFFUS, field.title)


def _at_points(field: MChaml, zones: list[tuple[ModelZone, ChamZone]], store: NodeStore) -> ChPoint:
    """Return the values of an element field at new points, one where each of its values is."""
    parts: dict[str, list[Part]] = {name: [] for name in field.names}
    for zone, values in zones:
        of = shape(zone.shape)
        places = geometry.positions(of, store.coords[zone.cells], support_points(of, field.support))
        nodes = store.add(places.reshape(-1, 3))
        for name in values.names:
            parts[name].append((nodes, values.component(name).ravel()))
    joined = {
        n: (np.concatenate([p[0] for p in each]), np.concatenate([p[1] for p in each])) for n, each in parts.items()
    }
    return ChPoint(store, joined, DIFFUS, field.title)


def _at_nodes(zone: ModelZone, values: FloatArray, field: MChaml) -> FloatArray:
    """Return the values of elements at their nodes: extended for a scalar field, their mean for others."""
    if field.subtype == SCALAIRE or field.support == "NOEUD":
        return moved(shape(zone.shape), values, field.support, "NOEUD")
    return np.repeat(values.mean(axis=1, keepdims=True), zone.cells.shape[1], axis=1)


@CHAN.form(
    Key(SUPPORTS, "where the values shall stand", name="support", required=True),
    Arg("model", MMODEL, "model"),
    Arg("field", MCHAML, "field"),
    TYPE,
    gives=[MCHAML],
)
def _to_support(ctx: Context, support: str, model: Modele, field: MChaml, subtype: str | None) -> MChaml:
    zones = []
    for zone in field_zones(ctx, model):
        values = on_zone(ctx, field, zone, "field")
        zones.append(ChamZone(zone, values.names, moved(shape(zone.shape), values.values, field.support, support)))
    return MChaml(zones, subtype.strip() if subtype else field.subtype, support, field.title)


@CHAN.form(
    Key("CHAM", "an element field", required=True),
    Arg("field", CHPOINT, "nodal field"),
    Arg("model", (MMODEL, MAILLAGE), "model, or mesh"),
    Key(SUPPORTS, "where the values shall stand (nodes)", name="support"),
    TYPE,
    gives=[MCHAML],
)
def _to_elements(
    ctx: Context, cham: bool, field: ChPoint, model: Modele | Maillage, support: str | None, subtype: str | None
) -> MChaml:
    zones = []
    for zone in mesh_zones(ctx, model) if isinstance(model, Maillage) else field_zones(ctx, model):
        nodal = field.table(field.names, zone.cells.ravel()).reshape(*zone.cells.shape, len(field.names))
        zones.append(ChamZone(zone, field.names, moved(shape(zone.shape), nodal, "NOEUD", support or "NOEUD")))
    return MChaml(zones, subtype.strip() if subtype else SCALAIRE, support or "NOEUD", field.title)


@CHAN.form(
    Key("TYPE", "another sub-type", required=True),
    Arg("field", MCHAML, "field"),
    Arg("subtype", MOT, "sub-type"),
    gives=[MCHAML],
)
def _retyped(ctx: Context, type: bool, field: MChaml, subtype: str) -> MChaml:
    return MChaml(field.zones, subtype.strip(), field.support, field.title)


@CHAN.form(
    Key("ATTRIBUT", "another nature", required=True),
    Arg("field", CHPOINT, "field"),
    Key("NATURE", "nature", Arg("nature", MOT), required=True),
    gives=[CHPOINT],
)
def _renatured(ctx: Context, attribut: bool, field: ChPoint, nature: str) -> ChPoint:
    known = {"INDE": "INDETERMINE", "DIFF": "DIFFUS", "DISC": "DISCRET"}.get(nature[:4].upper())
    if known is None:
        ctx.fail(7, "unknown nature '{nature}'; accepted: INDETERMINE, DIFFUS, DISCRET", at="nature", nature=nature)
    return ChPoint(field.store, field.parts, known, field.title)


@CHAN.form(
    Key("TITRE", "another title", required=True),
    Arg("field", CHPOINT, "field"),
    Arg("text", MOT, "title"),
    gives=[CHPOINT],
)
def _retitled(ctx: Context, titre: bool, field: ChPoint, text: str) -> ChPoint:
    return ChPoint(field.store, field.parts, field.nature, text.strip())


@CHAN.form(
    Key("COMP", "other names of components", required=True),
    Arg("name", MOT, "new name"),
    Arg("field", (CHPOINT, MCHAML), "field"),
    Key("NATURE", "nature", Arg("nature", MOT)),
    gives=["CHPOINT|MCHAML"],
)
def _renamed(ctx: Context, comp: bool, name: str, field: Field, nature: str | None) -> Field:
    return rename_only(ctx, name, field, nature, "CHAN 'COMP'")


@CHAN.form(
    Key("COMP", "other names of components", required=True),
    Arg("old", LISTMOTS, "components"),
    Arg("new", LISTMOTS, "new names"),
    Arg("field", (CHPOINT, MCHAML), "field"),
    Key("NATURE", "nature", Arg("nature", MOT)),
    gives=["CHPOINT|MCHAML"],
)
def _renamed_several(ctx: Context, comp: bool, old: ListMots, new: ListMots, field: Field, nature: str | None) -> Field:
    return rename(ctx, old, new, field, nature)


REDU = operator(
    "REDUIRE",
    topic="fields",
    summary="a field or a model on a part of its support",
    notice="`REDU CH G`: a nodal field on the nodes of a mesh, of a point or of another field; an element field on the "
    "elements of a mesh or of a model; a model on the elements of a mesh. The elements of the mesh must be among "
    "those of the field or model. `REDU MODL 'CONTACT'`: the contact zones of a model; `REDU RIG G`: the stiffness of "
    "some elements, and the conditions whose nodes all belong to the mesh.",
    example="OPTI DIME 2 ELEM SEG2 ; L = DROIT 2 (0. 0.) (1. 0.) ; CH = COOR 1 L ;\n"
    "MESS (MAXI (REDU CH (L POIN 'INIT'))) ;",
    see=["EXCO", "ELEM"],
)


@REDU.form(Arg("field", CHPOINT, "field"), Arg("where", (MAILLAGE, POINT), "where"), gives=[CHPOINT])
def _on_mesh(ctx: Context, field: ChPoint, where: Maillage | Point) -> ChPoint:
    nodes = where.nodes if isinstance(where, Maillage) else np.array([where.node])
    return _limited(field, nodes)


@REDU.form(Arg("field", CHPOINT, "field"), Arg("where", CHPOINT, "field that says where"), gives=[CHPOINT])
def _on_field(ctx: Context, field: ChPoint, where: ChPoint) -> ChPoint:
    kept = [nodes[values != 0] for nodes, values in where.parts.values()]
    return _limited(field, np.unique(np.concatenate(kept)) if kept else np.zeros(0, np.int64))


def _limited(field: ChPoint, nodes: Any) -> ChPoint:
    parts = {}
    for name, (own, values) in field.parts.items():
        inside = np.isin(own, nodes)
        if inside.any():
            parts[name] = (own[inside], values[inside])
    return ChPoint(field.store, parts, field.nature, field.title)


@REDU.form(Arg("model", MMODEL, "model"), Arg("mesh", MAILLAGE, "elements"), gives=[MMODEL])
def _model(ctx: Context, model: Modele, mesh: Maillage) -> Modele:
    return model_part(ctx, model, mesh)


@REDU.form(Arg("field", MCHAML, "element field"), Arg("model", MMODEL, "model"), gives=[MCHAML])
def _on_model(ctx: Context, field: MChaml, model: Modele) -> MChaml:
    zones = [on_zone(ctx, field, z, "field") for z in model.zones]
    contacts = [found for c in model.contacts if (found := field.zone_of(c)) is not None]
    return MChaml([*zones, *contacts], field.subtype, field.support, field.title)


@REDU.form(Arg("field", MCHAML, "element field"), Arg("mesh", MAILLAGE, "elements"), gives=[MCHAML])
def _on_elements(ctx: Context, field: MChaml, mesh: Maillage) -> MChaml:
    whole = Modele([z.zone for z in field.zones if isinstance(z.zone, ModelZone)])
    zones = [on_zone(ctx, field, z, "field") for z in model_part(ctx, whole, mesh).zones]
    return MChaml(zones, field.subtype, field.support, field.title)


@REDU.form(Arg("model", MMODEL, "model"), Key("CONTACT", "its contact zones", required=True), gives=[MMODEL])
def _contacts(ctx: Context, model: Modele, contact: bool) -> Modele:
    if not model.contacts:
        ctx.fail(21, "this model has no contact zone", at="model", hint="MODE G1 G2 'CONTACT' ... makes one")
    return Modele([], model.contacts)


INTG = operator(
    "INTG",
    topic="fields",
    summary="integral of an element field",
    notice="`INTG MODL CH (c)`: the integral of the component c (of the only one) over the model; with 'ELEM' over "
    "each element, an element field. In mode AXIS over the whole body of revolution (factor 2 pi r).",
    example="""
    OPTI DIME 2 ELEM QUA4 ; S = (DROI 2 (0. 0.) (2. 0.)) TRAN 2 (0. 1.) ;
    MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MESS (INTG MO (MANU 'CHML' MO 'SCAL' 3.)) ;
    """,
    see=["ENERGIE", "MANUEL"],
)


@INTG.form(
    Arg("model", MMODEL, "model"),
    Arg("field", MCHAML, "field"),
    Key("ELEM", "over each element"),
    Arg("name", MOT, "component", optional=True),
    Arg("cara", MCHAML, "geometry of shells", optional=True),
    gives=["FLOTTANT|MCHAML"],
)
def _intg(ctx: Context, model: Modele, field: MChaml, elem: bool, name: str | None, cara: MChaml | None) -> Any:
    if name is None:
        if len(field.names) != 1:
            ctx.fail(
                236,
                "the field has {count} components ({known}): name the one to integrate",
                at="field",
                count=len(field.names),
                known=" ".join(field.names),
            )
        name = field.names[0]
    name = name.strip()
    zones = []
    for zone in field_zones(ctx, model):
        values = on_zone(ctx, field, zone, "field")
        if name not in values.names:
            ctx.fail(
                236,
                "the field has no component {name}; it has {known}",
                at="name",
                name=name,
                known=" ".join(values.names),
            )
        corners = checked_corners(ctx, zone)
        column = values.component(name)[..., None]
        total = integrals(shape(zone.shape), corners, column, field.support, axisymmetric=zone.axisymmetric)
        zones.append(ChamZone(zone, [SCAL], total[:, None, :]))
    if elem:
        return MChaml(zones, SCALAIRE, "GRAVITE")
    return float(sum(z.values.sum() for z in zones))


GRAD = operator(
    "GRADIENT",
    topic="fields",
    summary="gradient of a nodal field",
    notice="`GRAD MODL CH`: an element field of sub-type GRADIENT at the stress points, whose component `T,X` is the "
    "derivative of T by x; of a displacement the components are UX,X UX,Y and so on.",
    example="""
    OPTI DIME 2 ELEM QUA4 ; S = (DROI 2 (0. 0.) (2. 0.)) TRAN 2 (0. 1.) ;
    MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; G = GRAD MO (NOMC 'T' (COOR 1 S)) ; MESS (MAXI (EXCO 'T,X' G)) ;
    """,
    see=["EPSI"],
)


@GRAD.form(
    Arg("model", MMODEL, "model"),
    Arg("field", CHPOINT, "nodal field"),
    Arg("cara", MCHAML, "geometry of shells", optional=True),
    gives=[MCHAML],
)
def _grad(ctx: Context, model: Modele, field: ChPoint, cara: MChaml | None) -> MChaml:
    zones = []
    for zone in field_zones(ctx, model):
        of = shape(zone.shape)
        axes = ("R", "Z") if zone.mode == "AXIS" else ("X", "Y", "Z")[: zone.dim]
        names = [n for n in field.names if len(np.intersect1d(field.parts[n][0], zone.cells))]
        nodal = field.table(names, zone.cells.ravel()).reshape(*zone.cells.shape, len(names))
        gradient, _ = geometry.gradients(of, checked_corners(ctx, zone), of.gauss[0])
        values = np.einsum("mqnd,mnc->mqcd", gradient, nodal)
        zones.append(ChamZone(zone, [f"{n},{a}" for n in names for a in axes], values.reshape(*values.shape[:2], -1)))
    return MChaml(zones, "GRADIENT", "STRESSES")
