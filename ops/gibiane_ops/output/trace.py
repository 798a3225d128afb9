"""TRACER: pictures of meshes, displaced shapes, arrows and fields."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.nodes import Name
from gibiane.registry import Context, operator
from gibiane.values import (
    CHPOINT,
    DEFORME,
    ENTIER,
    FLOTTANT,
    LISTREEL,
    MAILLAGE,
    MCHAML,
    MMODEL,
    MOT,
    POINT,
    RIGIDITE,
    VECTEUR,
)
from gibiane_ops.kernels.plot import Layer, Scale, draw_scene
from gibiane_ops.output import scenes
from gibiane_ops.output.scenes import Look
from gibiane_ops.output.targets import COLOURS, draw, title, vtk_draws
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.deformee import Deforme, Vecteur
from gibiane_ops.values.listes import ListReel
from gibiane_ops.values.maillage import Maillage, Point
from gibiane_ops.values.modele import Modele, ModelZone
from gibiane_ops.values.nodes import FloatArray, node_store
from gibiane_ops.values.rigidite import Rigidite

IGNORED = ("CACH", "FACE", "NCLK", "NOLE", "DATE", "FACB", "FSDB", "ANIM", "OSCI", "DIRE", "LOGO")
NUMBERS = ("NOEU", "ELEM", "CHAM")
WORDS = (*IGNORED, *NUMBERS, "QUAL", "COUL", "ECLA", "ECAR", "COUP", "SECT", "ARET", "TITR", "BOIT")
TYPES = (MAILLAGE, CHPOINT, MCHAML, MMODEL, DEFORME, VECTEUR, RIGIDITE, POINT, LISTREEL, ENTIER, FLOTTANT)

TRAC = operator(
    "TRACER",
    topic="output",
    summary="draw a mesh, a field, a displaced shape or arrows into a file",
    notice="A MAILLAGE, a RIGIDITE (its mesh), a DEFORME, a VECTEUR (over a mesh), a CHPOINT with its mesh or an "
    "MCHAML with its model: a picture for each component, in bands of colour. In space a POINT is the eye. 'COUP' p1 "
    "p2 p3 cuts away what lies on the eye's side of a plane, 'SECT' p1 p2 p3 shows only what the plane crosses; 'NOEU' "
    "'ELEM' 'CHAM' write the numbers of nodes and of elements, and values; 'ECLA' x draws every element reduced by x "
    "(0.5); 'ECAR' x moves the solids apart; 'ARET' shows only the sharp edges; 'QUAL' names the objects; 'TITR' t "
    "writes a title. An ENTIER is the number of bands, a LISTREEL gives their limits. Hidden parts are never shown: "
    "'CACH' and 'FACE' change nothing. The files are numbered: name of OPTI 'FTRA' (.png, .svg or .pdf), else "
    "traces/trace_001.png. At the prompt, on a screen, a window opens instead when FTRA is not set: it turns with the "
    "mouse, q closes it, 'NCLK' leaves it out. Needs matplotlib; PyVista draws solids where it is installed. Pictures "
    "never change results.",
    example="OPTI DIME 2 ELEM QUA4 ; S = (DROI 2 (0. 0.) (1. 0.)) TRAN 2 (0. 1.) ;\n"
    "TRAC S 'TITR' 'a square' ; TRAC (COOR 1 S) S ;",
    see=["DESSIN", "DEFORME", "VECTEUR", "SORTIR"],
)


@dataclass
class _Request:
    """What an instruction asks to draw."""

    meshes: list[tuple[Maillage, str]] = field(default_factory=list)
    nodal: tuple[ChPoint, str] | None = None
    element: tuple[MChaml, str] | None = None
    model: Modele | None = None
    shapes: Deforme | None = None
    arrows: list[Vecteur] = field(default_factory=list)
    eye: Point | None = None
    bands: int | None = None
    limits: FloatArray | None = None
    words: set[str] = field(default_factory=set)
    title: str | None = None
    plane: list[Point] = field(default_factory=list)
    shrink: float | None = None
    apart: float | None = None
    colour: str = ""


@TRAC.stream(
    *(Key(w, "accepted, changes nothing") for w in IGNORED),
    Key("NOEU", "numbers of the nodes"),
    Key("ELEM", "numbers of the elements in their block"),
    Key("CHAM", "values of the field"),
    Key("QUAL", "names of the objects"),
    Key("COUL", "one colour only", Arg("c", MOT, optional=True)),
    Key("ECLA", "elements reduced", Arg("x", FLOTTANT, optional=True)),
    Key("ECAR", "solids moved apart", Arg("x", FLOTTANT, optional=True)),
    Key("COUP", "cut by a plane", Arg("p1", POINT), Arg("p2", POINT), Arg("p3", POINT)),
    Key("SECT", "section by a plane", Arg("p1", POINT), Arg("p2", POINT), Arg("p3", POINT)),
    Key("ARET", "sharp edges only"),
    Key("TITR", "title", Arg("t", MOT)),
    Key("BOIT", "accepted, changes nothing", Arg("g", MAILLAGE)),
    syntax="g:MAILLAGE|field:CHPOINT g|field:MCHAML model:MMODEL|DEFORME|VECTEUR g (eye:POINT) (n:ENTIER|LISTREEL) "
    "('COUP'|'SECT' p1 p2 p3) ('NOEU') ('ELEM') ('CHAM') ('ECLA' x) ('ECAR' x) ('ARET') ('QUAL') ('TITR' t)",
)
def _trac(ctx: Context, q: Operands) -> None:
    request = _read(ctx, q)
    ctx.places.setdefault("object", ctx.node)
    if not (request.meshes or request.shapes or request.element):
        if request.nodal or request.arrows:
            raise q.missing(MAILLAGE, "the mesh under the field")
        raise q.missing("object to draw")
    shown: tuple[ChPoint | MChaml, str] | None = request.nodal or request.element
    if shown is None and request.shapes is not None:
        on_shape = next((s.field for s in request.shapes.shapes if s.field is not None), None)
        shown = None if on_shape is None else (on_shape, "")
    components: list[str | None] = (
        [None] if shown is None else [n for n in shown[0].names if _is_seen(request, shown[0], n)]
    )
    if not components:
        ctx.fail(21, "the field has no value on what is drawn", at="object")
    for component in components:
        _picture(ctx, request, component, _field_title(shown, component))


def _is_seen(r: _Request, shown: ChPoint | MChaml, component: str) -> bool:
    """Say whether a component has values on the meshes drawn (multipliers stand on nodes of their own)."""
    if isinstance(shown, MChaml):
        return True
    meshes = [m for m, _ in r.meshes] + [s.mesh for s in (r.shapes.shapes if r.shapes else ())]
    return any(len(np.intersect1d(shown.parts[component][0], m.nodes)) for m in meshes)


def _read(ctx: Context, q: Operands) -> _Request:
    r = _Request()
    while q.values:
        value, node = q.take(TYPES)
        if node is not None:
            _sort(r, value, node.word if isinstance(node, Name) else "")
            if isinstance(value, Maillage | ChPoint | MChaml | Deforme):
                ctx.places.setdefault("object", node)
            continue
        word = q.read_keyword(WORDS)
        if word is None:
            i = q.first_word()
            if q.is_operator_word(i):
                break
            raise q.unknown_keyword(WORDS)
        r.words.add(word)
        _read_operands(q, r, word)
    return r


def _sort(r: _Request, value: Any, name: str) -> None:
    """Put an operand where it belongs."""
    match value:
        case Maillage():
            r.meshes.append((value, name))
        case Rigidite():
            nodes = [n for part in value.conditions for n in part.node]
            r.meshes += [(m, name) for part in value.matrices if (m := getattr(part, "mesh", None)) is not None]
            if nodes and r.meshes:
                r.meshes.append((Maillage.of_nodes(r.meshes[0][0].store, np.unique(nodes)), name))
        case ChPoint():
            r.nodal = value, name
        case MChaml():
            r.element = value, name
        case Modele():
            r.model = value
        case Deforme():
            r.shapes = value if r.shapes is None else Deforme([*r.shapes.shapes, *value.shapes])
        case Vecteur():
            r.arrows.append(value)
        case Point():
            r.eye = value
        case ListReel():
            r.limits = value.values
        case int():
            r.bands = value


def _read_operands(q: Operands, r: _Request, word: str) -> None:
    if word in ("COUP", "SECT"):
        r.plane = [q.need(POINT, f"the plane of '{word}'") for _ in range(3)]
    elif word == "ECLA":
        r.shrink = q.read(FLOTTANT) or 0.5
    elif word == "ECAR":
        found = q.read(FLOTTANT)
        r.apart = 0.6 if found is None else found
    elif word == "TITR":
        r.title = str(q.need(MOT, "the title"))
    elif word == "COUL":
        i = q.first_word()
        if i >= 0 and str(q.values[i])[:4].upper() in COLOURS:
            r.colour = str(q.need(MOT))[:4].upper()
        else:
            r.colour = "DEFA"
    elif word == "BOIT":
        q.read(MAILLAGE)


def _field_title(shown: tuple[ChPoint | MChaml, str] | None, component: str | None) -> str:
    if shown is None or component is None:
        return ""
    named = shown[0].title or shown[1]
    return component if component != "SCAL" or not named else named


def _picture(ctx: Context, r: _Request, component: str | None, label: str) -> None:
    store = node_store(ctx)
    dim = 2 if int(ctx.option("DIME")) == 2 else 3
    points = store.coords[:, :dim].copy()
    view = None
    centre = np.zeros(3)
    meshes = [m for m, _ in r.meshes] + [s.mesh for s in (r.shapes.shapes if r.shapes else ())]
    if r.element is not None:
        meshes += [z.zone.mesh for z in r.element[0].zones if isinstance(z.zone, ModelZone)]
    nodes = np.unique(np.concatenate([m.nodes for m in meshes])) if meshes else np.zeros(0, np.int64)
    if not len(nodes):
        ctx.fail(21, "there is nothing to draw: the mesh is empty", at="object")
    if dim == 3:
        centre = 0.5 * (points[nodes].min(axis=0) + points[nodes].max(axis=0))
        view = r.eye.coords - centre if r.eye is not None else np.array([1.0, -1.75, 1.0])
        if not view.any():
            ctx.fail(21, "the eye is at the centre of the object", at="object")
    look = Look(_plane(ctx, r, view), r.shrink, r.apart, section="SECT" in r.words and view is not None)
    layers, caption = _layers(r, points, look, component)
    for vectors in r.arrows:
        layers += scenes.arrow_layers(points, vectors, scenes.diagonal(points, nodes))
    scale = Scale(title=label, bands=r.bands or 12, limits=r.limits)
    name = title(ctx, r.title)

    in_space = view is not None and any(layer.points.shape[1] == 3 for layer in layers)
    by_vtk = in_space and vtk_draws(ctx)

    def paint(path: Path) -> None:
        draw_scene(path, layers, view=view, scale=scale, title=name, caption=caption, by_vtk=by_vtk)

    def open_window() -> None:
        from gibiane_ops.kernels.plot.window import show_scene

        show_scene(layers, view=view, scale=scale, title=name)

    draw(ctx, paint, "object", window=open_window if by_vtk else None, wait="NCLK" not in r.words)


def _plane(ctx: Context, r: _Request, view: FloatArray | None) -> tuple[FloatArray, FloatArray] | None:
    """Return the plane of the cut with its normal towards the eye."""
    if not r.plane or view is None:
        return None
    a, b, c = (p.coords for p in r.plane)
    normal = np.cross(b - a, c - a)
    if not normal.any():
        ctx.fail(237, "the three points of the plane are aligned or coincide")
    return a, normal if normal @ view > 0 else -normal


def _layers(r: _Request, points: FloatArray, look: Look, component: str | None) -> tuple[list[Layer], str]:
    layers: list[Layer] = []
    caption = ""
    base = points
    if r.shapes is not None:
        for item in r.shapes.shapes:
            moved, factor = scenes.displaced(points, item)
            if factor != 0.0:
                base = moved
                caption = f"displacements x {factor:g}"
            alone = r.element is None and r.nodal is None
            if item.field is not None and alone:
                layers += scenes.field_layers(item.field, item.mesh, moved, look, component)
            elif (len(r.shapes.shapes) > 1 and factor == 0.0) or not alone:
                layers += scenes.outline_layers(moved, item.mesh, item.colour)
            else:
                layers += scenes.mesh_layers(moved, item.mesh, look, colour=item.colour)
            if item.arrows is not None:
                layers += scenes.arrow_layers(moved, item.arrows, scenes.diagonal(points, item.mesh.nodes))
    if r.element is not None:
        zones = None if r.model is None else r.model.zones
        layers += scenes.element_layers(r.element[0], base, look, component, zones)
    parts: list[list[Layer]] = []
    for number, (mesh, name) in enumerate(r.meshes):
        label = name if "QUAL" in r.words else ""
        if r.colour:
            mesh = scenes.of_colour(mesh, r.colour)
        if r.nodal is not None and component is not None:
            values = scenes.of_chpoint(r.nodal[0], component)
            parts.append(scenes.mesh_layers(base, mesh, look, values=values, label=label))
        elif r.element is not None or "ARET" in r.words:
            layers += scenes.outline_layers(points, mesh)
        else:
            parts.append(scenes.mesh_layers(base, mesh, look, label=label, first=number))
            caption = caption or f"{sum(m.n_cells for m, _ in r.meshes)} elements"
    layers += scenes.spread(parts, look)
    if r.words & set(NUMBERS):
        layers += _numbers(r, base, look, component)
    return layers, caption


def _numbers(r: _Request, points: FloatArray, look: Look, component: str | None) -> list[Layer]:
    """Return the numbers and values that are written on the picture."""
    meshes = [m for m, _ in r.meshes] + [s.mesh for s in (r.shapes.shapes if r.shapes else ())]
    if r.element is None:
        values = scenes.of_chpoint(r.nodal[0], component) if r.nodal is not None and component is not None else None
        return scenes.number_layers(points, meshes, look, r.words, values)
    layers: list[Layer] = []
    for zone in r.element[0].zones:
        if isinstance(zone.zone, ModelZone) and component in zone.names:
            values = scenes.of_zone(r.element[0], zone.zone, zone.component(str(component)), len(points))
            layers += scenes.number_layers(points, [zone.zone.mesh], look, r.words, values)
    return layers
