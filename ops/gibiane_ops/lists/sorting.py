"""Lists are searched and sorted: POSI, ORDO, UNIQ."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibiane.forms import Arg, Key
from gibiane.registry import Context, Refused, extend, operator
from gibiane.values import ENTIER, FLOTTANT, LISTENTI, LISTMOTS, LISTREEL, LOGIQUE, MOT, TABLE, Table, type_of
from gibiane_ops.values.listes import AnyList, ListEnti, ListMots, ListReel, items_of, like

LISTS = (LISTREEL, LISTENTI, LISTMOTS)
ITEM_TYPES = {LISTREEL: FLOTTANT, LISTENTI: ENTIER, LISTMOTS: MOT}
EPSILON = 2.0**-50

NOCA = Key("NOCA", "capital and small letters are the same")


POSI = operator(
    "POSITION",
    topic="lists",
    summary="where a value stands in a list, or a text in a word",
    notice="The position of the first occurrence, 0 when there is none; 'TOUS' gives a LISTENTI of all. A "
    "list of values gives the list of their first positions, a mesh of points those of its points. Reals are equal to "
    "rounding, or within "
    "the tolerance given after the list; 'NOCA' makes capital and small letters the same.",
    example="MESS (POSI 4. 'DANS' (PROG 2. 4. 6.)) ' ' (POSI 'c' 'DANS' 'abcd') ;",
    see=["EXISTE", "EXTRAIRE"],
)
TOUS = Key("TOUS", "all positions")


def _found(ctx: Context, hits: NDArray[np.bool_], every: bool) -> Any:
    at = np.flatnonzero(hits) + 1
    if every:
        return ListEnti(at)
    return int(at[0]) if len(at) else 0


def _near(values: NDArray[np.float64], x: float, tolerance: float | None) -> NDArray[np.bool_]:
    room = EPSILON * np.maximum(np.abs(values), abs(x)) if tolerance is None else tolerance
    hits: NDArray[np.bool_] = np.abs(values - x) <= room
    return hits


@POSI.form(
    Arg("x", ENTIER, "value"),
    Key("DANS", "where", Arg("values", LISTENTI, "list"), required=True),
    TOUS,
    gives=["ENTIER|LISTENTI"],
)
def _where_integer(ctx: Context, x: int, dans: ListEnti, tous: bool) -> Any:
    return _found(ctx, dans.values == x, tous)


@POSI.form(
    Arg("x", FLOTTANT, "value"),
    Key("DANS", "where", Arg("values", LISTREEL, "list"), Arg("tolerance", FLOTTANT, optional=True), required=True),
    TOUS,
    gives=["ENTIER|LISTENTI"],
)
def _where_real(ctx: Context, x: float, dans: tuple[ListReel, float | None], tous: bool) -> Any:
    return _found(ctx, _near(dans[0].values, x, dans[1]), tous)


@POSI.form(
    Arg("x", LISTENTI, "values"), Key("DANS", "where", Arg("values", LISTENTI, "list"), required=True), gives=[LISTENTI]
)
def _where_integers(ctx: Context, x: ListEnti, dans: ListEnti) -> ListEnti:
    return ListEnti([_found(ctx, dans.values == k, False) for k in x.values.tolist()])


@POSI.form(
    Arg("x", LISTREEL, "values"),
    Key("DANS", "where", Arg("values", LISTREEL, "list"), Arg("tolerance", FLOTTANT, optional=True), required=True),
    gives=[LISTENTI],
)
def _where_reals(ctx: Context, x: ListReel, dans: tuple[ListReel, float | None]) -> ListEnti:
    return ListEnti([_found(ctx, _near(dans[0].values, v, dans[1]), False) for v in x.values.tolist()])


def _folded(words: tuple[str, ...], noca: bool) -> NDArray[np.object_]:
    return np.array([w.upper() if noca else w for w in words], dtype=object)


@POSI.form(
    Arg("x", LISTMOTS, "words"),
    Key("DANS", "where", Arg("values", LISTMOTS, "list"), required=True),
    NOCA,
    gives=[LISTENTI],
)
def _where_words(ctx: Context, x: ListMots, dans: ListMots, noca: bool) -> ListEnti:
    known = _folded(dans.words, noca)
    return ListEnti([_found(ctx, known == word, False) for word in _folded(x.words, noca)])


@POSI.form(
    Arg("x", MOT, "word"),
    Key("DANS", "where", Arg("values", (LISTMOTS, MOT), "list or word"), required=True),
    NOCA,
    TOUS,
    gives=["ENTIER|LISTENTI"],
    last=True,
)
def _where_word(ctx: Context, x: str, dans: ListMots | str, noca: bool, tous: bool) -> Any:
    if isinstance(dans, ListMots):
        return _found(ctx, _folded(dans.words, noca) == (x.upper() if noca else x).rstrip()[:8], tous)
    text, part = (dans.upper(), x.upper()) if noca else (dans, x)
    hits = [bool(part) and text.startswith(part, i) for i in range(len(text))]
    return _found(ctx, np.array(hits, dtype=bool), tous)


EXIS = extend("EXIS")


@EXIS.form(Arg("values", LISTENTI, "list"), Arg("x", ENTIER, "value"), gives=[LOGIQUE])
def _has_integer(ctx: Context, values: ListEnti, x: int) -> bool:
    return bool((values.values == x).any())


@EXIS.form(
    Arg("values", LISTREEL, "list"),
    Arg("x", FLOTTANT, "value"),
    Arg("tolerance", FLOTTANT, optional=True),
    gives=[LOGIQUE],
)
def _has_real(ctx: Context, values: ListReel, x: float, tolerance: float | None) -> bool:
    return bool(_near(values.values, x, tolerance).any())


@EXIS.form(
    Arg("values", LISTMOTS, "list"),
    Arg("x", LISTMOTS, "words"),
    Key(("ET", "OU"), "all of them, or one of them", name="how"),
    gives=["LOGIQUE..."],
)
def _has_words(ctx: Context, values: ListMots, x: ListMots, how: str | None) -> Any:
    found = [word in values.words for word in x.words]
    if how is None:
        return tuple(found)
    return all(found) if how == "ET" else any(found)


@EXIS.form(Arg("values", LISTMOTS, "list"), Arg("x", MOT, "word"), gives=[LOGIQUE])
def _has_word(ctx: Context, values: ListMots, x: str) -> Any:
    if x == "*":  # `EXIS L*'TYPE'` asks for the type of L
        ctx.operands.push_front([values, x], ctx.node)
        return Refused
    return x.rstrip()[:8] in values.words


ORDO = operator(
    "ORDONNER",
    topic="lists",
    summary="sort a list, and others with it",
    notice="In increasing order, or 'DECR'; 'ABSO' compares absolute values, 'NOCA' words without regard to "
    "capitals. Further lists of the same length follow the first and give as many results. 'UNIQ' "
    "drops what is there twice (reals within a tolerance, if given). A TABLE of lists is sorted by "
    "the one whose index is given. 'COUT' puts the lists in the order j(i) of least cost, the sum of the costs "
    "C(i, j(i)) in a list of n*n values, row after row; the first result is this cost. A curve is sorted by abscissae; "
    "of a mesh the points by their distance to the first, segments end to end, other elements from neighbour to "
    "neighbour.",
    example="L M = ORDO (PROG 3. 1. 2.) (MOTS 'C' 'A' 'B') ; LIST L ; LIST M ;",
    see=["UNIQUE"],
)
ORDER = Key(("CROI", "DECR"), "increasing or decreasing", name="order")
ABSO = Key("ABSO", "by absolute value")


def _order(values: AnyList, order: str | None, abso: bool, noca: bool) -> list[int]:
    """Return the permutation that sorts a list; equal values keep their order."""
    key: Callable[[Any], Any] = (lambda x: abs(x)) if abso and not isinstance(values, ListMots) else (lambda x: x)
    if noca and isinstance(values, ListMots):
        key = str.upper
    items = list(items_of(values))
    return sorted(range(len(items)), key=lambda k: key(items[k]), reverse=order == "DECR")


def _permuted(values: AnyList, order: list[int]) -> AnyList:
    items = items_of(values)
    return like(values, [items[k] for k in order])


@ORDO.form(
    Arg("values", LISTS, "lists", many=True),
    Key("COUT", "order of least cost", Arg("costs", (LISTREEL, LISTENTI)), required=True),
    Key(("HONG", "COMP"), "method; both find the least cost", name="method"),
    gives=["FLOTTANT|ENTIER", "LISTREEL|LISTENTI|LISTMOTS"],
)
def _assign(ctx: Context, values: list[AnyList], cout: ListReel | ListEnti, method: str | None) -> Any:
    from scipy.optimize import linear_sum_assignment

    _same_length(ctx, values)
    size = len(values[0])
    if len(cout) != size * size:
        ctx.fail(
            217,
            "{count} costs for lists of {size} values: {wanted} are wanted",
            at="cout",
            count=len(cout),
            size=size,
            wanted=size * size,
        )
    costs = cout.values.reshape(size, size)
    rows, columns = linear_sum_assignment(costs)
    return costs[rows, columns].sum().item(), *(_permuted(v, columns.tolist()) for v in values)


@ORDO.form(
    Arg("values", LISTS, "lists", many=True),
    ORDER,
    ABSO,
    NOCA,
    Key("UNIQ", "drop what is there twice (one list only)"),
    Arg("tolerance", FLOTTANT, "of 'UNIQ'", optional=True),
    gives=["LISTREEL|LISTENTI|LISTMOTS"],
)
def _sort(
    ctx: Context, values: list[AnyList], order: str | None, abso: bool, noca: bool, uniq: bool, tolerance: float | None
) -> Any:
    _same_length(ctx, values)
    if uniq and len(values) > 1:
        ctx.fail(21, "'UNIQ' sorts one list, and {count} are given", at="uniq", count=len(values))
    permutation = _order(values[0], order, abso, noca)
    found = tuple(_permuted(v, permutation) for v in values)
    return tuple(_distinct(v, tolerance, noca) for v in found) if uniq else found


def _same_length(ctx: Context, values: list[AnyList]) -> None:
    sizes = [len(v) for v in values]
    if len(set(sizes)) > 1:
        ctx.fail(217, "the lists have different lengths: {sizes}", at="values", sizes=", ".join(map(str, sizes)))


@ORDO.form(
    Arg("t", TABLE, "table of lists"),
    Arg("index", (MOT, ENTIER), "index of the list that decides"),
    ORDER,
    ABSO,
    NOCA,
    gives=[TABLE],
)
def _sort_table(ctx: Context, t: Table, index: Any, order: str | None, abso: bool, noca: bool) -> Table:
    lists = {i: v for i, v in t.entries.values() if isinstance(v, AnyList)}
    chosen = t.get(index)
    if not isinstance(chosen, AnyList):
        ctx.fail(21, "what stands at this index is a {type}, not a list", at="index", type=type_of(chosen))
    _same_length(ctx, list(lists.values()))
    permutation = _order(chosen, order, abso, noca)
    found = t.copy()
    for i, v in lists.items():
        found.set(i, _permuted(v, permutation))
    return found


UNIQ = operator(
    "UNIQUE",
    topic="lists",
    summary="lists without what is there twice",
    notice="Keeps the first occurrence of each value. Reals are equal to rounding, or within a tolerance; "
    "'NOCA' makes capital and small letters the same. Several lists give as many results. Elements of a mesh are the "
    "same when they have the same nodes, with 'ORDO' in the same order.",
    example="L = UNIQ (LECT 3 1 3 2 1) ; LIST L ;",
    see=["ORDONNER"],
)


def _distinct(values: AnyList, tolerance: float | None, noca: bool) -> AnyList:
    kept: list[Any] = []
    if isinstance(values, ListReel):
        known: list[float] = []  # what is kept, in increasing order
        for x in values.values.tolist():
            at = bisect_left(known, x)
            room = EPSILON * abs(x) if tolerance is None else tolerance
            if not any(abs(y - x) <= room for y in known[max(at - 1, 0) : at + 1]):
                known.insert(at, x)
                kept.append(x)
        return ListReel(kept)
    seen: set[Any] = set()
    for item in items_of(values):
        key = item.upper() if noca and isinstance(item, str) else item
        if key not in seen:
            seen.add(key)
            kept.append(item)
    return like(values, kept)


@UNIQ.form(
    Arg("values", LISTS, "lists", many=True),
    Arg("tolerance", FLOTTANT, "for reals", optional=True),
    NOCA,
    gives=["LISTREEL|LISTENTI|LISTMOTS"],
)
def _unique(ctx: Context, values: list[AnyList], tolerance: float | None, noca: bool) -> Any:
    return tuple(_distinct(v, tolerance, noca) for v in values)
