"""Steady heat conduction: COND CAPA FLUX SOUR CONV."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, MAILLAGE, MCHAML, MMODEL, RIGIDITE
from gibiane_ops.kernels import assembly, heat, integrals, topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.values.champs import DISCRET, ChPoint, MChaml
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.material import properties
from gibiane_ops.values.modele import Modele, ModelZone
from gibiane_ops.values.nodes import node_store
from gibiane_ops.values.rigidite import MatrixPart, Rigidite

UNKNOWN, DUAL = "T", "Q"
_EXAMPLE = (
    "OPTI DIME 2 ELEM QUA4 ; S = (DROI 4 (0. 0.) (1. 0.)) TRAN 1 (0. 1.) ;\n"
    "MO = MODE S 'THERMIQUE' ; MA = MATE MO 'K' 2. ; K = (COND MO MA) ET (BLOQ 'T' (COTE 4 S)) ;\n"
)
COND = operator(
    "CONDUCTIVITE",
    topic="heat",
    summary="conduction matrix, or exchange matrix of a surface",
    notice="`COND MODL MAT`: of a model 'THERMIQUE', whose material holds K; of a model 'THERMIQUE' 'CONVECTION', with "
    "H, the exchange with a fluid. The unknown is T, its dual the heat Q: BLOQ 'T', FLUX, SOUR and CONV go with it in "
    "RESO, and EPTH takes the temperatures to thermal strains.",
    example=_EXAMPLE + "T = RESO K (FLUX MO 6. (COTE 2 S)) ; MESS (MAXI (EXCO 'T' T)) ;",
    see=["FLUX", "SOURCE", "CONVECTION", "EPTHERMIQUE"],
)
CAPA = operator(
    "CAPACITE",
    topic="heat",
    summary="heat capacity matrix",
    notice="`CAPA MODL MAT`: consistent matrix of RHO C, for calculations in time by hand.",
    example=_EXAMPLE
    + "C = CAPA MO (MATE MO 'K' 2. 'RHO' 3. 'C' 5.) ; MESS (MAXI (RESU (C * (MANU 'CHPO' S 'T' 1.)))) ;",
    see=["CONDUCTIVITE"],
)
FLUX = operator(
    "FLUX",
    topic="heat",
    summary="heat that enters through a surface",
    notice="`FLUX MODL x G`: nodal heat of a density x, a number or a CHPOINT, through the facets G; it enters.",
    example=_EXAMPLE + "T = RESO K (FLUX MO 6. (COTE 2 S)) ; MESS (MAXI (EXCO 'T' T)) ;",
    see=["CONDUCTIVITE", "SOURCE"],
)
SOUR = operator(
    "SOURCE",
    topic="heat",
    summary="heat made inside a solid",
    notice="`SOUR MODL x (G)`: nodal heat of a density x, a number or a CHPOINT, in the elements of G, or in all.",
    example=_EXAMPLE + "T = RESO K (SOUR MO 4.) ; MESS (MAXI (EXCO 'T' T)) ;",
    see=["CONDUCTIVITE", "FLUX"],
)
CONV = operator(
    "CONVECTION",
    topic="heat",
    summary="heat from a fluid at a given temperature",
    notice="`CONV MODL MAT T`: of a model 'THERMIQUE' 'CONVECTION' whose material holds H, the second member H T for "
    "the temperature of the fluid, a number or a CHPOINT; COND of the same model is its matrix.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROI 4 (0. 0.) (1. 0.)) TRAN 1 (0. 1.) ; MC = MODE (COTE 2 S) 'THERMIQUE' "
    "'CONVECTION' ; MESS (MAXI (RESU (CONV MC (MATE MC 'H' 3.) 20.))) ;",
    see=["CONDUCTIVITE"],
)
MODEL, MATERIAL = Arg("model", MMODEL, "model"), Arg("material", MCHAML, "its material")
VALUE = Arg("x", (FLOTTANT, CHPOINT), "density")


def _zones(ctx: Context, model: Modele, convection: bool | None = None) -> list[ModelZone]:
    zones = [z for z in model.heated if convection is None or ("CONVECTION" in z.law) == convection]
    if not zones:
        ctx.fail(
            26,
            "this model has no convection" if convection else "this model is not thermal",
            at="model",
            hint="MODE G 'THERMIQUE' is a solid that conducts, MODE G 'THERMIQUE' 'CONVECTION' a surface in a fluid",
        )
    return zones


def _corners(ctx: Context, zone: ModelZone) -> FloatArray:
    return np.asarray(node_store(ctx).coords[zone.cells][..., : zone.dim], np.float64)


def _matrix(ctx: Context, zones: list[ModelZone], each: list[FloatArray]) -> Rigidite:
    mesh = Maillage(node_store(ctx), [b for zone in zones for b in zone.mesh.blocks])
    nodes = mesh.nodes
    blocks = [(topology.places_in(nodes, zone.cells), Ke) for zone, Ke in zip(zones, each, strict=True)]
    return Rigidite([MatrixPart(nodes, (UNKNOWN,), (DUAL,), assembly.assemble(len(nodes), 1, blocks), mesh)])


@COND.form(MODEL, MATERIAL, gives=[RIGIDITE])
def _cond(ctx: Context, model: Modele, material: MChaml) -> Rigidite:
    zones, each = _zones(ctx, model), []
    for zone in zones:
        exchange = "CONVECTION" in zone.law
        name = "H" if exchange else "K"
        value = properties(ctx, material, zone, (name,), "material", f"COND needs {name}")[..., 0]
        compute = integrals.element_mass if exchange else heat.element_conduction
        with worded(ctx, at="model"):
            each.append(compute(shape(zone.shape), _corners(ctx, zone), value, axisymmetric=zone.axisymmetric))
    return _matrix(ctx, zones, each)


@CAPA.form(MODEL, MATERIAL, gives=[RIGIDITE])
def _capa(ctx: Context, model: Modele, material: MChaml) -> Rigidite:
    zones, each = _zones(ctx, model, convection=False), []
    for zone in zones:
        value = properties(ctx, material, zone, ("RHO", "C"), "material", "CAPA needs RHO and C").prod(axis=-1)
        of, x = shape(zone.shape), _corners(ctx, zone)
        with worded(ctx, at="model"):
            each.append(integrals.element_mass(of, x, value, axisymmetric=zone.axisymmetric))
    return _matrix(ctx, zones, each)


def _heat(ctx: Context, zone: ModelZone, blocks: list[tuple[str, IntArray, FloatArray]]) -> ChPoint:
    """Return the nodal heat of densities at the nodes of elements, (m, n) each."""
    store = node_store(ctx)
    nodes = topology.used_nodes([cells for _, cells, _ in blocks])
    local = []
    for name, cells, density in blocks:
        x = store.coords[cells][..., : zone.dim]
        with worded(ctx, at="g"):
            loads = heat.scalar_load(shape(name), x, density, axisymmetric=zone.axisymmetric)
        local.append((topology.places_in(nodes, cells), loads[..., None]))
    total = assembly.assemble_vector(len(nodes), 1, local)
    return ChPoint(store, {DUAL: (nodes, total)}, DISCRET)


def _at_nodes(ctx: Context, x: float | ChPoint, cells: IntArray) -> FloatArray:
    if not isinstance(x, ChPoint):
        return np.full(cells.shape, float(x))
    if len(x.names) != 1:
        ctx.fail(26, "the field has several components: EXCO chooses one", at="x")
    return np.asarray(x.at(x.names[0], cells.ravel()).reshape(cells.shape), np.float64)


@FLUX.form(MODEL, VALUE, Arg("g", MAILLAGE, "facets"), gives=[CHPOINT])
def _flux(ctx: Context, model: Modele, x: float | ChPoint, g: Maillage) -> ChPoint:
    zone = _zones(ctx, model, convection=False)[0]
    wrong = [b.shape for b in g.blocks if shape(b.shape).dim != zone.dim - 1]
    if wrong or not g.blocks:
        ctx.fail(
            16,
            "heat enters through facets, not through {shapes}",
            at="g",
            shapes=" ".join(wrong) or "an empty mesh",
            hint="FACE, ENVE or CONT give the facets of a solid",
        )
    return _heat(ctx, zone, [(b.shape, b.cells, _at_nodes(ctx, x, b.cells)) for b in g.blocks])


@SOUR.form(MODEL, VALUE, Arg("g", MAILLAGE, "elements", optional=True), gives=[CHPOINT])
def _sour(ctx: Context, model: Modele, x: float | ChPoint, g: Maillage | None) -> ChPoint:
    zones = _zones(ctx, model, convection=False)
    blocks: Any = zones if g is None else g.blocks
    wrong = [b.shape for b in blocks if shape(b.shape).dim != zones[0].dim]
    if wrong or not blocks:
        ctx.fail(16, "heat is made in solids, not in {shapes}", at="g", shapes=" ".join(wrong) or "an empty mesh")
    return _heat(ctx, zones[0], [(b.shape, b.cells, _at_nodes(ctx, x, b.cells)) for b in blocks])


@CONV.form(MODEL, MATERIAL, Arg("t", (FLOTTANT, CHPOINT), "temperature of the fluid"), gives=[CHPOINT])
def _conv(ctx: Context, model: Modele, material: MChaml, t: float | ChPoint) -> ChPoint:
    blocks = []
    zones = _zones(ctx, model, convection=True)
    ctx.places.setdefault("x", ctx.places.get("t", ctx.node))
    for zone in zones:
        h = properties(ctx, material, zone, ("H",), "material", "CONV needs H")[..., 0]
        blocks.append((zone.shape, zone.cells, np.reshape(h, (-1, 1)) * _at_nodes(ctx, t, zone.cells)))
    return _heat(ctx, zones[0], blocks)
