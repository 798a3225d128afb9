"""Loads in time: CHARGEMENT and TIRE."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend, operator
from gibiane.values import (
    CHARGEME,
    CHPOINT,
    EVOLUTIO,
    FLOTTANT,
    LISTCHPO,
    LISTMOTS,
    LISTOBJE,
    LISTREEL,
    MCHAML,
    MOT,
    TABLE,
    Table,
)
from gibiane_ops.values.algebra import Field, Incompatible, added
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.chargement import Chargement, Load
from gibiane_ops.values.evolution import Evolution
from gibiane_ops.values.listes import ListMots, ListReel
from gibiane_ops.values.material import refused
from gibiane_ops.values.nodes import FloatArray
from gibiane_ops.values.suites import ObjectList

_EXAMPLE = (
    "OPTI DIME 2 ; P = 0. 1. ; F = MANU 'CHPO' P 'FX' 2. 'NATU' 'DISCRET' ;\n"
    "C = CHAR 'MECA' F (EVOL 'MANU' (PROG 0. 1.) (PROG 0. 10.)) ; "
)
CHAR = operator(
    "CHARGEMENT",
    topic="loads",
    summary="a field that varies with time",
    notice="`C = CHAR 'NAME' FIELD EVOL`: a CHPOINT or MCHAML times a curve of time; `CHAR 'NAME' LREEL T`: fields at "
    "the times of the list, linear in between, from a LISTCHPO, a LISTOBJE or a table of indices 0, 1, ... "
    "ET joins loads; names (MECA DIMP T Q ...) are yours. TIRE gives the field at a time; `EXTR C 'COMP'` the names, "
    "`EXTR C 'NAME'` the loads of a name.",
    example=_EXAMPLE + "LIST C ;",
    see=["TIRE", "EVOLUTION"],
)
TIRE = operator(
    "TIRE",
    topic="loads",
    summary="a load at a given time",
    notice="`F = TIRE C t ('NAME')`: the sum of the loads of a name (of the only one) at the time t, which must be "
    "within their times.",
    example=_EXAMPLE + "MESS (MAXI (TIRE C 0.25 'MECA')) ;",
    see=["CHARGEMENT"],
)
FIELD = (CHPOINT, MCHAML)


def _times(ctx: Context, values: FloatArray, at: str) -> FloatArray:
    if len(values) < 2 or not (np.diff(values) > 0).all():
        ctx.fail(211, "times are at least two, and increase", at=at)
    return values


@CHAR.form(
    Arg("name", MOT, "name"), Arg("field", FIELD, "field"), Arg("curve", EVOLUTIO, "factor by time"), gives=[CHARGEME]
)
def _factored(ctx: Context, name: str, field: Field, curve: Evolution) -> Chargement:
    numbers = curve.curves[0].numbers() if len(curve.curves) == 1 else None
    if numbers is None:
        ctx.fail(21, "one curve of numbers is wanted", at="curve")
    return Chargement([Load(name.strip()[:4], _times(ctx, numbers[0], "curve"), [field], numbers[1])])


@CHAR.form(
    Arg("name", MOT, "name"),
    Arg("times", LISTREEL, "times"),
    Arg("fields", (TABLE, LISTCHPO, LISTOBJE), "fields, one per time"),
    gives=[CHARGEME],
)
def _tabulated(ctx: Context, name: str, times: ListReel, fields: Table | ObjectList) -> Chargement:
    values = _times(ctx, times.values, "times")
    if isinstance(fields, ObjectList):
        found = list(fields.objects)
    else:
        entries = {key: value for key, value in fields.entries.values() if isinstance(key, int)}
        found = [entries[key] for key in sorted(entries)]
    if len(found) != len(values):
        ctx.fail(212, "{times} times and {fields} fields", at="fields", times=len(values), fields=len(found))
    if not all(isinstance(f, ChPoint) for f in found) and not all(isinstance(f, MChaml) for f in found):
        ctx.fail(26, "fields of one kind are wanted: CHPOINT, or MCHAML", at="fields")
    return Chargement([Load(name.strip()[:4], values, found)])


@TIRE.form(
    Arg("loads", CHARGEME, "loads"),
    Arg("t", FLOTTANT, "time"),
    Arg("name", MOT, "name", optional=True),
    gives=["CHPOINT|MCHAML"],
)
def _tire(ctx: Context, loads: Chargement, t: float, name: str | None) -> Field:
    if name is None and len(loads.names) > 1:
        ctx.fail(21, "there are several loads ({names}): name one", at="loads", names=" ".join(loads.names))
    chosen = _named(ctx, loads, name)
    outside = next((each for each in chosen if not each.times[0] <= t <= each.times[-1]), None)
    if outside is not None:
        ctx.fail(
            210,
            "the time {t} is not between {first} and {last}",
            at="t",
            t=t,
            first=float(outside.times[0]),
            last=float(outside.times[-1]),
        )
    try:
        total = chosen[0].at(t)
        for each in chosen[1:]:
            total = added(total, each.at(t))
    except Incompatible as failure:
        refused(ctx, failure, "loads")
    return total


def _named(ctx: Context, loads: Chargement, name: str | None) -> list[Load]:
    wanted = loads.names[0] if name is None else name.strip()[:4]
    chosen = [each for each in loads.loads if each.name == wanted]
    if not chosen:
        ctx.fail(26, "there is no load {name}; there are {names}", at="name", name=wanted, names=" ".join(loads.names))
    return chosen


@extend("EXTRAIRE").form(Arg("loads", CHARGEME, "loads"), Key("COMP", "their names", required=True), gives=[LISTMOTS])
def _names(ctx: Context, loads: Chargement, comp: bool) -> ListMots:
    return ListMots(loads.names)


@extend("EXTRAIRE").form(Arg("loads", CHARGEME, "loads"), Arg("name", MOT, "name"), gives=[CHARGEME])
def _of_name(ctx: Context, loads: Chargement, name: str) -> Chargement:
    return Chargement(_named(ctx, loads, name))


@extend("ET").form(
    Arg("a", CHARGEME, "loads"),
    Arg("b", CHARGEME, "loads"),
    Arg("more", CHARGEME, "loads", many=True, optional=True),
    gives=[CHARGEME],
)
def _union(ctx: Context, a: Chargement, b: Chargement, more: list[Any]) -> Chargement:
    return Chargement([load for each in (a, b, *more) for load in each.loads])
