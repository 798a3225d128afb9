"""Logic and equality: ET, OU, NON, EGA, NEG, EXIS, TYPE."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, infix, operator
from gibiane.values import ANNULE, ANY, ENTIER, FLOTTANT, LOGIQUE, MOT, TABLE, Table, Value, type_of

ET = operator(
    "ET",
    topic="logic",
    summary="join: logical and, concatenation of words, union of objects",
    notice="LOGIQUE with LOGIQUE (two or more): true if all are. MOT with MOT: both joined, blanks at their "
    "ends removed unless 'TELQUEL'. Meshes, fields, models, matrices, lists: their union. Words must "
    "follow the operator: ET 'abc' 'def'.",
    example="MESS (VRAI ET FAUX) (ET 'abc' 'def') ;",
    see=["OU", "NON"],
)


@ET.form(
    Arg("a", LOGIQUE, "condition"),
    Arg("b", LOGIQUE, "condition"),
    Arg("more", LOGIQUE, "conditions", many=True, optional=True),
    gives=[LOGIQUE],
)
def _and(ctx: Context, a: bool, b: bool, more: list[bool]) -> bool:
    return a and b and all(more)


@ET.form(Key("TELQUEL", "keep blanks"), Arg("a", MOT, "word"), Arg("b", MOT, "word"), gives=[MOT], last=True)
def _join(ctx: Context, telquel: bool, a: str, b: str) -> str:
    joined = a + b if telquel else a.strip() + b.strip()
    if len(joined) > 512:
        ctx.fail(1114, "the word has {length} characters; 512 is the limit", length=len(joined))
    return joined


OU = operator(
    "OU",
    topic="logic",
    summary="logical or",
    notice="True if one of two or more LOGIQUE is.",
    example="MESS (VRAI OU FAUX) ;",
    see=["ET", "NON"],
)


@OU.form(
    Arg("a", LOGIQUE, "condition"),
    Arg("b", LOGIQUE, "condition"),
    Arg("more", LOGIQUE, "conditions", many=True, optional=True),
    gives=[LOGIQUE],
)
def _or(ctx: Context, a: bool, b: bool, more: list[bool]) -> bool:
    return a or b or any(more)


NON = operator(
    "NON",
    topic="logic",
    summary="logical not",
    notice="The contrary of a LOGIQUE.",
    example="MESS (NON VRAI) ;",
    see=["ET", "OU"],
)


@NON.form(Arg("a", LOGIQUE, "condition"), gives=[LOGIQUE])
def _not(ctx: Context, a: bool) -> bool:
    return not a


EGA = infix(
    "EGA",
    topic="logic",
    summary="are two values equal?",
    see=["NEG"],
    example="MESS (3 EGA 3.7) (EGA 'AA' 'AA   ') ;",
    notice="The second number takes the type of the first: 3 EGA 3.7 is VRAI. Words: trailing blanks do not "
    "count, case does; an ENTIER limits the letters compared. Two FLOTTANT may be followed by a "
    "tolerance. Other objects are equal when they are the same object. Values of different types differ. "
    "A word cannot stand before the operator: write EGA X 'WORD'.",
)
NEG = infix(
    "NEG",
    topic="logic",
    summary="are two values different?",
    see=["EGA"],
    example="MESS (3 NEG 4) ;",
    notice="The contrary of EGA.",
)


def equal(a: Any, b: Any, tolerance: float | None = None) -> bool:
    """Compare two values as EGA does."""
    kind_a, kind_b = type_of(a), type_of(b)
    if kind_a in (ENTIER, FLOTTANT) and kind_b in (ENTIER, FLOTTANT):
        if kind_a == ENTIER:
            return bool(a == int(b))
        return bool(abs(a - b) <= tolerance) if tolerance is not None else bool(a == float(b))
    if kind_a != kind_b:
        return False
    if kind_a == MOT:
        return bool(a.rstrip() == b.rstrip())
    return a.same(b) if isinstance(a, Value) else bool(a == b)


def _two(ctx: Context, q: Operands) -> Any:
    saved = q.values.copy(), q.nodes.copy()
    a, node_a = q.take((ANY,))
    b, node_b = q.take((ANY,))
    if node_a is None or node_b is None:
        q.values[:], q.nodes[:] = saved
        raise q.missing("second value") if q.values else q.missing("value")
    tolerance = None
    if type(a) is float and type(b) in (int, float):
        tolerance = q.read(FLOTTANT)
    if type(a) is str and type(b) is str:
        length = q.read(ENTIER)
        if length is not None:
            a, b = a[:length], b[:length]
    return equal(a, b, tolerance)


@EGA.stream(syntax="a b (tolerance|length)", gives=[LOGIQUE])
def _equal(ctx: Context, q: Operands) -> bool:
    return bool(_two(ctx, q))


@NEG.stream(syntax="a b (tolerance|length)", gives=[LOGIQUE])
def _different(ctx: Context, q: Operands) -> bool:
    return not _two(ctx, q)


TYPE = operator(
    "TYPE",
    topic="values",
    summary="type of an object, as a word of 8 letters",
    terminal=True,
    notice="The name of the type, padded with blanks to 8 letters. ENTIER, FLOTTANT, MOT, TABLE, POINT and others "
    "are names of operators too, which a word that stands first runs: write EGA (TYPE X) 'ENTIER', and "
    "let a procedure give the comparison, or the word in a TABLE, but not FINP (TYPE X).",
    example="MESS (TYPE 2E5) ; MESS (EGA (TYPE 3) 'ENTIER') ;",
)


@TYPE.form(Arg("x", ANY, "object"), gives=[MOT])
def _type(ctx: Context, x: Any) -> str:
    return type_of(x).ljust(8)


EXIS = operator(
    "EXISTE",
    topic="values",
    summary="does an object, a table index or a file exist?",
    notice="`EXIS X`: X is not ANNULE (an undefined name is a word, and exists). `EXIS X*'TYPE'`: and has "
    "this type. `EXIS T index`: the table has the index. `EXIS F*'FICHIER'`: the file exists.",
    example="T = TABL ; T.1 = 2 ; MESS (EXIS T 1) (EXIS T 2) (EXIS N*'ENTIER') ;",
    see=["TYPE"],
)


def _type_mark(q: Operands) -> str | None:
    if len(q.values) >= 2 and q.values[0] == "*" and isinstance(q.values[1], str):
        del q.values[0], q.nodes[0]
        del q.nodes[0]
        return str(q.values.pop(0)).strip()
    return None


@EXIS.form(Arg("t", TABLE, "table"), Arg("index", ANY, "index"), gives=[LOGIQUE])
def _exists_index(ctx: Context, t: Table, index: Any) -> Any:
    if index == "*":
        ctx.operands.push_front([t, index], ctx.node)
        return _exists(ctx, ctx.operands)
    return t.has(index)


@EXIS.stream(syntax="x (*'TYPE')", gives=[LOGIQUE], last=True)
def _exists(ctx: Context, q: Operands) -> Any:
    value, node = q.take((ANY,))
    if node is None:
        raise q.missing("object")
    mark = _type_mark(q)
    if mark == "FICHIER":
        return isinstance(value, str) and Path(value).is_file()
    if mark is not None:
        return type_of(value)[:8] == mark[:8]
    return type_of(value) != ANNULE


__all__ = ["ET", "equal"]
