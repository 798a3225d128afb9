"""DEFORME and VECTEUR: displaced shapes and fields of arrows, for TRAC."""

from __future__ import annotations

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend, operator
from gibiane.values import CHPOINT, DEFORME, FLOTTANT, LISTMOTS, MAILLAGE, MCHAML, MMODEL, MOT, VECTEUR
from gibiane_ops.output.targets import COLOURS
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.deformee import Arrow, Deforme, Shape, Vecteur
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.modele import Modele

FAMILIES = {"DEPL": (("UX", "UY", "UZ"), ("UR", "UZ")), "FORC": (("FX", "FY", "FZ"), ("FR", "FZ"))}

DEFO = operator(
    "DEFORME",
    topic="output",
    summary="a mesh displaced by a field, for TRAC",
    notice="`DEFO G U (x) (COLOUR)`: the mesh G moved by x times the displacement U; without x a round factor is "
    "chosen. A second CHPOINT, or an MCHAML (with its model), is shown in colours on it; a VECTEUR as arrows. ET joins "
    "several: `(DEFO G U 0.) ET (DEFO G U 100.)` shows the outline of the initial shape and the displaced one.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROI 2 (0. 0.) (1. 0.)) TRAN 1 (0. 1.) ;\n"
    "U = NOMC 'UX' (COOR 2 S) ; D = DEFO S U 0.1 ; LIST D ;",
    see=["TRACER", "VECTEUR"],
)


@DEFO.form(
    Arg("g", MAILLAGE, "mesh"),
    Arg("u", CHPOINT, "displacement"),
    Arg("factor", FLOTTANT, "amplification", optional=True),
    Arg("arrows", VECTEUR, "arrows", optional=True),
    Arg("field", (CHPOINT, MCHAML), "field in colours", optional=True),
    Arg("model", MMODEL, "model of the field", optional=True),
    Arg("colour", MOT, "colour", optional=True),
    gives=[DEFORME],
)
def _defo(
    ctx: Context,
    g: Maillage,
    u: ChPoint,
    factor: float | None,
    arrows: Vecteur | None,
    field: ChPoint | MChaml | None,
    model: Modele | None,
    colour: str | None,
) -> Deforme:
    if not {"UX", "UY", "UZ", "UR"} & set(u.names):
        ctx.fail(
            181, "the field has no displacement; it has {known}", at="u", known=" ".join(u.names) or "no component"
        )
    if colour is not None and colour[:4].upper() not in COLOURS:
        ctx.fail(
            1055,
            "there is no colour '{word}'",
            at="colour",
            word=colour,
            known=" ".join(COLOURS),
            hint="known colours: {known}",
        )
    return Deforme([Shape(g, u, factor, (colour or "")[:4].upper(), field, arrows)])


VECT = operator(
    "VECTEUR",
    topic="output",
    summary="a nodal field as arrows, for TRAC",
    notice="`VECT CH (x) ('DEPL'|'FORC'|names|LISTMOTS) (COLOUR)`: arrows of the components along the axes, x times as "
    "long as the field; without x the longest is an eighth of the picture. A negative x draws arrows that end at the "
    "nodes. ET joins several.",
    example="OPTI DIME 2 ; P = 0. 1. ; F = MANU 'CHPO' P 'FX' 1. 'FY' 2. ; LIST (VECT F 'FORC' 'ROUG') ;",
    see=["TRACER", "DEFORME"],
)


@VECT.stream(
    Key(("DEPL", "FORC"), "displacements or forces", name="family"),
    Key(tuple(COLOURS), "colour", name="c"),
    syntax="field:CHPOINT (x:FLOTTANT) ('DEPL'|'FORC'|name...|names:LISTMOTS) (colour)",
    gives=[VECTEUR],
)
def _vect(ctx: Context, q: Operands) -> Vecteur:
    field: ChPoint | None = None
    factor: float | None = None
    names: list[str] = []
    shade = ""
    family: str | None = None
    while q.values:
        found, node = q.take((CHPOINT, FLOTTANT, LISTMOTS, MCHAML))
        if node is not None:
            ctx.places.setdefault("field", node)
            if isinstance(found, ChPoint):
                field = found
            elif isinstance(found, int | float):
                factor = float(found)
            elif isinstance(found, MChaml):
                ctx.fail(
                    251,
                    "arrows of an element field are not available yet",
                    at="field",
                    hint="CHAN 'CHPO' makes a nodal field of it",
                )
            else:
                names += found.words
            continue
        i = q.first_word()
        if i < 0 or (q.is_operator_word(i) and str(q.values[i])[:4] not in FAMILIES):
            break
        word = str(q.need(MOT)).strip()
        if word[:4] in FAMILIES and len(word) > 2:
            family = word[:4]
        elif word[:4].upper() in COLOURS:
            shade = word[:4].upper()
        else:
            names.append(word)
    if field is None:
        raise q.missing(CHPOINT)
    chosen = tuple(names) or _family(field, family)
    absent = [n for n in chosen if n not in field.names]
    if not chosen or (absent and names):
        ctx.fail(
            181,
            "the field has no component {name}; it has {known}",
            at="field",
            name=absent[0] if absent else "of displacement or force",
            known=" ".join(field.names) or "none",
        )
    return Vecteur([Arrow(field, chosen, factor, shade)])


def _family(field: ChPoint, wanted: str | None) -> tuple[str, ...]:
    """Return the names of the components along the axes: of the family asked for, or of the one that the field has."""
    for family in [wanted] if wanted else list(FAMILIES):
        for names in FAMILIES[family]:
            if any(n in field.names for n in names):
                return names
    return ()


UNION = extend("ET")


@UNION.form(
    Arg("a", DEFORME, "shape"),
    Arg("b", DEFORME, "shape"),
    Arg("more", DEFORME, "shapes", many=True, optional=True),
    gives=[DEFORME],
)
def _shapes(ctx: Context, a: Deforme, b: Deforme, more: list[Deforme]) -> Deforme:
    return Deforme([shape for each in (a, b, *more) for shape in each.shapes])


@UNION.form(
    Arg("a", VECTEUR, "arrows"),
    Arg("b", VECTEUR, "arrows"),
    Arg("more", VECTEUR, "arrows", many=True, optional=True),
    gives=[VECTEUR],
)
def _arrows(ctx: Context, a: Vecteur, b: Vecteur, more: list[Vecteur]) -> Vecteur:
    return Vecteur([arrow for each in (a, b, *more) for arrow in each.arrows])
