"""Control words, declared so that INFO, completion and hints know them; :mod:`gibiane.control` runs them."""

from __future__ import annotations

from gibiane.binding import Operands
from gibiane.registry import Context, Operator, operator

_WORDS = {
    "SI": (
        "run what follows if a condition holds",
        "LOGIQUE ; ... (SINON ; ...) FINSI",
        "SI (2 > 1) ; MESS 'yes' ; FINSI ;",
    ),
    "SINON": ("what to run if the condition of SI does not hold", "", "SI FAUX ; SINON ; MESS 'no' ; FINSI ;"),
    "FINSI": ("end of a SI block", "", "SI VRAI ; MESS 'yes' ; FINSI ;"),
    "REPETER": ("repeat a block of instructions", "name (n:ENTIER) ; ... FIN name", "REPE B1 3 ; MESS &B1 ; FIN B1 ;"),
    "FIN": ("end of a loop (with its name), or of the run", "(name)", "REPE B1 2 ; MESS &B1 ; FIN B1 ;"),
    "QUITTER": ("leave a loop or the procedure", "name", "REPE B1 ; QUIT B1 ; FIN B1 ;"),
    "ITERER": ("go to the next turn of a loop", "name", "REPE B1 2 ; ITER B1 ; FIN B1 ;"),
    "DEBPROC": (
        "start of a procedure",
        "name (argument*'TYPE'|argument/'TYPE')... ; ... FINP results",
        "DEBP TWICE x*FLOTTANT ; FINP (2. * x) ; MESS (TWICE 4.) ;",
    ),
    "FINPROC": (
        "end of a procedure, with its results",
        "(result...)",
        "DEBP TWICE x*FLOTTANT ; FINP (2. * x) ; MESS (TWICE 4.) ;",
    ),
    "ARGUMENT": (
        "read more arguments inside a procedure",
        "argument*'TYPE'|argument/'TYPE'...",
        "DEBP F ; ARGU x*ENTIER ; FINP (x + 1) ; MESS (F 2) ;",
    ),
    "DEBMETH": (
        "start of a method of objects",
        "name (argument*'TYPE'|argument/'TYPE')... ; ... FINM results",
        "DEBM COUNTER n*ENTIER ; %N = n ; FINM ; O = OBJE COUNTER 5 ;",
    ),
    "FINMETH": (
        "end of a method, with its results",
        "(result...)",
        "DEBM COUNTER n*ENTIER ; %N = n ; FINM ; O = OBJE COUNTER 5 ;",
    ),
    "RESPRO": (
        "give a result of a procedure before its end",
        "result...",
        "DEBP F ; RESP 1 ; RESP 2 ; FINP ; A B = F ; MESS A B ;",
    ),
}


def _declare(name: str, summary: str, syntax: str, example: str) -> Operator:
    op = operator(
        name,
        topic="language",
        summary=summary,
        example=example,
        notice=f"{name}: {summary}. It is the first word of an instruction.",
    )

    @op.stream(syntax=syntax)
    def _misplaced(ctx: Context, q: Operands) -> None:
        ctx.fail(
            153, "it must be the first word of an instruction", hint="is the ; of the instruction before it missing?"
        )

    return op


for _name, (_summary, _syntax, _example) in _WORDS.items():
    _declare(_name, _summary, _syntax, _example)
