"""VIDE: empty objects, and whether an object is empty."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import (
    CHPOINT,
    DEFORME,
    ENTIER,
    EVOLUTIO,
    LISTCHPO,
    LISTENTI,
    LISTMOTS,
    LISTOBJE,
    LISTREEL,
    LOGIQUE,
    MAILLAGE,
    MCHAML,
    MMODEL,
    MOT,
    RIGIDITE,
    TABLE,
    VECTEUR,
    Table,
)
from gibiane_ops.options import ELEMENTS
from gibiane_ops.values.champs import DIFFUS, DISCRET, INDETERMINE, ChPoint, MChaml
from gibiane_ops.values.deformee import Deforme, Vecteur
from gibiane_ops.values.evolution import Evolution
from gibiane_ops.values.listes import AnyList, ListEnti, ListMots, ListReel
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.modele import Modele
from gibiane_ops.values.nodes import node_store
from gibiane_ops.values.suites import ListChpo, ListObje

INDICES = (LISTENTI, LISTREEL, LISTMOTS)

VIDE = operator(
    "VIDE",
    topic="values",
    summary="an empty object, or: is an object empty?",
    notice="`VIDE 'TYPE'` makes an empty object of the type, to which ET adds; `VIDE 'TYPE'*n` n of them, "
    "`'TYPE'/'SUBTYPE'` with a subtype (an element type, the nature of a nodal field, a table's subtype); 'TABU' puts "
    "them into a table, indexed from 1 or by the values of the list that follows. With an object that is no word: VRAI "
    "if nothing is in it.",
    example="L = VIDE 'LISTREEL' ; L = L ET 2. ; MESS (DIME L) (VIDE L) ;",
    see=["DIMENSION", "EXISTE"],
)


def _rigidity(ctx: Context, subtype: str) -> Any:
    from gibiane_ops.values.rigidite import Rigidite

    return Rigidite([])


Maker = Callable[[Context, str], Any]
EMPTY: dict[str, Maker] = {
    LISTREEL: lambda _ctx, _subtype: ListReel([]),
    LISTENTI: lambda _ctx, _subtype: ListEnti([]),
    LISTMOTS: lambda _ctx, _subtype: ListMots([]),
    LISTCHPO: lambda _ctx, _subtype: ListChpo([]),
    LISTOBJE: lambda _ctx, _subtype: ListObje([]),
    TABLE: lambda _ctx, subtype: Table(subtype or None),
    MAILLAGE: lambda ctx, _subtype: Maillage(node_store(ctx), []),
    CHPOINT: lambda ctx, subtype: ChPoint(node_store(ctx), {}, subtype or INDETERMINE),
    MCHAML: lambda _ctx, _subtype: MChaml([], "", "NOEUD"),
    MMODEL: lambda _ctx, _subtype: Modele([]),
    RIGIDITE: _rigidity,
    EVOLUTIO: lambda _ctx, _subtype: Evolution([]),
    DEFORME: lambda _ctx, _subtype: Deforme([]),
    VECTEUR: lambda _ctx, _subtype: Vecteur([]),
}
# the subtypes of a type, where they are limited; an empty mesh has no elements whose type it could keep
SUBTYPES: dict[str, tuple[str, ...]] = {
    MAILLAGE: ELEMENTS,
    CHPOINT: (DIFFUS, DISCRET, INDETERMINE),
    EVOLUTIO: ("REEL", "COMPLEXE"),
}
# what makes up an object of each type
CONTENT: dict[str, Callable[[Any], Any]] = {
    LISTREEL: len,
    LISTENTI: len,
    LISTMOTS: len,
    TABLE: lambda x: x.entries,
    MAILLAGE: lambda x: x.n_cells,
    CHPOINT: lambda x: len(x.nodes),
    MCHAML: lambda x: x.zones,
    MMODEL: lambda x: x.zones or x.contacts,
    RIGIDITE: lambda x: x.parts,
    EVOLUTIO: lambda x: x.curves,
    DEFORME: lambda x: x.shapes,
    VECTEUR: lambda x: x.arrows,
}


@VIDE.form(Arg("x", tuple(CONTENT), "object"), gives=[LOGIQUE])
def _is_empty(ctx: Context, x: Any) -> bool:
    return not CONTENT[x.type_name](x)


@VIDE.stream(
    Key(("TABU", "TABULER"), "into a table", name="table"),
    gives=["TYPE..."],
    last=True,
    syntax="('TABU' (indices:LISTENTI|LISTREEL|LISTMOTS)) 'TYPE'(/'SUBTYPE')(*n)...",
)
def _make_empty(ctx: Context, q: Operands) -> Any:
    indices: AnyList | None = None
    tabulated = q.read_keyword(["TABULER"]) is not None
    if tabulated:
        indices = q.read(INDICES)
    found: list[Any] = []
    while q.values:
        kind, subtype, count = _group(ctx, q)
        found.extend(EMPTY[kind](ctx, subtype) for _ in range(count))
    if not tabulated:
        return tuple(found)
    table = Table()
    for number, value in enumerate(found):
        table.set(indices.item(number) if indices is not None and number < len(indices) else number + 1, value)
    return table


def _group(ctx: Context, q: Operands) -> tuple[str, str, int]:
    """Read a type with its subtype and the number of objects, in any order."""
    ctx.places["type"] = q.nodes[0]
    kind = str(q.need(MOT, "the type of an empty object")).strip()[:8]
    if kind not in EMPTY:
        ctx.fail(
            19,
            "no empty {type} can be made",
            at="type",
            type=kind,
            hint="known: {known}",
            known=", ".join(sorted(EMPTY)),
        )
    count, subtype = 1, ""
    while q.values and q.values[0] in ("*", "/"):
        mark = q.values.pop(0)
        del q.nodes[0]
        ctx.places["subtype"] = q.nodes[0] if q.nodes else ctx.node
        if mark == "*":
            count = q.need(ENTIER, "their number")
            if count < 0:
                ctx.fail(36, "{count} is not an acceptable number of values", at="subtype", count=count)
        else:
            subtype = _subtype(ctx, kind, str(q.need(MOT, "the subtype")).strip())
    return kind, subtype, count


def _subtype(ctx: Context, kind: str, word: str) -> str:
    known = SUBTYPES.get(kind)
    if known is None:
        return word
    found = next((each for each in known if each[:4] == word[:4]), None)
    if found is None:
        ctx.fail(
            19,
            "there is no {type} of subtype '{word}'",
            at="subtype",
            type=kind,
            word=word,
            hint="known: {known}",
            known=", ".join(known),
        )
    return found
