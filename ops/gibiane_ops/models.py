"""MODE and MATE: models of solids and of contact, and their materials."""

from __future__ import annotations

from typing import Any

import numpy as np
from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, MAILLAGE, MMODEL, MOT

from gibiane_ops.kernels.elements.table import SHAPES, shape
from gibiane_ops.values.champs import ChamZone, ChPoint, MChaml
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.modele import ContactZone, Modele, ModelZone

FORMULATIONS = ("MECANIQUE", "ELASTIQUE", "ISOTROPE", "CONTACT", "UNILATERAL", "FROTTANT", "COULOMB")
KINEMATICS = ("MESC", "SYME", "FAIB", "MORT", "NOEU")
CONTACT_NAMES = ("MU", "COHE", "JEU")
SOLID_NAMES = ("YOUN", "NU", "RHO", "ALPH")

MODE = operator(
    "MODELISER",
    topic="models",
    summary="model of a solid, or of contact between two surfaces",
    notice="`MODE G 'MECANIQUE' 'ELASTIQUE' 'ISOTROPE'` makes an elastic solid of the elements of G, in the "
    "calculation mode of OPTI MODE. `MODE G1 G2 'CONTACT' 'FROTTANT' 'COULOMB'` (or 'UNILATERAL', "
    "without friction) makes a contact zone: G1 is the master surface, G2 the slave, facets with "
    "normals out of their solids; keywords and surfaces come in any order. Where the two surfaces "
    "have coincident nodes, contact acts on pairs of nodes.",
    example="OPTI DIME 3 ELEM CUB8 ; B = (DROI 1 (0 0 0) (1 0 0)) TRAN 1 (0 1 0) ;\n"
    "V = B VOLU 1 'TRAN' (0 0 1) ; MO = MODE V 'MECANIQUE' 'ELASTIQUE' 'ISOTROPE' ; LIST 'RESU' MO ;",
    see=["MATERIAU", "RIGIDITE"],
)


@MODE.stream(
    Key(FORMULATIONS, "formulation and law", name="law"),
    Key(KINEMATICS, "kinematics of contact", name="kine"),
    syntax="g:MAILLAGE (g2:MAILLAGE) 'MECANIQUE' ('ELASTIQUE' ('ISOTROPE')) | 'CONTACT' "
    "('UNILATERAL'|'FROTTANT' 'COULOMB') ('MESC'|'NOEU')",
    gives=[MMODEL],
)
def _mode(ctx: Context, q: Operands) -> Modele:
    meshes: list[Maillage] = []
    words: list[str] = []
    while True:
        at = q.nodes[0] if q.nodes else ctx.node
        mesh = q.read(MAILLAGE)
        if mesh is not None:
            ctx.places[f"mesh {len(meshes) + 1}"] = at
            meshes.append(mesh)
            continue
        word = q.read_keyword([*FORMULATIONS, *KINEMATICS])
        if word is None:
            break
        words.append(word)
    i = q.first_word()
    if i >= 0 and isinstance(q.values[i], str) and not q.is_operator_word(i) or not words:
        raise q.unknown_keyword([*FORMULATIONS, *KINEMATICS])
    if "CONTACT" in words:
        return _contact_model(ctx, q, meshes, words)
    if "MECANIQUE" not in words:
        ctx.fail(7, "the formulation is missing", hint="MODE G 'MECANIQUE' 'ELASTIQUE' 'ISOTROPE'")
    if len(meshes) != 1:
        raise q.missing(MAILLAGE, "the solid")
    return _solid_model(ctx, meshes[0])


def _solid_model(ctx: Context, mesh: Maillage) -> Modele:
    dim = int(ctx.option("DIME"))
    if dim not in (2, 3):
        ctx.fail(14, "the dimension of space is not set", hint="OPTI DIME 3 ;")
    mode = ctx.option("MODE") or ("TRID" if dim == 3 else "PLAN DEFO")
    if mode not in ("TRID", "PLAN DEFO", "PLAN CONT"):
        ctx.fail(81, "elastic solids in mode {mode} are not available yet", mode=mode)
    if (mode == "TRID") != (dim == 3):
        ctx.fail(970, "the mode {mode} does not go with dimension {dim}", mode=mode, dim=dim)
    if not mesh.n_cells:
        ctx.fail(26, "the mesh has no element", at="mesh 1")
    zones = []
    for block in mesh.blocks:
        if block.shape not in SHAPES or shape(block.shape).dim != dim:
            ctx.fail(
                16,
                "{shape} elements cannot be an elastic solid in mode {mode}",
                at="mesh 1",
                shape=block.shape,
                mode=mode,
                hint="give the volume (in space) or the surface (in the plane), not its boundary",
            )
        zones.append(ModelZone(Maillage(mesh.store, [block]), "MECANIQUE", ("ELASTIQUE", "ISOTROPE"), mode))
    return Modele(zones)


def _contact_model(ctx: Context, q: Operands, meshes: list[Maillage], words: list[str]) -> Modele:
    if len(meshes) != 2:
        raise q.missing(MAILLAGE, "the slave surface" if meshes else "the master surface")
    master, slave = meshes
    dim = int(ctx.option("DIME"))
    for number, mesh in enumerate(meshes, 1):
        wrong = [b.shape for b in mesh.blocks if shape(b.shape).dim != dim - 1]
        if wrong or not mesh.n_cells:
            ctx.fail(
                16,
                "a contact surface is made of facets, not of {shapes}",
                at=f"mesh {number}",
                shapes=", ".join(wrong) or "nothing",
                hint="FACE, ENVE or CONT give the facets of a solid",
            )
    kinematics = next((w for w in words if w in KINEMATICS), "MESC")
    return Modele([], [ContactZone(master, slave, "COULOMB" if "FROTTANT" in words else "UNILATERAL", kinematics)])


