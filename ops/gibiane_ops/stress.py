"""Strains, stresses and what is made of them: EPSI SIGM ELAS BSIG ENER VMIS PRIN INVA TRESCA."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, MCHAML, MMODEL
from gibiane_ops.kernels import assembly, elasticity, invariants
from gibiane_ops.kernels.arrays import strain_tensor, stress_tensor
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.supports import moved
from gibiane_ops.kernels.topology import places_in, used_nodes
from gibiane_ops.values import mechanics
from gibiane_ops.values.algebra import SCAL, SCALAIRE
from gibiane_ops.values.champs import DISCRET, ChamZone, ChPoint, MChaml
from gibiane_ops.values.material import (
    MATERIAL,
    STRAIN,
    STRESS,
    elastic_compliance,
    elastic_law,
    expansion,
    on_zone,
    solid_zones,
    told_apart,
)
from gibiane_ops.values.modele import FORCES, Modele, ModelZone
from gibiane_ops.values.nodes import FloatArray, node_store
from gibiane_ops.values.pressure import SUBTYPE, pressure_forces

PRINCIPAL = "PRINCIPALE"
COSINES = tuple(f"{axis}{k}" for k in (1, 2, 3) for axis in ("COX", "COY", "COZ"))
BLOCK = """OPTI DIME 3 ELEM CUB8 ;
S = (DROI 1 (0. 0. 0.) (1. 0. 0.)) TRAN 1 (0. 1. 0.) ; V = S VOLU 1 'TRAN' (0. 0. 1.) ;
MO = MODE V 'MECANIQUE' 'ELASTIQUE' 'ISOTROPE' ; MA = MATE MO 'YOUN' 2.1E11 'NU' 0.3 ;
U = NOMC 'UZ' (1.E-3 * (COOR 3 V)) ;
"""

ORDER = Key(("LINE", "QUAD"), "linear strains (the default), or those of Green and Lagrange", name="how")
OTHER_STRAINS = ("TRUE", "JAUM", "UTIL")


EPSI = operator(
    "EPSI",
    topic="fields",
    summary="strains of a displacement field",
    notice="An element field of sub-type DEFORMATIONS at the stress points: EPXX EPYY EPZZ GAXY GAXZ GAYZ in "
    "space, EPXX EPYY EPZZ GAXY in the plane, EPRR EPZZ EPTT GARZ in mode AXIS (engineering shears), EPSS in "
    "bars. In plane stress EPZZ is 0: ELAS of the stresses gives it. 'QUAD': with the terms of second order (Green "
    "and Lagrange), which a rotation, however large, does not change.",
    example=BLOCK + "MESS (MAXI (EXCO 'EPZZ' (EPSI MO U))) ;",
    see=["SIGMA", "ELAS"],
)


@EPSI.form(
    Key(OTHER_STRAINS, "not available", name="other"),
    Arg("model", MMODEL, "model"),
    Arg("u", CHPOINT, "displacement"),
    ORDER,
    Key("NOER", "accepted"),
    gives=[MCHAML],
)
def _epsi(ctx: Context, other: str | None, model: Modele, u: ChPoint, how: str | None, noer: bool) -> MChaml:
    if other is not None:
        ctx.fail(
            251,
            "EPSI '{how}' is not available: strains are linear, or those of Green and Lagrange",
            at="other",
            how=other,
            hint="EPSI 'QUAD' holds for large rotations",
        )
    quadratic = how == "QUAD"
    zones = [ChamZone(z, z.strains, mechanics.strains(ctx, z, u, quadratic=quadratic)) for z in solid_zones(ctx, model)]
    return MChaml(zones, STRAIN, "STRESSES")


EPTH = operator(
    "EPTHERMIQUE",
    topic="fields",
    summary="thermal strains of a temperature field",
    notice="`EPTH MODL MAT T`: ALPH (T - TALP) along every axis (ALP1 ALP2 ALP3 along those of an orthotropic "
    "material) at the stress points; T is a CHPOINT or MCHAML with the component T, TALP is 0 unless MATE gives it. "
    "Between a reference temperature TREF and T: EPTH of T minus EPTH of TREF. With EP = EPTH MODL MAT T, "
    "BSIG MODL (ELAS MODL EP MAT) is the load, SIGM MODL MAT U - (ELAS MODL EP MAT) the stress.",
    example=BLOCK + "MA = MATE MO 'YOUN' 2.1E11 'NU' 0.3 'ALPH' 1.E-5 ;\n"
    "MESS (MAXI (EPTH MO MA (MANU 'CHPO' V 'T' 100.))) ;",
    see=["ELAS", "BSIGMA", "MATERIAU"],
)


@EPTH.form(
    Arg("model", MMODEL, "model"),
    Arg("material", MCHAML, "material"),
    Arg("t", CHPOINT, "temperature"),
    gives=[MCHAML],
)
def _epth(ctx: Context, model: Modele, material: MChaml, t: ChPoint) -> MChaml:
    return _thermal_strain(ctx, model, material, t)


@EPTH.form(
    Arg("model", MMODEL, "model"),
    Arg("material", MCHAML, "material"),
    Arg("t", MCHAML, "temperature"),
    gives=[MCHAML],
)
def _epth_elements(ctx: Context, model: Modele, material: MChaml, t: MChaml) -> MChaml:
    (found,) = told_apart(ctx, [("material", material), ("t", t)], MATERIAL)
    return _thermal_strain(ctx, model, found, t if found is material else material)


def _thermal_strain(ctx: Context, model: Modele, material: MChaml, t: ChPoint | MChaml) -> MChaml:
    (material,) = told_apart(ctx, [("material", material)], MATERIAL)
    zones = []
    for zone in solid_zones(ctx, model):
        heated = _temperature(ctx, zone, t)
        known = on_zone(ctx, material, zone, "material")
        if "TALP" in known.names:
            heated = heated - known.component("TALP")[:, :1]
        by_degree = expansion(ctx, material, zone, "material")
        strain = heated[..., None] * (by_degree if by_degree.ndim == 1 else by_degree[:, None, :])
        zones.append(ChamZone(zone, zone.strains, strain))
    return MChaml(zones, STRAIN, "STRESSES")


def _temperature(ctx: Context, zone: ModelZone, t: ChPoint | MChaml) -> FloatArray:
    """Return temperatures at the stress points, (m, q)."""
    of = shape(zone.shape)
    names = t.names if isinstance(t, ChPoint) else on_zone(ctx, t, zone, "t").names
    name = "T" if "T" in names else names[0] if len(names) == 1 else None
    if name is None:
        ctx.fail(181, "the field has no component T; it has {known}", at="t", known=" ".join(names) or "none")
    if isinstance(t, ChPoint):
        nodal = t.at(name, zone.cells.ravel()).reshape(*zone.cells.shape, 1)
        return moved(of, nodal, "NOEUD", "STRESSES")[..., 0]
    return moved(of, on_zone(ctx, t, zone, "t").component(name)[..., None], t.support, "STRESSES")[..., 0]


SIGM = operator(
    "SIGMA",
    topic="fields",
    summary="stresses of a displacement field",
    notice="An element field of sub-type CONTRAINTES at the stress points: SMXX SMYY SMZZ SMXY SMXZ SMYZ in "
    "space, SMXX SMYY SMZZ SMXY in the plane, SMRR SMZZ SMTT SMRZ in mode AXIS, by the elastic law of the "
    "material; the axial force EFFX in bars. 'QUAD': of the strains of EPSI 'QUAD' (Piola and Kirchhoff's second).",
    example=BLOCK + "MESS (MAXI (EXCO 'SMZZ' (SIGM MO MA U))) ;",
    see=["EPSI", "VMIS", "ERREUR"],
)


@SIGM.form(
    Arg("model", MMODEL, "model"),
    Arg("material", MCHAML, "material"),
    Arg("u", CHPOINT, "displacement"),
    ORDER,
    gives=[MCHAML],
)
def _sigm(ctx: Context, model: Modele, material: MChaml, u: ChPoint, how: str | None) -> MChaml:
    (material,) = told_apart(ctx, [("material", material)], MATERIAL)
    zones = []
    for zone in solid_zones(ctx, model):
        law = elastic_law(ctx, material, zone, "material")
        strain = mechanics.strains(ctx, zone, u, quadratic=how == "QUAD")
        zones.append(ChamZone(zone, zone.stresses, elasticity.stresses(strain, law)))
    return MChaml(zones, STRESS, "STRESSES")


ELAS = operator(
    "ELAS",
    topic="fields",
    summary="stresses from strains, or strains from stresses",
    notice="Elastic law: a field of sub-type DEFORMATIONS gives CONTRAINTES, and conversely.",
    example=BLOCK + "MESS (MAXI (EXCO 'EPZZ' (ELAS MO (SIGM MO MA U) MA))) ;",
    see=["EPSI", "SIGMA"],
)


@ELAS.form(
    Arg("model", MMODEL, "model"),
    Arg("field", MCHAML, "strains or stresses"),
    Arg("material", MCHAML, "material"),
    gives=[MCHAML],
)
def _elas(ctx: Context, model: Modele, field: MChaml, material: MChaml) -> MChaml:
    given = (("field", field), ("material", material))
    source = STRAIN if STRAIN in (field.subtype, material.subtype) else STRESS
    field, material = told_apart(ctx, given, source, MATERIAL)
    law, target = (elastic_law, STRESS) if source == STRAIN else (elastic_compliance, STRAIN)
    zones = []
    for zone in solid_zones(ctx, model):
        values = on_zone(ctx, field, zone, "field").values
        names = zone.stresses if target == STRESS else zone.strains
        zones.append(ChamZone(zone, names, elasticity.stresses(values, law(ctx, material, zone, "material"))))
    return MChaml(zones, target, field.support)


BSIG = operator(
    "BSIGMA",
    topic="fields",
    summary="nodal forces that balance a stress field",
    notice="The integral of B^T sigma: internal forces, a field of nature DISCRET. Applied loads and reactions "
    "are in balance with it: F + REAC - BSIG = 0.",
    example=BLOCK + "F = BSIG MO (SIGM MO MA U) ; MESS (MAXI (RESU (EXCO 'FZ' F)) < 1.E-3) ;",
    see=["SIGMA", "REAC", "RESULT"],
)


@BSIG.form(
    Arg("model", MMODEL, "model"), Arg("stress", MCHAML, "stress"), Arg("more", MCHAML, optional=True), gives=[CHPOINT]
)
def _bsig(ctx: Context, model: Modele, stress: MChaml, more: MChaml | None) -> ChPoint:
    if stress.subtype == SUBTYPE:
        return pressure_forces(ctx, model, stress)
    (stress,) = told_apart(ctx, [("stress", stress), ("more", more)], STRESS)
    store = node_store(ctx)
    zones = solid_zones(ctx, model)
    dim, names = zones[0].dim, FORCES[zones[0].family]
    parts = []
    for zone in zones:
        of = shape(zone.shape)
        values = moved(of, on_zone(ctx, stress, zone, "stress").values, stress.support, "STRESSES")
        parts.append((zone.cells, mechanics.internal_forces(ctx, zone, values)))
    nodes = used_nodes([cells for cells, _ in parts])
    local = [(places_in(nodes, cells), forces) for cells, forces in parts]
    total = assembly.assemble_vector(len(nodes), dim, local).reshape(-1, dim)
    return ChPoint.from_table(store, names, nodes, total, DISCRET)


ENER = operator(
    "ENERGIE",
    topic="fields",
    summary="density of energy: stress times strain",
    notice="`ENER MODL SIG EPS` is sigma : epsilon at the stress points, without the factor 1/2; its integral "
    "(INTG) is twice the elastic energy.",
    example=BLOCK + "MESS (INTG MO (ENER MO (SIGM MO MA U) (EPSI MO U))) ;",
    see=["INTG", "SIGMA"],
)


@ENER.form(
    Arg("model", MMODEL, "model"), Arg("stress", MCHAML, "stress"), Arg("strain", MCHAML, "strain"), gives=[MCHAML]
)
def _ener(ctx: Context, model: Modele, stress: MChaml, strain: MChaml) -> MChaml:
    stress, strain = told_apart(ctx, [("stress", stress), ("strain", strain)], STRESS, STRAIN)
    zones = []
    for zone in solid_zones(ctx, model):
        a, b = on_zone(ctx, stress, zone, "stress").values, on_zone(ctx, strain, zone, "strain").values
        a, b = (moved(shape(zone.shape), v, f.support, "STRESSES") for v, f in ((a, stress), (b, strain)))
        zones.append(ChamZone(zone, [SCAL], (a * b).sum(axis=2, keepdims=True)))
    return MChaml(zones, SCALAIRE, "STRESSES", "energy")


def _tensor_zones(ctx: Context, model: Modele) -> list[ModelZone]:
    """Return the zones of a model, or fail when they are bars: a force has no principal directions."""
    zones = solid_zones(ctx, model)
    if any(zone.bars for zone in zones):
        ctx.fail(19, "bars have an axial force, not a stress tensor", at="model", hint="EXCO 'EFFX' gives that force")
    return zones


def _scalar(
    ctx: Context,
    model: Modele,
    fields: list[tuple[str, MChaml | None]],
    measure: Callable[[FloatArray], FloatArray],
    title: str,
) -> MChaml:
    """Return the element field that a formula gives of a stress, on the support of the stress."""
    (stress,) = told_apart(ctx, fields, STRESS)
    zones = [
        ChamZone(z, [SCAL], measure(on_zone(ctx, stress, z, "stress").values)[..., None])
        for z in _tensor_zones(ctx, model)
    ]
    return MChaml(zones, SCALAIRE, stress.support, title)


VMIS = operator(
    "VMISES",
    topic="fields",
    summary="equivalent stress of von Mises",
    notice="An element field with the component SCAL, on the support of the stress.",
    example=BLOCK + "MESS (MAXI (VMIS MO (SIGM MO MA U))) ;",
    see=["SIGMA", "TRESCA", "PRIN"],
)
TRES = operator(
    "TRESCA",
    topic="fields",
    summary="equivalent stress of Tresca",
    notice="The largest difference of two principal stresses: an element field with the component SCAL.",
    example=BLOCK + "MESS (MAXI (TRES MO (SIGM MO MA U))) ;",
    see=["SIGMA", "VMISES", "PRIN"],
)


@VMIS.form(
    Arg("model", MMODEL, "model"), Arg("stress", MCHAML, "stress"), Arg("more", MCHAML, optional=True), gives=[MCHAML]
)
def _vmis(ctx: Context, model: Modele, stress: MChaml, more: MChaml | None) -> MChaml:
    return _scalar(ctx, model, [("stress", stress), ("more", more)], invariants.von_mises, "von Mises")


@TRES.form(
    Arg("model", MMODEL, "model"), Arg("stress", MCHAML, "stress"), Arg("more", MCHAML, optional=True), gives=[MCHAML]
)
def _tres(ctx: Context, model: Modele, stress: MChaml, more: MChaml | None) -> MChaml:
    return _scalar(ctx, model, [("stress", stress), ("more", more)], invariants.tresca, "Tresca")


def _tensor(ctx: Context, field: MChaml, zone: ModelZone) -> FloatArray:
    """Return the tensors of a field of stresses or strains on a zone, (m, q, 3, 3)."""
    values = on_zone(ctx, field, zone, "field").values
    return strain_tensor(values) if field.subtype == STRAIN else stress_tensor(values)


def _tensor_field(ctx: Context, field: MChaml, more: MChaml | None) -> MChaml:
    found = next((f for f in (field, more) if f is not None and f.subtype in (STRESS, STRAIN)), None)
    if found is None:
        ctx.fail(
            565,
            "a field of stresses or of strains is wanted, not of sub-type {subtype}",
            at="field",
            subtype=field.subtype,
        )
    return found


PRIN = operator(
    "PRINCIPAL",
    topic="fields",
    summary="principal stresses or strains and their directions",
    notice="Components SI11 >= SI22 >= SI33 and the direction cosines COX1 COY1 COZ1 ... COZ3. In the plane "
    "the third value is the one across the plane, unless 'TRID' asks for all three in order.",
    example=BLOCK + "MESS (MAXI (EXCO 'SI11' (PRIN MO (SIGM MO MA U)))) ;",
    see=["SIGMA", "VMISES", "INVARIANTS"],
)


@PRIN.form(
    Arg("model", MMODEL, "model"),
    Arg("field", MCHAML, "stresses or strains"),
    Arg("more", MCHAML, optional=True),
    Key("TRID", "order the three values also in the plane"),
    gives=[MCHAML],
)
def _prin(ctx: Context, model: Modele, field: MChaml, more: MChaml | None, trid: bool) -> MChaml:
    source = _tensor_field(ctx, field, more)
    zones = []
    for zone in _tensor_zones(ctx, model):
        tensor = _tensor(ctx, source, zone)
        values, axes = invariants.principal(tensor, in_plane=zone.dim == 2 and not trid)
        stacked = np.concatenate([values, axes.reshape(*values.shape[:2], 9)], axis=2)
        zones.append(ChamZone(zone, ("SI11", "SI22", "SI33", *COSINES), stacked))
    return MChaml(zones, PRINCIPAL, source.support)


INVA = operator(
    "INVARIANTS",
    topic="fields",
    summary="three invariants of a stress or strain field",
    notice="Three element fields: trace, sum of the principal minors, determinant.",
    example=BLOCK + "I1 I2 I3 = INVA MO (SIGM MO MA U) ; MESS (MAXI I1) ;",
    see=["PRINCIPAL"],
)


@INVA.form(
    Arg("model", MMODEL, "model"),
    Arg("field", MCHAML, "stresses or strains"),
    Arg("more", MCHAML, optional=True),
    gives=[MCHAML, MCHAML, MCHAML],
)
def _inva(ctx: Context, model: Modele, field: MChaml, more: MChaml | None) -> tuple[MChaml, MChaml, MChaml]:
    source = _tensor_field(ctx, field, more)
    zones: list[list[ChamZone]] = [[], [], []]
    for zone in _tensor_zones(ctx, model):
        for column, values in zip(zones, invariants.invariants(_tensor(ctx, source, zone)), strict=True):
            column.append(ChamZone(zone, [SCAL], values[..., None]))
    first, second, third = (MChaml(each, SCALAIRE, source.support) for each in zones)
    return first, second, third
