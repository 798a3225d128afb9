"""MODE: models of solids, of bars and of contact."""

from __future__ import annotations

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import MAILLAGE, MMODEL, MOT
from gibiane_ops.kernels.elements.table import SHAPES, shape
from gibiane_ops.kernels.mesh import orientation
from gibiane_ops.values.maillage import Block, Maillage
from gibiane_ops.values.modele import ContactZone, Modele, ModelZone

FORMULATIONS = (
    "MECANIQUE",
    "ELASTIQUE",
    "ISOTROPE",
    "ORTHOTROPE",
    "CONTACT",
    "UNILATERAL",
    "FROTTANT",
    "CHARGEMENT",
    "PRESSION",
    "THERMIQUE",
    "CONDUCTION",
    "CONVECTION",
)
LAWS = ("COULOMB", "TRESCA", "REGULARISE", "NORTON")
KINEMATICS = ("MESC", "SYME", "FAIB", "MORT", "NOEU", "RIGIDE")
# Names of finite elements: that of the mesh is the default, and the only one that lines lack is BARR.
ELEMENTS = ("BARR", *SHAPES)

# Words that MODE of Cast3M takes and this one does not: formulations, behaviours, finite elements.
ELSEWHERE = [
    "THERMOHYDRIQUE",
    "POREUX",
    "DARCY",
    "NAVIER_STOKES",
    "EULER",
    "MELANGE",
    "FISSURE",
    "LIQUIDE",
    "DIFFUSION",
    "METALLURGIE",
    "ELECTROSTATIQUE",
    "MAGNETODYNAMIQUE",
    "RAYONNEMENT",
    "ADVECTION",
    "PLASTIQUE",
    "PARFAIT",
    "FLUAGE",
    "ENDOMMAGEMENT",
    "VISCOPLASTIQUE",
    "VISCOEXTERNE",
    "PLASTIQUE_ENDOM",
    "NON_LINEAIRE",
    "ANISOTROPE",
    "UNIDIRECTIONNEL",
    "IMPEDANCE",
    "SECTION",
    "POUT",
    "TIMO",
    "TUYA",
    "COQ2",
    "COQ3",
    "COQ4",
    "COQ6",
    "COQ8",
    "DKT",
    "DST",
    "BBAR",
    "JOI1",
    "JOI2",
    "JOI3",
    "JOI4",
    "C20R",
    "P15R",
    "ICQ4",
    "QUAS",
    "TRIS",
    "POJS",
    "CERC",
    "LIA2",
]

MODE = operator(
    "MODELISER",
    topic="models",
    summary="model of a solid, or of contact between two surfaces",
    notice="`MODE G 'MECANIQUE' 'ELASTIQUE' 'ISOTROPE'` makes an elastic solid of the elements of G, in the "
    "calculation mode of OPTI MODE: TRID, PLAN CONT (plane stress, unit thickness), PLAN DEFO (plane "
    "strain) or AXIS (UR UZ; x is the radius, forces and integrals go once round the axis). 'ORTHOTROPE' in "
    "place of 'ISOTROPE': a material with directions, see MATE. Lines (SEG2, SEG3) make bars: element 'BARR'. "
    "'CONS' name is accepted. `MODE G1 G2 'CONTACT' 'FROTTANT' 'COULOMB'` (or 'UNILATERAL', "
    "without friction) makes a contact zone: G1 is the master surface, G2 the slave, facets with "
    "normals out of their solids; keywords and surfaces come in any order. Where the two surfaces "
    "have coincident nodes, contact acts on pairs of nodes ('NOEU' demands them). Between different meshes: "
    "'MORT' (mortar with dual multipliers) holds the mean gap about each slave node and is exact for a uniform "
    "pressure; either side may be the slave. 'MESC', the default: each slave node against the facet of G1 in "
    "front of it; cheaper, but a uniform pressure is disturbed (stress wrong by 11 % with 5 elements of the "
    "slave on 3 of the master, by 81 % the other way round): take the finer side as slave. 'SYME' and 'FAIB' go "
    "with coincident nodes only. Nodes keep what they face at the start: a slip beyond half a facet is told "
    "(G417). Linear and quadratic facets. A surface with sharp edges has one normal per side, and nodes in a "
    "corner have no friction; one zone per side lets COFR tell their forces apart. "
    "Laws after 'FROTTANT': 'COULOMB' (MU, COHE), 'TRESCA' (SEUI), "
    "'REGULARISE' (MU, KT: elastic slip), 'NORTON' (MU, EXPO, VREF). 'RIGIDE': G1 is an obstacle that belongs "
    "to no solid; its nodes have no unknowns, and the nodes of G2 need not coincide with them. "
    "`MODE G 'CHARGEMENT' 'PRESSION'` makes a surface under pressure: see PRES. `MODE G 'THERMIQUE' "
    "('CONDUCTION')` makes a solid that conducts heat, 'THERMIQUE' 'CONVECTION' a surface in a fluid: see COND.",
    example="OPTI DIME 3 ELEM CUB8 ; B = (DROI 1 (0 0 0) (1 0 0)) TRAN 1 (0 1 0) ;\n"
    "V = B VOLU 1 'TRAN' (0 0 1) ; MO = MODE V 'MECANIQUE' 'ELASTIQUE' 'ISOTROPE' ; LIST 'RESU' MO ;",
    see=["MATERIAU", "RIGIDITE"],
)