MATE = operator(
    "MATERIAU",
    topic="models",
    summary="properties of a material",
    notice="Pairs of a name and a value. Solid: YOUN (Young's modulus), NU (Poisson's ratio), RHO (density), "
    "ALPH (thermal expansion). Contact: MU (friction coefficient), JEU (initial gap, instead of the "
    "one of the geometry). A value is a number, or a CHPOINT, of which each element takes its mean.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROI 1 (0 0) (1 0)) TRAN 1 (0 1) ;\n"
    "MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.1E11 'NU' 0.3 ; LIST 'RESU' MA ;",
    see=["MODELISER", "RIGIDITE"],
)


@MATE.stream(
    *(
        Key(name, doc, Arg("x", (FLOTTANT, CHPOINT)))
        for name, doc in (
            ("YOUN", "Young's modulus"),
            ("NU", "Poisson's ratio"),
            ("RHO", "mass density"),
            ("ALPH", "thermal expansion"),
            ("MU", "friction coefficient"),
            ("JEU", "initial gap"),
        )
    ),
    syntax="model:MMODEL name value (name value)...",
    gives=["MCHAML"],
)
def _mate(ctx: Context, q: Operands) -> MChaml:
    model: Modele | None = q.read(MMODEL)
    given: dict[str, Any] = {}
    places: dict[str, Any] = {}
    allowed = CONTACT_NAMES if model is not None and model.contacts else SOLID_NAMES
    while q.values:
        i = q.first_word()
        if model is None:
            model = q.read(MMODEL)
            if model is not None:
                allowed = CONTACT_NAMES if model.contacts else SOLID_NAMES
                continue
        if i != 0 or q.is_operator_word(0):
            break
        node = q.nodes[0]
        name = str(q.need(MOT)).strip()[:4]
        if model is not None and name not in allowed:
            ctx.places["name"] = node
            ctx.fail(
                45,
                "{name} is not a property of this material; it has {known}",
                at="name",
                name=name,
                known=", ".join(allowed),
            )
        value = q.read((FLOTTANT, CHPOINT, "MCHAML"))
        if value is None:
            raise q.missing(FLOTTANT, name)
        given[name], places[name] = value, node
    if model is None:
        raise q.missing(MMODEL)
    ctx.places.update(places)
    if model.contacts:
        return _contact_material(ctx, model, given)
    missing = [n for n in ("YOUN", "NU") if n not in given]
    if missing:
        ctx.fail(46, "the property {name} is missing", name=missing[0], hint="an elastic solid needs YOUN and NU")
    zones = [ChamZone(z, list(given), _values(ctx, z, given)) for z in model.zones]
    for zone in zones:
        _check_elastic(ctx, zone)
    return MChaml(zones, "CARACTERISTIQUES", "GRAVITE")


def _values(ctx: Context, zone: ModelZone, given: dict[str, Any]) -> np.ndarray[Any, Any]:
    columns = []
    for name, value in given.items():
        if isinstance(value, ChPoint):
            if len(value.names) != 1:
                ctx.fail(26, "the field given for {name} has several components", at=name, name=name)
            nodal = value.at(value.names[0], zone.cells.ravel()).reshape(zone.cells.shape)
            columns.append(nodal.mean(axis=1))
        elif isinstance(value, MChaml):
            found = value.zone_of(zone)
            if found is None:
                ctx.fail(21, "the field given for {name} is not defined on this model", at=name, name=name)
            columns.append(found.values[:, :, 0].mean(axis=1))
        else:
            columns.append(np.full(len(zone.cells), float(value)))
    return np.stack(columns, axis=1)[:, None, :]


def _check_elastic(ctx: Context, zone: ChamZone) -> None:
    young, nu = zone.component("YOUN"), zone.component("NU")
    if not (young > 0).all():
        ctx.fail(41, "YOUN = {value}: Young's modulus is positive", at="YOUN", value=float(young.min()))
    bad = nu[(nu <= -1) | (nu >= 0.5) | np.isnan(nu)]
    if len(bad):
        ctx.fail(
            41,
            "NU = {value}: Poisson's ratio is above -1 and below 0.5",
            at="NU",
            value=float(bad[0]),
            hint="near 0.5 (0.499) a solid is almost incompressible; 0.5 itself needs another formulation",
        )


def _contact_material(ctx: Context, model: Modele, given: dict[str, Any]) -> MChaml:
    zones = []
    for name, value in given.items():
        if isinstance(value, ChPoint | MChaml):
            ctx.fail(251, "a field for {name} is not available yet: give a number", at=name, name=name)
        if name in ("MU", "COHE") and not value >= 0:
            ctx.fail(41, "{name} = {value}: it cannot be negative", at=name, name=name, value=float(value))
        if name == "COHE" and value:
            ctx.fail(251, "cohesion is not available yet", at=name)
    for pair in model.contacts:
        if pair.law == "COULOMB" and "MU" not in given:
            ctx.fail(46, "the property MU is missing", hint="the friction coefficient: MATE MC 'MU' 0.2")
        values = np.array([[[float(v) for v in given.values()]]]).reshape(1, 1, len(given))
        zones.append(ChamZone(pair, list(given), values))
    return MChaml(zones, "CARACTERISTIQUES", "GRAVITE")
