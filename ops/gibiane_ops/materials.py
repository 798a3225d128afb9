"""MATE and CARA: properties of materials and of elements."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.binding import Operands
from gibiane.diagnostics import nearest
from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, MCHAML, MMODEL, MOT, POINT
from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.values.champs import ChamZone, ChPoint, MChaml
from gibiane_ops.values.contact import MAY_HAVE, NEEDS, RANGES
from gibiane_ops.values.maillage import Point
from gibiane_ops.values.material import AXES, MATERIAL, MODULI, NEEDED, elastic_law
from gibiane_ops.values.mechanics import corners
from gibiane_ops.values.modele import Modele, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray

CONTACT = {
    "MU": "friction coefficient",
    "COHE": "cohesion, a stress",
    "SEUI": "bound of Tresca's friction, a stress",
    "KT": "stiffness of the elastic slip, stress over length",
    "EXPO": "exponent of Norton-Hoff",
    "VREF": "slip scale of Norton-Hoff",
    "ADHE": "adhesion, a stress",
    "JEU": "initial gap, instead of the one of the geometry",
}
COMMON = {
    "RHO": "mass density",
    "TREF": "temperature without thermal strain",
    "TALP": "temperature that the expansion counts from",
}
ISOTROPIC = {"YOUN": "Young's modulus", "NU": "Poisson's ratio", "ALPH": "thermal expansion"} | COMMON
ORTHOTROPIC = {
    **dict.fromkeys(MODULI[:3], "Young's modulus along an axis"),
    **dict.fromkeys(MODULI[3:6], "Poisson's ratio of two axes"),
    **dict.fromkeys(MODULI[6:], "shear modulus of two axes"),
    **dict.fromkeys(("ALP1", "ALP2", "ALP3"), "thermal expansion along an axis"),
} | COMMON
SECTION = {"SECT": "section of bars"}
DIRECTIONS = ("DIRECTION", "RADIAL", "PARALLELE", "INCLINE")

MATE = operator(
    "MATERIAU",
    topic="models",
    summary="properties of a material",
    notice="Pairs of a name and a value. Isotropic solid: YOUN (Young's modulus), NU (Poisson's ratio), RHO (density), "
    "ALPH (thermal expansion), TALP (temperature that it counts from, 0 by default), TREF. Orthotropic solid: "
    "YG1 YG2 NU12 G12 in plane stress, YG3 NU13 NU23 too in the other plane modes, G13 G23 too in space; "
    "ALP1 ALP2 ALP3; the axes are those of space, or given by 'DIRECTION' V1 (V2 in space: the plane of the first "
    "two axes) or 'RADIAL' P1 (P2: an axis in space; the first direction leaves it), turned by 'INCLINE' A "
    "degrees. Bars: YOUN, SECT (section). Contact: MU (friction coefficient), COHE (cohesion, added to MU times "
    "the pressure), SEUI (Tresca's bound), KT (stiffness of the elastic slip), EXPO VREF (Norton-Hoff), ADHE "
    "(tension that surfaces in contact withstand before they come off for good; under a tension t the bound of "
    "friction is COHE - MU t), JEU (initial gap, instead of "
    "the one of the geometry: 0. for curved surfaces in touch whose facets cross): numbers, or CHPOINT on the "
    "slave surface. Heat: K (conductivity), RHO and C (capacity); surfaces in a fluid: H (exchange). A value is "
    "a number, or a CHPOINT or MCHAML, of which each element takes its mean.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROI 1 (0 0) (1 0)) TRAN 1 (0 1) ;\n"
    "MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.1E11 'NU' 0.3 ; LIST 'RESU' MA ;",
    see=["MODELISER", "RIGIDITE", "EPTH", "CARACTERISTIQUE"],
)
CARA = operator(
    "CARACTERISTIQUE",
    topic="models",
    summary="properties of elements that the mesh does not show",
    notice="Pairs of a name and a value: SECT (section of bars). To be joined to the material by ET, or given to MATE.",
    example="OPTI DIME 2 ELEM SEG2 ; L = DROI 1 (0 0) (1 0) ; MO = MODE L 'MECANIQUE' 'ELASTIQUE' 'BARR' ;\n"
    "MA = (MATE MO 'YOUN' 2.1E11 'NU' 0.3) ET (CARA MO 'SECT' 1.E-4) ; LIST 'RESU' (RIGI MO MA) ;",
    see=["MATERIAU"],
)

VALUE = Arg("x", (FLOTTANT, CHPOINT, MCHAML))
HEAT = {"K": "conductivity", "RHO": "mass density", "C": "heat capacity of a unit of mass"}
EXCHANGE = {"H": "exchange coefficient"}


@MATE.stream(
    *(Key(name, doc, VALUE) for name, doc in (ISOTROPIC | ORTHOTROPIC | SECTION | CONTACT | HEAT | EXCHANGE).items()),
    Key("DIRECTION", "first axis, or plane of the first two", Arg("v", POINT)),
    Key("RADIAL", "centre or axis that the first direction leaves", Arg("p", POINT)),
    Key("INCLINE", "angle from there to the first axis", Arg("a", FLOTTANT)),
    syntax="model:MMODEL name value (name value)... ('DIRECTION' v1 (v2) | 'RADIAL' p1 (p2)) ('INCLINE' a)",
    gives=[MCHAML],
)
def _mate(ctx: Context, q: Operands) -> MChaml:
    model, given, axes = _read(ctx, q)
    if model.contacts:
        return _contact_material(ctx, model, given)
    if model.heated:
        if model.zones:
            ctx.fail(21, "the model mixes solids and heat: make their materials one by one, and join them by ET")
        return _thermal_material(ctx, model, given)
    zones = []
    for zone in model.zones:
        needed = _needed(zone)
        missing = [name for name in needed if name not in given]
        if missing:
            kind = "an orthotropic" if zone.orthotropic else "an elastic"
            ctx.fail(
                46,
                "the property {name} is missing",
                name=missing[0],
                kind=kind,
                needed=" and ".join(needed) if len(needed) < 3 else " ".join(needed),
                hint="{kind} solid needs {needed}",
            )
        names, values = list(given), _values(ctx, zone, given)
        if axes is not None:
            names += AXES[zone.dim]
            values = np.concatenate([values, axes.of(ctx, zone)[:, None, :]], axis=2)
        zones.append(_checked(ctx, ChamZone(zone, names, values)))
    return MChaml(zones, MATERIAL, "GRAVITE")


@CARA.stream(
    *(Key(name, doc, VALUE) for name, doc in SECTION.items()),
    syntax="model:MMODEL name value (name value)...",
    gives=[MCHAML],
)
def _cara(ctx: Context, q: Operands) -> MChaml:
    model, given, _ = _read(ctx, q)
    return MChaml([ChamZone(z, list(given), _values(ctx, z, given)) for z in model.zones], MATERIAL, "GRAVITE")


def _needed(zone: ModelZone) -> tuple[str, ...]:
    if zone.orthotropic:
        return NEEDED[zone.mode.split()[-1]]
    return ("YOUN",) if zone.bars else ("YOUN", "NU")


def _allowed(model: Modele) -> list[str]:
    """Return the names of properties that a model knows."""
    if model.contacts:
        return list(dict.fromkeys(name for zone in model.contacts for name in (*NEEDS[zone.law], *MAY_HAVE[zone.law])))
    if model.heated and not model.zones:
        return [name for zone in model.heated for name in (EXCHANGE if "CONVECTION" in zone.law else HEAT)]
    names: dict[str, str] = {}
    for zone in model.zones:
        names |= (ORTHOTROPIC if zone.orthotropic else ISOTROPIC) | (SECTION if zone.bars else {})
    return list(names)


class _Axes:
    """The directions of an orthotropic material, as the user gave them."""

    def __init__(self, radial: bool, points: list[Point]) -> None:
        self.radial = radial
        self.points = points
        self.angle = 0.0

    def of(self, ctx: Context, zone: ModelZone) -> FloatArray:
        """Return the components of the first axis (plane) or of the first two (space) in each element."""
        x = geometry.centroids(shape(zone.shape), corners(ctx, zone))
        given = np.array([p.coords[: zone.dim] for p in self.points])
        if len(given) < zone.dim - 1:
            raise ctx.operands.missing(POINT, "the second point of the axis" if self.radial else "the second vector")
        first, second = self._radial(x, given) if self.radial else self._fixed(x, given)
        for vector in (first, second):
            length = np.linalg.norm(vector, axis=1, keepdims=True)
            if not length.all():
                ctx.fail(
                    237,
                    "the directions of the material are not defined: a vector is null, two are parallel, or the "
                    "centre of an element lies on the axis",
                    at="axes",
                )
            vector /= length
        turn = np.radians(self.angle)
        first, second = np.cos(turn) * first + np.sin(turn) * second, np.cos(turn) * second - np.sin(turn) * first
        return first if zone.dim == 2 else np.concatenate([first, second], axis=1)

    def _fixed(self, x: FloatArray, given: FloatArray) -> tuple[FloatArray, FloatArray]:
        first = given[0]
        if len(first) == 2:
            second = np.array([-first[1], first[0]])
        else:
            # The part of the second vector across the first one.
            second = given[1] * (first @ first) - first * (first @ given[1])
            second[np.abs(second) <= 1e-12 * np.abs(given[1]).max() * (first @ first)] = 0.0
        return np.tile(first, (len(x), 1)), np.tile(second, (len(x), 1))

    def _radial(self, x: FloatArray, given: FloatArray) -> tuple[FloatArray, FloatArray]:
        arm = x - given[0]
        if x.shape[1] == 2:
            return arm, np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        along = given[1] - given[0]
        first = arm * (along @ along) - (arm @ along)[:, None] * along
        return first, np.cross(along, first)


def _read(ctx: Context, q: Operands) -> tuple[Modele, dict[str, Any], _Axes | None]:
    """Read the model, the properties and the directions."""
    model: Modele | None = q.read(MMODEL)
    given: dict[str, Any] = {}
    places: dict[str, Any] = {}
    axes = None
    while q.values:
        if model is None:
            model = q.read(MMODEL)
            if model is not None:
                continue
        if q.first_word() != 0:
            break
        node = q.nodes[0]
        # PARALLELE and RADIAL are read before operators of the same letters, as any keyword in its place.
        directed = model is not None and any(z.orthotropic for z in model.zones)
        operator_word = q.is_operator_word(0)
        word = q.read_keyword(DIRECTIONS) if directed else None
        if word is None and operator_word:
            break
        if word in ("DIRECTION", "RADIAL"):
            points = [q.need(POINT, word)]
            if len(q.values) and (second := q.read(POINT)) is not None:
                points.append(second)
            axes, places["axes"] = _Axes(word == "RADIAL", points), node
            continue
        if word == "INCLINE":
            angle = q.need(FLOTTANT, word)
            if axes is not None:
                axes.angle = float(angle)
            continue
        if word is not None:
            continue
        name = str(q.need(MOT)).strip()[:4].strip()
        if model is not None and name not in _allowed(model):
            ctx.places["name"] = node
            known = _allowed(model)
            close = nearest(name, known)
            ctx.fail(
                45,
                "{name} is not a property of this material; it has {known}",
                at="name",
                name=name,
                known=", ".join(known),
                close=close,
                hint="did you mean {close}?" if close else None,
            )
        value = q.read((FLOTTANT, CHPOINT, MCHAML))
        if value is None:
            raise q.missing(FLOTTANT, name)
        given[name], places[name] = value, node
    if model is None:
        raise q.missing(MMODEL)
    ctx.places.update(places)
    return model, given, axes


def _values(ctx: Context, zone: ModelZone, given: dict[str, Any]) -> FloatArray:
    """Return one row of properties per element, (m, 1, k)."""
    columns = [np.zeros((len(zone.cells), 0))]
    for name, value in given.items():
        if isinstance(value, ChPoint):
            if len(value.names) != 1:
                ctx.fail(26, "the field given for {name} has several components", at=name, name=name)
            nodal = value.at(value.names[0], zone.cells.ravel()).reshape(zone.cells.shape)
            columns.append(nodal.mean(axis=1, keepdims=True))
        elif isinstance(value, MChaml):
            found = value.zone_of(zone)
            if found is None:
                ctx.fail(21, "the field given for {name} is not defined on this model", at=name, name=name)
            columns.append(found.values[:, :, 0].mean(axis=1, keepdims=True))
        else:
            columns.append(np.full((len(zone.cells), 1), float(value)))
    return np.concatenate(columns, axis=1)[:, None, :]


def _checked(ctx: Context, zone: ChamZone) -> ChamZone:
    """Refuse values that make no elastic material."""
    for name in ("YOUN", "SECT"):
        if name in zone.names and not (zone.component(name) > 0).all():
            what = "Young's modulus" if name == "YOUN" else "the section"
            ctx.fail(
                41, "{name} = {value}: {what} is positive", at=name, name=name, what=what,
                value=float(zone.component(name).min()),
            )  # fmt: skip
    if "NU" in zone.names:
        nu = zone.component("NU")
        bad = nu[(nu <= -1) | (nu >= 0.5) | np.isnan(nu)]
        if len(bad):
            ctx.fail(
                41,
                "NU = {value}: Poisson's ratio is above -1 and below 0.5",
                at="NU",
                value=float(bad[0]),
                hint="near 0.5 (0.499) a solid is almost incompressible; 0.5 itself needs another formulation",
            )
    if isinstance(zone.zone, ModelZone) and zone.zone.orthotropic:
        elastic_law(ctx, MChaml([zone], MATERIAL, "GRAVITE"), zone.zone)
    return zone


def _thermal_material(ctx: Context, model: Modele, given: dict[str, Any]) -> MChaml:
    """Return K, C and RHO of solids, H of surfaces in a fluid."""
    zones = []
    for zone in model.heated:
        known = EXCHANGE if "CONVECTION" in zone.law else HEAT
        own = {name: value for name, value in given.items() if name in known}
        first = next(iter(known))
        if first not in own:
            ctx.fail(46, "the property {name} is missing", name=first, meaning=known[first], hint="{name}: {meaning}")
        found = ChamZone(zone, list(own), _values(ctx, zone, own))
        for name in own:
            if not (found.component(name) > 0).all():
                value = float(found.component(name).min())
                ctx.fail(41, "{name} = {value}: it is positive", at=name, name=name, value=value)
        zones.append(found)
    return MChaml(zones, MATERIAL, "GRAVITE")


def _contact_material(ctx: Context, model: Modele, given: dict[str, Any]) -> MChaml:
    """Keep numbers as they are and fields at the nodes of the slave surface."""
    zones = []
    for zone in model.contacts:
        missing = [name for name in NEEDS[zone.law] if name not in given]
        if missing:
            ctx.fail(
                46,
                "the property {name} is missing",
                name=missing[0],
                meaning=CONTACT[missing[0]],
                hint="{name}: {meaning}",
            )
        nodes = zone.slave.nodes if any(isinstance(v, ChPoint) for v in given.values()) else np.zeros(1, np.int64)
        columns = [_contact_values(ctx, name, value, nodes) for name, value in given.items()]
        values = np.stack(columns, axis=1) if columns else np.zeros((len(nodes), 0))
        zones.append(ChamZone(zone, list(given), values[None]))
    return MChaml(zones, MATERIAL, "NOEUD")


def _contact_values(ctx: Context, name: str, value: Any, nodes: IntArray) -> FloatArray:
    """Return a property of contact at nodes, in its range."""
    if isinstance(value, MChaml):
        ctx.fail(26, "{name} is a number or a CHPOINT on the slave surface", at=name, name=name)
    if isinstance(value, ChPoint):
        if len(value.names) != 1:
            ctx.fail(26, "the field given for {name} has several components", at=name, name=name)
        found = value.at(value.names[0], nodes)
    else:
        found = np.full(len(nodes), float(value))
    low, strict, high = RANGES.get(name, (-np.inf, False, np.inf))
    bad = ~((found > low) if strict else (found >= low)) | ~(found <= high)
    if bad.any():
        limit = f"above {low:g}" if strict else f"at least {low:g}"
        ctx.fail(
            41,
            "{name} = {value}: the {what} is {limit}",
            at=name,
            name=name,
            value=float(found[bad][0]),
            what=CONTACT[name].split(",")[0],
            limit=limit if np.isinf(high) else f"{limit} and at most {high:g}",
        )
    return found
