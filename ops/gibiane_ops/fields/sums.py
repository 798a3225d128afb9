"""One number, or one value per node, from the values of fields: MAXI MINI SOMT RESU XTX XTY PSCA MASQ BORN."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend, operator
from gibiane.values import CHPOINT, FLOTTANT, LISTMOTS, MCHAML
from gibiane_ops.values.algebra import SCAL, Field, Incompatible, by_names, mapped, values_of
from gibiane_ops.values.champs import DISCRET, ChPoint, MChaml
from gibiane_ops.values.listes import ListMots
from gibiane_ops.values.material import refused
from gibiane_ops.values.nodes import FloatArray

FIELD = (CHPOINT, MCHAML)


def _kept(ctx: Context, field: Field, which: tuple[str, ListMots] | None, names: ListMots | None) -> list[str]:
    """Return the components that count: all, those listed, or all but those listed."""
    word, listed = which if which is not None else ("AVEC", names)
    if listed is None:
        return field.names
    if word == "SANS":
        return [n for n in field.names if n not in listed.words]
    absent = [n for n in listed.words if n not in field.names]
    if absent:
        code = 181 if isinstance(field, ChPoint) else 236
        ctx.fail(
            code,
            "the field has no component {name}; it has {known}",
            at="which" if which else "names",
            name=absent[0],
            known=" ".join(field.names) or "none",
        )
    return list(listed.words)


def _extreme(name: str, reduce: Callable[[FloatArray], Any], pairwise: Callable[..., FloatArray]) -> None:
    op = extend(name)

    @op.form(
        Arg("field", MCHAML, "element field"),
        Key("ABS", "compare absolute values"),
        Key(("AVEC", "SANS"), "components to keep or to drop", Arg("listed", LISTMOTS), name="which"),
        Arg("names", LISTMOTS, "components to keep", optional=True),
        gives=[FLOTTANT],
    )
    def _of_elements(ctx: Context, field: MChaml, abs: bool, which: Any, names: ListMots | None) -> float:
        return _single(ctx, field, abs, which, names)

    @op.form(
        Arg("field", CHPOINT, "nodal fields", many=True),
        Key("ABS", "compare absolute values"),
        Key(("AVEC", "SANS"), "components to keep or to drop", Arg("listed", LISTMOTS), name="which"),
        Arg("names", LISTMOTS, "components to keep", optional=True),
        gives=["FLOTTANT|CHPOINT"],
    )
    def _of_nodes(ctx: Context, field: list[ChPoint], abs: bool, which: Any, names: ListMots | None) -> Any:
        if len(field) == 1:
            return _single(ctx, field[0], abs, which, names)
        first = field[0]
        if any(
            set(f.names) != set(first.names)
            or any(not np.array_equal(f.parts[n][0], first.parts[n][0]) for n in first.names)
            for f in field[1:]
        ):
            ctx.fail(21, "the fields must have the same components on the same nodes", at="field")
        columns = {n: [np.abs(f.parts[n][1]) if abs else f.parts[n][1] for f in field] for n in first.names}
        parts = {n: (first.parts[n][0], pairwise(values)) for n, values in columns.items()}
        return ChPoint(first.store, parts, first.nature)

    def _single(ctx: Context, field: Field, absolute: bool, which: Any, names: ListMots | None) -> float:
        values = values_of(field, _kept(ctx, field, which, names))
        if not len(values):
            ctx.fail(21, "the field has no value", at="field")
        return float(reduce(np.abs(values) if absolute else values))


_extreme("MAXIMUM", np.max, np.maximum.reduce)
_extreme("MINIMUM", np.min, np.minimum.reduce)

SOMT = operator(
    "SOMT",
    topic="fields",
    summary="sum of the values of a nodal field",
    notice="The sum over the nodes of a field of one component.",
    example="OPTI DIME 2 ; P = 0. 1. ; CH = MANU 'CHPO' P 'SCAL' 2. ; MESS (SOMT CH) ;",
    see=["RESULT"],
)


@SOMT.form(Arg("field", CHPOINT, "nodal field"), gives=[FLOTTANT])
def _somt(ctx: Context, field: ChPoint) -> float:
    if len(field.names) > 1:
        ctx.fail(
            21,
            "the field has {count} components ({known}); one is wanted",
            at="field",
            count=len(field.names),
            known=" ".join(field.names),
            hint="EXCO takes one; RESULT sums each component",
        )
    return float(values_of(field).sum())


RESU = operator(
    "RESULT",
    topic="fields",
    summary="resultant of a nodal field",
    notice="A field on one point (the origin), whose components are the sums over the nodes. Its nature is "
    "DISCRET. EXCO and MAXI read them: MAXI (EXCO 'FZ' (RESU F)).",
    example="OPTI DIME 2 ; P = 0. 1. ; F = MANU 'CHPO' P 'FX' 2. ; LIST (RESU F) ;",
    see=["SOMT", "REAC"],
)


@RESU.form(Arg("field", CHPOINT, "nodal field"), gives=[CHPOINT])
def _resu(ctx: Context, field: ChPoint) -> ChPoint:
    point = field.store.add(np.zeros((1, 3)))
    return ChPoint(field.store, {n: (point, np.array([v.sum()])) for n, (_, v) in field.parts.items()}, DISCRET)


XTX = operator(
    "XTX",
    topic="fields",
    summary="sum of the squares of a nodal field",
    notice="The sum of the squares of all the values of the field.",
    example="OPTI DIME 2 ; P = 0. 1. ; U = MANU 'CHPO' P 'UX' 3. 'UY' 4. ; MESS (XTX U) ;",
    see=["XTY", "PSCA"],
)


@XTX.form(Arg("field", CHPOINT, "nodal field"), gives=[FLOTTANT])
def _xtx(ctx: Context, field: ChPoint) -> float:
    return float((values_of(field) ** 2).sum())


XTY = operator(
    "XTY",
    topic="fields",
    summary="product of two nodal fields, summed over the nodes",
    notice="The sum over the nodes of the products of components: those of one name, or the pairs that two "
    "LISTMOTS make (displacements and forces: (MOTS 'UX' 'UY') (MOTS 'FX' 'FY')).",
    example="OPTI DIME 2 ; P = 0. 1. ; U = MANU 'CHPO' P 'UX' 3. ; F = MANU 'CHPO' P 'FX' 2. ;\n"
    "MESS (XTY U F (MOTS 'UX') (MOTS 'FX')) ;",
    see=["XTX", "PSCA"],
)


@XTY.form(
    Arg("a", CHPOINT, "first field"),
    Arg("b", CHPOINT, "second field"),
    Arg("first", LISTMOTS, "components of the first", optional=True),
    Arg("second", LISTMOTS, "components of the second", optional=True),
    gives=[FLOTTANT],
)
def _xty(ctx: Context, a: ChPoint, b: ChPoint, first: ListMots | None, second: ListMots | None) -> float:
    left, right = _pairs(ctx, a, b, first, second)
    return float(values_of(_product(ctx, a, b, left, right)).sum()) if left else 0.0


def _pairs(
    ctx: Context, a: Field, b: Field, first: ListMots | None, second: ListMots | None
) -> tuple[list[str], list[str]]:
    if first is None:
        common = [n for n in a.names if n in b.names]
        return common, common
    if second is None or len(first.words) != len(second.words):
        ctx.fail(
            212,
            "two LISTMOTS of one length are wanted: components of the first field, of the second",
            at="second" if second is not None else "first",
        )
    return list(first.words), list(second.words)


def _product(ctx: Context, a: Field, b: Field, left: list[str], right: list[str]) -> Field:
    try:
        return by_names(a, b, np.multiply, left, right, [SCAL] * len(left))
    except Incompatible as failure:
        refused(ctx, failure, "a" if failure.fields.get("name") in left else "b")


PSCA = operator(
    "PSCAL",
    topic="fields",
    summary="product of two fields, node by node",
    notice="At each node (or point of an element) the sum of the products of the pairs of components that two "
    "LISTMOTS name; components of one name without them. The result has the component SCAL.",
    example="OPTI DIME 2 ; P = 0. 1. ; U = MANU 'CHPO' P 'UX' 3. 'UY' 4. ;\n"
    "LIST (PSCA U U (MOTS 'UX' 'UY') (MOTS 'UX' 'UY')) ;",
    see=["XTY"],
)


def _declare_psca(kind: str) -> None:
    @PSCA.form(
        Arg("a", kind, "first field"),
        Arg("b", kind, "second field"),
        Arg("first", LISTMOTS, "components of the first", optional=True),
        Arg("second", LISTMOTS, "components of the second", optional=True),
        gives=[kind],
    )
    def _psca(ctx: Context, a: Field, b: Field, first: ListMots | None, second: ListMots | None) -> Field:
        left, right = _pairs(ctx, a, b, first, second)
        if not left:
            ctx.fail(
                179, "no component in common ({left}; {right})", at="b", left=" ".join(a.names), right=" ".join(b.names)
            )
        return _product(ctx, a, b, left, right)


_declare_psca(CHPOINT)
_declare_psca(MCHAML)

TESTS: dict[str, Callable[[FloatArray, Any], Any]] = {
    "SUPERIEUR": np.greater,
    "EGSUPE": np.greater_equal,
    "EGALE": np.equal,
    "EGINFE": np.less_equal,
    "INFERIEUR": np.less,
    "DIFFERENT": np.not_equal,
}

MASQ = extend("MASQUER")


@MASQ.form(
    Arg("field", FIELD, "field"),
    Key(tuple(TESTS), "condition", name="test", required=True),
    Key("SOMME", "count the ones"),
    Arg("x", FLOTTANT, "value"),
    gives=["CHPOINT|MCHAML|ENTIER"],
)
def _masq(ctx: Context, field: Field, test: str, somme: bool, x: float) -> Any:
    return _counted(mapped(field, lambda v: TESTS[test](v, x).astype(np.float64)), somme)


@MASQ.form(
    Arg("field", CHPOINT, "field"),
    Key(tuple(TESTS), "condition", name="test", required=True),
    Key("SOMME", "count the ones"),
    Arg("other", CHPOINT, "field to compare with"),
    gives=["CHPOINT|ENTIER"],
)
def _masq_field(ctx: Context, field: ChPoint, test: str, somme: bool, other: ChPoint) -> Any:
    single = other.names[0] if len(other.names) == 1 else None
    parts = {
        n: (nodes, TESTS[test](v, other.at(single or n, nodes)).astype(np.float64))
        for n, (nodes, v) in field.parts.items()
    }
    return _counted(ChPoint(field.store, parts, field.nature), somme)


@MASQ.form(
    Arg("field", FIELD, "field"),
    Key("COMPRIS", "between two values", required=True),
    Key("SOMME", "count the ones"),
    Arg("low", FLOTTANT, "lower end"),
    Arg("high", FLOTTANT, "upper end"),
    gives=["CHPOINT|MCHAML|ENTIER"],
)
def _masq_between(ctx: Context, field: Field, compris: bool, somme: bool, low: float, high: float) -> Any:
    return _counted(mapped(field, lambda v: ((v >= low) & (v <= high)).astype(np.float64)), somme)


def _counted(mask: Field, count: bool) -> Any:
    return int(values_of(mask).sum()) if count else mask


BORN = extend("BORNER")


@BORN.form(
    Arg("field", FIELD, "field"),
    Key("MINIMUM", "lower bound", Arg("low", FLOTTANT), name="mini"),
    Key("MAXIMUM", "upper bound", Arg("high", FLOTTANT), name="maxi"),
    Key("COMPRIS", "both bounds", Arg("low", FLOTTANT), Arg("high", FLOTTANT)),
    gives=["CHPOINT|MCHAML"],
)
def _born(
    ctx: Context, field: Field, mini: float | None, maxi: float | None, compris: tuple[float, float] | None
) -> Field:
    low, high = compris if compris is not None else (mini, maxi)
    if low is None and high is None:
        ctx.fail(7, "a bound is missing: 'MINI' x, 'MAXI' x or 'COMP' a b")
    if low is not None and high is not None and low > high:
        ctx.fail(21, "the lower bound {low} is above the upper bound {high}", low=low, high=high)
    return mapped(field, lambda v: np.clip(v, low, high))
