"""FORME: saving, moving and restoring the places of all nodes."""

from __future__ import annotations

from gibiane.forms import Arg
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT
from gibiane_ops.mesh.building import nodes_of
from gibiane_ops.mesh.transforms import shift
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.configuration import CONFIGUR, Configuration

FORM = operator(
    "FORME",
    topic="mesh",
    summary="save, move or restore the places of the nodes",
    notice="`C0 = FORM ;` keeps the places of all nodes; `FORM DEP ;` moves the nodes by a displacement field, and "
    "every object with them (`C1 = FORM DEP` keeps the new places too); `FORM C0 ;` brings the nodes back; "
    "`FORM C0 DEP ;` puts them at the places of C0 moved by DEP. Nodes made after C0 stay where they are.",
    example="OPTI DIME 2 ELEM SEG2 ; L = DROIT 2 (0. 0.) (1. 0.) ; C0 = FORM ; "
    "DEP = NOMC 'UX' (COOR 1 L) 'NATU' 'DIFFUS' ; FORM DEP ; MESS (MESU L) ; FORM C0 ; MESS (MESU L) ;",
    see=["DEPLACER", "PLUS"],
)


@FORM.form(
    Arg("saved", CONFIGUR, "places to start from", optional=True),
    Arg("by", CHPOINT, "displacement", optional=True),
    gives=[CONFIGUR],
)
def _form(ctx: Context, saved: Configuration | None, by: ChPoint | None) -> Configuration:
    store = nodes_of(ctx)
    if saved is not None:
        store.coords[: len(saved.coords)] = saved.coords
    if by is not None:
        nodes = by.nodes
        store.coords[nodes] = shift(ctx, by, 1.0, "by")(store.coords[nodes], nodes)
    return Configuration(store)
