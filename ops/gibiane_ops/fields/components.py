"""Components of fields: EXCO, NOMC, EXTR on fields and models, EXIS of a component."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.diagnostics import nearest
from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend, operator
from gibiane.values import (
    CHPOINT,
    ENTIER,
    FLOTTANT,
    LISTMOTS,
    LOGIQUE,
    MAILLAGE,
    MCHAML,
    MMODEL,
    MOT,
    POINT,
    TABLE,
    Table,
)
from gibiane_ops.values.algebra import SCAL, Field, Incompatible, chosen
from gibiane_ops.values.champs import DIFFUS, DISCRET, INDETERMINE, ChPoint, MChaml
from gibiane_ops.values.listes import ListMots, ListReel
from gibiane_ops.values.maillage import Block, Maillage, Point
from gibiane_ops.values.modele import DISPLACEMENTS, FORCES, STRAINS, STRESSES, Modele

FIELD = (CHPOINT, MCHAML)
NATURES = {"INDE": INDETERMINE, "DIFF": DIFFUS, "DISC": DISCRET}
NATURE = Key("NATURE", "nature of the result", Arg("nature", MOT, "INDETERMINE, DIFFUS or DISCRET"), name="nature")


def with_nature(ctx: Context, field: Field, nature: str | None) -> Field:
    """Return a nodal field with the nature that the user asks for."""
    if nature is None:
        return field
    known = NATURES.get(nature[:4].upper())
    if known is None:
        ctx.fail(7, "unknown nature '{nature}'; accepted: INDETERMINE, DIFFUS, DISCRET", at="nature", nature=nature)
    if not isinstance(field, ChPoint):
        ctx.fail(19, "only a nodal field has a nature", at="nature")
    return ChPoint(field.store, field.parts, known, field.title)


def pick(ctx: Context, field: Field, names: list[str], new: list[str], *, lenient: bool, at: str) -> Field:
    """Return some components of a field under other names; an absent one is error 181 (or 236)."""
    try:
        return chosen(field, names, new, lenient=lenient)
    except Incompatible as failure:
        close = nearest(str(failure.fields.get("name", "")), field.names)
        ctx.fail(
            failure.code,
            failure.template,
            at=at,
            close=close,
            hint="did you mean {close}?" if close else None,
            **failure.fields,
        )


def rename(ctx: Context, old: ListMots, new: ListMots, field: Field, nature: str | None) -> Field:
    """Return a field some of whose components (operand `old`) have other names (operand `new`)."""
    if len(old.words) != len(new.words):
        ctx.fail(212, "{old} components and {new} new names", at="new", old=len(old.words), new=len(new.words))
    pick(ctx, field, list(old.words), list(new.words), lenient=False, at="old")
    table = dict(zip(old.words, new.words, strict=True))
    names = [table.get(n, n) for n in field.names]
    if len(set(names)) < len(names):
        ctx.fail(21, "two components would have one name", at="new")
    return with_nature(ctx, chosen(field, field.names, names), nature)


EXCO = operator(
    "EXCO",
    topic="fields",
    summary="some components of a field, as a field",
    notice="`EXCO 'UX' U` gives the component UX, renamed SCAL for a nodal field unless another name follows "
    "it; an element field keeps the name. With a LISTMOTS of names (and one of new names) several "
    "components. An absent component is an error, unless 'NOID' is given.",
    example="OPTI DIME 2 ; P = 0. 1. ; U = MANU 'CHPO' P 'UX' 1. 'UY' 2. ;\nMESS (MAXI (EXCO 'UY' U)) ;",
    see=["NOMC", "EXTRAIRE"],
)


@EXCO.form(
    Arg("name", MOT, "component"),
    Key("NOID", "no error when it is absent"),
    Arg("field", FIELD, "field"),
    Arg("new", MOT, "new name", optional=True),
    NATURE,
    gives=["CHPOINT|MCHAML"],
)
def _exco(ctx: Context, name: str, noid: bool, field: Field, new: str | None, nature: str | None) -> Field:
    name = name.strip()
    result = new.strip() if new is not None else SCAL if isinstance(field, ChPoint) else name
    return with_nature(ctx, pick(ctx, field, [name], [result], lenient=noid, at="name"), nature)


@EXCO.form(
    Arg("names", LISTMOTS, "components"),
    Key("NOID", "no error when some are absent"),
    Arg("field", FIELD, "field"),
    Arg("new", LISTMOTS, "new names", optional=True),
    NATURE,
    gives=["CHPOINT|MCHAML"],
)
def _exco_several(
    ctx: Context, names: ListMots, noid: bool, field: Field, new: ListMots | None, nature: str | None
) -> Field:
    if new is not None and len(new.words) != len(names.words):
        ctx.fail(212, "{old} components and {new} new names", at="new", old=len(names.words), new=len(new.words))
    renamed = list(new.words if new is not None else names.words)
    return with_nature(ctx, pick(ctx, field, list(names.words), renamed, lenient=noid, at="names"), nature)


NOMC = operator(
    "NOMC",
    topic="fields",
    summary="rename the components of a field",
    notice="`NOMC 'T' CH` renames the only component of CH; `NOMC LM1 LM2 CH` renames the components LM1 into "
    "LM2 and keeps the others.",
    example="OPTI DIME 2 ; P = 0. 1. ; U = MANU 'CHPO' P 'UX' 1. ;\nMESS (EXTR (NOMC 'T' U) 'T' P) ;",
    see=["EXCO"],
)


def rename_only(ctx: Context, name: str, field: Field, nature: str | None, word: str) -> Field:
    """Give another name to the one component of a field."""
    if len(field.names) != 1:
        ctx.fail(
            21,
            "the field has {count} components ({known}): which is to be renamed?",
            at="field",
            count=len(field.names),
            known=" ".join(field.names),
            word=word,
            hint="{word} (MOTS 'old') (MOTS 'new') FIELD renames some of them",
        )
    return with_nature(ctx, chosen(field, field.names, [name.strip()]), nature)


@NOMC.form(Arg("name", MOT, "new name"), Arg("field", FIELD, "field"), NATURE, gives=["CHPOINT|MCHAML"])
def _nomc(ctx: Context, name: str, field: Field, nature: str | None) -> Field:
    return rename_only(ctx, name, field, nature, "NOMC")


@NOMC.form(
    Arg("old", LISTMOTS, "components"),
    Arg("new", LISTMOTS, "new names"),
    Arg("field", FIELD, "field"),
    NATURE,
    gives=["CHPOINT|MCHAML"],
)
def _nomc_several(ctx: Context, old: ListMots, new: ListMots, field: Field, nature: str | None) -> Field:
    return rename(ctx, old, new, field, nature)


EXTR = extend("EXTRAIRE")


@EXTR.form(
    Arg("field", CHPOINT, "nodal field"), Arg("point", POINT, "node"), Arg("name", MOT, "component"), gives=[FLOTTANT]
)
def _value(ctx: Context, field: ChPoint, point: Point, name: str) -> float:
    name = name.strip()
    pick(ctx, field, [name], [name], lenient=False, at="name")
    return float(field.at(name, np.array([point.node]))[0])


@EXTR.form(
    Arg("field", MCHAML, "element field"),
    Arg("zone", ENTIER, "number of the zone"),
    Arg("element", ENTIER, "number of the element"),
    Arg("point", ENTIER, "number of the point in it"),
    Arg("name", MOT, "component"),
    gives=[FLOTTANT],
)
def _element_value(ctx: Context, field: MChaml, zone: int, element: int, point: int, name: str) -> float:
    name = name.strip()
    pick(ctx, field, [name], [name], lenient=False, at="name")
    if not 1 <= zone <= len(field.zones):
        ctx.fail(1068, "there is no zone {n}: the field has {size}", at="zone", n=zone, size=len(field.zones))
    found = field.zones[zone - 1]
    if name not in found.names:
        ctx.fail(
            236,
            "the zone {zone} has no component {name}; it has {known}",
            at="name",
            zone=zone,
            name=name,
            known=" ".join(found.names),
        )
    for what, n, size in (("element", element, len(found.values)), ("point", point, found.values.shape[1])):
        if not 1 <= n <= size:
            ctx.fail(1068, "there is no {what} {n}: this zone has {size}", at=what, what=what, n=n, size=size)
    return float(found.component(name)[element - 1, point - 1])


@EXTR.form(
    Arg("field", CHPOINT, "nodal field"),
    Key(("COMP", "MAIL", "NATU", "TITR", "TYPE"), "names, support, nature or title", name="what", required=True),
    gives=["LISTMOTS|MAILLAGE|MOT"],
)
def _of_nodal(ctx: Context, field: ChPoint, what: str) -> Any:
    if what == "COMP":
        return ListMots(field.names)
    if what == "MAIL":
        return Maillage.of_nodes(field.store, field.nodes)
    return field.nature if what == "NATU" else field.title


@EXTR.form(
    Arg("field", CHPOINT, "nodal field"),
    Key("VALE", "values of a component", Arg("name", MOT, optional=True), required=True),
    Arg("g", MAILLAGE, "where, in the order of its nodes", optional=True),
    gives=["LISTREEL"],
)
def _values(ctx: Context, field: ChPoint, vale: str | None, g: Maillage | None) -> ListReel:
    name = vale.strip() if vale is not None else field.names[0] if len(field.names) == 1 else None
    if name is None:
        ctx.fail(21, "the field has {count} components: name one", at="vale", count=len(field.names))
    pick(ctx, field, [name], [name], lenient=False, at="vale")
    return ListReel(field.at(name, field.parts[name][0] if g is None else g.nodes_in_order()))


@EXTR.form(
    Arg("field", MCHAML, "element field"),
    Key(("COMP", "MAIL", "TYPE", "NBZO"), "names, support, sub-type or number of zones", name="what", required=True),
    gives=["LISTMOTS|MAILLAGE|MOT|ENTIER"],
)
def _of_element_field(ctx: Context, field: MChaml, what: str) -> Any:
    if what == "COMP":
        return ListMots(field.names)
    if what == "MAIL":
        return _together([z.zone.mesh for z in field.zones if hasattr(z.zone, "mesh")], ctx)
    return len(field.zones) if what == "NBZO" else field.subtype


def _together(meshes: list[Maillage], ctx: Context) -> Maillage:
    """Return the meshes of several zones as one, each shape once."""
    if not meshes:
        ctx.fail(21, "there is no solid zone", at="field")
    shapes = dict.fromkeys(b.shape for m in meshes for b in m.blocks)
    blocks = []
    for shape in shapes:
        same = [b for m in meshes for b in m.blocks if b.shape == shape]
        blocks.append(Block(shape, np.concatenate([b.cells for b in same]), np.concatenate([b.colours for b in same])))
    return Maillage(meshes[0].store, blocks)


_TABLES = {"CONTRAINTES": STRESSES, "DEFORMATIONS": STRAINS, "DEPLACEMENTS": DISPLACEMENTS, "FORCES": FORCES}


@EXTR.form(Arg("model", MMODEL, "model"), Key("MAIL", "its mesh", required=True), gives=[MAILLAGE])
def _mesh_of_model(ctx: Context, model: Modele, mail: bool) -> Maillage:
    meshes = [z.mesh for z in (*model.zones, *model.heated, *model.loads)]
    return _together(meshes or [m for c in model.contacts for m in (c.master, c.slave)], ctx)


@EXTR.form(
    Arg("model", MMODEL, "model"),
    Key(tuple(_TABLES), "names of components", name="what", required=True, width=6),
    gives=[LISTMOTS],
)
def _names_of_model(ctx: Context, model: Modele, what: str) -> ListMots:
    if not model.zones:
        ctx.fail(21, "the model has no solid", at="model", hint="contact, pressure and heat are no elastic solids")
    return ListMots(_TABLES[what][model.zones[0].family])


@EXTR.form(Arg("model", MMODEL, "model"), Key("ZONE", "its zones, one by one", required=True), gives=[TABLE])
def _zones_of_model(ctx: Context, model: Modele, zone: bool) -> Table:
    table = Table()
    every = [Modele([each]) for each in model.zones] + [Modele([], [each]) for each in model.contacts]
    every += [Modele([], [], [each]) for each in model.loads]
    every += [Modele([], [], [], [each]) for each in model.heated]
    for number, each in enumerate(every, 1):
        table.set(number, each)
    return table


@extend("EXIS").form(
    Arg("field", FIELD, "field"), Arg("name", (MOT, LISTMOTS), "component", optional=True), gives=[LOGIQUE]
)
def _exists(ctx: Context, field: Field, name: str | ListMots | None) -> bool:
    if name is None:
        return True
    wanted = name.words if isinstance(name, ListMots) else (name.strip(),)
    return set(wanted) <= set(field.names)


@extend("ENLEVER").form(
    Arg("field", FIELD, "field"), Arg("name", (MOT, LISTMOTS), "component"), gives=["CHPOINT|MCHAML"]
)
def _without(ctx: Context, field: Field, name: str | ListMots) -> Field:
    dropped = name.words if isinstance(name, ListMots) else (name.strip(),)
    pick(ctx, field, list(dropped), list(dropped), lenient=False, at="name")
    return chosen(field, [n for n in field.names if n not in dropped])
