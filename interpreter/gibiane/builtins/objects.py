"""OBJE makes an object; METHODE and HERITE are explained here and done by :mod:`gibiane.objects`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gibiane import procedures
from gibiane.binding import Operands
from gibiane.builtins.logic import EXIS
from gibiane.forms import Arg, Key
from gibiane.library import read_script
from gibiane.registry import Context, operator
from gibiane.values import ANY, LOGIQUE, MOT, OBJET, PROCEDUR, Objet

OBJE = operator(
    "OBJET",
    topic="language",
    summary="make an object of a class",
    notice="The class is a method, defined by DEBM ... FINM, that is run as constructor with the operands that "
    "follow. `O % M x` calls method M; inside a method `%X` is an attribute of the object, which "
    "nobody else sees. `O%METHODE NAME M` gives the object one more method, `O%HERITE OTHER` those "
    "of another object.",
    example="DEBM COUNTER n*ENTIER ; %N = n ; FINM ; DEBM MORE ; %N = %N + 1 ; FINM %N ;\n"
    "O = OBJE COUNTER 5 ; O%METHODE ADD MORE ; MESS (O%ADD) ;",
    see=["TABLE", "DEBPROC"],
)


@OBJE.stream(syntax="class:PROCEDUR argument...", gives=[OBJET])
def _object(ctx: Context, q: Operands) -> Objet:
    place = q.nodes[q.first_word()] if q.first_word() >= 0 else ctx.node
    method = q.need(PROCEDUR, "the class")
    if not method.is_method:
        ctx.places["class"] = place
        ctx.fail(
            39,
            "{name} is a procedure; a class is a method",
            at="class",
            name=method.name,
            hint="define it with DEBM ... FINM",
        )
    this = Objet(method.name)
    this.methods[method.name] = method
    procedures.results(ctx.session.evaluator, method.of(this), q, ctx.node)
    return this


UTIL = operator(
    "UTILISER",
    topic="language",
    summary="define the procedures of a file",
    notice="Every procedure that the file holds is defined. A procedure in a file of its own, "
    "`name.procedur`, needs no such instruction.",
    example="OPTI 'SORT' 'some.procedur' ; SORT 'CHAI' 'DEBP TWICE x*ENTIER ; FINP (2 * x) ;' ; "
    "UTIL 'PROC' 'some.procedur' ; MESS (TWICE 4) ;",
    see=["DEBPROC"],
)


@UTIL.form(Key("PROC", "file of procedures", Arg("file", MOT), required=True))
def _procedures(ctx: Context, proc: str) -> None:
    procedures.define_all(ctx.session.evaluator, read_script(Path(proc)))


@EXIS.form(Arg("o", OBJET, "object"), Arg("name", ANY, "attribute"), gives=[LOGIQUE])
def _has_attribute(ctx: Context, o: Objet, name: Any) -> bool:
    return o.attributes.has(name)
