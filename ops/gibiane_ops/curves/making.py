"""EVOL: curves from lists, from a field along a line, from fields at several times, from complex values."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from gibiane.binding import ABSENT, Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, Refused, operator
from gibiane.values import (
    CHPOINT,
    ENTIER,
    EVOLUTIO,
    LISTCHPO,
    LISTENTI,
    LISTMOTS,
    LISTREEL,
    MAILLAGE,
    MOT,
    POINT,
    TABLE,
    Table,
)
from gibiane_ops.curves.reading import abscissae, component, line_nodes
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.evolution import NAME_LENGTH, Curve, Evolution
from gibiane_ops.values.listes import AnyList, ListEnti, ListMots, ListReel
from gibiane_ops.values.maillage import COLOURS, Maillage, Point
from gibiane_ops.values.suites import ListChpo

LISTS = (LISTREEL, LISTENTI, LISTMOTS)
KINDS = {LISTREEL: "REEL", LISTENTI: "ENTI", LISTMOTS: "MOTS"}

EVOL = operator(
    "EVOLUTION",
    topic="lists",
    summary="a curve from two lists, from a field along a line, or from fields at several times",
    notice="""A colour may stand first.
    'MANU': abscissae and ordinates, two lists of the same length, each with a name before it if wanted; 'LEGE' gives a
    title. 'CHPO': a component of a nodal field along a line, against the length from its first node. 'TEMP': a
    component at points, at the times of a LISTREEL for the fields of a LISTCHPO, or at those of a table of results (its
    'TEMPS') for one of its other entries (DEPLACEMENTS unless told); a LISTENTI keeps some of the times. 'COMP': the
    two curves of a complex function, real and imaginary part ('REIM') or modulus and phase ('MOPH').""",
    example="OPTI DIME 2 ELEM SEG2 ; L = DROI 4 (0 0) (2 0) ;\nE = EVOL 'ROUG' 'CHPO' (COOR 1 L) 'SCAL' L ; "
    "LIST (EXTR E 'ORDO') ;\nF = EVOL 'MANU' 'TIME' (PROG 0. 1. 2.) 'LOAD' (PROG 0. 5. 7.) ; LIST F ;",
    see=["DESSIN", "EXTRAIRE", "IPOL", "SUITE"],
)


def _announced(q: Operands, word: str) -> bool:
    """Say whether the operands are for the form named by `word`: it comes first, or after a colour."""
    words = [v for v in q.values if isinstance(v, str)]
    return words[:1] == [word] or (words[1:2] == [word] and words[0][:4] in COLOURS)


def _colour(ctx: Context, q: Operands, word: str) -> str:
    """Read the colour, if one is there, and the word of the form."""
    colour = q.read_keyword(COLOURS) or str(ctx.session.options.get("COUL") or "DEFA")[:4]
    q.need_keyword([word])
    return colour


@EVOL.stream(
    Key("MANU", "from two lists"),
    Key("TYPE", "type of the curve", Arg("type", MOT)),
    Key("LEGE", "title", Arg("title", MOT)),
    gives=[EVOLUTIO],
    syntax="(colour:MOT) 'MANU' ('TYPE' type:MOT) ('LEGE' title:MOT) (namex:MOT) x:LIST (namey:MOT) y:LIST",
)
def _manual(ctx: Context, q: Operands) -> Any:
    if not _announced(q, "MANU"):
        return Refused
    colour = _colour(ctx, q, "MANU")
    kind, title = None, ""
    while word := q.read_keyword(["TYPE", "LEGENDE"]):
        if word == "TYPE":
            kind = q.need(MOT, "the type of the curve")
        else:
            title = q.need(MOT, "the title")
    x_name, x = _axis(q, "the abscissae")
    y_name, y = _axis(q, "the ordinates")
    if len(x) != len(y):
        ctx.fail(217, "{left} abscissae and {right} ordinates", left=len(x), right=len(y))
    return Evolution([Curve(x, y, x_name, y_name, title, colour, kind or KINDS[y.type_name])])


def _axis(q: Operands, what: str) -> tuple[str, AnyList]:
    words: list[str] = []
    # A name may be followed by its variable, F(T): two words for the language.
    while len(words) < 2 and q.values and isinstance(q.values[0], str):
        words.append(q.need(MOT).rstrip())
    name = words[0] + "".join(f"({variable})" for variable in words[1:]) if words else ""
    return name[:NAME_LENGTH].rstrip(), q.need(LISTS, what)


@EVOL.stream(
    Key("CHPO", "a field along a line"),
    gives=[EVOLUTIO],
    syntax="(colour:MOT) 'CHPO' field:CHPOINT (component:MOT) line:MAILLAGE",
)
def _along_line(ctx: Context, q: Operands) -> Any:
    if not _announced(q, "CHPO"):
        return Refused
    colour = _colour(ctx, q, "CHPO")
    field = q.need(CHPOINT, "the field")
    word, _ = q.take((MOT,), choosy=True)
    ctx.places["line"] = next((n for v, n in zip(q.values, q.nodes, strict=True) if isinstance(v, Maillage)), ctx.node)
    nodes = line_nodes(ctx, q.need(MAILLAGE, "the line"), "line")
    name = component(ctx, field, None if word is ABSENT else word)
    having, _ = field.parts[name]
    absent = int(np.sum(~np.isin(nodes, having)))
    if absent:
        ctx.fail(
            21,
            "the field has no value at {count} of the {total} nodes of the line",
            at="line",
            count=absent,
            total=len(nodes),
            name=name,
            hint="the line must lie on the mesh of the field",
        )
    x = ListReel(abscissae(ctx, nodes))
    return Evolution([Curve(x, ListReel(field.at(name, nodes)), "ABS", name, colour=colour)])


@EVOL.stream(
    Key("TEMP", "at points, time after time"),
    gives=[EVOLUTIO],
    syntax="(colour:MOT|LISTMOTS) 'TEMP' (fields:LISTCHPO times:LISTREEL|results:TABLE (entry:MOT)) (steps:LISTENTI) "
    "(component:MOT|LISTMOTS) (p:POINT|MAILLAGE | zone:ENTIER element:ENTIER point:ENTIER)",
)
def _in_time(ctx: Context, q: Operands) -> Any:
    if not _announced(q, "TEMP"):
        return Refused
    first = q.values[0] if q.values else None
    colours: list[str] = []
    if isinstance(first, ListMots):
        del q.values[0], q.nodes[0]
        colours = [word[:4] for word in first.words]
    colour = _colour(ctx, q, "TEMP")
    times, states = _history(ctx, q)
    steps = q.read(LISTENTI)
    if steps is not None:
        times, states = _chosen_steps(ctx, steps, times, states)
    names = _names(ctx, q, states[0] if states else None)
    if states and isinstance(states[0], MChaml):
        curves = [_at_element(ctx, q, times, states, names[0])]
    else:
        curves = _at_points(ctx, q, times, states, names)
    return Evolution([replace(c, colour=colours[i] if i < len(colours) else colour) for i, c in enumerate(curves)])


def _history(ctx: Context, q: Operands) -> tuple[list[float], list[Any]]:
    """Read fields and their times: a LISTCHPO and a LISTREEL, or a table of results."""
    ctx.places["fields"] = q.nodes[0] if q.nodes else ctx.node
    given = q.need((LISTCHPO, TABLE), "the fields")
    if isinstance(given, ListChpo):
        times = q.need(LISTREEL, "the times").values.tolist()
        if len(times) != len(given):
            ctx.fail(217, "{left} fields and {right} times", at="fields", left=len(given), right=len(times))
        return times, list(given.objects)
    entry = "DEPLACEMENTS"
    i = q.first_word()
    if i >= 0 and given.has(q.values[i]) and isinstance(given.get(q.values[i]), Table):
        entry = str(q.need(MOT))
    instants, results = (given.get(index) for index in ("TEMPS", entry))
    if not isinstance(instants, Table) or not isinstance(results, Table):
        ctx.fail(
            21,
            "the entries 'TEMPS' and '{entry}' of the table must be tables, one value for each step",
            at="fields",
            entry=entry,
        )
    numbers = [i for i, _ in results.entries.values() if type(i) is int and instants.has(i)]
    return [float(instants.get(i)) for i in numbers], [results.get(i) for i in numbers]


def _chosen_steps(
    ctx: Context, steps: ListEnti, times: list[float], states: list[Any]
) -> tuple[list[float], list[Any]]:
    for number in steps.values.tolist():
        if not 1 <= number <= len(states):
            ctx.fail(
                1068, "there is no number {number}: this object has {size}", at="fields", number=number,
                size=len(states),
            )  # fmt: skip
    kept = [number - 1 for number in steps.values.tolist()]
    return [times[k] for k in kept], [states[k] for k in kept]


def _names(ctx: Context, q: Operands, field: Any) -> list[str]:
    names = q.read(LISTMOTS)
    if names is not None:
        return list(names.words)
    name, _ = q.take((MOT,), choosy=True)
    word = None if name is ABSENT else str(name)
    return [(word or "").strip() if field is None else component(ctx, field, word)]


def _at_points(ctx: Context, q: Operands, times: list[float], states: list[ChPoint], names: list[str]) -> list[Curve]:
    """Return one curve for each component and each point; what a field lacks counts as zero."""
    where = q.need((POINT, MAILLAGE), "the points")
    nodes = np.array([where.node]) if isinstance(where, Point) else where.nodes_in_order()
    x = ListReel(times)
    curves = []
    for name in names:
        for state in states:
            component(ctx, state, name)
        values = np.array([state.at(name, nodes) for state in states]).reshape(len(states), len(nodes))
        titles = [""] if len(nodes) == 1 else [f"{name} ({i})" for i in range(1, len(nodes) + 1)]
        curves += [Curve(x, ListReel(values[:, i]), "TEMPS", name, title) for i, title in enumerate(titles)]
    return curves


def _at_element(ctx: Context, q: Operands, times: list[float], states: list[MChaml], name: str) -> Curve:
    ctx.places["place"] = q.nodes[0] if q.nodes else ctx.node
    zone, element, point = (q.need(ENTIER, what) for what in ("the zone", "the element", "the point of the element"))
    values = []
    for state in states:
        size = (len(state.zones), 0, 0)
        if 1 <= zone <= len(state.zones):
            size = (len(state.zones), *state.zones[zone - 1].values.shape[:2])
        if not all(1 <= i <= n for i, n in zip((zone, element, point), size, strict=True)):
            ctx.fail(
                1068,
                "there is no zone {zone} with an element {element} and a point {point} in this field",
                at="place",
                zone=zone,
                element=element,
                point=point,
            )
        values.append(float(state.zones[zone - 1].component(name)[element - 1, point - 1]))
    return Curve(ListReel(times), ListReel(values), "TEMPS", name)


@EVOL.stream(
    Key("COMP", "a complex function"),
    Key(("REIM", "MOPH"), "real and imaginary part, or modulus and phase", name="parts"),
    Key("LEGE", "titles of the two curves", Arg("first", MOT), Arg("second", MOT)),
    gives=[EVOLUTIO],
    syntax="(colour:MOT) 'COMP' ('REIM'|'MOPH') ('LEGE' title1:MOT title2:MOT) "
    "(namex:MOT) x:LISTREEL (name1:MOT) y1:LISTREEL (name2:MOT) y2:LISTREEL",
)
def _complex(ctx: Context, q: Operands) -> Any:
    if not _announced(q, "COMP"):
        return Refused
    colour = _colour(ctx, q, "COMP")
    kinds, titles = ("PREE", "PIMA"), ["Re", "Im"]
    while word := q.read_keyword(["REIM", "MOPH", "LEGENDE"]):
        if word == "MOPH":
            kinds, titles = ("MODU", "PHAS"), ["Amp", "Phi"]
        elif word == "LEGENDE":
            titles = [str(q.need(MOT, "the titles of the two curves")) for _ in range(2)]
    axes = [_axis(q, what) for what in ("the abscissae", "the first ordinates", "the second ordinates")]
    (x_name, x), *others = axes
    curves = []
    for (name, y), kind, title in zip(others, kinds, titles, strict=True):
        if len(y) != len(x):
            ctx.fail(217, "{left} abscissae and {right} ordinates", left=len(x), right=len(y))
        curves.append(Curve(x, y, x_name, name, title, colour, kind))
    return Evolution(curves)
