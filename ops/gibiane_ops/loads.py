"""Loads: FORC, PRES, FSUR, CNEQ."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, MAILLAGE, MCHAML, MMODEL, POINT
from gibiane_ops.kernels import assembly, integrals, topology
from gibiane_ops.kernels.contact.outward import facets_of_body
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import EmptyContact
from gibiane_ops.kernels.supports import moved
from gibiane_ops.values.champs import DISCRET, ChPoint, MChaml
from gibiane_ops.values.conditions import ROTATIONS, family, support
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.material import MATERIAL, on_zone, properties, solid_zones
from gibiane_ops.values.mechanics import checked_corners
from gibiane_ops.values.modele import DUALS, FORCES, Modele, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store

_EXAMPLE = (
    "OPTI DIME 2 ELEM QUA4 ; S = (DROI 2 (0 0) (1 0)) TRAN 2 (0 1) ;\n"
    "MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.1E11 'NU' 0.3 ;\n"
)

FORC = operator(
    "FORCE",
    topic="loads",
    summary="forces on the nodes of a mesh or point",
    notice="`FORC V G`: the vector V is shared between the nodes of G, V/n each. `FORC 'FX' x ('FY' y) G` "
    "likewise, by component.",
    example=_EXAMPLE + "F = FORC (0 -1.E6) (S POIN 'DROI' (0 1) (1 1) 1.E-6) ; LIST F ;",
    see=["PRESSION"],
)


@FORC.form(Arg("v", POINT, "vector"), Arg("g", (MAILLAGE, POINT), "where"), gives=[CHPOINT])
def _forc(ctx: Context, v: Point, g: Maillage | Point) -> ChPoint:
    nodes = support(ctx, g)
    names = FORCES[family(ctx)]
    share = v.coords[: len(names)] / len(nodes)
    return ChPoint.from_table(node_store(ctx), names, nodes, np.tile(share, (len(nodes), 1)), DISCRET)


@FORC.form(
    *(Key(name, "component", Arg("x", FLOTTANT)) for name in ("FX", "FY", "FZ", "FR")),
    Arg("g", (MAILLAGE, POINT), "where"),
    gives=[CHPOINT],
)
def _forc_named(
    ctx: Context, fx: float | None, fy: float | None, fz: float | None, fr: float | None, g: Maillage | Point
) -> ChPoint:
    return _by_name(ctx, {"FX": fx, "FY": fy, "FZ": fz, "FR": fr}, FORCES[family(ctx)], g)


def _by_name(ctx: Context, values: dict[str, float | None], known: Sequence[str], g: Maillage | Point) -> ChPoint:
    """Share the components given between the nodes of a mesh."""
    given = {n: x for n, x in values.items() if x is not None}
    wrong = [n for n in given if n not in known]
    if wrong or not given:
        ctx.fail(
            197,
            "{name} is not a force here; the forces are {known}",
            name=wrong[0] if wrong else "this",
            known=" ".join(known),
        )
    nodes = support(ctx, g)
    return ChPoint(
        node_store(ctx), {n: (nodes, np.full(len(nodes), x / len(nodes))) for n, x in given.items()}, DISCRET
    )


MOME = operator(
    "MOMENT",
    topic="loads",
    summary="moments on the nodes of a mesh or point",
    notice="`MOME V G`: the vector V is shared between the nodes of G, V/n each; `MOME 'MZ' x G` likewise, by "
    "component (MX MY MZ in space, MZ in the plane, MT in mode AXIS). Solids and bars have no rotations: RESO says so "
    "(54), and a couple on a face of a solid is a pair of forces, or a traction (FSUR of a CHPOINT).",
    example="OPTI DIME 2 ; P = 0. 0. ; LIST (MOME 'MZ' 2. P) ;",
    see=["FORCE", "FSUR"],
)


@MOME.form(Arg("v", POINT, "vector"), Arg("g", (MAILLAGE, POINT), "where"), gives=[CHPOINT])
def _mome(ctx: Context, v: Point, g: Maillage | Point) -> ChPoint:
    names = MOMENTS[family(ctx)]
    if len(names) == 1:
        ctx.fail(34, "a vector of moments is for space: here MOME '{name}' x G", at="v", name=names[0])
    nodes = support(ctx, g)
    return ChPoint.from_table(node_store(ctx), names, nodes, np.tile(v.coords / len(nodes), (len(nodes), 1)), DISCRET)


@MOME.form(
    *(Key(name, "component", Arg("x", FLOTTANT)) for name in ("MX", "MY", "MZ", "MT")),
    Arg("g", (MAILLAGE, POINT), "where"),
    gives=[CHPOINT],
)
def _mome_named(
    ctx: Context, mx: float | None, my: float | None, mz: float | None, mt: float | None, g: Maillage | Point
) -> ChPoint:
    return _by_name(ctx, {"MX": mx, "MY": my, "MZ": mz, "MT": mt}, MOMENTS[family(ctx)], g)


PRES = operator(
    "PRESSION",
    topic="loads",
    summary="nodal forces of a pressure",
    notice="Consistent forces of a pressure on facets of the boundary of the model; positive, it pushes into "
    "the solid, whichever way the facets turn. The pressure is a number or a CHPOINT (one component); without "
    "facets the CHPOINT acts on those of the boundary that have all their nodes in it. In mode AXIS the forces are "
    "those of the whole body of revolution. `PRES MODL 'PRES' p (G)` (or a MCHAML of pressures) on a model "
    "'CHARGEMENT' 'PRESSION' gives a MCHAML, and BSIG the forces: p acts against the normals of its facets.",
    example=_EXAMPLE + "F = PRES 'MASS' MO 1.E6 (CONT S ELEM 'APPU' 'STRI' (S POIN 'DROI' (0 1) (1 1) 1.E-6)) ;\n"
    "LIST F ;",
    see=["FORCE", "FSUR", "CNEQ"],
)
FSUR = operator(
    "FSUR",
    topic="loads",
    summary="nodal forces of a surface traction",
    notice="Consistent forces of a force per unit of area: a vector, or a CHPOINT with the names of forces (FX FY FZ, "
    "FR FZ in mode AXIS), on facets of the boundary; without facets the CHPOINT acts on those of the boundary that "
    "have all their nodes in it.",
    example=_EXAMPLE + "F = FSUR 'MASS' MO (0 -1.E6) (CONT S ELEM 'APPU' 'STRI' (S POIN 'DROI' (0 1) (1 1) 1.E-6)) ;\n"
    "LIST F ;",
    see=["PRESSION", "FORCE", "CNEQ"],
)
CNEQ = operator(
    "CNEQ",
    topic="loads",
    summary="nodal forces of a force per unit of volume",
    notice="`CNEQ MODL CH`: the consistent forces of a CHPOINT or MCHAML whose components are forces per unit of "
    "volume (FX FY FZ, FR FZ in mode AXIS), such as a weight: density times gravity. Bars want their section too: "
    "`CNEQ MODL CH CAR`, with SECT in CAR.",
    example=_EXAMPLE + "F = CNEQ MO (MANU 'CHPO' S 'FY' (-9.81 * 7800.)) ; LIST (RESU F) ;",
    see=["FORCE", "PRESSION", "MASSE"],
)
MOMENTS = {mode: tuple(DUALS[name] for name in names) for mode, names in ROTATIONS.items()}
MASSIVE = Key("MASS", "on a solid", required=True)
Loaded = list[tuple[str, IntArray]]


def _sum(ctx: Context, zone: ModelZone, blocks: list[tuple[IntArray, FloatArray]]) -> ChPoint:
    """Return the field of the forces of elements, (m, n, d) each."""
    nodes = topology.used_nodes([cells for cells, _ in blocks])
    local = [(topology.places_in(nodes, cells), forces) for cells, forces in blocks]
    total = assembly.assemble_vector(len(nodes), zone.dim, local).reshape(-1, zone.dim)
    return ChPoint.from_table(node_store(ctx), FORCES[zone.family], nodes, total, DISCRET)


def _solids(ctx: Context, model: Modele) -> list[ModelZone]:
    """Return the zones that fill the space (bars have no facets)."""
    zones = [zone for zone in model.zones if not zone.bars]
    if not zones:
        ctx.fail(26, "this model has no solid", at="model")
    return zones


def _checked_facets(ctx: Context, g: Maillage, dim: int) -> Loaded:
    wrong = [b.shape for b in g.blocks if shape(b.shape).dim != dim - 1]
    if wrong or not g.n_cells:
        ctx.fail(
            16,
            "a pressure acts on facets, not on {shapes}",
            at="g",
            shapes=", ".join(wrong) or "an empty mesh",
            hint="FACE, ENVE or CONT give the facets of a solid; ELEM 'APPU' chooses among them",
        )
    return g.kernel_blocks


def _facets_in(ctx: Context, zones: list[ModelZone], field: ChPoint) -> Loaded:
    """Return the facets of the boundary that have all their nodes in a field."""
    boundary = topology.boundary([(z.shape, z.cells) for z in zones])
    inside = {name: facets.nodes[np.isin(facets.nodes, field.nodes).all(axis=1)] for name, facets in boundary.items()}
    found = [(name, cells) for name, cells in inside.items() if len(cells)]
    if not found:
        ctx.fail(
            21,
            "no facet of the boundary of the model has all its nodes in the field",
            at="field",
            hint="give the field on a part of the boundary, or the facets after it",
        )
    return found


@PRES.form(
    MASSIVE,
    Arg("model", MMODEL, "model"),
    Arg("p", FLOTTANT, "pressure"),
    Arg("g", MAILLAGE, "facets"),
    gives=[CHPOINT],
)
def _pres(ctx: Context, mass: bool, model: Modele, p: float, g: Maillage) -> ChPoint:
    zones = _solids(ctx, model)
    return _pressure(ctx, zones, _checked_facets(ctx, g, zones[0].dim), lambda cells: p)


@PRES.form(
    MASSIVE,
    Arg("model", MMODEL, "model"),
    Arg("field", CHPOINT, "pressure"),
    Arg("g", MAILLAGE, "facets", optional=True),
    gives=[CHPOINT],
)
def _pres_field(ctx: Context, mass: bool, model: Modele, field: ChPoint, g: Maillage | None) -> ChPoint:
    if len(field.names) != 1:
        ctx.fail(26, "the pressure has several components", at="field")
    zones = _solids(ctx, model)
    facets = _facets_in(ctx, zones, field) if g is None else _checked_facets(ctx, g, zones[0].dim)
    name = field.names[0]
    return _pressure(ctx, zones, facets, lambda cells: field.at(name, cells.ravel()).reshape(cells.shape))


def _pressure(ctx: Context, zones: list[ModelZone], facets: Loaded, value: Callable[[IntArray], Any]) -> ChPoint:
    zone = zones[0]
    x = node_store(ctx).coords[:, : zone.dim]
    try:
        turned = facets_of_body([(z.shape, z.cells) for z in zones], facets)
    except EmptyContact as failure:
        ctx.fail(21, "{reason}", at="g", reason=failure.reason, hint="is the model made of the solid that has them?")
    with worded(ctx, at="g"):
        forces = [
            (c, integrals.pressure_load(shape(n), x[c], value(c), axisymmetric=zone.axisymmetric)) for n, c in turned
        ]
    return _sum(ctx, zone, forces)


def _named_forces(ctx: Context, zone: ModelZone, field: ChPoint | MChaml) -> None:
    """Refuse a field that holds anything but forces of this mode."""
    known = FORCES[zone.family]
    wrong = [name for name in field.names if name not in known]
    if wrong:
        ctx.fail(
            197,
            "{name} is not a force here; the forces are {known}",
            at="field",
            name=wrong[0],
            known=" ".join(known),
        )


@FSUR.form(
    MASSIVE,
    Arg("model", MMODEL, "model"),
    Arg("v", POINT, "traction"),
    Arg("g", MAILLAGE, "facets"),
    gives=[CHPOINT],
)
def _fsur(ctx: Context, mass: bool, model: Modele, v: Point, g: Maillage) -> ChPoint:
    zone = _solids(ctx, model)[0]
    return _traction(ctx, zone, _checked_facets(ctx, g, zone.dim), lambda cells: v.coords[: zone.dim])


@FSUR.form(
    MASSIVE,
    Arg("model", MMODEL, "model"),
    Arg("field", CHPOINT, "traction"),
    Arg("g", MAILLAGE, "facets", optional=True),
    gives=[CHPOINT],
)
def _fsur_field(ctx: Context, mass: bool, model: Modele, field: ChPoint, g: Maillage | None) -> ChPoint:
    zones = _solids(ctx, model)
    zone = zones[0]
    _named_forces(ctx, zone, field)
    facets = _facets_in(ctx, zones, field) if g is None else _checked_facets(ctx, g, zone.dim)
    return _traction(ctx, zone, facets, lambda cells: _nodal(zone, field, cells))


def _nodal(zone: ModelZone, field: ChPoint, cells: IntArray) -> FloatArray:
    """Return the forces of a nodal field at the nodes of elements, (m, n, d)."""
    return field.table(FORCES[zone.family], cells.ravel()).reshape(*cells.shape, zone.dim)


def _traction(ctx: Context, zone: ModelZone, facets: Loaded, value: Callable[[IntArray], FloatArray]) -> ChPoint:
    x = node_store(ctx).coords[:, : zone.dim]
    with worded(ctx, at="g"):
        forces = [
            (c, integrals.distributed_load(shape(n), x[c], value(c), axisymmetric=zone.axisymmetric)) for n, c in facets
        ]
    return _sum(ctx, zone, forces)


@CNEQ.form(
    Arg("model", MMODEL, "model"),
    Arg("field", (CHPOINT, MCHAML), "force per unit of volume"),
    Arg("cara", MCHAML, "section of bars", optional=True, subtype=MATERIAL),
    gives=[CHPOINT],
)
def _cneq(ctx: Context, model: Modele, field: ChPoint | MChaml, cara: MChaml | None) -> ChPoint:
    forces = []
    for zone in solid_zones(ctx, model):
        _named_forces(ctx, zone, field)
        if isinstance(field, ChPoint):
            density = _nodal(zone, field, zone.cells)
        else:
            values, of = on_zone(ctx, field, zone, "field"), shape(zone.shape)
            table = np.zeros((*values.values.shape[:2], zone.dim))
            table[..., [FORCES[zone.family].index(n) for n in values.names]] = values.values
            density = moved(of, table, field.support, "NOEUD")
        if zone.bars:
            if cara is None:
                raise ctx.operands.missing(MCHAML, "the section of the bars (CARA MODL 'SECT' ...)")
            density = density * properties(ctx, cara, zone, ("SECT",), "cara")[..., None, None]
        x = checked_corners(ctx, zone)
        with worded(ctx, at="model"):
            each = integrals.distributed_load(shape(zone.shape), x, density, axisymmetric=zone.axisymmetric)
        forces.append((zone.cells, each))
    return _sum(ctx, model.zones[0], forces)
