"""Masses (MASSE, LUMP), stiffnesses and masses added at nodes, and products of matrices with fields and numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, Operator, Refused, extend, operator
from gibiane.values import CHPOINT, FLOTTANT, LISTMOTS, MAILLAGE, MCHAML, MMODEL, MOT, POINT, RIGIDITE
from gibiane_ops.kernels import assembly, integrals
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.topology import places_in
from gibiane_ops.values.champs import DISCRET, ChPoint, MChaml
from gibiane_ops.values.conditions import family, support
from gibiane_ops.values.failures import worded
from gibiane_ops.values.listes import ListMots
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.material import properties, solid_zones
from gibiane_ops.values.mechanics import checked_corners
from gibiane_ops.values.modele import DISPLACEMENTS, FORCES, Modele
from gibiane_ops.values.nodes import FloatArray, IntArray, node_store
from gibiane_ops.values.rigidite import MatrixPart, Rigidite
from gibiane_ops.values.system import build

_EXAMPLE = (
    "OPTI DIME 2 ELEM QUA4 ; S = (DROI 2 (0 0) (2 0)) TRAN 2 (0 1) ; MO = MODE S 'MECANIQUE' 'ELASTIQUE' ;\n"
    "MA = MATE MO 'YOUN' 2.1E11 'NU' 0.3 'RHO' 7800. ; "
)
MASS = operator(
    "MASSE",
    topic="resolution",
    summary="mass matrix of a model, or masses added at nodes",
    notice="`MASSE MODL MAT`: the consistent mass matrix; the material holds RHO, and SECT for bars. "
    "`MASSE 'DEPL' X G` (or names of unknowns in place of 'DEPL') puts the mass X at each node of a mesh or "
    "point. In mode AXIS the mass is that of the whole body of revolution.",
    example=_EXAMPLE + "LIST (RESU ((MASS MO MA) * (MANU 'CHPO' S 'UX' 1.))) ;",
    see=["LUMP", "RIGIDITE", "CNEQ"],
)
LUMP = operator(
    "LUMP",
    topic="resolution",
    summary="diagonal mass matrix",
    notice="`LUMP MODL MAT`: the mass of each element shared between its nodes, by the sums of the rows of its "
    "matrix, or for elements of second degree in proportion to its diagonal. `LUMP M (LMOTS)`: the "
    "diagonal matrix made of the sums of the rows of M; for the unknowns of LMOTS, of its diagonal.",
    example=_EXAMPLE + "LIST (RESU ((LUMP MO MA) * (MANU 'CHPO' S 'UX' 1.))) ;",
    see=["MASSE"],
)


def _masses(ctx: Context, model: Modele, material: MChaml, lumped: bool) -> Rigidite:
    zones = solid_zones(ctx, model)
    dim, kind = zones[0].dim, zones[0].family
    mesh = Maillage(node_store(ctx), [b for zone in zones for b in zone.mesh.blocks])
    nodes = mesh.nodes
    blocks: list[tuple[IntArray, FloatArray]] = []
    for zone in zones:
        wanted = ("RHO", "SECT") if zone.bars else ("RHO",)
        density = properties(ctx, material, zone, wanted, "material", "a mass matrix needs RHO, and SECT for bars")
        of, x = shape(zone.shape), checked_corners(ctx, zone)
        compute = integrals.lumped_mass if lumped else integrals.element_mass
        with worded(ctx, at="model"):
            each = compute(of, x, density.prod(axis=-1), axisymmetric=zone.axisymmetric)
        blocks.append((places_in(nodes, zone.cells), each))
    if lumped:
        local = [(cells, each[..., None]) for cells, each in blocks]
        scalar = sp.diags_array(assembly.assemble_vector(len(nodes), 1, local))
    else:
        scalar = assembly.assemble(len(nodes), 1, blocks)
    matrix = sp.csr_array(sp.kron(scalar, sp.eye_array(dim)))
    return Rigidite([MatrixPart(nodes, DISPLACEMENTS[kind], FORCES[kind], matrix, mesh)])


@MASS.form(Arg("model", MMODEL, "model"), Arg("material", MCHAML, "its material"), gives=[RIGIDITE])
def _mass(ctx: Context, model: Modele, material: MChaml) -> Rigidite:
    return _masses(ctx, model, material, lumped=False)


@LUMP.form(Arg("model", MMODEL, "model"), Arg("material", MCHAML, "its material"), gives=[RIGIDITE])
def _lump(ctx: Context, model: Modele, material: MChaml) -> Rigidite:
    return _masses(ctx, model, material, lumped=True)


@LUMP.form(
    Arg("m", RIGIDITE, "matrix"),
    Arg("kept", LISTMOTS, "unknowns that keep the diagonal", optional=True),
    gives=[RIGIDITE],
)
def _lump_matrix(ctx: Context, m: Rigidite, kept: ListMots | None) -> Rigidite:
    words = [w.strip() for w in kept.words] if kept is not None else []
    parts = []
    for part in _matrices(ctx, m, "m"):
        by_diagonal = np.tile([name in words for name in part.names], len(part.nodes))
        values = np.where(by_diagonal, part.matrix.diagonal(), np.asarray(part.matrix.sum(axis=1)).ravel())
        parts.append(MatrixPart(part.nodes, part.names, part.duals, sp.csr_array(sp.diags_array(values)), part.mesh))
    return Rigidite(parts)


def _matrices(ctx: Context, k: Rigidite, at: str) -> list[MatrixPart]:
    if k.contacts or not k.matrices:
        ctx.fail(26, "this holds no matrix that multiplies a field", at=at, hint="RIGI and MASSE make matrices")
    return k.matrices


def _added(op: Operator, doc: str) -> None:
    """Declare the form of an operator that adds a coefficient at nodes, on all displacements or on some unknowns."""

    @op.stream(
        Key("DEPL", "all displacements"),
        syntax=f"'DEPL' | name... x:FLOTTANT ({doc}) g:MAILLAGE|POINT",
        gives=[RIGIDITE],
    )
    def _at_nodes(ctx: Context, q: Operands) -> Any:
        every = DISPLACEMENTS[family(ctx)]
        if q.first_word() < 0 or q.is_operator_word(q.first_word()):
            return Refused
        names: list[str] = []
        while (word := q.read_keyword(("DEPL", *every))) is not None:
            names += every if word == "DEPL" else (word,)
        if not names:
            at = q.nodes[q.first_word()]
            ctx.places["word"] = at
            ctx.fail(
                197,
                "{word} is not the name of an unknown",
                at="word",
                word=q.need(MOT),
                known=" ".join(every),
                hint="here the unknowns are {known}; 'DEPL' means all of them",
            )
        x = float(q.need(FLOTTANT, doc))
        place: Maillage | Point = q.need((MAILLAGE, POINT), "the nodes")
        nodes = np.unique(support(ctx, place))
        kept = [name for name in every if name in names]
        duals = [FORCES[family(ctx)][every.index(name)] for name in kept]
        matrix = sp.csr_array(sp.diags_array(np.full(len(nodes) * len(kept), x)))
        return Rigidite([MatrixPart(nodes, kept, duals, matrix)])


_added(MASS, "mass")
_added(extend("RIGIDITE"), "stiffness")


TIMES = extend("*")


@TIMES.form(Arg("k", RIGIDITE, "matrix"), Arg("u", CHPOINT, "field"), gives=[CHPOINT])
def _times_field(ctx: Context, k: Rigidite, u: ChPoint) -> ChPoint:
    _matrices(ctx, k, "k")
    system = build(ctx, k)
    values = u.table(system.names, system.nodes).ravel()
    forces = system.K @ values - system.reactions.T @ u.at("LX", system.multipliers)
    table = forces.reshape(-1, system.dim)
    parts = {name: (system.nodes, table[:, i]) for i, name in enumerate(system.duals)}
    if len(system.multipliers):
        parts["FLX"] = (system.multipliers, system.C @ values)
    return ChPoint(system.store, parts, DISCRET)


@TIMES.form(Arg("x", FLOTTANT, "factor"), Arg("k", RIGIDITE, "matrix"), gives=[RIGIDITE])
def _times_number(ctx: Context, x: float, k: Rigidite) -> Rigidite:
    return _scaled(ctx, k, x)


@TIMES.form(Arg("k", RIGIDITE, "matrix"), Arg("x", FLOTTANT, "factor"), gives=[RIGIDITE])
def _times_number_after(ctx: Context, k: Rigidite, x: float) -> Rigidite:
    return _scaled(ctx, k, x)


def _scaled(ctx: Context, k: Rigidite, x: float) -> Rigidite:
    """Return a matrix times a number; conditions (the same ones for any factor) and contact are refused."""
    if k.conditions or k.contacts:
        ctx.fail(26, "conditions cannot be multiplied by a number", at="k", hint="multiply the matrix before ET")
    parts = [MatrixPart(p.nodes, p.names, p.duals, sp.csr_array(p.matrix * x), p.mesh) for p in k.matrices]
    for part, source in zip(parts, k.matrices, strict=True):
        part.symmetric = source.symmetric
    return Rigidite(parts)
