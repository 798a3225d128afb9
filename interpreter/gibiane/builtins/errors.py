"""ERRE as a directive: stop, or obey OPTI ERRE. The indicator forms of the same operator come from elsewhere."""

from __future__ import annotations

from typing import Any

from gibiane.diagnostics import ERROR, GibianeError, Text, make
from gibiane.error_texts import TEXTS, UNKNOWN
from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ANY, ENTIER, MOT

ERRE = operator(
    "ERREUR",
    topic="errors",
    summary="raise an error, or estimate the error of a solution",
    notice="Directive: `ERRE 0` does nothing, `ERRE n` raises error n with its text and level (5 is fatal: how "
    "tests fail; 'AVEC' adds values), `ERRE 'text'` writes the text and raises error 308. OPTI "
    "ERRE says what an error does. "
    "Operator: `X CH (E) = ERREUR MODL SIG MAT`, the relative error of a stress in energy norm and its map by element "
    "('ABSO', 'RELA', 'LOCA'; 'TABL': all in one TABLE, with GARANTI and its reason; 'REFE': the ratio THETA to the "
    "true error and its scatter SD). 'MOYE' 'MOYC' 'PROJ' 'SPR' compare with a smoothed stress: estimates, not bounds, "
    "often 0.6 to 0.95 of the error. 'RESI', explicit residuals, on every solid, with contact "
    "('REAC') and hanging nodes too: an estimate up to a factor ('CONS'; sizes are h / p in elements of degree p), not "
    "a bound. 'RDC', constitutive relation error: a stress in exact equilibrium with the supports and loads "
    "given ('PRES', 'FSUR', 'VOLU'); guaranteed: not below the error, and 0 to 10 % above it after two sweeps "
    "('BALA'). Elements of every shape and degree are cut into triangles or tetrahedra; guaranteed unless their sides "
    "are curved, their faces not plane, or loads not linear over a facet. "
    "A facet counts as held where BLOQ holds all its nodes. 'EXAC': the true error, from an exact stress "
    "or a procedure ('PROC'). `XS XC XG CARTE = ERREUR 'CONTACT' MODL SIG MAT MC MATC U REA` adds the contact part: an "
    "estimate, except with 'RDC', where the sum is guaranteed without friction and with Tresca's (a bound "
    "given on the whole surface, all pairs closed, no 'HIST'); on quadratic facets without friction, where they are "
    "closed; "
    "never with Coulomb's: GARANTI and a note tell. INFERIEURE and "
    "SUPERIEURE of 'RDC' 'TABL' bound the energy of the exact solution (dual analysis); the table lacks them where "
    "prescribed displacements or gaps are not zero, strains are thermal, elements distorted, or 'BALA' is 0. Thermal "
    "strains count as interpolated from the integration points (uniform in TRI3, TET4; linear in TRI6, TE10). "
    "The procedure RICHARDSON extrapolates the energies of three meshes.",
    example="""
    OPTI ERRE IGNO DIME 2 ELEM QUA4 MODE PLAN DEFO ; ERRE 'this text is shown' ; MESS 'and the script goes on' ;
    S = (DROI 8 (0. 0.) (4. 0.)) TRAN 2 (0. 1.) ;
    MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.E5 'NU' 0.3 ;
    CL = BLOQ 'DEPL' (COTE 4 S) ; F = 0. -1. ; G = COTE 2 S ;
    U = RESO ((RIGI MO MA) ET CL) (FSUR 'MASS' MO F G) ; SIG = SIGM MO MA U ;
    X CARTE = ERREUR 'SPR' MO SIG MA ; MESS 'estimate ' X ', largest share ' (MAXI CARTE) ;
    T = ERREUR 'RDC' MO SIG MA CL 'FSUR' F G 'TABL' ; MESS 'at most ' (T.'GLOBALE') ', guaranteed: ' (T.'GARANTI') ;
    """,
    see=["OPTION", "LISSER", "TAILLE"],
)


@ERRE.form(Arg("n", ENTIER, "number of the error"), Key("AVEC", "values for its text", Arg("x", ANY, many=True)))
def _raise(ctx: Context, n: int, avec: list[Any] | None) -> None:
    sentence = TEXTS.get(n, UNKNOWN)
    if avec:
        values = ", ".join(ctx.session.brief(v) for v in avec)
        sentence = Text("{sentence} ({values})", {"sentence": sentence, "values": values})
    diagnostic = make(n, "raised by the script", operator="ERREUR", span=ctx.operands.span(ctx.node))
    diagnostic.sentence = sentence
    if diagnostic.level >= ERROR:
        raise GibianeError(diagnostic)
    if n != 0:
        ctx.session.emit(diagnostic)


@ERRE.form(Arg("text", MOT, "text to show"), last=True)
def _raise_text(ctx: Context, text: str) -> None:
    ctx.write(text)
    ctx.fail(308, "raised by the script")


@ERRE.form(last=True)
def _nothing(ctx: Context) -> None:
    ctx.fail(533, "a number, a text, or the operands of the indicator are wanted")