@MODE.stream(
    Key(FORMULATIONS, "formulation and law", name="law"),
    Key(LAWS, "law of friction", name="friction"),
    Key(KINEMATICS, "kinematics of contact, or a rigid obstacle", name="kine"),
    Key(ELEMENTS, "finite element", name="element"),
    Key("CONS", "name of the part", Arg("part", MOT)),
    syntax="g:MAILLAGE (g2:MAILLAGE) 'MECANIQUE' ('ELASTIQUE' ('ISOTROPE'|'ORTHOTROPE')) ('BARR') | 'CONTACT' "
    "('UNILATERAL'|'FROTTANT' 'COULOMB'|'TRESCA'|'REGULARISE'|'NORTON') ('MESC'|'MORT'|'NOEU'|'SYME'|'FAIB') "
    "('RIGIDE') | 'CHARGEMENT' 'PRESSION' | 'THERMIQUE' ('CONDUCTION'|'CONVECTION')",
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
        word = q.read_keyword([*FORMULATIONS, *LAWS, *KINEMATICS, *ELEMENTS, "CONS"])
        if word is None:
            break
        if word == "CONS":
            q.need(MOT, "the name of the part")
        words.append(word)
    i = q.first_word()
    if i >= 0 and isinstance(q.values[i], str) and not q.is_operator_word(i):
        missing = next((w for w in ELSEWHERE if w[:4] == q.values[i][:4]), None)
        if missing is None:
            raise q.unknown_keyword([*FORMULATIONS, *LAWS, *KINEMATICS, "BARR", "CONS"])
        ctx.places["word"] = q.nodes[i]
        ctx.fail(
            251,
            "models with {word} are not available yet",
            at="word",
            word=missing,
            hint="there are elastic solids, bars, heat conduction, and contact with or without friction",
        )
    if "CONTACT" in words:
        return _contact_model(ctx, q, meshes, words)
    if "CHARGEMENT" in words:
        if len(meshes) != 1:
            raise q.missing(MAILLAGE, "the surface under pressure")
        return _pressure_model(ctx, meshes[0])
    if "THERMIQUE" in words:
        if len(meshes) != 1:
            raise q.missing(MAILLAGE, "the elements")
        return _thermal_model(ctx, meshes[0], "CONVECTION" in words)
    if "MECANIQUE" not in words:
        ctx.fail(7, "the formulation is missing", hint="MODE G 'MECANIQUE' 'ELASTIQUE' 'ISOTROPE'")
    if len(meshes) != 1:
        raise q.missing(MAILLAGE, "the solid")
    return _solid_model(ctx, meshes[0], words)


def _solid_model(ctx: Context, mesh: Maillage, words: list[str]) -> Modele:
    dim = int(ctx.option("DIME"))
    if dim not in (2, 3):
        ctx.fail(14, "the dimension of space is not set", hint="OPTI DIME 3 ;")
    mode = ctx.option("MODE") or ("TRID" if dim == 3 else "PLAN DEFO")
    if mode not in ("TRID", "PLAN DEFO", "PLAN CONT", "AXIS"):
        ctx.fail(81, "elastic solids in mode {mode} are not available yet", mode=mode)
    if (mode == "TRID") != (dim == 3):
        ctx.fail(970, "the mode {mode} does not go with dimension {dim}", mode=mode, dim=dim)
    if not mesh.n_cells:
        ctx.fail(26, "the mesh has no element", at="mesh 1")
    wanted = [word for word in words if word in SHAPES]
    absent = [word for word in wanted if word not in mesh.shapes]
    if absent:
        ctx.fail(
            16, "the mesh has no {shape}; it has {known}", at="mesh 1", shape=absent[0], known=" ".join(mesh.shapes)
        )
    law = ("ELASTIQUE", "ORTHOTROPE" if "ORTHOTROPE" in words else "ISOTROPE")
    blocks = [block for block in mesh.blocks if not wanted or block.shape in wanted]
    return Modele([_solid_zone(ctx, mesh, block, law, mode, "BARR" in words) for block in blocks])


def _thermal_model(ctx: Context, mesh: Maillage, convection: bool) -> Modele:
    """Return the model of a solid that conducts heat, or of a surface in a fluid."""
    dim = int(ctx.option("DIME"))
    if dim not in (2, 3):
        ctx.fail(14, "the dimension of space is not set", hint="OPTI DIME 3 ;")
    mode = ctx.option("MODE") or ("TRID" if dim == 3 else "PLAN DEFO")
    wanted = dim - 1 if convection else dim
    wrong = [name for name in mesh.shapes if SHAPES[name].dim != wanted]
    if wrong or not mesh.shapes:
        ctx.fail(
            16,
            "a fluid touches facets, not {shapes}" if convection else "{shapes} elements do not fill the space",
            at="mesh 1",
            shapes=" ".join(wrong) or "nothing",
            hint="a solid that conducts fills the space; 'CONVECTION' acts on its facets",
        )
    law = ("CONVECTION",) if convection else ("CONDUCTION",)
    blocks = mesh.blocks if dim == 3 or convection else [_counterclockwise(mesh, block) for block in mesh.blocks]
    return Modele([], [], [], [ModelZone(Maillage(mesh.store, [b]), "THERMIQUE", law, mode) for b in blocks])


def _pressure_model(ctx: Context, mesh: Maillage) -> Modele:
    """Return the model of a surface (in the plane, of a line) that PRES loads."""
    dim = int(ctx.option("DIME"))
    mode = ctx.option("MODE") or ("TRID" if dim == 3 else "PLAN DEFO")
    wrong = [name for name in mesh.shapes if SHAPES[name].dim != dim - 1]
    if wrong or not mesh.shapes:
        ctx.fail(
            16,
            "a pressure acts on facets, not on {shapes}",
            at="mesh 1",
            shapes=" ".join(wrong) or "nothing",
            hint="FACE, ENVE or CONT give the facets of a solid",
        )
    zones = [ModelZone(Maillage(mesh.store, [b]), "CHARGEMENT", ("PRESSION",), mode) for b in mesh.blocks]
    return Modele([], [], zones)


def _solid_zone(ctx: Context, mesh: Maillage, block: Block, law: tuple[str, ...], mode: str, bars: bool) -> ModelZone:
    """Return the zone of one block: its elements fill the space, or are lines that make bars."""
    dim = 3 if mode == "TRID" else 2
    of = SHAPES.get(block.shape)
    if of is None or of.dim != (1 if bars else dim):
        line = of is not None and of.dim == 1
        ctx.fail(
            16,
            "{shape} elements cannot be bars" if bars else "{shape} elements cannot be an elastic solid in mode {mode}",
            at="mesh 1",
            shape=block.shape,
            mode=mode,
            hint="bars are lines: SEG2 or SEG3"
            if bars
            else "lines make bars: add 'BARR'; for a solid give the volume (in space) or the surface (in the plane)"
            if line
            else "give the volume (in space) or the surface (in the plane), not its boundary",
        )
    if bars and (mode == "AXIS" or "ORTHOTROPE" in law):
        ctx.fail(81, "bars go with isotropic materials and the modes TRID and PLAN", at="mesh 1")
    if dim == 2 and not bars:
        block = _counterclockwise(mesh, block)
    return ModelZone(Maillage(mesh.store, [block]), "MECANIQUE", (*law, "BARR") if bars else law, mode)


def _counterclockwise(mesh: Maillage, block: Block) -> Block:
    """Turn over the plane elements that turn clockwise: a line pushed to its right makes such a surface."""
    x = mesh.store.coords[block.cells][:, :, :2]
    clockwise = orientation.negative(block.shape, x)
    if not len(clockwise):
        return block
    cells = block.cells.copy()
    cells[clockwise] = orientation.reversed_cells(block.shape, cells[clockwise])
    return Block(block.shape, cells, block.colours)


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
    kinematics = next((w for w in words if w in KINEMATICS and w != "RIGIDE"), "MESC")
    named = next((w for w in words if w in LAWS), None)
    if named is not None and "FROTTANT" not in words:
        ctx.fail(7, "{law} is a law of friction: 'FROTTANT' is missing", law=named, hint="'CONTACT' 'FROTTANT' '{law}'")
    law = (named or "COULOMB") if "FROTTANT" in words else "UNILATERAL"
    return Modele([], [ContactZone(master, slave, law, kinematics, "RIGIDE" in words)])
